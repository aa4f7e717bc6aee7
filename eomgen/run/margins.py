"""Margins: how far the constraints of a mechanism are from being singular, and their least ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SINGULAR, NEAR = 1e-9, 0.05
"""A margin that counts as 0; and one below which the least margin is searched between steps."""
NEAR_SOLVED = 1e-7
"""A margin that counts as 0 in closed form, which turns back on the same branch at a dead point."""


def rank_margin(matrix: NDArray[np.float64]) -> float:
    """How far the rows (nc, nv) are from following from each other: the least singular value, in
    parts of the largest. For those of constraints it is about the distance from a change point.
    """
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0]) if values[0] else 0.0


@dataclass
class Seen:
    """The least margins of a run: `here` at the last time t, and `before` at `start`, the time
    before it; -inf if there is none.
    """

    start: float = 0.0
    t: float = 0.0
    before: float = float("-inf")
    here: float = float("inf")

    def begin(self, t: float, margin: float) -> None:
        """Begin with a state at t that ends no step."""
        self.start = self.t = t
        self.before, self.here = float("-inf"), margin

    def add(self, t: float, margin: float) -> None:
        """Take account of the end of a step."""
        self.start, self.t, self.before, self.here = self.t, t, self.here, margin

    def nears(self, now: float) -> bool:
        """Whether a step ends with a margin that has fallen, and may come to 0 in the next step."""
        return now < self.here and (now < NEAR or now < self.here - now)

    def turns(self, t: float, now: float) -> bool:
        """Whether with a step to t the margins have passed a small minimum, and may be 0 in one of
        the last two steps.
        """
        before, here = self.before, self.here
        if not (here < before and here < now and here < NEAR):
            return False
        return not stays_away(here, (self.start, self.t, t), (before, here, now))


def stays_away(least: float, times: Sequence[float], margins: Sequence[float]) -> bool:
    """Whether a margin with these values at ascending times, the least of them `least`, cannot come
    to 0 between them: it would have to change more than twice as fast as it does from one to the
    next. Where it comes to 0, it does so with a slope, on both sides.
    """
    steepest = 0.0
    for i in range(1, len(times)):
        if not times[i - 1] < times[i]:
            return False
        steepest = max(steepest, abs(margins[i] - margins[i - 1]) / (times[i] - times[i - 1]))
    return least > 2 * steepest * (times[-1] - times[0])
