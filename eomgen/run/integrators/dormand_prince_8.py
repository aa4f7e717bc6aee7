"""The method of Dormand and Prince of order 8 with dense output of order 7, known as DOP853.

Its steps are those of `eomgen.engine.adaptive`, which also C and the page make: a run has the same
bits on every machine on which its derivative has them.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from eomgen.engine.adaptive import (
    Bounds,
    Progress,
    first_length,
    interpolate,
    made,
    within,
)
from eomgen.engine.embedded import DOP853
from eomgen.engine.sums import round_off
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.problem import FloatArray

FEW = 12
"""Greatest number of states for which Python's own numbers are quicker than NumPy."""
MANY = 128
"""After this many steps they are worth their printing."""
TOO_SHORT = "Required step size is less than spacing between numbers."
_made: Counter[int] = Counter()
"""Steps made so far, by the number of states."""


@dataclass(frozen=True, slots=True)
class _System:
    derivative: Callable[[float, FloatArray], FloatArray]


class DormandPrince8:
    """A solver of y' = fun(t, y) from `t0` on, with the interface of SciPy's.

    Its state consists of `t`, `y`, the length `h_abs` of the next step in s, the slope `f` at t, y,
    and what rounding took from y, `lost`, which is added to the next change.
    """

    nlu = 0

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
        self.fun = fun
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.status: Literal["running", "finished", "failed"] = "running"
        self.f, self.lost = fun(self.t, y0), np.zeros(len(y0))
        self._system = _System(fun)
        self._bounds = Bounds(np.zeros(len(y0)) + atol, rtol, max_step)
        longest = min(t_bound - self.t, max_step)
        self.h_abs = first_length(self._system, self._bounds, self.t, y0, self.f, longest)
        self._k: Any = np.zeros((len(DOP853.nodes), len(y0)))
        if len(y0) <= FEW:
            self._k = list(self._k)
        self._at, self._start = Progress(), y0
        self._made = self._how()
        self._dense: Callable[[FloatArray | float], FloatArray] | None = None

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        t, y, k = self.t, self.y, self._k
        at, raw, change = self._at, np.empty(y.shape), np.empty(y.shape)
        k[0], at.t, at.length, self._bounds.until = self.f, t, self.h_abs, self.t_bound
        if self._is_new:
            self._made = self._how()
        if not self._made(self._system, self._bounds, at, y, self.lost, k, change, raw):
            self.status = "failed"
            return TOO_SHORT
        self.h_abs, self._start, self._dense = at.length, y, None
        self.t_old, self.t, self.y = t, at.end, raw
        k[DOP853.last] = self.f = self.fun(at.end, raw)
        self.lost = np.empty(y.shape)
        round_off(y, raw, change, self.lost)
        if at.end >= self.t_bound:
            self.status = "finished"
        return None

    def _how(self) -> Callable[..., bool]:
        """The function that makes a step: for few states it is printed once it pays off."""
        ny = len(self.y)
        self._is_new = 0 < ny <= FEW and _made[ny] < MANY
        _made[ny] += self._is_new
        if self._is_new or not 0 < ny <= FEW:
            return partial(made, DOP853)
        # Imported here because short runs do without the printer.
        from eomgen.engine.printed import steps_of_few

        return steps_of_few(ny)

    def dense_output(self) -> Callable[[FloatArray | float], FloatArray]:
        """The states within the last step, as a function of times: (m,) -> (ny, m), or one."""
        if self._dense is None:
            at, y = self._at, self._start
            terms = np.empty((7, len(y)))
            interpolate(DOP853, self._system, at, y, self.y, self._k, terms)
            self._dense = partial(interpolated, at.t, at.h, y, terms)
        return self._dense


def interpolated(
    start: float, h: float, y: FloatArray, terms: FloatArray, times: FloatArray | float
) -> FloatArray:
    """The states at times within a step of length h from `y` at `start`, from the terms (7, ny) of
    its interpolant.
    """
    place = np.empty((*np.shape(times), len(y)))
    each: Any = np.asarray(times)[..., None]
    within(Progress(start, h), y, terms, each, place)
    return place.T


INTEGRATOR = Adaptive(
    DormandPrince8, memory=("h_abs", "f", "lost"), compiled="DOP853", smallest_rtol=1e-16
)
