"""Where a derivative with corners changes its branch, located as exactly as the motion itself.

With its branches fixed (`precise.CornerBranches`) a derivative is smooth, even across a corner. The
sign of each corner's margin along the step shows which corner changes first, and where. The step is
then repeated so that it ends there, the corner's branch is switched, and the next step starts on
the other side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Legendre

from eomgen.run.problem import FloatArray

NOTHING = 1e-22
"""A margin this small, relative to its greatest value in the step, counts as 0."""


@dataclass(frozen=True)
class BranchChange:
    """Corner number `corner` changes its branch at 1 + `beyond` times the step. `beyond` is kept
    apart because 1 + `beyond` as a double would lose digits close to the end of the step.
    """

    corner: int
    beyond: float


def wrong(branches: Sequence[bool], margins: FloatArray) -> FloatArray:
    """Where margins (n, corners) contradict the current branches; booleans (n, corners)."""
    return np.where(np.array(branches), margins < 0, margins > 0)


def wrong_from_the_start(branches: Sequence[bool], margins: FloatArray) -> list[int]:
    """Corners that were at their zero at the start of a step and contradict their branch all along.

    If a margin is 0 all along the step, the branch for margins > 0 is wrong. That happens to a
    stop, whose margin is how far a coordinate exceeds its limits, when it was switched with others.

    margins (n, corners) at the start, the stages and the end
    """
    against = wrong(branches, margins)
    sizes = np.max(np.abs(margins), axis=0)
    late = against[1:].all(axis=0) & (np.abs(margins[0]) <= NOTHING * sizes)
    idle = np.array(branches) & (margins[1:] == 0).all(axis=0)
    return np.flatnonzero(late | idle).tolist()


def first_change(
    branches: Sequence[bool], abscissas: FloatArray, margins: FloatArray
) -> BranchChange | None:
    """The first branch change within a step; None if there is none.

    abscissas  (n,): 0, the nodes, 1, as parts of the step
    margins  (n, corners) at these places
    """
    against = wrong(branches, margins)[1:].any(axis=0)
    turns = [
        BranchChange(corner, _root(bool(branches[corner]), abscissas, margins[:, corner]) - 1.0)
        for corner in np.flatnonzero(against).tolist()
    ]
    return min(turns, key=lambda change: change.beyond, default=None)


def nearer(change: BranchChange, abscissas: FloatArray, margins: FloatArray) -> BranchChange:
    """The branch change located again, from the margins of a step that ends close to it."""
    values = margins[:, change.corner]
    slope = float(_through(abscissas, values).deriv()(1.0))
    size = float(np.max(np.abs(values)))
    return BranchChange(change.corner, -float(values[-1]) / size / slope if slope else 0.0)


def simpler(change: BranchChange, abscissas: FloatArray, margins: FloatArray) -> BranchChange:
    """Of the corners whose margins vanish at a branch change, the one whose margin is steepest.

    The force of a contact with exponent 3/2 is not a polynomial of time where it vanishes; its
    depth nearly is. So a few steps locate the zero of the depth, where the force would take many.
    """
    sizes = np.max(np.abs(margins), axis=0)
    near = [
        other
        for corner in np.flatnonzero(sizes > 0).tolist()
        if abs((other := nearer(BranchChange(corner, 0.0), abscissas, margins)).beyond)
        <= 10 * abs(change.beyond)
    ]
    return max(
        near, key=lambda other: abs(margins[-1, other.corner]) / sizes[other.corner], default=change
    )


def changed_at_the_end(change: BranchChange, margins: FloatArray) -> list[int]:
    """The corners whose margins are 0 at the end of a step that ends at a branch change."""
    sizes = np.max(np.abs(margins), axis=0)
    there = (np.abs(margins[-1]) <= NOTHING * sizes) & (sizes > 0)
    there[change.corner] = True
    return np.flatnonzero(there).tolist()


def is_there(change: BranchChange, margins: FloatArray) -> bool:
    """Whether a step ends at its branch change."""
    values = np.abs(margins[:, change.corner])
    return bool(values[-1] <= NOTHING * np.max(values))


def _through(abscissas: FloatArray, values: FloatArray) -> Legendre:
    """The polynomial through margins, relative to the greatest of them."""
    size = float(np.max(np.abs(values)))
    return Legendre.fit(abscissas, values / size, len(abscissas) - 1, domain=[0.0, 1.0])


def _root(branch: bool, abscissas: FloatArray, values: FloatArray) -> float:
    """The first part of the step at which a margin gets the sign that contradicts its branch."""
    polynomial = _through(abscissas, values)
    slope = polynomial.deriv()
    found = polynomial.roots()
    real = found[np.abs(found.imag) < 1e-6].real
    passing = [c for c in real if 0.0 < c <= 1.0 and (slope(c) < 0) == branch]
    if passing:
        return float(min(passing))
    # No root was found: take the middle between the last right sign and the first wrong one.
    first = int(np.flatnonzero(values[1:] < 0 if branch else values[1:] > 0)[0]) + 1
    return float((abscissas[first - 1] + abscissas[first]) / 2)
