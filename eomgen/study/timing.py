"""Measuring how long calls take."""

import time
from collections.abc import Callable, Sequence

TIMING = 1.0
"""About how long all rounds of all calls take together, s."""
CHUNK = 5e-4
"""About how long one function is called in one round, s: too short to be interrupted often."""
LEAST_ROUNDS = 7


def least_seconds(calls: Sequence[Callable[[], object]]) -> list[float]:
    """The least time of a call of each function, s; they take turns, so that load affects all."""
    return [least for least, _ in least_and_spread(calls)]


def least_and_spread(calls: Sequence[Callable[[], object]]) -> list[tuple[float, float]]:
    """The same, and the lower quartile of the rounds less the least time, s: a smaller difference
    between two functions means nothing.
    """
    counts = [1 + int(CHUNK / min(_seconds(call, 1) for _ in range(5))) for call in calls]
    times: list[list[float]] = [[] for _ in calls]
    rounds, begin = 0, time.perf_counter()
    while rounds < LEAST_ROUNDS or time.perf_counter() < begin + TIMING:
        for own, call, count in zip(times, calls, counts, strict=True):
            own.append(_seconds(call, count))
        rounds += 1
    return [(min(own), sorted(own)[len(own) // 4] - min(own)) for own in times]


def _seconds(call: Callable[[], object], count: int) -> float:
    begin = time.perf_counter()
    for _ in range(count):
        call()
    return (time.perf_counter() - begin) / count
