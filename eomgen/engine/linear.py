"""Gaussian elimination in a fixed order of operations, by rows: there is no other library of linear
algebra here, so that the bits are the same everywhere.
"""

from typing import Annotated

from eomgen.subset.words import Matrix, Vector, Whole, copy, outer


def factorised(n: int, a: Annotated[Matrix, "n", "n"], order: Annotated[Whole, "n"]) -> bool:
    """Replace a matrix by its factors L and U, with pivots that are the largest of each column; row
    i was row order[i]. False if it is singular.
    """
    for i in range(n):
        order[i] = i
    for p in range(n):
        pivot = p
        for i in range(p + 1, n):
            if abs(a[i, p]) > abs(a[pivot, p]):
                pivot = i
        if a[pivot, p] == 0.0:
            return False
        if pivot != p:
            row = copy(a[p])
            a[p, :] = a[pivot]
            a[pivot, :] = row
            number = order[p]
            order[p] = order[pivot]
            order[pivot] = number
        diagonal = a[p, p]
        a[p + 1 :, p] /= diagonal
        factors = copy(a[p + 1 :, p])
        above = copy(a[p, p + 1 :])
        a[p + 1 :, p + 1 :] -= outer(factors, above)
    return True


def solved(
    n: int,
    a: Annotated[Matrix, "n", "n"],
    order: Annotated[Whole, "n"],
    b: Annotated[Vector, "n"],
    x: Annotated[Vector, "n"],
) -> None:
    """Solve L U x = b, of which the rows are in order; column by column."""
    for i in range(n):
        x[i] = b[order[i]]
    for p in range(n):
        part = x[p]
        x[p + 1 :] -= part * a[p + 1 :, p]
    for p in range(n - 1, -1, -1):
        part = x[p] / a[p, p]
        x[p] = part
        x[:p] -= part * a[:p, p]
