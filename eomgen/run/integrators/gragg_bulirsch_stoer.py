"""Gragg, Bulirsch, Stoer: the explicit midpoint rule, extrapolated to an order and with a step that
pay best. For tight tolerances, where DOP853 takes ever shorter steps and this a higher order.

Hairer, Norsett, Wanner, Solving ODEs I, section II.9, and their program ODEX, whose control of
order and step this is. Unlike there, rows of the table are not smoothed, and all is reckoned in
changes since the step's start, which rounding hurts less than states.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from math import comb, factorial, inf, isfinite, log10, nextafter, sqrt
from typing import Any

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from eomgen.run.problem import Floats

MOST_ROWS = 10
SUBSTEPS = tuple(4 * row + 2 for row in range(MOST_ROWS))
"""Of each row; half of them is odd, as the dense output needs."""
WORK = tuple(1 + sum(SUBSTEPS[: row + 1]) - (row + 1) for row in range(MOST_ROWS))
"""Derivatives of a step that ends with this row."""

_HIGHEST = MOST_ROWS - 2
# ODEX's SAFE1, SAFE2, FAC1, FAC2, FAC3, FAC4 and SAFE3.
_ERROR, _STEP, _LEAST, _MOST, _LOWER, _HIGHER, _REFUSED = 0.65, 0.94, 0.02, 4.0, 0.8, 0.9, 0.5


@dataclass
class _Table:
    """The extrapolation of one step, as far as it has come.

    change   of y over the step by the last row, (ny,)
    slopes   of each row at its substeps, without its end, (substeps, ny)
    middles  change of y up to the middle, by each row
    errors   of each row, in parts of what is allowed; the first has none
    lengths  of step that would have met the tolerance with each row
    """

    change: Floats
    slopes: list[Floats] = field(default_factory=list)
    middles: list[Floats] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    accepted: bool = False

    def price(self, row: int) -> float:
        """Derivatives per second of motion."""
        return WORK[row] / self.lengths[row]


class GraggBulirschStoer(OdeSolver[Any]):
    """A method as SciPy's own are, for `y' = fun(t, y)` from `t0` to `t_bound`."""

    def __init__(
        self,
        fun: Callable[[float, Floats], Floats],
        t0: float,
        y0: Floats,
        t_bound: float,
        *,
        rtol: float,
        atol: float,
        max_step: float = inf,
    ) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized=False)
        self.rtol, self.atol, self.max_step = rtol, atol, max_step
        self.slope: Floats = self.fun(self.t, self.y)
        allowed = atol + rtol * np.abs(self.y)
        size, speed = _norm(self.y / allowed), _norm(self.slope / allowed)
        unknown = size < 1e-5 or not 1e-5 < speed < inf
        self.length = 1e-6 if unknown else 0.01 * size / speed
        self.target = max(1, min(_HIGHEST, int(0.5 - 0.6 * log10(rtol))))
        self.fresh = True
        self.y_old: Floats = self.y
        self.last: tuple[_Table, Floats] | None = None

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y = float(self.t), self.y
        shortest = 10 * abs(nextafter(t, self.direction * inf) - t)
        length = min(self.length, self.max_step, abs(self.t_bound - t))
        refused, failure = False, None
        while True:
            if length < shortest and length < abs(self.t_bound - t):
                if failure:
                    raise failure
                return False, self.TOO_SMALL_STEP
            last = length >= abs(self.t_bound - t)
            end = self.t_bound if last else t + self.direction * length
            # Steps may lead out of where there is a derivative, and shorter ones not yet.
            try:
                table = self._tabulate(t, y, end - t, self.fresh or last, refused)
                slope = self.fun(end, y + table.change) if table.accepted else self.slope
            except (ArithmeticError, ValueError) as error:
                failure, refused, length = error, True, _REFUSED * length
                continue
            if table.accepted and np.isfinite(slope).all():
                break
            length = length * _REFUSED if table.accepted else self._shorter(table, length)
            refused = True
        self._choose(table, refused, length)
        self.last = table, self.slope
        self.y_old, self.slope, self.fresh = y, slope, False
        self.t, self.y = end, y + table.change
        return True, None

    def _tabulate(self, t: float, y: Floats, step: float, watch: bool, refused: bool) -> _Table:
        """Add rows until the error is met or seen not to be; `watch` is to look at every row."""
        table, columns = _Table(y), list[Floats]()
        k, worst = self.target, inf
        size = np.abs(y)
        for row in range(min(k + 1, MOST_ROWS - 1) + 1):
            change = self._midpoint(t, y, step, row, table)
            columns = _next_row(columns, change, row)
            table.change = change = columns[-1]
            if not row:
                table.errors.append(inf)
                table.lengths.append(abs(step))
                continue
            allowed = self.atol + self.rtol * np.maximum(size, np.abs(y + change))
            error = _norm((change - columns[-2]) / allowed)
            table.errors.append(error)
            table.lengths.append(self._length(row, error, abs(step)))
            if not isfinite(error) or (row > 1 and error >= worst):
                table.lengths = [_REFUSED * abs(step)] * (row + 1)
                return table
            worst = max(4 * error, 1.0)
            if error <= 1 and (watch or row >= k or (row == k - 1 and not refused)):
                table.accepted = True
                return table
            if row == k - 1 and not watch and not refused:
                hopeless = (SUBSTEPS[k] * SUBSTEPS[k + 1] / 4) ** 2
            elif row == k:
                hopeless = (SUBSTEPS[k + 1] / 2) ** 2
            else:
                hopeless = inf
            if error > hopeless:
                return table
        return table

    def _midpoint(self, t: float, y: Floats, step: float, row: int, table: _Table) -> Floats:
        """The change of y by the explicit midpoint rule (II.9.13), noting what dense output needs."""
        substeps = SUBSTEPS[row]
        h = step / substeps
        slopes = np.empty((substeps, len(y)))
        slopes[0] = self.slope
        before, change = np.zeros_like(y), h * self.slope
        h2 = 2 * h
        for i in range(1, substeps):
            if 2 * i == substeps:
                table.middles.append(change)
            slope = self.fun(t + i * h, y + change)
            slopes[i] = slope
            before, change = change, before + h2 * slope
        table.slopes.append(slopes)
        return change

    def _length(self, row: int, error: float, length: float) -> float:
        """Of a step whose error by this row is what is allowed, less a margin."""
        root = 1 / (2 * row + 1)
        least = _LEAST**root
        return min(
            length / min(_MOST / least, max(least, (error / _ERROR) ** root / _STEP)), self.max_step
        )

    def _shorter(self, table: _Table, length: float) -> float:
        """The length of the step to try after one that was refused, which sets the order, too."""
        k = min(self.target, len(table.errors) - 1, _HIGHEST)
        if k > 1 and table.price(k - 1) < _LOWER * table.price(k):
            k -= 1
        self.target = k
        return min(table.lengths[k], length)

    def _choose(self, table: _Table, refused: bool, length: float) -> None:
        """Order and length of the next step: those of the least work a second of motion."""
        price, lengths = table.price, table.lengths
        row, k = len(table.errors) - 1, self.target
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

    def _dense_output_impl(self) -> DenseOutput:
        assert self.last is not None
        return _Interpolant(float(self.t_old), float(self.t), self.y_old, *self.last, self.slope)


class _Interpolant(DenseOutput):
    """The polynomial that has the values and slopes of a step's ends and, in its middle, value and
    derivatives that come of differences of the rows' slopes, extrapolated: II.9, dense output, of
    the order of the step itself but for one.
    """

    def __init__(
        self, t_old: float, t: float, y_old: Floats, table: _Table, before: Floats, after: Floats
    ) -> None:
        super().__init__(t_old, t)
        self._step, self._start = t - t_old, y_old
        half = self._step / 2
        self._coefficients = _polynomial(table, half, half * before, half * after)

    def _call_impl(self, t: Any) -> Any:
        z = 2 * (np.asarray(t)[..., None] - self.t_old) / self._step - 1
        change = np.zeros_like(self._start)
        for coefficient in self._coefficients[::-1]:
            change = change * z + coefficient
        return (self._start + change).T


def _norm(x: Floats) -> float:
    return sqrt(float(x @ x) / len(x))


def _polynomial(table: _Table, half: float, before: Floats, after: Floats) -> Floats:
    """Coefficients of the change of y over z, from -1 at the start to 1 at the end of a step, the
    lowest first; `before` and `after` are the slopes by z there, `half` is half the step, s.
    """
    middle = _middle(table, half)
    count = len(middle)
    power = np.arange(count)[:, None]
    sign = (-1.0) ** power
    # What the Taylor polynomial about the middle misses of values and slopes at both ends.
    missing = np.array(
        [
            -(sign * middle).sum(axis=0),
            table.change - middle.sum(axis=0),
            before + (sign * power * middle).sum(axis=0),
            after - (power * middle).sum(axis=0),
        ]
    )
    return np.vstack((middle, _ends(count) @ missing))


def _middle(table: _Table, half: float) -> Floats:
    """Value and derivatives by z in the middle, divided by factorials, one after another.

    Of order κ, of each row: its slopes' central difference of order κ - 1 over two substeps each.
    """
    found = [_extrapolated(table.middles, 0)]
    for order in range(1, max(2, 2 * len(table.slopes) - 2)):
        first = order // 2  # the first row with so many slopes
        raw = []
        for slopes in table.slopes[first:]:
            at, weights = _difference(len(slopes), order - 1)
            raw.append(weights @ slopes[at])
        found.append(half / factorial(order) * _extrapolated(raw, first))
    return np.array(found)


@cache
def _difference(substeps: int, order: int) -> tuple[slice, Floats]:
    """Which slopes, and their weights, give the derivative by z of this order in the middle."""
    middle = substeps // 2
    weights = [(-1) ** (order - i) * comb(order, i) for i in range(order + 1)]
    return (
        slice(middle - order, middle + order + 1, 2),
        np.array(weights) * (substeps / 4) ** order,
    )


def _extrapolated(values: list[Floats], first: int) -> Floats:
    """What rows from `first` on tend to as their substeps tend to 0, by Aitken and Neville."""
    column: list[Floats] = []
    for row, value in enumerate(values, first):
        column = _next_row(column, value, row)
    return column[-1]


def _next_row(above: list[Floats], value: Floats, row: int) -> list[Floats]:
    """A row of the extrapolation table from the one above it, in the squares of the substeps."""
    columns = [value]
    for i, left in enumerate(above):
        ratio = SUBSTEPS[row] / SUBSTEPS[row - 1 - i]
        columns.append(columns[-1] + (columns[-1] - left) / (ratio * ratio - 1))
    return columns


@cache
def _ends(count: int) -> Floats:
    """From values and slopes at z = -1 and 1 to the coefficients of the next four powers."""
    power = np.arange(count, count + 4)
    sign = (-1.0) ** power
    return np.linalg.inv(np.array([sign, np.ones(4), -sign * power, power]))
