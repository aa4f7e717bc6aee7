"""Small displacements of states with unit quaternions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eomgen.engine import quaternions as engine

FloatArray = NDArray[np.float64]


def tangents(
    y: FloatArray, quaternions: Sequence[tuple[int, int, int, int]], plain: float = 1.0
) -> FloatArray:
    """T (ny, n) of δy = T δx: `plain` for each scalar state, q (0, δr)/2 for each quaternion."""
    n, many = len(y), len(quaternions)
    basis = np.empty((n, n - many))
    engine.tangents(n, n - many, many, sum(quaternions, ()), y, plain, basis)  # type: ignore[arg-type]
    return basis
