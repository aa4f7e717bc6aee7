"""How long calls take."""

import time
from collections.abc import Callable, Sequence
from math import inf

TIMING = 1.0
"""About how long all calls that are timed take together, s."""
CHUNK = 5e-4
"""About how long those of one function in one round take, s: too short to be interrupted often."""
LEAST_ROUNDS = 7


def least_seconds(calls: Sequence[Callable[[], object]]) -> list[float]:
    """The least time of a call of each, s, all in turn: a busy machine is busy for all."""
    counts = [1 + int(CHUNK / min(_seconds(call, 1) for _ in range(5))) for call in calls]
    least, rounds, begin = [inf] * len(calls), 0, time.perf_counter()
    while rounds < LEAST_ROUNDS or time.perf_counter() < begin + TIMING:
        for k, (call, count) in enumerate(zip(calls, counts, strict=True)):
            least[k] = min(least[k], _seconds(call, count))
        rounds += 1
    return least


def _seconds(call: Callable[[], object], count: int) -> float:
    begin = time.perf_counter()
    for _ in range(count):
        call()
    return (time.perf_counter() - begin) / count
