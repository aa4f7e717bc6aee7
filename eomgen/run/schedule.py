"""When switching functions of time alone change sign, found by interval arithmetic: none is missed.

An interval of time over which each function keeps one sign holds no change; any other is halved
(Moore, Kearfott, Cloud, Introduction to Interval Analysis, section 8.1).
"""

from collections.abc import Callable, Iterator, Sequence

from eomgen.run.intervals import Interval

Functions = Callable[[Interval], Sequence[Interval]]

MOST_PARTS = 4000
"""Of a step."""
SHORTEST = 1e-12
"""Of a step: what changes back within less than that is nothing."""
AHEAD = 16.0
"""Steps ahead that are looked at together."""


class Schedule:
    """The changes of some functions of time, asked for step by step."""

    def __init__(self, functions: Functions) -> None:
        self._functions = functions
        self._quiet = (0.0, 0.0)

    def changes(self, start: float, end: float) -> tuple[list[float], bool]:
        """The times in a step at which functions change sign, in order, and whether these are all.

        Where a function is 0 at the start itself and not after, it counts as changing there.
        """
        if self._quiet[0] <= start and end <= self._quiet[1]:
            return [], True
        far = end + AHEAD * (end - start)
        if None not in self._signs(start, far):
            self._quiet = (start, far)
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

    def _parts(
        self, start: float, end: float
    ) -> Iterator[tuple[float, float, list[bool | None] | None]]:
        """Parts of a step in order, each with the signs of the functions there, and at last a part
        without them if there are too many.
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

    def _signs(self, low: float, high: float) -> list[bool | None]:
        """Whether each function is > 0 all along a time; None where it may be either."""
        values = self._functions(Interval(low, high))
        return [True if v.low > 0 else False if v.high <= 0 else None for v in values]
