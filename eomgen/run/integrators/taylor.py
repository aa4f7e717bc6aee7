"""Steps by Taylor series of the solution: those of `eomgen.engine.taylor`.

The best order grows with the logarithm of the tolerance. Jorba and Zou assume a cost per step like
the square of the order, but it grows more slowly if products are added up several at a time, so
ours is higher.
"""

import math
from functools import partial
from typing import Any

import numpy as np

from eomgen.engine.sums import round_off
from eomgen.engine.taylor import change_after, order_of, reach
from eomgen.run.compiled import Series
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.solver import Solver, States
from eomgen.run.problem import FloatArray

SMALLEST_RTOL = 1e-16


class TaylorSeries(Solver):
    """The length `h_abs` of the next step in s follows from its state.

    series    the Taylor coefficients of the solution
    expanded  coefficients computed for the last step; each takes at least one derivative
    """

    def __init__(self, *given: Any, series: Series, **options: Any) -> None:
        super().__init__(*given, **options)
        self.order = self.expanded = order_of(self.bounds.rtol)
        self._series = series
        self._known: tuple[float, FloatArray, FloatArray] | None = None
        self._taken = (self.t, np.zeros((1, len(self.y))))

    def _terms(self) -> FloatArray:
        """The coefficients at t, y."""
        known = self._known
        if known is None or known[0] != self.t or known[1] is not self.y:
            rows = self._series(self.t, self.y, self.order)
            known = self._known = self.t, self.y, rows
        return known[2]

    @property
    def h_abs(self) -> float:
        """The length of the next step, s."""
        return reach(self.bounds, self.order, self._terms(), self.y)

    @h_abs.setter
    def h_abs(self, length: float) -> None:
        """Runs that continue give what was kept; it follows from the state."""

    def made(self) -> tuple[float, FloatArray] | None:
        """See `Solver`."""
        t, y, terms, length = self.t, self.y, self._terms(), self.h_abs
        shortest = 10 * abs(math.nextafter(t, math.inf) - t)
        if not length >= shortest or not np.isfinite(terms).all():
            self.derivative(t, y)  # raises its own error where it has no value
            return None
        end = min(t + length, self.t_bound)
        change, lost = np.empty(len(y)), np.empty(len(y))
        change_after(end - t, self.order, terms, change)
        change += self.lost
        last = y + change
        round_off(y, last, change, lost)
        self.lost, self._taken = lost, (t, terms)
        return end, last

    def dense_output(self) -> States:
        """See `Solver`."""
        start, terms = self._taken
        return partial(between, start, self.t - start, terms[0], terms)


def between(
    start: float, h: float, y: FloatArray, terms: FloatArray, times: FloatArray | float
) -> FloatArray:
    """The states at times within a step of length h from `y` at `start`, from the terms of the
    series there.
    """
    lengths: Any = (np.asarray(times) - start)[..., None]
    change: Any = np.empty((*np.shape(times), len(y)))
    change_after(lengths, len(terms) - 1, terms, change)
    return np.asarray(y + change).T


class _Held(DormandPrince8):
    """Steps where contacts are held: their forces have no series. The slope is not kept."""

    def made(self) -> tuple[float, FloatArray] | None:
        """See `Solver`."""
        self.f = self.derivative(self.t, self.y)
        return super().made()


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
