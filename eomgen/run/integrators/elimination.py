"""Gaussian elimination in a fixed order of operations, for implicit methods: see
`eomgen.engine.elimination`.
"""

from dataclasses import dataclass

import numpy as np

from eomgen.engine import elimination, few
from eomgen.run.problem import FloatArray


@dataclass(frozen=True, eq=False)
class Factors:
    """The factors of a matrix (n, n)."""

    found: elimination.Factors

    def solve(self, values: FloatArray) -> FloatArray:
        """The solution (n,) for the right side `values` (n,), which is not modified."""
        x = values.copy()
        elimination.solve_by(self.found, x)
        return x


def factored(jacobian: FloatArray, diagonal: float, positions: int) -> Factors | None:
    """The factors of diagonal I - J for a Jacobian J (n, n); None if that is singular.

    positions  the number of positions, which come first among the states
    """
    found = few.factors_of(len(jacobian), positions)
    return Factors(found) if elimination.factored(found, diagonal, positions, jacobian) else None


def product(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """matrix @ values, for a vector or a matrix, summed term by term."""
    terms = matrix[..., None] * values if values.ndim > 1 else matrix * values
    return np.asarray(np.take(np.add.accumulate(terms, axis=1), -1, axis=1))
