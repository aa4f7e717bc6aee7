"""The times at which switching functions of time alone change sign, all found by interval
arithmetic.

An interval of time in which each function has one sign contains no change; any other is bisected
(Moore, Kearfott, Cloud, Introduction to Interval Analysis, section 8.1), down to neighbouring
doubles where the first change is wanted exactly.
"""

import math
from collections.abc import Callable, Iterator, Sequence

from eomgen.run.intervals import Interval

Functions = Callable[[Interval], Sequence[Interval]]

MOST_PARTS = 4000
"""Greatest number of intervals in a step."""
SHORTEST = 1e-12
"""Fraction of a step below which intervals are not bisected; shorter pulses are ignored."""
AHEAD = 16.0
"""Number of steps ahead that are first checked together."""
FARTHER = 4.0
"""Ratio of the numbers of steps ahead that are tried before that, where many are to be made."""


class Schedule:
    """The sign changes of functions of time, step by step."""

    def __init__(self, functions: Functions) -> None:
        self._functions = functions
        self._no_change = (0.0, 0.0)
        self._unknown = math.inf

    def first(self, start: float, end: float) -> tuple[float, float] | None:
        """The last time before the first change in `start` to `end`, and the double after it, at
        which the signs are those after the change. None if there is no change, or none can be told
        apart with `MOST_PARTS` intervals; then `changes` may find some in a step.
        """
        known = self._no_change[0] <= start and end <= self._no_change[1]
        if known or start >= self._unknown:
            return None
        waiting = [(start, end)]
        for _ in range(MOST_PARTS):
            if not waiting:
                self._no_change = (start, end)
                return None
            low, high = waiting.pop()
            if None not in self._signs(low, high):
                continue
            middle = low + (high - low) / 2
            if low < middle < high:
                waiting += [(middle, high), (low, middle)]
            elif self._signs_at(low) != self._signs_at(high):
                self._no_change = (start, low)
                return low, high
        self._unknown = start
        return None

    def changes(self, start: float, end: float) -> tuple[list[float], bool]:
        """The times in a step at which functions change sign, in order, and whether these are all.

        A function that is 0 at the start and not after it changes sign there.
        """
        if self._no_change[0] <= start and end <= self._no_change[1]:
            return [], True
        far = end + AHEAD * (end - start)
        if None not in self._signs(start, far):
            self._no_change = (start, far)
            return [], True
        found, signs, since = list[float](), None, start
        for low, high, those in self._parts(start, end):
            if those is None:
                return found, False
            if None in those:
                continue
            if those != signs and (signs is not None or low > start):
                found.append((since + low) / 2)
            signs, since = those, high
        return found, True

    def clear(self, start: float, length: float, most: int) -> float:
        """A time up to which no function changes sign after `start`, s: up to `most` steps of this
        length ahead. `start` if none is found.
        """
        known = self._no_change[1] if self._no_change[0] <= start else start
        ahead = float(most)
        while ahead >= AHEAD:
            far = start + ahead * length
            if far <= known:
                break
            if None not in self._signs(start, far):
                self._no_change = (start, far)
                return far
            ahead /= FARTHER
        return max(start, known)

    def _parts(
        self, start: float, end: float
    ) -> Iterator[tuple[float, float, list[bool | None] | None]]:
        """Intervals of a step in order, each with the signs of the functions there; None for signs
        in the last one if there are too many intervals.
        """
        shortest = SHORTEST * (end - start)
        waiting = [(start, end)]
        for _ in range(MOST_PARTS):
            if not waiting:
                return
            low, high = waiting.pop()
            signs = self._signs(low, high)
            middle = (low + high) / 2
            if None in signs and high - low > shortest and low < middle < high:
                waiting += [(middle, high), (low, middle)]
            else:
                yield low, high, signs
        if waiting:
            yield *waiting[-1], None

    def _signs_at(self, t: float) -> list[bool]:
        """Whether each function is > 0 at a time."""
        return [v.low + v.high > 0 for v in self._functions(Interval(t, t))]

    def _signs(self, low: float, high: float) -> list[bool | None]:
        """Whether each function is > 0 in an interval; None if it may have both signs."""
        values = self._functions(Interval(low, high))
        return [True if v.low > 0 else False if v.high <= 0 else None for v in values]
