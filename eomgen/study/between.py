"""The states of a run between its rows, by cubic interpolation, and where a function is 0."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.problem import FloatArray
from eomgen.study.observed import Observed
from eomgen.study.recording import held_rows

Direction = Literal["rising", "falling", "both"]
HALVINGS = 52
"""Halvings of an interval between two rows, to the last bit of its length."""
FEWER = 16.0
"""Factor by which the error falls if the rows are twice as dense: the order of cubics is 4."""


@dataclass(frozen=True, eq=False)
class Between:
    """Cubic Hermite interpolation of rows by their slopes, from the derivative at the rows.

    Where a rigid contact is held, and where a slope is not finite, it is linear: the derivative
    does not know the contact's force. Its error is h⁴/384 times the fourth derivative of the
    motion, where h is the time between two rows.
    """

    t: FloatArray  # (n,) s
    y: FloatArray  # (n, ny)
    slopes: FloatArray  # (n, ny), nan where not known
    quaternions: tuple[tuple[int, ...], ...]

    def __call__(self, times: FloatArray) -> FloatArray:
        """The states (m, ny) at times (m,) within the run; at an impact, those after it."""
        if len(self.t) == 1:
            return np.repeat(self.y, len(times), axis=0)
        k = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        h = (self.t[k + 1] - self.t[k])[:, None]
        s = np.where(h > 0, (times - self.t[k])[:, None] / np.where(h > 0, h, 1.0), 1.0)
        change = self.y[k + 1] - self.y[k]
        start, end = self.slopes[k] * h, self.slopes[k + 1] * h
        bend = (s - 1) * ((1 - 2 * s) * change + (s - 1) * start + s * end)
        y = self.y[k] + s * (change + np.where(np.isfinite(bend), bend, 0.0))
        for four in map(list, self.quaternions):
            y[:, four] /= np.linalg.norm(y[:, four], axis=1, keepdims=True)
        return np.asarray(y)

    def error(self) -> float:
        """The error of the interpolation, relative to the range of each state; the greatest of all.

        It is estimated: every other row is left out and compared with what the others give.
        """
        if len(self.t) < 5:
            return float("nan")
        few = Between(self.t[::2], self.y[::2], self.slopes[::2], self.quaternions)
        inside = slice(1, 2 * (len(few.t) - 1), 2)
        t, y = self.t[inside], self.y[inside]
        # An impact between these rows, which the others do not show, is no error.
        smooth = np.diff(few.t) > 0
        struck = np.isin(t, self.t[1:][np.diff(self.t) == 0])
        off = np.abs(few(t) - y)[smooth & ~struck]
        size = np.ptp(self.y, axis=0)
        return float((off / np.where(size > 0, size, 1.0)).max(initial=0.0)) / FEWER


def between(run: Observed) -> Between:
    """The interpolation of a run."""
    t, y = run.trajectory.t, run.trajectory.y
    try:
        slopes = run.output("derivative", t, y)
    except RunError:
        slopes = np.full_like(y, np.nan)
    slopes = np.where(held_rows(run.trajectory)[:, None], np.nan, slopes)
    return Between(t, y, slopes, tuple(getattr(run.functions, "QUATERNIONS", ())))


def crossings(
    states: Between, value: Callable[[FloatArray, FloatArray], FloatArray], direction: Direction
) -> FloatArray:
    """The times (m,) at which `value` of times (n,) and states (n, ny) passes through 0.

    Between two rows it finds one crossing where the signs at the rows differ, by bisection of the
    interpolated motion; two crossings between the same rows are not seen. Jumps at impacts are not
    counted.
    """
    at = value(states.t, states.y)
    below, above = at[:-1], at[1:]
    rising, falling = (below < 0) & (above >= 0), (below > 0) & (above <= 0)
    chosen = {"rising": rising, "falling": falling, "both": rising | falling}[direction]
    k = np.flatnonzero(chosen & (np.diff(states.t) > 0))
    low, high, sign = states.t[k], states.t[k + 1], np.sign(below[k])
    for _ in range(HALVINGS):
        middle = low + (high - low) / 2
        before = value(middle, states(middle)) * sign > 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.asarray(high)
