"""The method of Gragg, Bulirsch and Stoer: extrapolation of the explicit midpoint rule.

It chooses the order and the step with the least work per second of motion. For tight tolerances it
raises the order, where DOP853 must shorten its steps.

Hairer, Norsett, Wanner, Solving ODEs I, section II.9; order and step are controlled as in their
program ODEX. Unlike there, the rows of the table are not smoothed, and the table holds changes
since the start of the step, which have smaller rounding errors than states.
"""

from dataclasses import dataclass, field, replace
from math import inf, isfinite, log10, nextafter
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from eomgen.run.integrators.extrapolation import (
    MOST_ROWS,
    SUBSTEPS,
    Slope,
    midpoint,
    next_row,
    norm,
)
from eomgen.run.integrators.gragg_dense import Interpolant, Span
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.problem import FloatArray

if TYPE_CHECKING:
    Solver = OdeSolver[Any]
else:
    Solver = OdeSolver  # which is generic from SciPy 1.17 on

WORK = tuple(1 + sum(SUBSTEPS[: row + 1]) - (row + 1) for row in range(MOST_ROWS))
"""Number of derivatives in a step that ends with this row."""

_HIGHEST = MOST_ROWS - 2
# ODEX's SAFE1, SAFE2, FAC1, FAC2, FAC3, FAC4 and SAFE3.
_ERROR, _STEP, _LEAST, _MOST, _LOWER, _HIGHER, _REFUSED = 0.65, 0.94, 0.02, 4.0, 0.8, 0.9, 0.5

_ASIDE = 1e-6
"""Fraction of a step, beside a corner, at which the derivative is evaluated on one side of it."""


@dataclass
class _Table:
    """The extrapolation table of a step.

    change   change of y over the step by the last row, (ny,)
    error    error of the last row relative to the tolerance; infinite after the first row
    lengths  for each row, the length of a step that would meet the tolerance
    """

    change: FloatArray
    error: float = inf
    lengths: list[float] = field(default_factory=list)

    @property
    def last(self) -> int:
        """Number of the last row."""
        return len(self.lengths) - 1

    def price(self, row: int) -> float:
        """Number of derivatives per second of motion with this row."""
        return WORK[row] / self.lengths[row]


