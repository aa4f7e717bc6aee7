"""What our own adaptive methods have in common: the interface of SciPy's solvers."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from eomgen.engine.adaptive import Bounds, first_length
from eomgen.run.problem import FloatArray

TOO_SHORT = "Required step size is less than spacing between numbers."
States = Callable[[FloatArray | float], FloatArray]
"""The states within a step, as a function of times: (m,) -> (ny, m), or one."""


class Solver:
    """A solver of y' = fun(t, y) from `t0` on.

    Its state consists of `t`, `y`, what rounding took from y, `lost`, which is added to the next
    change, and what a method adds: see its `memory`.
    """

    def __init__(
        self,
        fun: Callable[[float, FloatArray], FloatArray],
        t0: float,
        y0: FloatArray,
        t_bound: float,
        *,
        rtol: float,
        atol: float | FloatArray,
        max_step: float = math.inf,
    ) -> None:
        self.derivative = fun
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old, self.nlu = self.t, 0
        self.status: Literal["running", "finished", "failed"] = "running"
        self.lost = np.zeros(len(y0))
        self.bounds = Bounds(np.zeros(len(y0)) + atol, rtol, max_step)

    def first_length(self, slope: FloatArray) -> float:
        """The length of the first step, s, from the slope there."""
        longest = min(self.t_bound - self.t, self.bounds.longest)
        return first_length(self, self.bounds, self.t, self.y, slope, longest)

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        made = self.made()
        if made is None:
            self.status = "failed"
            return TOO_SHORT
        self.t_old, (self.t, self.y) = self.t, made
        if self.t >= self.t_bound:
            self.status = "finished"
        return None

    def made(self) -> tuple[float, FloatArray] | None:
        """The end of a step and the state there; None if it would be too short."""
        raise NotImplementedError

    def dense_output(self) -> States:
        """The states within the last step."""
        raise NotImplementedError
