"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian.

A step solves eight linear systems with one matrix and needs no Newton iteration. The method is
L-stable and stiffly accurate; its error estimate has order 4, its dense output, too. Steps are
chosen as in RODAS: Hairer, Wanner, Solving ODEs II, sections IV.7 and IV.8, with Gustafsson's
predictive control. Sums are taken term by term in a fixed order, so that compiled code has the same
bits: see `eomgen.native.implicit` and `templates/c/implicit.c.jinja`, which repeats this
arithmetic line by line.
"""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from eomgen.run.integrators.elimination import Factors, factored
from eomgen.run.integrators.first_length import first_length, norm
from eomgen.run.integrators.interface import Adaptive, Remark, ignored
from eomgen.run.integrators.rodas_5p_coefficients import (
    COUPLINGS,
    DENSE,
    END,
    GAMMA,
    IN_TIME,
    NODES,
    PLACES,
    Row,
)
from eomgen.run.problem import FloatArray

STAGES = len(NODES)
SUMS: tuple[Row, ...] = (
    *(row for both in zip(PLACES[1:], COUPLINGS[1:], strict=True) for row in both),
    END,
    *DENSE,
)
"""All sums over the solutions u_j of a step: for each stage after the first that of its place and
that of its equation, then those of the end and of the dense output."""
AT_END, IN_DENSE = 2 * (STAGES - 1), 2 * STAGES - 1
"""The number of the sum `END`, and of the first of `DENSE`."""
MATRIX = np.array([[*row, *[0.0] * (STAGES - len(row))] for row in SUMS])
"""The factors, (18, 8): one row a sum, one column a solution."""
SAFETY, SMALLEST, GREATEST = 0.9, 0.2, 6.0
"""Factor for the next step's length, and its bounds."""
POWER = -1 / 5
LEAST_ERROR = 0.01
"""An error below this counts as this, where the next step's length depends on two steps."""
NEGLIGIBLE = 1e-30
"""Errors up to this count as none."""
ASIDE = 2.0**-10
"""The derivative with respect to time is a difference quotient over twice this part of the step,
within the step, with an error of order 2."""
TOO_SHORT = "Required step size is less than spacing between numbers."

# The sums to which solution j adds: those of stage j + 1 and all behind it.
_ADDED = tuple(np.ascontiguousarray(MATRIX[2 * j :, j, None]) for j in range(STAGES))


