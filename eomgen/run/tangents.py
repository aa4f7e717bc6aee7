"""Small displacements of states with unit quaternions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def tangents(
    y: FloatArray, quaternions: Sequence[tuple[int, int, int, int]], plain: float = 1.0
) -> FloatArray:
    """T (ny, n) of δy = T δx: `plain` for each scalar state, q (0, δr)/2 for each quaternion."""
    firsts = {indices[0]: indices for indices in quaternions}
    rest = {i for indices in quaternions for i in indices}
    result = np.zeros((len(y), len(y) - len(quaternions)))
    column = 0
    for i in range(len(y)):
        if i in firsts:
            a, b, c, d = (0.5 * y[list(firsts[i])]).tolist()
            block = [[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]]
            result[list(firsts[i]), column : column + 3] = block
            column += 3
        elif i not in rest:
            result[i, column] = plain
            column += 1
    return result
