"""Unit quaternions among the states."""

from typing import Annotated

from eomgen.subset.words import Vector, Whole, sqrt

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
