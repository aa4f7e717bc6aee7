"""Projection of a state onto the constraints of a mechanism, after each step.

The step of an integrator leaves the constraints by its error. Newton's method returns the
coordinates to them, and a linear solution the velocities, both to the nearest state in the metric
of the mass matrix (Hairer and Wanner II, VII.2; Eich 1993). The order of the method is kept, and no
error of the constraints adds up.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np

from eomgen.subset.words import Matrix, Vector, with_arrays

MOST = 12
"""Most steps of Newton's method after a step; two suffice where steps are accurate."""
MET = 1e-15
"""A residual relative to the mechanism's size that is rounding, beside the last one."""
CLOSE = 1e-9
"""The largest residual that is left where Newton's method ends, in sizes."""
PROJECTED, FAR, INVALID = 1, 0, -1
"""What a projection returns: the state is on the constraints; they cannot be met near it; a
function has no valid result."""


class Constraints(Protocol):
    """The constraints of a mechanism, with residuals in rows. Each function returns whether its
    result is valid.
    """

    def residuals_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Vector, "rows"]
    ) -> bool:
        """The residuals, m or rad."""
        ...

    def move_closer(
        self, t: float, y: Annotated[Vector, "STATES"], there: Annotated[Vector, "STATES"]
    ) -> bool:
        """Give `there`, a copy of y, the coordinates after a step of Newton's method, with unit
        quaternions.
        """
        ...

    def hold_velocities(self, t: float, y: Annotated[Vector, "STATES"]) -> bool:
        """Give y the velocities that meet the constraints."""
        ...


class Linkage(Protocol):
    """A mechanism with constraints in rows, for steps that solve for them: nv velocities, and as
    many coordinates or, with quaternions, more. Residuals are in sizes. Each function returns
    whether its result is valid.
    """

    def off_by(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Vector, "rows"]
    ) -> bool:
        """The residuals."""
        ...

    def drift_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Vector, "rows"]
    ) -> bool:
        """Their rates."""
        ...

    def rows_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Matrix, "rows", "nv"]
    ) -> bool:
        """The derivatives J of their rates by the velocities."""
        ...

    def rates_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Vector, "STATES"]
    ) -> bool:
        """The rates of the states."""
        ...

    def inertia_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Matrix, "nv", "nv"]
    ) -> bool:
        """The mass matrix."""
        ...

    def slopes_at(
        self, t: float, y: Annotated[Vector, "STATES"], out: Annotated[Vector, "nv"]
    ) -> bool:
        """The derivatives of the kinetic energy by the coordinates."""
        ...


def _worst_off(rows: int, residuals: Vector, sizes: Vector) -> float:
    return float(np.abs(residuals / sizes).max())


@with_arrays(_worst_off)
def worst_off(
    rows: int, residuals: Annotated[Vector, "rows"], sizes: Annotated[Vector, "rows"]
) -> float:
    """The largest residual, in sizes; not a number if one is not."""
    largest = 0.0
    nothing = 0.0
    for i in range(rows):
        size = abs(residuals[i] / sizes[i])
        nothing += 0.0 * size
        if size > largest:
            largest = size
    return largest + nothing


@dataclass(slots=True)
class Residuals:
    """The residuals of constraints, in rows: their sizes; those of a state before it is moved onto
    the constraints, and those that are left; and room for those `after` a move to `there`.
    """

    rows: int
    sizes: Annotated[Vector, "rows"]
    first: Annotated[Vector, "rows"]
    left: Annotated[Vector, "rows"]
    after: Annotated[Vector, "rows"]
    there: Annotated[Vector, "STATES"]


def moved_onto(held: Constraints, t: float, y: Annotated[Vector, "STATES"], off: Residuals) -> int:
    """Move a state with unit quaternions onto the constraints."""
    if not held.residuals_at(t, y, off.left):
        return INVALID
    off.first[:] = off.left
    far = worst_off(off.rows, off.left, off.sizes)
    for _ in range(MOST):
        if far <= MET:
            break
        off.there[:] = y
        if not held.move_closer(t, y, off.there) or not held.residuals_at(t, off.there, off.after):
            return INVALID
        nearer = worst_off(off.rows, off.after, off.sizes)
        if not nearer < far:  # rounding, or no way towards the constraints
            break
        y[:] = off.there
        off.left[:] = off.after
        far = nearer
    if not far <= CLOSE:
        return FAR
    return PROJECTED if held.hold_velocities(t, y) else INVALID
