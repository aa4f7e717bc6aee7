"""The chunks of a sweep, run here, in processes of this machine, or by a Dask scheduler."""

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import closing
from itertools import islice
from typing import Protocol

from eomgen.results.design import Design
from eomgen.run.progress import Progress
from eomgen.sweep.cluster import by_dask
from eomgen.sweep.counter import Counter
from eomgen.sweep.members import Arrays, Task
from eomgen.sweep.processes import PAUSE, Job, by_processes
from eomgen.sweep.together import run_chunk

LARGEST_CHUNK, TOGETHER, CHUNKS = 256, 4096, 64
"""Greatest number of members in a chunk that run one by one, or together; and about how many chunks
there are if it is less.
"""
FILLING = 32
"""Least number of members in a chunk that run together: fewer would not fill vector registers."""
MOST_BYTES = 2**26
"""Greatest size of a chunk's results, if it has more than one member."""


class Kept(Protocol):
    """Where results are kept."""

    def has(self, number: int) -> bool:
        """Whether a chunk is there."""
        ...

    def put(self, number: int, arrays: Arrays) -> None:
        """Take a chunk."""
        ...


def chunk_size(members: int, together: bool, bytes_each: int) -> int:
    """Number of members in a chunk; it depends on nothing else, so that a sweep can go on."""
    least, largest = (FILLING, TOGETHER) if together else (1, LARGEST_CHUNK)
    wanted = max(least, min(largest, math.ceil(members / CHUNKS)))
    return max(1, min(wanted, MOST_BYTES // max(1, bytes_each)))


def execute(
    task: Task,
    design: Design,
    kept: Kept,
    size: int,
    *,
    workers: int = 1,
    scheduler: str = "",
    progress: Progress = lambda fraction: None,
) -> None:
    """Run all members in chunks of `size`, or those whose chunks `kept` does not have.

    Raises `RunError` if workers fail, or if the scheduler cannot be reached.
    """
    total = len(design.values)
    jobs = [
        (number, design.values[number * size : (number + 1) * size])
        for number in range(math.ceil(total / size))
        if not kept.has(number)
    ]
    ended = total - sum(len(values) for _, values in jobs)
    sizes = {number: len(values) for number, values in jobs}
    progress(ended / total)

    def running(members: int) -> None:  # that have ended, in chunks that are not done
        progress(min(1.0, (ended + members) / total))

    with closing(_results(task, jobs, workers, scheduler, running)) as results:
        for number, arrays in results:
            kept.put(number, arrays)
            ended += sizes[number]
            running(0)


def _results(
    task: Task,
    jobs: Sequence[Job],
    workers: int,
    scheduler: str,
    running: Callable[[int], None],
) -> Generator[tuple[int, Arrays], None, None]:
    """The chunks as they come."""
    if scheduler:
        yield from by_dask(task, jobs, scheduler)
    elif task.together or (task.threads and workers > 1):
        yield from _by_threads(task, jobs, max(1, min(workers, len(jobs))), running)
    elif workers > 1 and len(jobs) > 1:
        yield from by_processes(task, jobs, min(workers, len(jobs)), running)
    else:
        for number, values in jobs:
            yield number, run_chunk(task, values, _Shown(running))


class _Shown(Counter):
    """A counter that shows each member at once."""

    def __init__(self, show: Callable[[int], None]) -> None:
        super().__init__()
        self._show = show

    def add(self, members: int = 1) -> None:
        super().add(members)
        self._show(self.ended)


def _by_threads(
    task: Task, jobs: Sequence[Job], workers: int, running: Callable[[int], None]
) -> Iterator[tuple[int, Arrays]]:
    """The chunks as they come; compiled code, which runs them, lets other threads go on."""
    left, done, counter = iter(jobs), 0, Counter()
    with ThreadPoolExecutor(workers) as pool:
        futures = {
            pool.submit(run_chunk, task, values, counter): (number, len(values))
            for number, values in islice(left, 2 * workers)
        }
        try:
            while futures:
                ready, _ = wait(futures, PAUSE, FIRST_COMPLETED)
                for future in ready:
                    number, members = futures.pop(future)
                    for following, values in islice(left, 1):
                        added = pool.submit(run_chunk, task, values, counter)
                        futures[added] = following, len(values)
                    done += members
                    yield number, future.result()
                running(max(0, counter.ended - done))
        finally:
            counter.stop()
            for future in futures:
                future.cancel()
