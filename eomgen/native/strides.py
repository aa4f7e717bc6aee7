"""Steps of adaptive methods in compiled code: what they leave, as runs take it."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.adaptive import Records
from eomgen.native.memory import room
from eomgen.run.compiled import Stretch, Stride
from eomgen.subset.structures import take

MEMORY = {
    "h_abs": "lengths",
    "f": "slopes",
    "lost": "losses",
    "h_last": "last_lengths",
    "error": "errors",
}
"""The records of what determines a solver's next step."""


def records_of(stretch: Stretch, most: int, **given: Any) -> tuple[Records, ctypes.Structure]:
    """Room for the records of up to `most` steps and their rows, and what C is given of it."""
    ny, count = len(stretch.solver.y), len(stretch.times)
    sizes = {"most": most, "STATES": ny, "count": count, "many": 0, "times": stretch.times}
    return room(Records, **{**sizes, "rows": np.empty((count, ny)), **given})


def stride(
    kept: Records,
    records: ctypes.Structure,
    memory: Sequence[str],
    usual: bool,
    counts: Mapping[str, NDArray[np.int64]],
    **more: Any,
) -> Stride:
    """The steps in records that C has made."""
    take(kept, records)
    n = kept.made
    passed = int(kept.sampled[n - 1]) if n else 0  # not those of a step that was not made
    return Stride(
        kept.ends[:n],
        kept.states[:n],
        {name: getattr(kept, MEMORY[name])[:n] for name in memory},
        {name: values[:n] for name, values in {"derivatives": kept.derivatives, **counts}.items()},
        kept.sampled[:n],
        kept.rows[:passed].copy(),  # the array for all rows to come is not kept with them
        usual,
        **more,
    )
