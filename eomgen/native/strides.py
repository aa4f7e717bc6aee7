"""Steps of adaptive methods in compiled code: what they leave, as runs take it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.run.compiled import Stride

MEMORY = {
    "h_abs": "lengths",
    "f": "slopes",
    "lost": "losses",
    "h_last": "last_lengths",
    "error": "errors",
}
"""The records of what determines a solver's next step."""
COUNTED = ("derivatives", "jacobians", "factorisations")


def stride(
    kept: Any,
    n: int,
    memory: Sequence[str],
    usual: bool,
    counts: Mapping[str, NDArray[np.int64]] | None = None,
    **more: Any,
) -> Stride:
    """The first n steps of records of them."""
    passed = int(kept.sampled[n - 1]) if n else 0
    counted = {name: getattr(kept, name) for name in COUNTED if hasattr(kept, name)}
    return Stride(
        kept.ends[:n],
        kept.states[:n],
        {name: getattr(kept, MEMORY[name])[:n] for name in memory},
        {name: values[:n] for name, values in {**counted, **(counts or {})}.items()},
        kept.sampled[:n],
        kept.rows[:passed].copy(),  # the array for all rows to come is not kept with them
        usual,
        **more,
    )
