"""The chunks of a sweep, run here, in processes of this machine, or by a Dask scheduler."""

import math
import signal
from collections.abc import Iterator, Sequence
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
from typing import Any

import numpy as np

from eomgen.errors import RunError
from eomgen.run.progress import Progress
from eomgen.sweep.design import Design
from eomgen.sweep.members import Arrays, Task
from eomgen.sweep.storage import Storage
from eomgen.sweep.together import run_chunk

LARGEST_CHUNK, TOGETHER, CHUNKS = 256, 4096, 64
"""Greatest number of members in a chunk that run one by one, or together; and about how many chunks
there are if it is less.
"""

Job = tuple[int, np.ndarray]
"""The number of a chunk, and the values of its members."""


def chunk_size(members: int, together: bool) -> int:
    """Number of members in a chunk; it depends on nothing else, so that a sweep can go on."""
    largest = TOGETHER if together else LARGEST_CHUNK
    return max(1, min(largest, math.ceil(members / CHUNKS)))


def execute(
    task: Task,
    design: Design,
    storage: Storage | None,
    *,
    workers: int = 1,
    scheduler: str = "",
    progress: Progress = lambda fraction: None,
) -> Arrays:
    """Run all members, or those whose chunks `storage` does not have; return their arrays in order.

    Raises `RunError` if workers fail, or if the scheduler cannot be reached.
    """
    size = chunk_size(len(design.values), bool(task.vectors))
    count = math.ceil(len(design.values) / size)
    chunks: dict[int, Arrays] = {}
    if storage:
        chunks = {k: kept for k in range(count) if (kept := storage.get(k)) is not None}
    jobs = [(k, design.values[k * size : (k + 1) * size]) for k in range(count) if k not in chunks]
    progress(len(chunks) / count)
    for number, arrays in _results(task, jobs, workers, scheduler):
        if storage:
            storage.put(number, arrays)
        chunks[number] = arrays
        progress(len(chunks) / count)
    return {name: np.concatenate([chunks[k][name] for k in range(count)]) for name in chunks[0]}


def _results(
    task: Task, jobs: Sequence[Job], workers: int, scheduler: str
) -> Iterator[tuple[int, Arrays]]:
    """The chunks as they come."""
    if scheduler:
        yield from _by_dask(task, jobs, scheduler)
    elif workers > 1 and len(jobs) > 1:
        yield from _by_workers(task, jobs, min(workers, len(jobs)))
    else:
        for number, values in jobs:
            yield number, run_chunk(task, values)


def _by_workers(task: Task, jobs: Sequence[Job], workers: int) -> Iterator[tuple[int, Arrays]]:
    left = iter(jobs)
    with _pool(task, workers) as pool:
        running = {
            pool.submit(run_chunk, task, values): number
            for number, values in islice(left, 2 * workers)
        }
        try:
            while running:
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    number = running.pop(future)
                    for following, values in islice(left, 1):
                        running[pool.submit(run_chunk, task, values)] = following
                    yield number, future.result()
        except BrokenProcessPool:
            raise RunError("a worker process ended unexpectedly, out of memory perhaps") from None
        finally:
            for future in running:
                future.cancel()


def _pool(task: Task, workers: int) -> Executor:
    """Threads if compiled code makes the runs, which lets other threads go on; else processes."""
    if task.vectors:
        return ThreadPoolExecutor(workers)
    # Ctrl-C is heard here; a worker would print a traceback.
    deaf = (signal.SIGINT, signal.SIG_IGN)
    return ProcessPoolExecutor(workers, initializer=signal.signal, initargs=deaf)


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
