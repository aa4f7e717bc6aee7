"""Gaussian elimination of g I - J for implicit methods, and products in order, with the same bits
everywhere.

Where the rates of the positions are velocities times constants or functions of other states, but
not of positions, J = [0 N; A B]. Then the positions are eliminated first, each by its own row, and
only the rest, half as large, needs pivots: Hairer, Wanner, Solving ODEs II, section IV.8.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from eomgen.subset.words import Matrix, Vector, Whole, copy, transposed, with_arrays, with_lists


def _largest(n: int, x: Vector) -> int:
    return int(np.argmax(np.abs(x)))


@with_arrays(_largest)
def place_of_largest(n: int, x: Annotated[Vector, "n"]) -> int:
    """The number of the first of the entries of greatest size."""
    found = 0
    for i in range(1, n):
        if abs(x[i]) > abs(x[found]):
            found = i
    return found


def _nonzero(n: int, x: Vector, found: Whole) -> int:
    numbers = np.flatnonzero(x)
    found[: len(numbers)] = numbers
    return len(numbers)


@with_arrays(_nonzero)
def nonzero(n: int, x: Annotated[Vector, "n"], found: Annotated[Whole, "n"]) -> int:
    """Write down the numbers of the entries that are not 0; returns how many there are."""
    many = 0
    for i in range(n):
        if x[i] != 0.0:
            found[many] = i
            many += 1
    return many


def _subtract_products(n: int, p: int, columns: Matrix) -> None:
    columns[p + 1 :, p + 1 :] -= columns[p + 1 :, p, None] * columns[p, p + 1 :]


@with_arrays(_subtract_products)
def subtract_products(n: int, p: int, columns: Annotated[Matrix, "n", "n"]) -> None:
    """Subtract row p from all that are below it, each times its factor, which is in column p."""
    factors = copy(columns[p])
    for j in range(p + 1, n):
        above = columns[j, p]
        if above != 0.0:
            columns[j, p + 1 :] -= above * factors[p + 1 :]


def _subtract_columns(n: int, m: int, columns: Matrix, x: Vector) -> None:
    terms = np.concatenate((x[None, m:], x[:m, None] * columns[:m, m:]))
    x[m:] = np.subtract.accumulate(terms)[-1]


@with_arrays(_subtract_columns)
def subtract_columns(
    n: int, m: int, columns: Annotated[Matrix, "n", "n"], x: Annotated[Vector, "n"]
) -> None:
    """Subtract the first m columns, each times its unknown, from the rest of x, one by one."""
    for p in range(m):
        value = x[p]
        x[m:] -= value * columns[p, m:]


@dataclass(slots=True)
class Factors:
    """The factors of a matrix (n, n) whose first `first` rows have the number `diagonal` on the
    diagonal, and nothing else in the first `first` columns.

    right    these rows: right[i, j] is entry (i, j) of the matrix, j >= first
    entries  for each of them, up to ends[i], the columns - first where it is not 0
    columns  the other rows: columns[j, i] is entry (i, j), i >= first
    order    the other row i was row order[i]
    """

    n: int
    right: Annotated[Matrix, "n", "n"]
    columns: Annotated[Matrix, "n", "n"]
    entries: Annotated[Whole, "n * n"]
    ends: Annotated[Whole, "n"]
    order: Annotated[Whole, "n"]
    first: int = 0
    diagonal: float = 0.0


def _decoupled(n: int, positions: int, jacobian: Matrix) -> int:
    return 0 if jacobian[:positions, :positions].any() else positions


@with_arrays(_decoupled)
def decoupled(n: int, positions: int, jacobian: Annotated[Matrix, "n", "n"]) -> int:
    """`positions` if the rates of positions, which come first, do not depend on these; else 0."""
    for i in range(positions):
        for j in range(positions):
            if jacobian[i, j] != 0.0:
                return 0
    return positions


def factored(
    factors: Factors,
    diagonal: float,
    positions: int,
    jacobian: Annotated[Matrix, "factors.n", "factors.n"],
) -> bool:
    """Factorise diagonal I - J for a Jacobian J, in which `positions` come first; False if that is
    singular.
    """
    n = factors.n
    m = decoupled(n, positions, jacobian)
    factors.first = m
    factors.diagonal = diagonal
    factors.right[:m, m:] = 0.0 - jacobian[:m, m:]  # and so no entry is -0
    factors.columns[:, m:] = 0.0 - transposed(jacobian[m:])
    for i in range(m, n):
        factors.columns[i, i] += diagonal
    return eliminated(factors)


def factorised(factors: Factors, matrix: Annotated[Matrix, "factors.n", "factors.n"]) -> bool:
    """Factorise a matrix; False if it is singular."""
    factors.first = 0
    factors.columns[:, :] = transposed(matrix)
    return eliminated(factors)


@with_lists("eliminated")
def eliminated(factors: Factors) -> bool:
    """Factorise the matrix whose rows are in `right` and `columns`; False if it is singular."""
    n = factors.n
    m = factors.first
    diagonal = factors.diagonal
    used = 0
    for p in range(m):
        factors.columns[p, m:] /= diagonal
        below = copy(factors.columns[p])
        end = used + nonzero(n - m, factors.right[p, m:], factors.entries[used:])
        for e in range(used, end):
            k = factors.entries[e]
            factor = factors.right[p, m + k]
            factors.columns[m + k, m:] -= factor * below[m:]
        factors.ends[p] = end
        used = end
    for i in range(m, n):
        factors.order[i] = i
    for p in range(m, n):
        pivot = p + place_of_largest(n - p, factors.columns[p, p:])
        if pivot != p:
            row = copy(factors.columns[:, p])
            factors.columns[m:, p] = factors.columns[m:, pivot]
            factors.columns[m:, pivot] = row[m:]
            number = factors.order[p]
            factors.order[p] = factors.order[pivot]
            factors.order[pivot] = number
        value = factors.columns[p, p]
        if value == 0.0:
            return False
        factors.columns[p, p + 1 :] /= value
        subtract_products(n, p, factors.columns)
    return True


@with_lists("solve_by")
def solve_by(factors: Factors, x: Annotated[Vector, "factors.n"]) -> None:
    """Solve the system with these factors for the right side x, in place; column by column."""
    n = factors.n
    m = factors.first
    subtract_columns(n, m, factors.columns, x)
    rest = copy(x)
    for i in range(m, n):
        x[i] = rest[factors.order[i]]
    for p in range(m, n):
        value = x[p]
        x[p + 1 :] -= value * factors.columns[p, p + 1 :]
    for p in range(n - 1, m - 1, -1):
        value = x[p] / factors.columns[p, p]
        x[p] = value
        x[m:p] -= value * factors.columns[p, m:p]
    e = 0
    for i in range(m):
        value = x[i]
        while e < factors.ends[i]:
            k = m + factors.entries[e]
            value -= factors.right[i, k] * x[k]
            e += 1
        x[i] = value / factors.diagonal


def solve_rows(
    many: int,
    factors: Factors,
    right: Annotated[Matrix, "many", "factors.n"],
    solutions: Annotated[Matrix, "many", "factors.n"],
) -> None:
    """The solutions for the rows of a matrix as right sides."""
    for i in range(many):
        solutions[i, :] = right[i]
        solve_by(factors, solutions[i])
