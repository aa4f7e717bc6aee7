"""What makes the steps of a method in Python, one by one, for the engine's driver."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from eomgen.engine.adaptive import Bounds, Progress, first_length
from eomgen.engine.adaptive_steps import Records
from eomgen.run.integrators.interface import Remark, ignored
from eomgen.subset.words import Vector

TOO_SHORT = "Required step size is less than spacing between numbers"


class Maker:
    """Makes steps of y' = fun(t, y): a `Stepping` of `engine.adaptive_steps`. It is also where a
    run by them is: at t, y, with what rounding took from y, `lost`, and what a method adds: see
    its `memory`. `t_old` is the start of the last step, and `t_bound` where steps must end.

    reached         whether the last step ends there
    factorisations  those since `begin`
    why             why no step could be made
    remark          called with what SciPy would warn of
    counts          what it counts beside the calls of functions, by the names of records
    """

    counts: tuple[str, ...] = ()
    remark: Remark = staticmethod(ignored)
    h_abs: float

    def __init__(
        self,
        fun: Callable[[float, Vector], Vector],
        t0: float,
        y0: Vector,
        t_bound: float,
        *,
        rtol: float,
        atol: float | Vector,
        max_step: float = math.inf,
    ) -> None:
        self.derivative, self.why, self.reached, self.factorisations = fun, TOO_SHORT, False, 0
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.lost = np.zeros(len(y0))
        self.bounds = Bounds(np.zeros(len(y0)) + atol, rtol, max_step, reaches=True)

    def first_length(self, slope: Vector) -> float:
        """The length of the first step, s, from the slope there."""
        longest = min(self.t_bound - self.t, self.bounds.longest)
        return first_length(self, self.bounds, self.t, self.y, slope, longest)

    def begin(self) -> None:
        """Steps from where the run is are to be made."""

    def ready(self, run: Bounds, at: Progress, y: Vector) -> None:
        """See `Stepping`, also for what follows. What depends on y alone is left to `make`, for
        there may be no next step.
        """

    def make(self, run: Bounds, at: Progress, y: Vector, lost: Vector, raw: Vector) -> bool:
        """Make a step."""
        raise NotImplementedError

    def between(self, at: Progress, y: Vector, raw: Vector, t: Any, place: Vector) -> None:
        """The states `place` (ny,) at a time within the step; or (m, ny) at times (m, 1)."""
        raise NotImplementedError

    def record(self, run: Bounds, at: Progress, y: Vector, raw: Vector, kept: Records) -> None:
        """Keep what is the method's own."""

    def frozen(self) -> "Maker":
        """What gives the states within this step when others have been made."""
        return self

    @property
    def slopes(self) -> Vector | None:
        """The derivatives (2, ny) at the ends of the step, if they are known."""
        return None
