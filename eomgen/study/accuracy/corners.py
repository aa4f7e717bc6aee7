"""Where a derivative with corners turns: found as exactly as the motion itself.

Held on one side of its corners (`precise.Watch`), a derivative is smooth, and so is a step through
a corner. What each corner's margin does along the step tells where the first of them turns; the
step is made again up to there, its ways are turned, and the next one begins on the other side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Legendre

from eomgen.run.problem import Floats

NOTHING = 1e-22
"""A margin this small, in parts of the greatest of its step, is 0."""


@dataclass(frozen=True)
class Turn:
    """Corner number `corner` turns at 1 + `beyond` times the step, if only just before its end to
    more digits than 1 + `beyond` has in doubles.
    """

    corner: int
    beyond: float


def wrong(ways: Sequence[bool], margins: Floats) -> Floats:
    """Where margins (n, corners) contradict the ways; (n, corners) of booleans."""
    return np.where(np.array(ways), margins < 0, margins > 0)


def wrong_from_the_start(ways: Sequence[bool], margins: Floats) -> list[int]:
    """Corners that were about to turn at the start of a step and go the wrong way all along it.

    A margin that is 0 throughout is not > 0: as that of a stop, which is what a coordinate is
    beyond its limits, has been turned with others, and then stays 0.

    margins (n, corners) at the start, the stages and the end
    """
    against = wrong(ways, margins)
    sizes = np.max(np.abs(margins), axis=0)
    late = against[1:].all(axis=0) & (np.abs(margins[0]) <= NOTHING * sizes)
    idle = np.array(ways) & (margins[1:] == 0).all(axis=0)
    return np.flatnonzero(late | idle).tolist()


def first_turn(ways: Sequence[bool], places: Floats, margins: Floats) -> Turn | None:
    """The first corner to turn within a step; None if none does.

    places   (n,): 0, the nodes, 1
    margins  (n, corners) there
    """
    against = wrong(ways, margins)[1:].any(axis=0)
    turns = [
        Turn(corner, _root(bool(ways[corner]), places, margins[:, corner]) - 1.0)
        for corner in np.flatnonzero(against).tolist()
    ]
    return min(turns, key=lambda turn: turn.beyond, default=None)


def nearer(turn: Turn, places: Floats, margins: Floats) -> Turn:
    """The turn again, from a step that ends about there, as exactly as its margins tell."""
    values = margins[:, turn.corner]
    slope = float(_through(places, values).deriv()(1.0))
    size = float(np.max(np.abs(values)))
    return Turn(turn.corner, -float(values[-1]) / size / slope if slope else 0.0)


def simpler(turn: Turn, places: Floats, margins: Floats) -> Turn:
    """The corner whose margin goes through 0 most steeply where a turn is, which it may be itself.

    The force of a contact of the power 3/2 vanishes with its depth, where it is no polynomial; the
    depth is one. So its zero is found in a few steps, that of the force in very many.
    """
    sizes = np.max(np.abs(margins), axis=0)
    near = [
        other
        for corner in np.flatnonzero(sizes > 0).tolist()
        if abs((other := nearer(Turn(corner, 0.0), places, margins)).beyond)
        <= 10 * abs(turn.beyond)
    ]
    return max(
        near, key=lambda other: abs(margins[-1, other.corner]) / sizes[other.corner], default=turn
    )


def turned_at_the_end(turn: Turn, margins: Floats) -> list[int]:
    """The corners that are 0 at the end of a step that a turn ends."""
    sizes = np.max(np.abs(margins), axis=0)
    there = (np.abs(margins[-1]) <= NOTHING * sizes) & (sizes > 0)
    there[turn.corner] = True
    return np.flatnonzero(there).tolist()


def is_there(turn: Turn, margins: Floats) -> bool:
    """Whether a step ends where its turn is."""
    values = np.abs(margins[:, turn.corner])
    return bool(values[-1] <= NOTHING * np.max(values))


def _through(places: Floats, values: Floats) -> Legendre:
    """The polynomial through margins, in parts of the greatest."""
    size = float(np.max(np.abs(values)))
    return Legendre.fit(places, values / size, len(places) - 1, domain=[0.0, 1.0])


def _root(way: bool, places: Floats, values: Floats) -> float:
    """The first share of the step where a margin passes to the wrong side of a way."""
    polynomial = _through(places, values)
    slope = polynomial.deriv()
    found = polynomial.roots()
    real = found[np.abs(found.imag) < 1e-6].real
    passing = [c for c in real if 0.0 < c <= 1.0 and (slope(c) < 0) == way]
    if passing:
        return float(min(passing))
    # No root to see: it lies between the last place that is right and the first that is wrong.
    first = int(np.flatnonzero(values[1:] < 0 if way else values[1:] > 0)[0]) + 1
    return float((places[first - 1] + places[first]) / 2)