class Rodas5P:
    """A solver of y' = fun(t, y) from `t0` on, with the interface of SciPy's.

    jac        its Jacobian df/dy, (t, y) -> (ny, ny)
    timed      whether `fun` depends on time
    positions  the number of states that are positions, which come first

    Its state consists of `t`, `y`, the length `h_abs` of the next step in s, that of the last one,
    `h_last` (0 before the first), its error relative to the tolerance, and what rounding took from
    y, `lost`, which is added to the next change (Hairer, Lubich, Wanner, Geometric Numerical
    Integration, section VIII.5).
    """

    remark: Remark = staticmethod(ignored)

    def __init__(
        self,
        fun: Callable[[float, FloatArray], FloatArray],
        t0: float,
        y0: FloatArray,
        t_bound: float,
        *,
        jac: Callable[[float, FloatArray], FloatArray],
        rtol: float,
        atol: float | FloatArray,
        max_step: float = math.inf,
        timed: bool = True,
        positions: int = 0,
    ) -> None:
        self.fun, self.jac, self.rtol, self.atol, self.max_step = fun, jac, rtol, atol, max_step
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.status: Literal["running", "finished", "failed"] = "running"
        self.nlu, self.lost = 0, np.zeros(len(y0))
        self.h_abs = first_length(
            fun,
            self.t,
            y0,
            fun(self.t, y0),
            scale=atol + np.abs(y0) * rtol,
            power=-POWER,
            longest=min(t_bound - self.t, max_step),
        )
        self.h_last, self.error = 0.0, 1.0
        self._timed, self._positions = timed, positions
        self._sums = np.empty((len(SUMS), len(y0)))
        self._products = np.empty_like(self._sums)
        self._step = (0.0, y0)

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        t, y = self.t, self.y
        shortest = 10 * abs(math.nextafter(t, math.inf) - t)
        length = max(min(self.h_abs, self.max_step), shortest)
        slope, matrix = self.fun(t, y), self.jac(t, y)
        in_time = self._in_time(t, y, slope, min(t + length, self.t_bound) - t)
        rejected = False
        while True:
            if length < shortest or math.isnan(length):
                self.status = "failed"
                return TOO_SHORT
            end = min(t + length, self.t_bound)
            h = length = end - t
            self.nlu += 1
            factors = factored(matrix, 1 / (h * GAMMA), self._positions)
            error = math.nan
            if factors is not None:
                missing = self._attempt(t, y, h, slope, in_time, factors)
                change = self._sums[AT_END] + self.lost
                last = y + change
                scale = self.atol + np.maximum(np.abs(y), np.abs(last)) * self.rtol
                error = norm(missing / scale)
                if error < 1:
                    within = norm(self._within(t, y, last, h, factors) / scale)
                    error = error if within <= error else within
            if error < 1:
                break
            length *= max(SMALLEST, SAFETY * error**POWER) if error < math.inf else SMALLEST
            rejected = True
        self.h_abs = length * self._factor(h, error, rejected)
        self.h_last, self.error = h, max(LEAST_ERROR, error)
        self._step = (h, y)
        self.t_old, self.t, self.y = t, end, last
        rest = last - y
        self.lost = (y - (last - rest)) + (change - rest)
        if end >= self.t_bound:
            self.status = "finished"
        return None

    def _factor(self, h: float, error: float, rejected: bool) -> float:
        """The next step's length by that of this one, h, which has the given error."""
        factor = GREATEST
        if error > NEGLIGIBLE:
            factor = SAFETY * error**POWER
            if self.h_last:
                ratio = error * error / self.error
                factor = min(factor, SAFETY * (h / self.h_last) * ratio**POWER)
            factor = min(GREATEST, max(SMALLEST, factor))
        return min(1.0, factor) if rejected else factor

    def _in_time(self, t: float, y: FloatArray, slope: FloatArray, h: float) -> FloatArray | None:
        """∂f/∂t at the start of a step of h, (ny,); None if f does not depend on time."""
        if not self._timed:
            return None
        aside = h * ASIDE
        near, far = self.fun(t + aside, y), self.fun(t + 2 * aside, y)
        return np.asarray((4 * (near - slope) - (far - slope)) / (2 * aside))

    def _attempt(
        self,
        t: float,
        y: FloatArray,
        h: float,
        slope: FloatArray,
        in_time: FloatArray | None,
        factors: Factors,
    ) -> FloatArray:
        """Compute the solutions u_j of a step and the sums over them; returns the last u_j."""
        sums, values = self._sums, slope
        sums.fill(0.0)
        for i in range(STAGES):
            if i:
                place, coupling = sums[2 * i - 2], sums[2 * i - 1]
                values = self.fun(t + NODES[i] * h, y + place) + coupling / h
            if in_time is not None:
                values = values + (h * IN_TIME[i]) * in_time
            solution = factors.solve(values)
            products, added = self._products[2 * i :], sums[2 * i :]
            np.multiply(_ADDED[i], solution, products)
            np.add(added, products, added)
        return solution

    def _within(
        self, t: float, y: FloatArray, last: FloatArray, h: float, factors: Factors
    ) -> FloatArray:
        """An estimate of the error of the dense output in the middle of a step, (ny,).

        It is a step of Newton's method from there. Where a stiff motion follows a slow one, steps
        may be so long that their ends are right and what lies between is not.
        """
        first, second, third = self._sums[IN_DENSE:]
        rise = (last - y) + (second + third) / 4
        middle = (y + last) / 2 + (first + (second + third / 2) / 2) / 4
        return factors.solve(self.fun(t + h / 2, middle) - rise / h)

    def dense_output(self) -> Callable[[FloatArray | float], FloatArray]:
        """The states within the last step, as a function of times: (m,) -> (ny, m), or one."""
        (h, y), last, start = self._step, self.y.copy(), self.t_old
        first, second, third = self._sums[IN_DENSE:].copy()

        def states(times: FloatArray | float) -> FloatArray:
            x = (np.asarray(times)[..., None] - start) / h
            back = 1 - x
            bend = back * (first + x * (second + x * third))
            return np.asarray(back * y + x * (last + bend)).T

        return states


INTEGRATOR = Adaptive(
    Rodas5P,
    uses_jacobian=True,
    asks_more=True,
    memory=("h_abs", "h_last", "error", "lost"),
    compiled="rodas_5p",
    smallest_rtol=1e-15,
)
