"""The method of Dormand and Prince of order 8 with dense output of order 7, known as DOP853.

Hairer, Norsett, Wanner, Solving ODEs I, sections II.5 and II.6; steps are chosen as in SciPy's
DOP853. The sums over slopes are taken term by term in a fixed order. So a run has the same bits on
every machine on which its derivative has them, and also when C makes its steps: see
`eomgen.native.runs` and `templates/c/runs.c.jinja`, which repeats this arithmetic line by line.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from itertools import cycle
from typing import Any, Literal

import numpy as np

from eomgen.run.integrators import dop853_written_out as written_out
from eomgen.run.integrators.dop853_coefficients import (
    DENSE,
    DENSE_STAGES,
    END,
    ERROR_5,
    NODES,
    ORDER_3,
    STAGES,
    Row,
)
from eomgen.run.integrators.first_length import first_length
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.problem import FloatArray

SUMS: tuple[Row, ...] = (
    *STAGES,
    END,
    ERROR_5,
    {i: END.get(i, 0.0) - ORDER_3.get(i, 0.0) for i in {**END, **ORDER_3}},
    *DENSE_STAGES,
    *DENSE,
)
"""All sums over the slopes of a step, by their factors."""
AT_END, LONG_ERROR, SHORT_ERROR, AT_DENSE, IN_DENSE = 12, 13, 14, 15, 18
"""The numbers of these sums from `END` on, and of the first of `DENSE_STAGES` and of `DENSE`."""
SLOPES = len(NODES)
MATRIX = np.array([[row.get(j, 0.0) for j in range(SLOPES)] for row in SUMS])
"""The factors, (22, 16): one row a sum, one column a slope."""
SAFETY, SMALLEST, GREATEST = 0.9, 0.2, 10.0
"""Factor for the next step's length, and its bounds."""
POWER = -1 / 8
SHORT_WEIGHT = 0.01
"""Weight of the square of the error of order 3."""
TOO_SHORT = "Required step size is less than spacing between numbers."

# The parts of sums to which slope j adds: stage j + 1 and all sums behind it.
_ADDED = tuple(
    np.ascontiguousarray(MATRIX[(j + 1 if j < 12 else j + 3) :, j, None]) for j in range(SLOPES)
)

_TERMS = written_out.terms_of((*SUMS[1:12], *SUMS[AT_END : SHORT_ERROR + 1]))


