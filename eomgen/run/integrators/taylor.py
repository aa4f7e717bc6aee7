"""Steps by Taylor series of the solution: those of `eomgen.engine.taylor`.

The best order grows with the logarithm of the tolerance. Jorba and Zou assume a cost per step like
the square of the order, but it grows more slowly if products are added up several at a time, so
ours is higher.
"""

import copy
import math
from typing import Any

import numpy as np

from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.taylor import change_after, order_of, reach, series_step
from eomgen.run.compiled import Series
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.maker import Maker
from eomgen.subset.words import Vector

SMALLEST_RTOL = 1e-16


class TaylorSeries(Maker):
    """The length of the next step in s follows from its state.

    series    the Taylor coefficients of the solution
    """

    counts = ("derivatives",)

    def __init__(self, *given: Any, series: Series, **options: Any) -> None:
        super().__init__(*given, **options)
        self.order = order_of(self.bounds.rtol)
        self._series = series
        self._terms = np.empty((0, len(self.y)))
        self._known: tuple[float, Vector, Vector, float] | None = None

    @property
    def h_abs(self) -> float:
        """The length of the next step, s."""
        return self._at(self.t, self.y)[1]

    @h_abs.setter
    def h_abs(self, length: float) -> None:
        """Runs that continue give what was kept; it follows from the state."""

    def _at(self, t: float, y: Vector) -> tuple[Vector, float]:
        """The coefficients at t, y, and the length of a step from there, s; nan if one of them is
        not finite.
        """
        known = self._known
        if known is None or known[0] != t or not np.array_equal(known[1], y):
            terms = self._series(t, y, self.order)
            is_finite = np.isfinite(terms).all()
            length = reach(self.bounds, self.order, terms, y) if is_finite else math.nan
            known = self._known = t, y, terms, length
        return known[2:]

    def ready(self, run: Bounds, at: Progress, y: Vector) -> None:
        """See `Maker`, also for what follows."""
        at.length = self._at(at.t, y)[1]
        if not at.length >= 10 * abs(math.nextafter(at.t, math.inf) - at.t):
            self.derivative(at.t, y)  # raises its own error where it has no value

    def make(self, run: Bounds, at: Progress, y: Vector, lost: Vector, raw: Vector) -> bool:
        self._terms, _ = self._at(at.t, y)
        series_step(self.order, self._terms, run, at, y, lost, raw)
        return True

    def between(self, at: Progress, y: Vector, raw: Vector, t: Any, place: Vector) -> None:
        between(at, y, self._terms, t, place)

    def frozen(self) -> "TaylorSeries":
        return copy.copy(self)


def between(at: Progress, y: Vector, terms: Vector, t: Any, place: Vector) -> None:
    """The state at a time within a step from y, from the terms of the series there."""
    change_after(t - at.t, len(terms) - 1, terms, place)
    place += y


class _Held(DormandPrince8):
    """Steps where contacts are held: their forces have no series. The slope is not kept."""

    def _slope(self, t: float, y: Vector) -> Vector:
        return self.derivative(t, y)

    @property
    def slopes(self) -> None:
        return None


def _solver(*given: Any, series: Series | None, **options: Any) -> TaylorSeries | _Held:
    """Steps by the series, or else of DOP853."""
    if series is None:
        return _Held(*given, **options)
    return TaylorSeries(*given, series=series, **options)


INTEGRATOR = Adaptive(
    _solver,
    memory=("h_abs", "lost"),
    vectors=("lost",),
    compiled="taylor",
    series="taylor",
    smallest_rtol=SMALLEST_RTOL,
)