class GraggBulirschStoer(Solver):
    """A SciPy solver of `y' = fun(t, y)` from `t0` to `t_bound`."""

    def __init__(
        self,
        fun: Slope,
        t0: float,
        y0: FloatArray,
        t_bound: float,
        *,
        rtol: float,
        atol: float | FloatArray,
        max_step: float = inf,
    ) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized=False)
        self.rtol, self.atol, self.max_step = rtol, atol, max_step
        self.slope: FloatArray = self.fun(self.t, self.y)
        allowed = atol + rtol * np.abs(self.y)
        size, speed = norm(self.y / allowed), norm(self.slope / allowed)
        unknown = size < 1e-5 or not 1e-5 < speed < inf
        self.length = 1e-6 if unknown else 0.01 * size / speed
        self.target = max(1, min(_HIGHEST, int(0.5 - 0.6 * log10(rtol))))
        self.fresh = True
        self.taken: Span | None = None

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y = float(self.t), self.y
        shortest = 10 * abs(nextafter(t, self.direction * inf) - t)
        left = abs(self.t_bound - t)
        length = min(self.length, self.max_step, left)
        refused, failure = False, None
        while True:
            if length < min(shortest, left):
                if failure:
                    raise failure
                return False, self.TOO_SMALL_STEP
            end = self.t_bound if length == left else t + self.direction * length
            # A step may leave the domain of the derivative; then a shorter one is tried.
            try:
                table = self._tabulate(t, y, end - t, self.fresh or length == left, refused)
                accepted = table.error <= 1
                slope = self.fun(end, y + table.change) if accepted else self.slope
            except (ArithmeticError, ValueError) as error:
                failure, refused, length = error, True, _REFUSED * length
                continue
            if accepted and np.isfinite(slope).all():
                break
            length = _REFUSED * length if accepted else self._shorter(table, length)
            refused = True
        self._choose(table, refused, length)
        self.taken = Span(t, y, end - t, table.change, self.slope, slope)
        self.t, self.y, self.slope, self.fresh = end, y + table.change, slope, False
        return True, None

    def _tabulate(self, t: float, y: FloatArray, step: float, watch: bool, refused: bool) -> _Table:
        """Add rows until the error is small enough, or clearly will not be. With `watch` every row
        may be accepted, else only those from the one before the target.
        """
        table, columns = _Table(y), list[FloatArray]()
        k, worst = self.target, inf
        for row in range(k + 2):
            found = midpoint(self.fun, t, y, step, SUBSTEPS[row], self.slope)
            columns = next_row(columns, found.change, SUBSTEPS[: row + 1])
            table.change = columns[-1]
            if not row:
                table.lengths.append(abs(step))
                continue
            allowed = self.atol + self.rtol * np.maximum(np.abs(y), np.abs(y + table.change))
            error = table.error = norm((columns[-1] - columns[-2]) / allowed)
            table.lengths.append(self._length(row, error, abs(step)))
            if not isfinite(error) or (row > 1 and error >= worst):
                table.error, table.lengths = inf, [_REFUSED * abs(step)] * (row + 1)
                return table
            worst = max(4 * error, 1.0)
            window = row == k - 1 and not refused
            if error <= 1 and (watch or window or row >= k):
                return table
            # The greatest reduction of the error that the next rows can be expected to give.
            if window and not watch and error > (SUBSTEPS[k] * SUBSTEPS[k + 1] / 4) ** 2:
                return table
            if row == k and error > (SUBSTEPS[k + 1] / 2) ** 2:
                return table
        return table

    def _length(self, row: int, error: float, length: float) -> float:
        """The length of a step that meets the tolerance with this row, less a safety factor."""
        root = 1 / (2 * row + 1)
        least = _LEAST**root
        shrink = min(_MOST / least, max(least, (error / _ERROR) ** root / _STEP))
        return float(min(length / shrink, self.max_step))

    def _shorter(self, table: _Table, length: float) -> float:
        """The length of the next attempt after a rejected step; also sets the order."""
        k = min(self.target, table.last, _HIGHEST)
        if k > 1 and table.price(k - 1) < _LOWER * table.price(k):
            k -= 1
        self.target = k
        return min(table.lengths[k], length)

    def _choose(self, table: _Table, refused: bool, length: float) -> None:
        """Set order and length of the next step: those with the least work per second of motion."""
        price, lengths = table.price, table.lengths
        row, k = table.last, self.target
        if row == 1:
            best = 1 if refused else min(2, _HIGHEST)
        elif row <= k:
            best = row
            if price(row - 1) < _LOWER * price(row):
                best = row - 1
            if price(row) < _HIGHER * price(row - 1):
                best = min(row + 1, _HIGHEST)
        else:
            best = row - 1
            if row > 2 and price(row - 2) < _LOWER * price(row - 1):
                best = row - 2
            if price(row) < _HIGHER * price(best):
                best = min(row, _HIGHEST)
        if refused:
            self.target = min(best, row)
            self.length = min(length, lengths[self.target])
            return
        self.target = best
        if best <= row:
            self.length = lengths[best]
        else:
            ahead = row < k and price(row) < _HIGHER * price(row - 1)
            self.length = lengths[row] * WORK[min(best + ahead, MOST_ROWS - 1)] / WORK[row]

    def turn(self) -> None:
        """Account for a corner of the derivative at the end of the last step: take the slope at the
        end of its dense output from before the corner, that of the next step from after it.
        """
        assert self.taken is not None
        step = _ASIDE * self.taken.step
        self.taken = replace(self.taken, after=self._slope_beside(-step))
        self.slope = self._slope_beside(step)

    def _slope_beside(self, step: float) -> FloatArray:
        """The slope here, extrapolated from the slopes one and two small steps away."""
        near, far = (self.fun(self.t + h, self.y + h * self.slope) for h in (step, 2 * step))
        return np.asarray(2 * near - far)

    def _dense_output_impl(self) -> DenseOutput:
        assert self.taken is not None
        return Interpolant(self.taken, self.fun, self.rtol, self.atol)


INTEGRATOR = Adaptive(
    GraggBulirschStoer, memory=("length", "slope", "target", "fresh"), sees_end=False
)