class DormandPrince8:
    """A solver of y' = fun(t, y) from `t0` on, with the interface of SciPy's.

    Its state consists of `t`, `y`, the length `h_abs` of the next step in s, the slope `f` at t, y,
    and what rounding took from y, `lost`. That is added to the next change, or else the errors of
    these sums would limit the accuracy (Hairer, Lubich, Wanner, Geometric Numerical Integration,
    section VIII.5).
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
        max_step: float = math.inf,
    ) -> None:
        self.fun, self.rtol, self.atol, self.max_step = fun, rtol, atol, max_step
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.status: Literal["running", "finished", "failed"] = "running"
        self.f, self.lost = fun(self.t, y0), np.zeros(len(y0))
        self.h_abs = first_length(
            fun,
            self.t,
            y0,
            self.f,
            scale=atol + np.abs(y0) * rtol,
            power=1 / 8,
            longest=min(t_bound - self.t, max_step),
        )
        self._step = (0.0, y0)
        self._dense: Callable[[FloatArray | float], FloatArray] | None = None

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        t, y = self.t, self.y
        shortest = 10 * abs(math.nextafter(t, math.inf) - t)
        length = max(min(self.h_abs, self.max_step), shortest)
        rejected = False
        while True:
            if length < shortest or math.isnan(length):
                self.status = "failed"
                return TOO_SHORT
            end = min(t + length, self.t_bound)
            h = length = end - t
            change = self._attempt(t, y, h) + self.lost
            last = y + change
            error = self._error(y, last, h)
            if error < 1:
                break
            length *= max(SMALLEST, SAFETY * error**POWER)
            rejected = True
        factor = GREATEST if error == 0 else min(GREATEST, SAFETY * error**POWER)
        self.h_abs = length * (min(1.0, factor) if rejected else factor)
        self._step, self._dense = (h, y), None
        self.t_old, self.t, self.y = t, end, last
        self.f, rest = self.fun(end, last), last - y
        self.lost = (y - (last - rest)) + (change - rest)
        if end >= self.t_bound:
            self.status = "finished"
        return None

    @cached_property
    def _slopes(self) -> FloatArray:
        return np.empty((SLOPES, len(self.y)))

    @cached_property
    def _sums(self) -> FloatArray:
        return np.empty((len(SUMS), len(self.y)))

    @cached_property
    def _parts(self) -> list[tuple[FloatArray, ...]]:
        """For each slope its place, its factors, and the products and sums that it changes."""
        products = np.empty_like(self._sums)
        return [
            (slope, factors, products[-len(factors) :], self._sums[-len(factors) :])
            for slope, factors in zip(self._slopes, _ADDED, strict=True)
        ]

    @cached_property
    def _written(self) -> written_out.Stages | None:
        """The stages written out, for few states."""
        few = 0 < len(self.y) <= written_out.MOST
        return written_out.written_out(len(self.y), _TERMS) if few else None

    def _attempt(self, t: float, y: FloatArray, h: float) -> FloatArray:
        """Compute slopes 0 to 11 of a step and the sums over them; returns the change of y."""
        sums = self._sums
        if self._written:
            later, end, long, short = self._written(self.fun, t, h, y.tolist(), self.f.tolist())
            self._first = [self.f, *later]
            sums[LONG_ERROR], sums[SHORT_ERROR] = long, short
            return np.asarray(h * np.array(end))
        sums.fill(0.0)
        self._add(0, self.f)
        for i in range(1, 12):
            self._add(i, self.fun(t + NODES[i] * h, y + h * sums[i]))
        return np.asarray(h * sums[AT_END])

    def _add(self, j: int, slope: FloatArray) -> None:
        """Take slope j, and add its part to all sums that have one."""
        kept, factors, products, sums = self._parts[j]
        kept[:] = slope
        np.multiply(factors, kept, products)
        np.add(sums, products, sums)

    def _error(self, y: FloatArray, last: FloatArray, h: float) -> float:
        """The error estimate of a step, relative to the tolerance."""
        if not len(y):
            return 0.0
        scale = self.atol + np.maximum(np.abs(y), np.abs(last)) * self.rtol
        both = self._sums[LONG_ERROR : SHORT_ERROR + 1] / scale
        long, short = np.add.accumulate(both * both, axis=1)[:, -1].tolist()
        size = math.sqrt((long + SHORT_WEIGHT * short) * len(y))
        return float(h * long / size) if size else 0.0

    def dense_output(self) -> Callable[[FloatArray | float], FloatArray]:
        """The states within the last step, as a function of times: (m,) -> (ny, m), or one."""
        if self._dense is None:
            self._dense = self._interpolant()
        return self._dense

    def _interpolant(self) -> Callable[[FloatArray | float], FloatArray]:
        h, y = self._step
        start, sums = self.t_old, self._sums
        if self._written:
            sums.fill(0.0)
            for j, slope in enumerate(self._first):
                self._add(j, slope)
        self._add(12, self.f)
        for i in range(13, SLOPES):
            row = AT_DENSE + i - 13
            self._add(i, self.fun(start + NODES[i] * h, y + h * sums[row]))
        change, first = self.y - y, self._slopes[0]
        terms = np.empty((7, len(y)))
        terms[0] = change
        terms[1] = h * first - change
        terms[2] = 2 * change - h * (self.f + first)
        terms[3:] = h * sums[IN_DENSE:]

        return partial(interpolated, start, h, y, list(terms))


def interpolated(
    start: float, h: float, y: FloatArray, terms: Sequence[FloatArray], times: FloatArray | float
) -> FloatArray:
    """The states at times within a step of length h from `y` at `start`, from the terms (ny,) of
    its interpolant.
    """
    one = isinstance(times, float)
    x: Any = (times - start) / h if one else (np.asarray(times)[..., None] - start) / h
    found = np.zeros((len(y),) if one else (*np.shape(times), len(y)))
    for term, factor in zip(reversed(terms), cycle((x, 1 - x)), strict=False):
        found += term
        found *= factor
    return (found + y).T


INTEGRATOR = Adaptive(
    DormandPrince8, memory=("h_abs", "f", "lost"), compiled="dop853", smallest_rtol=1e-16
)
