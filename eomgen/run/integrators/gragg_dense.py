"""Dense output of the method of Gragg, Bulirsch and Stoer (Hairer, Norsett, Wanner I, II.9)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import comb, factorial, inf
from typing import Any

import numpy as np
from scipy.integrate import DenseOutput

from eomgen.run.integrators.extrapolation import (
    MOST_ROWS,
    SUBSTEPS,
    Row,
    Slope,
    extrapolated,
    midpoint,
    next_row,
    norm,
)
from eomgen.run.problem import FloatArray

DENSE_SUBSTEPS = tuple(4 * row + 2 for row in range(MOST_ROWS))
"""Number of substeps for each row of the table of the dense output; half of each is odd."""
_COMPARED_AT = np.array([-0.75, -0.5, 0.5, 0.75])
"""Points of a step, from -1 to 1, at which polynomials of different numbers of rows are compared.
"""
_CONVERGED = 10.0
"""The polynomials have converged if they differ by less than this times the tolerance."""


@dataclass(frozen=True, eq=False)
class Span:
    """A step or half a step from `start` at `t`: the change of y and the slopes at both ends."""

    t: float
    start: FloatArray
    step: float
    change: FloatArray
    before: FloatArray
    after: FloatArray


class Interpolant(DenseOutput):
    """The state within a step, as accurate as at its end: a polynomial for each half of the step.

    Each polynomial matches the values and slopes at both ends of its half and, in the middle, the
    value and derivatives extrapolated from differences of the slopes (Hairer, Norsett, Wanner I,
    II.9, dense output). This takes about as many derivatives as the step itself.

    For a single time, as in a search for an event, a step from the start to that time is made
    instead: the derivative may change at the event, which would distort the whole polynomial.
    """

    def __init__(self, taken: Span, fun: Slope, rtol: float, atol: float | FloatArray) -> None:
        super().__init__(taken.t, taken.t + taken.step)
        self._fun, self._taken = fun, taken
        start, step = taken.start, taken.step / 2
        allowed = atol + rtol * np.maximum(np.abs(start), np.abs(start + taken.change))
        self._allowed = allowed
        rows, columns = list[Row](), list[FloatArray]()
        for count in range(1, MOST_ROWS + 1):
            substeps = DENSE_SUBSTEPS[count - 1]
            rows.append(midpoint(fun, taken.t, start, step, substeps, taken.before))
            columns = next_row(columns, rows[-1].change, DENSE_SUBSTEPS[:count])
            if count > 1 and norm((columns[-1] - columns[-2]) / allowed) <= 1:
                break
        change, middle = columns[-1], taken.t + step
        slope = fun(middle, start + change)
        self._halves = (
            Span(taken.t, start, step, change, taken.before, slope),
            Span(middle, start + change, step, taken.change - change, slope, taken.after),
        )
        self._coefficients = (
            _converged(fun, self._halves[0], rows, allowed),
            _converged(fun, self._halves[1], [], allowed),
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

    def _stepped(self, t: float) -> FloatArray | None:
        """The state at t by a step from the start; None if the extrapolation does not converge."""
        taken, columns = self._taken, list[FloatArray]()
        if t == taken.t:
            return taken.start
        for count in range(1, MOST_ROWS + 1):
            substeps = SUBSTEPS[count - 1]
            row = midpoint(self._fun, taken.t, taken.start, t - taken.t, substeps, taken.before)
            columns = next_row(columns, row.change, SUBSTEPS[:count])
            if count > 1 and norm((columns[-1] - columns[-2]) / self._allowed) <= 1:
                return taken.start + columns[-1]
        return None


def _converged(fun: Slope, half: Span, rows: list[Row], allowed: FloatArray) -> FloatArray:
    """Coefficients of the polynomial, with rows added until it converges or its change no longer
    falls.
    """
    rows, smallest = list(rows), inf
    accepted: FloatArray | None = None
    for count in range(max(1, len(rows) - 1), MOST_ROWS + 1):
        if count > len(rows):
            substeps = DENSE_SUBSTEPS[count - 1]
            rows.append(midpoint(fun, half.t, half.start, half.step, substeps, half.before))
        coefficients = _polynomial(half, rows[:count])
        if accepted is not None:
            difference = _values(coefficients, _COMPARED_AT) - _values(accepted, _COMPARED_AT)
            change = max(map(norm, difference / allowed))
            if not change < smallest:
                break
            smallest = change
        accepted = coefficients
        if smallest <= _CONVERGED:
            break
    assert accepted is not None
    return accepted


def _values(coefficients: FloatArray, z: FloatArray) -> FloatArray:
    """The values (…, ny) at z (…) of a polynomial with coefficients (n, ny), the lowest first."""
    found = np.zeros((*z.shape, coefficients.shape[1]))
    for coefficient in coefficients[::-1]:
        found = found * z[..., None] + coefficient
    return found


def _polynomial(span: Span, rows: Sequence[Row]) -> FloatArray:
    """Coefficients (n, ny), the lowest first, of the change of y over z, from -1 to 1."""
    half = span.step / 2
    middle = _middle(rows, half)
    count = len(middle)
    power = np.arange(count)[:, None]
    sign = (-1.0) ** power
    # The residuals of the Taylor polynomial about the middle in values and slopes at both ends.
    missing = np.array(
        [
            -(sign * middle).sum(axis=0),
            span.change - middle.sum(axis=0),
            half * span.before + (sign * power * middle).sum(axis=0),
            half * span.after - (power * middle).sum(axis=0),
        ]
    )
    return np.vstack((middle, _ends(count) @ missing))


def _middle(rows: Sequence[Row], half: float) -> FloatArray:
    """Taylor coefficients in z at the middle of the step, (n, ny).

    Each row estimates the derivative of order κ by the central difference of order κ - 1 of its
    slopes, two substeps apart; the estimates are extrapolated.
    """
    substeps = [len(row.slopes) for row in rows]
    found = [extrapolated([row.middle for row in rows], substeps)]
    for order in range(1, max(2, 2 * len(rows) - 2)):
        first = order // 2  # the first row with enough slopes
        raw = [_difference(row.slopes, order - 1) for row in rows[first:]]
        found.append(half / factorial(order) * extrapolated(raw, substeps[first:]))
    return np.array(found)


def _difference(slopes: FloatArray, order: int) -> FloatArray:
    """The derivative of the slopes with respect to z, of the given order, in the middle."""
    middle = len(slopes) // 2
    weights = [(-1.0) ** (order - i) * comb(order, i) for i in range(order + 1)]
    return np.asarray(
        (len(slopes) / 4) ** order * (weights @ slopes[middle - order : middle + order + 1 : 2])
    )


@cache
def _ends(count: int) -> FloatArray:
    """The matrix (4, 4) from values and slopes at z = -1 and 1 to the coefficients of the next four
    powers.
    """
    power = np.arange(count, count + 4)
    sign = (-1.0) ** power
    return np.linalg.inv(np.array([sign, np.ones(4), -sign * power, power]))
