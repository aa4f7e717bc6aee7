"""Unit quaternions among the states."""

from typing import Annotated

from eomgen.subset.words import Matrix, Vector, Whole, sqrt

SHORTEST, LONGEST = 1e-100, 1e100
"""Lengths between these have squares that neither overflow nor underflow."""


def normalised(
    many: int, places: Annotated[Whole, "4 * many"], y: Annotated[Vector, "STATES"]
) -> bool:
    """Give each quaternion, of which `places` are four states, the length 1; False for a length
    that is not usual.

    The exact motion stays on the unit sphere, and a step leaves it by its error. Projection to the
    nearest point keeps the order of the method: Hairer, Lubich, Wanner, IV.4.
    """
    for i in range(many):
        a = places[4 * i]
        b = places[4 * i + 1]
        c = places[4 * i + 2]
        d = places[4 * i + 3]
        length = sqrt(y[a] * y[a] + y[b] * y[b] + y[c] * y[c] + y[d] * y[d])
        if not (length > SHORTEST and length < LONGEST):
            return False
        y[a] /= length
        y[b] /= length
        y[c] /= length
        y[d] /= length
    return True


def tangents(
    n: int,
    nv: int,
    many: int,
    places: Annotated[Whole, "4 * many"],
    y: Annotated[Vector, "STATES"],
    plain: float,
    basis: Annotated[Matrix, "n", "nv"],
) -> None:
    """T of δy = T δx, small displacements of n coordinates, the first of y: `plain` for each scalar
    one, q (0, δr)/2 for each quaternion, whose columns are orthogonal.
    """
    basis[:, :] = 0.0
    column = 0
    for i in range(n):
        first = -1
        inside = False
        for k in range(many):
            if places[4 * k] == i:
                first = 4 * k
            for j in range(1, 4):
                if places[4 * k + j] == i:
                    inside = True
        if first >= 0:
            a = places[first]
            b = places[first + 1]
            c = places[first + 2]
            d = places[first + 3]
            w = 0.5 * y[a]
            x = 0.5 * y[b]
            u = 0.5 * y[c]
            v = 0.5 * y[d]
            basis[a, column] = -x
            basis[a, column + 1] = -u
            basis[a, column + 2] = -v
            basis[b, column] = w
            basis[b, column + 1] = -v
            basis[b, column + 2] = u
            basis[c, column] = v
            basis[c, column + 1] = w
            basis[c, column + 2] = -x
            basis[d, column] = -u
            basis[d, column + 1] = x
            basis[d, column + 2] = w
            column += 3
        elif not inside:
            basis[i, column] = plain
            column += 1
