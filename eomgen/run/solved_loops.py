"""Constraints that a module keeps in closed form, of which a run watches the margins only."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.run.margins import NEAR, NEAR_SOLVED, Seen
from eomgen.run.projection import without

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SolvedLoops:
    """The constraints of a module that keeps them in closed form: nothing is projected.

    names    of the rows
    angles   names of angles that jump by a turn at the end of their range
    margins  (t, y) -> (nc + na,), or (n,), (ny, n) -> (nc + na, n), as of `Projection`; then how
             far each angle is from there, at most 1
    jacobian (t, y) -> (nc, nv), the derivatives of the constraints' rates by all velocities;
             `without` if the module has none, as that of a large mechanism
    seen     the margins of the run, if they are watched
    """

    names: tuple[str, ...]
    angles: tuple[str, ...]
    margins: Callable[[Any, FloatArray], FloatArray]
    jacobian: Callable[[float, FloatArray], FloatArray]
    seen: Seen | None = None

    def passed(
        self, t: float, y: FloatArray, ends: FloatArray, states: FloatArray
    ) -> FloatArray | None:
        """The least margins (m + 1,) at t and at the ends (m,) of m steps from there, whose states
        are (m, ny); None if one of these steps may pass a singular position.
        """
        times = np.concatenate(([t], ends))
        found = self.margins(times, np.vstack((y, states)).T).min(axis=0)
        if found.min() >= NEAR:
            return np.asarray(found)
        assert self.seen
        seen = replace(self.seen)
        for end, margin in zip(ends.tolist(), found[1:].tolist(), strict=True):
            if not margin >= NEAR_SOLVED or seen.turns(end, margin):
                return None
            seen.add(end, margin)
        return np.asarray(found)


def solved_loops_of(module: Any, parameters: Any, inputs: Any) -> SolvedLoops | None:
    """The constraints of a module that keeps them in closed form; None if it does not."""
    if not getattr(module, "FOLLOWING", None):
        return None
    return SolvedLoops(
        tuple(module.CONSTRAINTS),
        tuple(getattr(module, "RANGED", ())),
        lambda t, y: module.constraint_margins(t, y, parameters, inputs),
        (lambda t, y: module.constraint_jacobian(t, y, parameters, inputs))
        if hasattr(module, "constraint_jacobian")
        else without,
    )
