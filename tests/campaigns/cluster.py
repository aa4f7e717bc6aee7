"""A sweep on a cluster of Dask's, one worker of which is killed on the way.

pip install -e '.[dask]' && pytest -n0 tests/campaigns/cluster.py
"""

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dask.distributed import LocalCluster

import eomgen
from eomgen.sweep.storage import Storage


@pytest.mark.filterwarnings("ignore")  # Dask's own
@pytest.mark.parametrize(("backend", "members", "chunks"), [("numpy", 30, 30), ("c", 1200, 38)])
def test_a_cluster_runs_the_same_and_may_lose_a_worker(
    backend: str, members: int, chunks: int, tmp_path: Path
) -> None:
    """Dask's workers as processes, of which one is killed on the way; code is compiled there."""
    design = eomgen.grid({"theta": np.linspace(0.0, 1.0, members)})
    options: dict[str, Any] = {"t_end": 40.0, "integrator": "DOP853", "rtol": 1e-10}
    options["backend"] = backend
    here = eomgen.ensemble("pendulum", design, **options)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        done: list[int] = []
        put = Storage.put

        def killing(self: Any, number: int, arrays: Any) -> None:
            done.append(number)
            if len(done) == 3:
                os.kill(pids[0], signal.SIGKILL)
            put(self, number, arrays)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Storage, "put", killing)
            there = eomgen.ensemble(
                "pendulum",
                design,
                scheduler=cluster.scheduler_address,
                folder=tmp_path / "kept",
                **options,
            )
    assert sorted(done) == list(range(chunks)) and here.final.tobytes() == there.final.tobytes()
