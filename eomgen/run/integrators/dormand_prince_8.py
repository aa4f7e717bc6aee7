"""The method of Dormand and Prince of order 8 with dense output of order 7, known as DOP853.

Its steps are those of `eomgen.engine.adaptive`, which also C and the page make: a run has the same
bits on every machine on which its derivative has them.
"""

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from eomgen.engine.adaptive import Progress, interpolate, made, within
from eomgen.engine.embedded import DOP853
from eomgen.engine.sums import round_off
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.solver import Solver, States
from eomgen.run.problem import FloatArray

FEW = 12
"""Greatest number of states for which Python's own numbers are quicker than NumPy."""
MANY = 128
"""After this many steps they are worth their printing."""
_made: Counter[int] = Counter()
"""Steps made so far, by the number of states."""


class DormandPrince8(Solver):
    """Its state has the length `h_abs` of the next step in s, and the slope `f` at t, y."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self.f = self.derivative(self.t, self.y)
        self.h_abs, many = self.first_length(self.f), len(self.y)
        self._k: Any = np.zeros((len(DOP853.nodes), many))
        if many <= FEW:
            self._k = list(self._k)
        self._at, self._start = Progress(), self.y
        self._made = self._how()
        self._dense: States | None = None

    def made(self) -> tuple[float, FloatArray] | None:
        """See `Solver`."""
        y, k, at = self.y, self._k, self._at
        change = np.empty(y.shape)
        k[0], at.t, at.length, self.bounds.until = self.f, self.t, self.h_abs, self.t_bound
        if self._is_new:
            self._made = self._how()
        if not self._made(self, self.bounds, at, y, self.lost, k, change):
            return None
        self.h_abs, self._start, self._dense, raw = at.length, y, None, y + change
        k[DOP853.last] = self.f = self.derivative(at.end, raw)
        self.lost = np.empty(y.shape)
        round_off(y, raw, change, self.lost)
        return at.end, raw

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

    def dense_output(self) -> States:
        """See `Solver`."""
        if self._dense is None:
            at, y = self._at, self._start
            terms = np.empty((7, len(y)))
            interpolate(DOP853, self, at, y, self.y, self._k, terms)
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
