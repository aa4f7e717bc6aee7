"""Gragg, Bulirsch, Stoer: the explicit midpoint rule, extrapolated to an order and with a step that
pay best. For tight tolerances, where DOP853 takes ever shorter steps and this a higher order.

Hairer, Norsett, Wanner, Solving ODEs I, section II.9, and their program ODEX, whose control of
order and step this is. Unlike there, rows of the table are not smoothed, and all is reckoned in
changes since the step's start, which rounding hurts less than states.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from math import comb, factorial, inf, isfinite, log10, nextafter, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from eomgen.run.problem import Floats

if TYPE_CHECKING:
    Solver = OdeSolver[Any]
else:
    Solver = OdeSolver  # which is generic from SciPy 1.17 on

Slope = Callable[[float, Floats], Floats]

MOST_ROWS = 10
SUBSTEPS = tuple(2 * row + 2 for row in range(MOST_ROWS))
"""Of each row of the table of a step."""
DENSE_SUBSTEPS = tuple(4 * row + 2 for row in range(MOST_ROWS))
"""Of each row of the table of the dense output; half of them is odd."""
WORK = tuple(1 + sum(SUBSTEPS[: row + 1]) - (row + 1) for row in range(MOST_ROWS))
"""Derivatives of a step that ends with this row."""

_HIGHEST = MOST_ROWS - 2
# ODEX's SAFE1, SAFE2, FAC1, FAC2, FAC3, FAC4 and SAFE3.
_ERROR, _STEP, _LEAST, _MOST, _LOWER, _HIGHER, _REFUSED = 0.65, 0.94, 0.02, 4.0, 0.8, 0.9, 0.5

_LOOKS = np.array([-0.75, -0.5, 0.5, 0.75])
"""Where in a step, from -1 to 1, dense outputs of more and of fewer rows are compared."""
_ASIDE = 1e-6
"""Of a step: so far from a corner the derivative is that of one side of it."""
_SETTLED = 10.0
"""Such a difference, in parts of what is allowed, is the error of the one of fewer."""


@dataclass(frozen=True, eq=False)
class _Row:
    """The explicit midpoint rule over a step: the change of y (ny,) up to the middle and the end,
    and the slopes after each substep but the last, (substeps, ny).
    """

    middle: Floats
    change: Floats
    slopes: Floats


@dataclass
class _Table:
    """The extrapolation of one step, as far as it has come.

    change   of y over the step by the last row, (ny,)
    error    of the last row, in parts of what is allowed; the first has none
    lengths  of step that would have met the tolerance with each row
    """

    change: Floats
    error: float = inf
    lengths: list[float] = field(default_factory=list)

    @property
    def last(self) -> int:
        """Number of the last row."""
        return len(self.lengths) - 1

    def price(self, row: int) -> float:
        """Derivatives per second of motion."""
        return WORK[row] / self.lengths[row]


class GraggBulirschStoer(Solver):
    """A method as SciPy's own are, for `y' = fun(t, y)` from `t0` to `t_bound`."""

    def __init__(
        self,
        fun: Slope,
        t0: float,
        y0: Floats,
        t_bound: float,
        *,
        rtol: float,
        atol: float | Floats,
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
        self.taken: _Span | None = None

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
            # Steps may lead out of where there is a derivative, and shorter ones not yet.
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
        self.taken = _Span(t, y, end - t, table.change, self.slope, slope)
        self.t, self.y, self.slope, self.fresh = end, y + table.change, slope, False
        return True, None

    def _tabulate(self, t: float, y: Floats, step: float, watch: bool, refused: bool) -> _Table:
        """Add rows until the error is met or seen not to be; `watch` is to look at every row."""
        table, columns = _Table(y), list[Floats]()
        k, worst = self.target, inf
        for row in range(k + 2):
            found = _midpoint(self.fun, t, y, step, SUBSTEPS[row], self.slope)
            columns = _next_row(columns, found.change, SUBSTEPS[: row + 1])
            table.change = columns[-1]
            if not row:
                table.lengths.append(abs(step))
                continue
            allowed = self.atol + self.rtol * np.maximum(np.abs(y), np.abs(y + table.change))
            error = table.error = _norm((columns[-1] - columns[-2]) / allowed)
            table.lengths.append(self._length(row, error, abs(step)))
            if not isfinite(error) or (row > 1 and error >= worst):
                table.error, table.lengths = inf, [_REFUSED * abs(step)] * (row + 1)
                return table
            worst = max(4 * error, 1.0)
            window = row == k - 1 and not refused
            if error <= 1 and (watch or window or row >= k):
                return table
            # What the rows ahead can hope to gain.
            if window and not watch and error > (SUBSTEPS[k] * SUBSTEPS[k + 1] / 4) ** 2:
                return table
            if row == k and error > (SUBSTEPS[k + 1] / 2) ** 2:
                return table
        return table

    def _length(self, row: int, error: float, length: float) -> float:
        """Of a step whose error by this row is what is allowed, less a margin."""
        root = 1 / (2 * row + 1)
        least = _LEAST**root
        shrink = min(_MOST / least, max(least, (error / _ERROR) ** root / _STEP))
        return float(min(length / shrink, self.max_step))

    def _shorter(self, table: _Table, length: float) -> float:
        """The length of the step to try after one that was refused, which sets the order, too."""
        k = min(self.target, table.last, _HIGHEST)
        if k > 1 and table.price(k - 1) < _LOWER * table.price(k):
            k -= 1
        self.target = k
        return min(table.lengths[k], length)

    def _choose(self, table: _Table, refused: bool, length: float) -> None:
        """Order and length of the next step: those of the least work a second of motion."""
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
        """Take note that the derivative has a corner at the end of the step just made: the slope
        that its dense output ends with, and that of the next step's start, are taken just aside.
        """
        assert self.taken is not None
        step = _ASIDE * self.taken.step
        self.taken = replace(self.taken, after=self._slope_beside(-step))
        self.slope = self._slope_beside(step)

    def _slope_beside(self, step: float) -> Floats:
        """The slope here, extrapolated from two moments, one and two small steps away."""
        near, far = (self.fun(self.t + h, self.y + h * self.slope) for h in (step, 2 * step))
        return np.asarray(2 * near - far)

    def _dense_output_impl(self) -> DenseOutput:
        assert self.taken is not None
        return _Interpolant(self.taken, self.fun, self.rtol, self.atol)


@dataclass(frozen=True, eq=False)
class _Span:
    """A step, or half of it: from `start` at `t`, the change over it and the slopes at its ends."""

    t: float
    start: Floats
    step: float
    change: Floats
    before: Floats
    after: Floats


class _Interpolant(DenseOutput):
    """The state within a step, as accurate as the step's end: a polynomial for each half of it.

    Each has the values and slopes of both ends and, in the middle, the value and derivatives that
    come of differences of the rows' slopes, extrapolated (Hairer, Norsett, Wanner I, II.9, dense
    output). The rows are made for it, which costs about as many derivatives as the step did.

    At a single time, which is asked where an event is looked for, a step is made from the start to
    there instead: one that goes beyond an event may bend behind it, and its polynomial all along.
    """

    def __init__(self, taken: _Span, fun: Slope, rtol: float, atol: float | Floats) -> None:
        super().__init__(taken.t, taken.t + taken.step)
        self._fun, self._taken = fun, taken
        start, step = taken.start, taken.step / 2
        allowed = atol + rtol * np.maximum(np.abs(start), np.abs(start + taken.change))
        self._allowed = allowed
        rows, columns = list[_Row](), list[Floats]()
        for count in range(1, MOST_ROWS + 1):
            substeps = DENSE_SUBSTEPS[count - 1]
            rows.append(_midpoint(fun, taken.t, start, step, substeps, taken.before))
            columns = _next_row(columns, rows[-1].change, DENSE_SUBSTEPS[:count])
            if count > 1 and _norm((columns[-1] - columns[-2]) / allowed) <= 1:
                break
        change, middle = columns[-1], taken.t + step
        slope = fun(middle, start + change)
        self._halves = (
            _Span(taken.t, start, step, change, taken.before, slope),
            _Span(middle, start + change, step, taken.change - change, slope, taken.after),
        )
        self._coefficients = (
            _settled(fun, self._halves[0], rows, allowed),
            _settled(fun, self._halves[1], [], allowed),
        )

    def _call_impl(self, t: Any) -> Any:
        times = np.asarray(t)
        alone = self._stepped(float(times)) if not times.ndim else None
        if alone is not None:
            return alone
        first, second = (
            half.start + _values(coefficients, 2 * (times - half.t) / half.step - 1)
            for half, coefficients in zip(self._halves, self._coefficients, strict=True)
        )
        late = (times - self._halves[1].t) * self._halves[1].step > 0
        return np.where(late[..., None], second, first).T

    def _stepped(self, t: float) -> Floats | None:
        """The state at t by a step from the start; None if its rows do not agree."""
        taken, columns = self._taken, list[Floats]()
        if t == taken.t:
            return taken.start
        for count in range(1, MOST_ROWS + 1):
            substeps = SUBSTEPS[count - 1]
            row = _midpoint(self._fun, taken.t, taken.start, t - taken.t, substeps, taken.before)
            columns = _next_row(columns, row.change, SUBSTEPS[:count])
            if count > 1 and _norm((columns[-1] - columns[-2]) / self._allowed) <= 1:
                return taken.start + columns[-1]
        return None


def _settled(fun: Slope, half: _Span, rows: list[_Row], allowed: Floats) -> Floats:
    """The polynomial of so many rows that one more would change nothing, or bring rounding only."""
    rows, shrunk = list(rows), inf
    settled: Floats | None = None
    for count in range(max(1, len(rows) - 1), MOST_ROWS + 1):
        if count > len(rows):
            substeps = DENSE_SUBSTEPS[count - 1]
            rows.append(_midpoint(fun, half.t, half.start, half.step, substeps, half.before))
        coefficients = _polynomial(half, rows[:count])
        if settled is not None:
            difference = _values(coefficients, _LOOKS) - _values(settled, _LOOKS)
            change = max(map(_norm, difference / allowed))
            if not change < shrunk:
                break
            shrunk = change
        settled = coefficients
        if shrunk <= _SETTLED:
            break
    assert settled is not None
    return settled


def _values(coefficients: Floats, z: Floats) -> Floats:
    """Of a polynomial with coefficients (n, ny), the lowest first, at z (…); (…, ny)."""
    found = np.zeros((*z.shape, coefficients.shape[1]))
    for coefficient in coefficients[::-1]:
        found = found * z[..., None] + coefficient
    return found


def _norm(x: Floats) -> float:
    return sqrt(float(x @ x) / len(x))


def _midpoint(fun: Slope, t: float, y: Floats, step: float, substeps: int, slope: Floats) -> _Row:
    """Hairer, Norsett, Wanner I, (II.9.13), for the change of y; `slope` is that at the start."""
    h = step / substeps
    slopes = np.empty((substeps, len(y)))
    slopes[0] = slope
    before, change, middle = np.zeros_like(y), h * slope, y
    for i in range(1, substeps):
        if 2 * i == substeps:
            middle = change
        slope = slopes[i] = fun(t + i * h, y + change)
        before, change = change, before + 2 * h * slope
    return _Row(middle, change, slopes)


def _next_row(above: list[Floats], value: Floats, substeps: Sequence[int]) -> list[Floats]:
    """A row of Aitken and Neville's table in the squares of the substeps, from the one above."""
    columns = [value]
    for i, left in enumerate(above):
        ratio = substeps[-1] / substeps[-2 - i]
        columns.append(columns[-1] + (columns[-1] - left) / (ratio * ratio - 1))
    return columns


def _extrapolated(values: Sequence[Floats], substeps: Sequence[int]) -> Floats:
    """What values at these numbers of substeps tend to."""
    columns: list[Floats] = []
    for row, value in enumerate(values, 1):
        columns = _next_row(columns, value, substeps[:row])
    return columns[-1]


def _polynomial(span: _Span, rows: Sequence[_Row]) -> Floats:
    """Coefficients (n, ny), the lowest first, of the change of y over z, from -1 to 1."""
    half = span.step / 2
    middle = _middle(rows, half)
    count = len(middle)
    power = np.arange(count)[:, None]
    sign = (-1.0) ** power
    # What the Taylor polynomial about the middle misses of values and slopes at both ends.
    missing = np.array(
        [
            -(sign * middle).sum(axis=0),
            span.change - middle.sum(axis=0),
            half * span.before + (sign * power * middle).sum(axis=0),
            half * span.after - (power * middle).sum(axis=0),
        ]
    )
    return np.vstack((middle, _ends(count) @ missing))


def _middle(rows: Sequence[_Row], half: float) -> Floats:
    """Value and derivatives by z in the middle, divided by factorials, one after another.

    That of order κ by one row: its slopes' central difference of order κ - 1, two substeps apart.
    """
    substeps = [len(row.slopes) for row in rows]
    found = [_extrapolated([row.middle for row in rows], substeps)]
    for order in range(1, max(2, 2 * len(rows) - 2)):
        first = order // 2  # the first row with so many slopes
        raw = [_difference(row.slopes, order - 1) for row in rows[first:]]
        found.append(half / factorial(order) * _extrapolated(raw, substeps[first:]))
    return np.array(found)


def _difference(slopes: Floats, order: int) -> Floats:
    """The derivative by z of this order in the middle."""
    middle = len(slopes) // 2
    weights = [(-1.0) ** (order - i) * comb(order, i) for i in range(order + 1)]
    return np.asarray(
        (len(slopes) / 4) ** order * (weights @ slopes[middle - order : middle + order + 1 : 2])
    )


@cache
def _ends(count: int) -> Floats:
    """From values and slopes at z = -1 and 1 to the coefficients of the next four powers."""
    power = np.arange(count, count + 4)
    sign = (-1.0) ** power
    return np.linalg.inv(np.array([sign, np.ones(4), -sign * power, power]))
