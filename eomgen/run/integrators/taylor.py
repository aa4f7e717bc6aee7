"""Steps by Taylor series of the solution, of an order that follows from the tolerance.

A step is as long as its last two terms stay below the tolerance: Jorba and Zou, A software package
for the numerical integration of ODEs by means of high-order Taylor methods, Experimental
Mathematics 14 (2005), section 3. So no step is refused. The best order grows with the logarithm of
the tolerance; they assume a cost per step like the square of the order, but it grows more slowly if
products are added up several at a time, so ours is higher. The polynomial of a step is its dense
output. C makes the same steps: see `templates/c/taylor.c.jinja`.
"""

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from eomgen.run.compiled import Series
from eomgen.run.integrators.dormand_prince_8 import TOO_SHORT, DormandPrince8
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.problem import FloatArray

HIGHEST = 24
"""The highest order."""
SMALLEST_RTOL = 1e-16


def order_of(rtol: float) -> int:
    """The order for a relative tolerance. Measured on pendulums of 2 and 10 links: the time for an
    error is within a tenth of the least one.
    """
    return min(HIGHEST, max(8, math.ceil(5 - math.log(rtol) / 2)))


class TaylorSeries:
    """A solver of y' = fun(t, y) from `t0` on, with the interface of SciPy's.

    Its state consists of `t`, `y`, and what rounding took from y, `lost`, which is added to the
    next change. The length `h_abs` of the next step in s follows from them.

    series    the Taylor coefficients of the solution
    expanded  coefficients computed for the last step; each takes at least one derivative
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
        series: Series,
        max_step: float = math.inf,
    ) -> None:
        self.fun, self.rtol, self.atol, self.max_step = fun, rtol, atol, max_step
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.status: Literal["running", "finished", "failed"] = "running"
        self.lost = np.zeros(len(y0))
        self.order = self.expanded = order_of(rtol)
        self._series = series
        self._known: tuple[float, FloatArray, FloatArray] | None = None
        self._taken = (self.t, np.zeros((1, len(y0))))

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
        terms, order = self._terms(), self.order
        allowed = self.atol + self.rtol * np.abs(self.y)
        last, other = (np.max(np.abs(row) / allowed, initial=0.0) for row in (terms[-1], terms[-2]))
        larger = max(_log(float(last)) / order, _log(float(other)) / (order - 1))
        return min(math.exp(-larger) if larger > -math.inf else math.inf, self.max_step)

    @h_abs.setter
    def h_abs(self, length: float) -> None:
        """Runs that continue give what was kept; it follows from the state."""

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        t, y, terms, length = self.t, self.y, self._terms(), self.h_abs
        shortest = 10 * abs(math.nextafter(t, math.inf) - t)
        if not length >= shortest or not np.isfinite(terms).all():
            self.fun(t, y)  # raises its own error where it has no value
            self.status = "failed"
            return TOO_SHORT
        end = min(t + length, self.t_bound)
        change = _change(terms, end - t) + self.lost
        last = y + change
        rest = last - y
        self.lost = (y - (last - rest)) + (change - rest)
        self.t_old, self.t, self.y, self._taken = t, end, last, (t, terms)
        if end >= self.t_bound:
            self.status = "finished"
        return None

    def dense_output(self) -> Callable[[FloatArray | float], FloatArray]:
        """The states within the last step, as a function of times: (m,) -> (ny, m), or one."""
        start, terms = self._taken

        def states(times: FloatArray | float) -> FloatArray:
            x = (np.asarray(times) - start)[..., None]
            return np.asarray(terms[0] + _change(terms, x)).T

        return states


def _log(size: float) -> float:
    return math.log(size) if size > 0 else -math.inf


def _change(terms: FloatArray, h: Any) -> FloatArray:
    """The change of the state after h s, (ny,) or for times (m, 1), by Horner's rule."""
    found: FloatArray = terms[-1]
    for row in terms[-2:0:-1]:
        found = found * h + row
    return np.asarray(found * h)


class _Held(DormandPrince8):
    """Steps where contacts are held: their forces have no series. The slope is not kept."""

    def step(self) -> str | None:
        self.f = self.fun(self.t, self.y)
        return super().step()


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
HEYOKA = Adaptive(
    _solver,
    memory=("h_abs", "lost"),
    vectors=("lost",),
    series="heyoka",
    smallest_rtol=SMALLEST_RTOL,
)
