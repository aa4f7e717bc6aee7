"""Gaussian elimination in a fixed order of operations, for implicit methods.

There are only sums and products of numbers, one after the other, and no library of linear algebra:
so compiled code that repeats them has the same bits (`templates/c/implicit.c.jinja`).

Where the rates of the positions are velocities times constants or functions of other states, but
not of positions, J = [0 N; A B]. Then the positions are eliminated first, each by its own row, and
only the rest, half as large, needs pivoting. Hairer, Wanner, Solving ODEs II, section IV.8.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray

SMALL = 20
"""Up to this many unknowns Python's numbers are quicker than arrays; the operations are the
same."""


class Factors(Protocol):
    """The factors of a matrix (n, n)."""

    def solve(self, values: FloatArray) -> FloatArray:
        """The solution (n,) for the right side `values` (n,), which is not modified."""
        ...


def factored(jacobian: FloatArray, diagonal: float, positions: int) -> Factors | None:
    """The factors of diagonal I - J for a Jacobian J (n, n); None if that is singular.

    positions  the number of positions, which come first among the states
    """
    m = 0 if jacobian[:positions, :positions].any() else positions
    return (_numbers if len(jacobian) - m <= SMALL else _arrays)(jacobian, diagonal, m)


def product(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """matrix @ values, for a vector or a matrix, summed term by term."""
    terms = matrix[..., None] * values if values.ndim > 1 else matrix * values
    return np.asarray(np.take(np.add.accumulate(terms, axis=1), -1, axis=1))


@dataclass(frozen=True, eq=False)
class _Arrays:
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
        m, rest = len(self.right), self.rest
        first, others = values[:m], _less(values[m:], self.below, values[:m])[self.order]
        for k in range(len(rest)):
            others[k + 1 :] -= others[k] * rest[k + 1 :, k]
        for k in range(len(rest) - 1, -1, -1):
            others[k] /= rest[k, k]
            others[:k] -= others[k] * rest[:k, k]
        return np.concatenate((_less(first, self.right, others) / self.diagonal, others))


def _arrays(jacobian: FloatArray, diagonal: float, m: int) -> Factors | None:
    """The factors, by operations on rows and columns."""
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
    return _Arrays(diagonal, right, below, rest, order)


def _less(values: FloatArray, matrix: FloatArray, factors: FloatArray) -> FloatArray:
    """values - matrix @ factors, column by column."""
    terms = np.concatenate((values[None], matrix.T * factors[:, None]))
    return np.array(np.subtract.accumulate(terms)[-1])


@dataclass(frozen=True, eq=False)
class _Numbers:
    """The same as rows of numbers; of `right`, only what is not 0, with its column."""

    diagonal: float
    right: list[list[tuple[int, float]]]
    below: list[list[float]]
    rest: list[list[float]]
    order: list[int]

    def solve(self, values: FloatArray) -> FloatArray:
        given: list[float] = values.tolist()
        m, rest = len(self.right), self.rest
        first, others = given[:m], given[m:]
        for i, row in enumerate(self.below):
            for factor, x in zip(row, first, strict=True):
                others[i] -= factor * x
        others = [others[i] for i in self.order]
        for i, row in enumerate(rest):
            for k in range(i):
                others[i] -= row[k] * others[k]
        for i in range(len(rest) - 1, -1, -1):
            row = rest[i]
            for k in range(len(rest) - 1, i, -1):
                others[i] -= row[k] * others[k]
            others[i] /= row[i]
        for i, entries in enumerate(self.right):
            for k, factor in entries:
                first[i] -= factor * others[k]
            first[i] /= self.diagonal
        return np.array(first + others)


def _numbers(jacobian: FloatArray, diagonal: float, m: int) -> Factors | None:
    """The factors, number by number."""
    rows: list[list[float]] = jacobian.tolist()
    right = [[(j, -x) for j, x in enumerate(row[m:]) if x] for row in rows[:m]]
    below = [[-x / diagonal for x in row[:m]] for row in rows[m:]]
    rest = [[-x for x in row[m:]] for row in rows[m:]]
    for i, (row, factors) in enumerate(zip(rest, below, strict=True)):
        row[i] += diagonal
        for factor, entries in zip(factors, right, strict=True):
            for j, x in entries:
                row[j] -= factor * x
    size, order = len(rest), list(range(len(rest)))
    for k in range(size):
        pivot = max(range(k, size), key=lambda i: abs(rest[i][k]))
        rest[k], rest[pivot] = rest[pivot], rest[k]
        order[k], order[pivot] = order[pivot], order[k]
        upper = rest[k]
        if upper[k] == 0:
            return None
        for row in rest[k + 1 :]:
            factor = row[k] = row[k] / upper[k]
            if factor:
                row[k + 1 :] = [
                    x - factor * y for x, y in zip(row[k + 1 :], upper[k + 1 :], strict=True)
                ]
    return _Numbers(diagonal, right, below, rest, order)
