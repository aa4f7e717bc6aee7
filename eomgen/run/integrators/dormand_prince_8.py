"""The method of Dormand and Prince of order 8 with dense output of order 7, known as DOP853.

Its steps are those of `eomgen.engine.adaptive`, which also C and the page make: a run has the same
bits on every machine on which its derivative has them.
"""

import copy
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from eomgen.engine.adaptive import Bounds, Progress, interpolate, made, within
from eomgen.engine.adaptive_steps import Records
from eomgen.engine.embedded import DOP853
from eomgen.engine.sums import round_off
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.maker import Maker
from eomgen.subset.words import Vector

FEW = 12
"""Greatest number of states for which Python's own numbers are quicker than NumPy."""
MANY = 128
"""After this many steps they are worth their printing."""
_made: Counter[int] = Counter()
"""Steps made so far, by the number of states."""


class DormandPrince8(Maker):
    """Its state has the length `h_abs` of the next step in s, and the slope `f` at t, y."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self.f = self.derivative(self.t, self.y)
        self.h_abs, many = self.first_length(self.f), len(self.y)
        self._k: Any = np.zeros((len(DOP853.nodes), many))
        if many <= FEW:
            self._k = list(self._k)
        self._terms = np.empty((7, many))
        self._made = self._how()

    def begin(self) -> None:
        """See `Maker`, also for what follows."""
        self._k[DOP853.last] = self.f
        if self._is_new:
            self._made = self._how()

    def make(self, run: Bounds, at: Progress, y: Vector, lost: Vector, raw: Vector) -> bool:
        k, change = self._k, np.empty(y.shape)
        k[0] = self._slope(at.t, y)
        if not self._made(self, run, at, y, lost, k, change):
            return False
        raw[:] = y + change
        k[DOP853.last] = self.derivative(at.end, raw)
        round_off(y, raw, change, lost)
        return True

    def _slope(self, t: float, y: Vector) -> Vector:
        """That where a step begins."""
        slope: Vector = self._k[DOP853.last]
        return slope

    def between(self, at: Progress, y: Vector, raw: Vector, t: Any, place: Vector) -> None:
        interpolate(DOP853, self, at, y, raw, self._k, self._terms)
        within(at, y, self._terms, t, place)

    def record(self, run: Bounds, at: Progress, y: Vector, raw: Vector, kept: Records) -> None:
        kept.slopes[kept.made] = self._k[DOP853.last]

    def frozen(self) -> "DormandPrince8":
        made = copy.copy(self)
        made._k, made._terms = self._k.copy(), self._terms.copy()
        return made

    @property
    def slopes(self) -> Vector | None:
        return np.array([self._k[0], self._k[DOP853.last]])

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


INTEGRATOR = Adaptive(
    DormandPrince8, memory=("h_abs", "f", "lost"), compiled="DOP853", smallest_rtol=1e-16
)
