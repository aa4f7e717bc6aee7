"""Sweeps on clusters of Dask's: one worker is killed on the way, all are, or they are not fit.

pip install -e '.[dask]' && pytest -n0 tests/campaigns/cluster.py
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dask.distributed import LocalCluster

import eomgen
from eomgen.commands.main import main
from eomgen.sweep import cluster
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


SWEEP = "sweep pendulum --vary theta=0:1:6 --t-end 1 --backend numpy -o {out} --scheduler {at}"
ROOT = Path(eomgen.__file__).parent.parent
Start = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[tuple[Start, Callable[[], str]]]:
    """What starts a scheduler or a worker with modules of its own, and the scheduler's address."""
    file, processes = tmp_path / "scheduler.json", []

    def start(what: str, modules: Path | None = None) -> subprocess.Popen[bytes]:
        words = f"-m dask {what} --scheduler-file {file} --no-dashboard".split()
        with (tmp_path / "log").open("ab") as log:
            made = subprocess.Popen(
                [sys.executable, *words],
                cwd=tmp_path,
                env={**os.environ, "PYTHONPATH": str(modules or ROOT)},
                stdout=log,
                stderr=log,
            )
        processes.append(made)
        return made

    def address() -> str:
        due = time.monotonic() + 60
        while not file.exists() and time.monotonic() < due:
            time.sleep(0.1)
        return str(json.loads(file.read_text())["address"])

    yield start, address
    for process in reversed(processes):
        process.kill()
        process.wait()


WORKER = "worker --nworkers 1 --nthreads 1 --no-nanny"


def another_version(folder: Path) -> Path:
    """This program with one more comment."""
    here = Path(eomgen.__file__).parent
    shutil.copytree(here, folder / "eomgen", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(here.parent / "templates", folder / "templates")
    with (folder / "eomgen" / "run" / "projection.py").open("a") as file:
        file.write("# another version\n")
    return folder


def no_package(folder: Path) -> Path:
    """A place for modules where this program cannot be imported."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text("import sys; sys.modules['eomgen'] = None")
    return folder


@pytest.mark.parametrize(
    ("modules", "said"),
    [
        (another_version, "scheduler: a worker has eomgen "),
        (no_package, "scheduler: a worker lacks eomgen "),
    ],
)
def test_a_worker_that_is_not_fit(
    modules: Callable[[Path], Path],
    said: str,
    started: tuple[Start, Callable[[], str]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    start, address = started
    start("scheduler --host 127.0.0.1 --port 0")
    at = address()
    start(WORKER, modules(tmp_path / "modules"))
    assert main(SWEEP.format(out=tmp_path / "out", at=at).split()) == 1
    error = capfd.readouterr().err
    assert error.startswith(f"eomgen: {said}") and error.count("\n") == 1, error


def test_no_worker_is_left(
    started: tuple[Start, Callable[[], str]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is killed, and then the scheduler: one line each. With another worker it goes on."""
    monkeypatch.setattr(cluster, "ALONE", 5.0)
    start, address = started
    scheduler = start("scheduler --host 127.0.0.1 --port 0")
    at, out = address(), tmp_path / "out"
    worker = start(WORKER)

    def kill(process: subprocess.Popen[bytes], chunks: int) -> None:
        while len(list(out.glob("*/chunk_*"))) < chunks:
            time.sleep(0.01)
        process.kill()

    command = SWEEP.replace("1:6 --t-end 1", "1:60 --t-end 40").format(out=out, at=at).split()
    for process, chunks, said in (
        (worker, 3, f"scheduler: {at} has no worker; start one; with a folder, the same sweep "),
        (scheduler, 6, f"scheduler: {at} is lost: "),
    ):
        killer = threading.Thread(target=kill, args=(process, chunks))
        killer.start()
        assert main(command) == 1
        killer.join()
        error = capfd.readouterr().err
        assert error.startswith(f"eomgen: {said}") and error.count("\n") == 1, error
        start(WORKER)
    assert main([*command[:-2], "--workers", "1"]) == 0


@pytest.mark.parametrize("at", ["ucx://127.0.0.1:1", "tcp://127.0.0.1:1", "x://y", "\x1b[31m"])
def test_an_address_without_a_scheduler(
    at: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECTING", 2.0)
    assert main(SWEEP.format(out=tmp_path / "out", at=at).split()) == 1
    error = capfd.readouterr().err
    assert error.startswith("eomgen: scheduler: ") and error.count("\n") == 1, error
    assert " cannot be reached: " in error
