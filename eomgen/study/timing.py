"""How long calls take."""

import time
from collections.abc import Callable, Sequence

TIMING = 1.0
"""About how long all calls that are timed take together, s."""
CHUNK = 5e-4
"""About how long those of one function in one round take, s: too short to be interrupted often."""
LEAST_ROUNDS = 7


def least_seconds(calls: Sequence[Callable[[], object]]) -> list[float]:
    """The least time of a call of each, s, all in turn: a busy machine is busy for all."""
    return [least for least, _ in least_and_spread(calls)]


def least_and_spread(calls: Sequence[Callable[[], object]]) -> list[tuple[float, float]]:
    """The same, and how far above it, s, a quarter of the rounds stay: what is to be thought of a
    difference that is no larger.
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
