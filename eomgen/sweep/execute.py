"""The chunks of a sweep, run here, in processes of this machine, or by a Dask scheduler."""

import math
import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from importlib import import_module
from itertools import islice
from multiprocessing.context import BaseContext
from typing import Any, Protocol

import numpy as np

from eomgen.errors import RunError
from eomgen.run.progress import Progress
from eomgen.sweep.counter import SIZE, Counter, StoppedError
from eomgen.sweep.design import Design
from eomgen.sweep.members import Arrays, Task
from eomgen.sweep.together import run_chunk

LARGEST_CHUNK, TOGETHER, CHUNKS = 256, 4096, 64
"""Greatest number of members in a chunk that run one by one, or together; and about how many chunks
there are if it is less.
"""
FILLING = 32
"""Least number of members in a chunk that run together: fewer would not fill vector registers."""
MOST_BYTES = 2**26
"""Greatest size of a chunk's results, if it has more than one member."""
PAUSE = 0.2
"""Time between two looks at how far the members are, s."""

Job = tuple[int, np.ndarray]
"""The number of a chunk, and the values of its members."""


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

    for number, arrays in _results(task, jobs, workers, scheduler, running):
        kept.put(number, arrays)
        ended += sizes[number]
        running(0)


def _results(
    task: Task,
    jobs: Sequence[Job],
    workers: int,
    scheduler: str,
    running: Callable[[int], None],
) -> Iterator[tuple[int, Arrays]]:
    """The chunks as they come."""
    if scheduler:
        yield from _by_dask(task, jobs, scheduler)
    elif task.together or (workers > 1 and len(jobs) > 1):
        yield from _by_workers(task, jobs, max(1, min(workers, len(jobs))), running)
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


def _by_workers(
    task: Task, jobs: Sequence[Job], workers: int, running: Callable[[int], None]
) -> Iterator[tuple[int, Arrays]]:
    left, done = iter(jobs), 0
    pool, counter, run = _pool(task, workers)
    with pool:
        futures = {
            pool.submit(run, task, values): (number, len(values))
            for number, values in islice(left, 2 * workers)
        }
        try:
            while futures:
                ready, _ = wait(futures, PAUSE, FIRST_COMPLETED)
                for future in ready:
                    number, members = futures.pop(future)
                    for following, values in islice(left, 1):
                        futures[pool.submit(run, task, values)] = (following, len(values))
                    done += members
                    yield number, future.result()
                running(max(0, counter.ended - done))
        except BrokenProcessPool:
            raise RunError("a worker process ended unexpectedly, out of memory perhaps") from None
        finally:
            counter.stop()
            for future in futures:
                future.cancel()


Run = Callable[[Task, Any], Arrays]


def _pool(task: Task, workers: int) -> tuple[Executor, Counter, Run]:
    """Threads if compiled code makes the runs, which lets other threads go on; else processes."""
    if task.together:
        counter = Counter()
        return ThreadPoolExecutor(workers), counter, lambda t, values: run_chunk(t, values, counter)
    start = _start()
    memory = start.Array("q", SIZE)
    pool = ProcessPoolExecutor(workers, start, initializer=_begin_worker, initargs=(memory,))
    return pool, Counter(memory.get_obj(), memory.get_lock()), _in_worker


def _start() -> BaseContext:
    """How processes are started: as is usual, but not as copies of one in which JAX runs, whose
    threads would be missing there.
    """
    usual = multiprocessing.get_start_method()
    return multiprocessing.get_context("spawn" if "jax" in sys.modules else usual)


_of_worker = Counter()


def _begin_worker(memory: Any) -> None:
    """Ctrl-C is heard by the main process; a worker would print a traceback."""
    global _of_worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _of_worker = Counter(memory.get_obj(), memory.get_lock())


def _in_worker(task: Task, values: Any) -> Arrays:
    try:
        return run_chunk(task, values, _of_worker)
    except StoppedError:
        return {}


def _by_dask(task: Task, jobs: Sequence[Job], scheduler: str) -> Iterator[tuple[int, Arrays]]:
    """Chunks as tasks. Dask repeats those of a worker that is lost."""
    try:
        distributed: Any = import_module("dask.distributed")
    except ImportError:
        raise RunError("scheduler: needs Dask; run: pip install 'eomgen[dask]'") from None
    try:
        client = distributed.Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise RunError(f"scheduler: {scheduler} cannot be reached: {error}") from None
    with client:
        shared = client.scatter(task, broadcast=True, hash=False)
        futures = {
            client.submit(run_chunk, shared, values, pure=False): number for number, values in jobs
        }
        try:
            for future in distributed.as_completed(list(futures)):
                yield futures[future], future.result()
                future.release()
        finally:
            with suppress(Exception):
                client.cancel(list(futures))
