"""Gaussian elimination of g I - J for implicit methods, and products in order, with the same bits
everywhere.

Where the rates of the positions are velocities times constants or functions of other states, but
not of positions, J = [0 N; A B]. Then the positions are eliminated first, each by its own row, and
only the rest, half as large, needs pivots: Hairer, Wanner, Solving ODEs II, section IV.8.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from eomgen.subset.words import Matrix, Vector, Whole, numbers, transposed, with_arrays, with_lists


def _largest(first: int, end: int, x: Vector) -> int:
    return first + int(np.argmax(np.abs(x[first:end])))


@with_arrays(_largest)
def place_of_largest(first: int, end: int, x: Annotated[Vector, "end"]) -> int:
    """The number of the first of some entries that has the greatest size."""
    found = first
    for i in range(first + 1, end):
        if abs(x[i]) > abs(x[found]):
            found = i
    return found


def _nonzero(first: int, end: int, x: Vector, found: Whole) -> int:
    places = first + np.flatnonzero(x[first:end])
    found[: len(places)] = places
    return len(places)


@with_arrays(_nonzero)
def nonzero(
    first: int, end: int, x: Annotated[Vector, "end"], found: Annotated[Whole, "end"]
) -> int:
    """Write down the numbers of the entries that are not 0; returns how many there are."""
    many = 0
    for i in range(first, end):
        if x[i] != 0.0:
            found[many] = i
            many += 1
    return many


def _divide_part(first: int, end: int, divisor: float, x: Vector) -> None:
    x[first:end] /= divisor


@with_arrays(_divide_part)
def divide_part(first: int, end: int, divisor: float, x: Annotated[Vector, "end"]) -> None:
    """Divide some entries."""
    for i in range(first, end):
        x[i] /= divisor


def _subtract_part(first: int, end: int, factor: float, y: Vector, x: Vector) -> None:
    x[first:end] -= factor * y[first:end]


@with_arrays(_subtract_part)
def subtract_part(
    first: int,
    end: int,
    factor: float,
    y: Annotated[Vector, "end"],
    x: Annotated[Vector, "end"],
) -> None:
    """Subtract from some entries of x those of y, times a factor."""
    for i in range(first, end):
        x[i] -= factor * y[i]


def _subtract_products(n: int, p: int, columns: Matrix) -> None:
    columns[p + 1 :, p + 1 :] -= columns[p + 1 :, p, None] * columns[p, p + 1 :]


@with_arrays(_subtract_products)
def subtract_products(n: int, p: int, columns: Annotated[Matrix, "n", "n"]) -> None:
    """Subtract row p from all that are below it, each times its factor, which is in column p."""
    for j in range(p + 1, n):
        above = columns[j][p]
        if above != 0.0:
            subtract_part(p + 1, n, above, columns[p], columns[j])


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
        subtract_part(m, n, value, columns[p], x)


def _exchange_rows(m: int, n: int, p: int, q: int, columns: Matrix) -> None:
    row = columns[m:, p].copy()
    columns[m:, p] = columns[m:, q]
    columns[m:, q] = row


@with_arrays(_exchange_rows)
def exchange_rows(m: int, n: int, p: int, q: int, columns: Annotated[Matrix, "n", "n"]) -> None:
    """Exchange two rows, from column m on."""
    for j in range(m, n):
        value = columns[j][p]
        columns[j][p] = columns[j][q]
        columns[j][q] = value


def _put_in_order(m: int, n: int, order: Whole, x: Vector) -> None:
    x[m:] = x[order[m:]]


@with_arrays(_put_in_order)
def put_in_order(m: int, n: int, order: Annotated[Whole, "n"], x: Annotated[Vector, "n"]) -> None:
    """Put entries in an order, from m on."""
    rest = numbers(n)
    for i in range(m, n):
        rest[i] = x[i]
    for i in range(m, n):
        x[i] = rest[order[i]]


@dataclass(slots=True)
class Factors:
    """The factors of a matrix (n, n) whose first `first` rows have the number `diagonal` on the
    diagonal, and nothing else in the first `first` columns.

    right    these rows: right[i, j] is entry (i, j) of the matrix, j >= first
    entries  for each of them the ends[i] columns where it is not 0
    columns  the other rows: columns[j, i] is entry (i, j), i >= first
    order    the other row i was row order[i]
    """

    n: int
    right: Annotated[Matrix, "n", "n"]
    columns: Annotated[Matrix, "n", "n"]
    entries: Annotated[Whole, "n", "n"]
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
    for p in range(m):
        divide_part(m, n, factors.diagonal, factors.columns[p])
        factors.ends[p] = nonzero(m, n, factors.right[p], factors.entries[p])
        for e in range(factors.ends[p]):
            k = factors.entries[p][e]
            subtract_part(m, n, factors.right[p][k], factors.columns[p], factors.columns[k])
    for i in range(m, n):
        factors.order[i] = i
    for p in range(m, n):
        pivot = place_of_largest(p, n, factors.columns[p])
        if pivot != p:
            exchange_rows(m, n, p, pivot, factors.columns)
            number = factors.order[p]
            factors.order[p] = factors.order[pivot]
            factors.order[pivot] = number
        value = factors.columns[p][p]
        if value == 0.0:
            return False
        divide_part(p + 1, n, value, factors.columns[p])
        subtract_products(n, p, factors.columns)
    return True


@with_lists("solve_by")
def solve_by(factors: Factors, x: Annotated[Vector, "factors.n"]) -> None:
    """Solve the system with these factors for the right side x, in place; column by column."""
    n = factors.n
    m = factors.first
    subtract_columns(n, m, factors.columns, x)
    put_in_order(m, n, factors.order, x)
    for p in range(m, n):
        value = x[p]
        subtract_part(p + 1, n, value, factors.columns[p], x)
    for p in range(n - 1, m - 1, -1):
        value = x[p] / factors.columns[p][p]
        x[p] = value
        subtract_part(m, p, value, factors.columns[p], x)
    for i in range(m):
        value = x[i]
        for e in range(factors.ends[i]):
            k = factors.entries[i][e]
            value -= factors.right[i][k] * x[k]
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
