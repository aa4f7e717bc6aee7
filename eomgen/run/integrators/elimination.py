"""Gaussian elimination in a fixed order of operations, for implicit methods.

There are only sums and products of numbers, one after the other, and no library of linear algebra:
so compiled code that repeats them has the same bits (`templates/c/implicit.c.jinja`).

Where the rates of the positions are velocities times constants or functions of other states, but
not of positions, J = [0 N; A B]. Then the positions are eliminated first, each by its own row, and
only the rest, half as large, needs pivoting. Hairer, Wanner, Solving ODEs II, section IV.8.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray


@dataclass(frozen=True, eq=False)
class Factors:
    """The factors of g I - J, (n, n), of which the first m rows and columns are eliminated first.

    diagonal  g
    right     (m, n - m), what is right of them
    below     (n - m, m), what is below, divided by g
    rest      (n - m, n - m), the factors L and U of what then remains
    order     (n - m,), its row i was row order[i]
    """

    diagonal: float
    right: FloatArray
    below: FloatArray
    rest: FloatArray
    order: NDArray[np.intp]

    def solve(self, values: FloatArray) -> FloatArray:
        """The solution x (n,) of (g I - J) x = values (n,)."""
        m, rest = len(self.right), self.rest
        first, others = values[:m], _less(values[m:], self.below, values[:m])[self.order]
        for k in range(len(rest)):
            others[k + 1 :] -= others[k] * rest[k + 1 :, k]
        for k in range(len(rest) - 1, -1, -1):
            others[k] /= rest[k, k]
            others[:k] -= others[k] * rest[:k, k]
        return np.concatenate((_less(first, self.right, others) / self.diagonal, others))


def leading(jacobian: FloatArray, positions: int) -> int:
    """How many states are eliminated first: all `positions`, or none if J has no such form."""
    return 0 if jacobian[:positions, :positions].any() else positions


def factored(jacobian: FloatArray, diagonal: float, positions: int) -> Factors | None:
    """The factors of diagonal I - J for a Jacobian J (n, n); None if that is singular.

    positions  the number of positions, which come first among the states
    """
    m = leading(jacobian, positions)
    right, below = -jacobian[:m, m:], -jacobian[m:, :m] / diagonal
    rest = np.asfortranarray(-jacobian[m:, m:])
    rest.ravel("K")[:: len(rest) + 1] += diagonal
    for k in range(m):
        columns = np.flatnonzero(right[k])
        rest[:, columns] -= below[:, k, None] * right[k, columns]
    order = np.arange(len(rest))
    for k in range(len(rest)):
        pivot = k + int(np.argmax(np.abs(rest[k:, k])))
        if pivot != k:
            rest[[k, pivot]], order[[k, pivot]] = rest[[pivot, k]], order[[pivot, k]]
        if rest[k, k] == 0:
            return None
        factors = rest[k + 1 :, k]
        factors /= rest[k, k]
        rest[k + 1 :, k + 1 :] -= factors[:, None] * rest[k, k + 1 :]
    return Factors(diagonal, right, below, rest, order)


def _less(values: FloatArray, matrix: FloatArray, factors: FloatArray) -> FloatArray:
    """values - matrix @ factors, column by column."""
    terms = np.concatenate((values[None], matrix.T * factors[:, None]))
    return np.array(np.subtract.accumulate(terms)[-1])
