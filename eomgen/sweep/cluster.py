"""The chunks of a sweep as tasks of a Dask scheduler."""

import logging
import pickle
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from itertools import islice
from typing import Any

import numpy as np

from eomgen.base.errors import RunError
from eomgen.base.text import one_line
from eomgen.store import this_program
from eomgen.sweep.members import Arrays, Task
from eomgen.sweep.processes import Job
from eomgen.sweep.together import run_chunk

CONNECTING, ALONE = 10.0, 30.0
"""Longest times until a scheduler answers, and without a worker, s."""
LOOK = 2.0
"""Time between two looks at the workers, s."""
AHEAD, LEAST_AHEAD = 4, 256
"""Chunks that wait on the cluster: so many for each thread, and at least."""
GOES_ON = "with a folder, the same sweep goes on"


def by_dask(task: Task, jobs: Sequence[Job], scheduler: str) -> Iterator[tuple[int, Arrays]]:
    """The chunks as they come. Dask repeats those of a worker that is lost.

    Raises `RunError` if the scheduler cannot be reached, if there is no worker for `ALONE` seconds,
    or one that lacks this program or has another version of it.
    """
    try:
        distributed: Any = import_module("dask.distributed")
    except ImportError:
        raise RunError("scheduler: needs Dask; run: pip install 'eomgen[dask]'") from None
    left, futures = iter(jobs), dict[Any, int]()
    with _quiet(), _client(distributed, scheduler) as client:
        # Made by a task, so that it is made again if the workers that have it are lost.
        sent = client.submit(bytes, pickle.dumps(task), pure=False)
        alone_since = None
        try:
            while True:
                threads = sum(client.nthreads().values())
                if threads:
                    alone_since = None
                alone_since = alone_since or (None if threads else time.monotonic())
                if alone_since and time.monotonic() - alone_since > ALONE:
                    raise RunError(f"scheduler: {scheduler} has no worker; start one; {GOES_ON}")
                room = max(LEAST_AHEAD, AHEAD * threads) - len(futures)
                for number, values in islice(left, room):
                    call = pickle.dumps(_Call(task.by, values), 5, buffer_callback=lambda _: None)
                    made = client.submit(pickle.loads, call, buffers=[sent], pure=False)
                    futures[made] = number
                if not futures:
                    return
                for future in _done(distributed, futures):
                    try:
                        arrays = _result(distributed, future)
                    except TimeoutError:  # its worker was lost with it: it is made again
                        break
                    yield futures.pop(future), arrays
                    future.release()
        except (OSError, distributed.CancelledError) as error:
            raise RunError(f"scheduler: {scheduler} is lost: {_worded(error)}; {GOES_ON}") from None
        finally:
            with suppress(Exception):
                client.cancel([*futures, sent])


@dataclass(frozen=True)
class _Call:
    """A call that is made where it is unpickled, with the pickled task as its buffer.

    So all that Dask itself handles is of Python: a worker without this program, which could not
    read a function of it, would end. And each worker is sent the task once.
    """

    by: str
    values: np.ndarray

    def __reduce__(self) -> tuple[Any, ...]:
        return run_for, (self.by, pickle.PickleBuffer(b""), self.values.tolist())


def run_for(by: str, sent: bytes, values: list[list[float]]) -> Arrays:
    """Run members on a worker, of a pickled task that the program `by` made.

    Raises `RunError` in another version of this program, whose numbers may be others.
    """
    if by != this_program():
        raise RunError(
            f"scheduler: a worker has {this_program()}, and this is {by}; install the same there"
        )
    return run_chunk(_task(bytes(sent)), np.array(values))


@lru_cache(2)
def _task(sent: bytes) -> Task:
    task: Task = pickle.loads(sent)
    return task


def _done(distributed: Any, futures: dict[Any, int]) -> list[Any]:
    """The futures that are done, as soon as there is one; none after a while."""
    with suppress(TimeoutError):
        return list(distributed.wait(list(futures), LOOK, "FIRST_COMPLETED").done)
    return []


def _result(distributed: Any, future: Any) -> Arrays:
    """The result of a future that is done. Raises `RunError` if the worker is not fit, and
    `TimeoutError` if it does not come, as from a worker that was lost, or an `OSError` if the
    scheduler is.
    """
    try:
        arrays: Arrays = future.result(ALONE)
        return arrays
    except (TimeoutError, import_module("distributed.comm").CommClosedError):
        raise
    except (ImportError, AttributeError) as error:
        text = f"scheduler: a worker lacks {this_program()}; install it there: {_worded(error)}"
        raise RunError(text) from None
    except OSError as error:
        raise RunError(f"scheduler: a worker fails: {_worded(error)}; {GOES_ON}") from None
    except distributed.KilledWorker:
        text = "the workers that run a chunk end again and again, out of memory perhaps"
        raise RunError(f"scheduler: {text}; {GOES_ON}") from None


@contextmanager
def _client(distributed: Any, scheduler: str) -> Iterator[Any]:
    try:
        client = distributed.Client(scheduler, timeout=CONNECTING)
    except Exception as error:  # of any transport that the address names
        text = f"scheduler: {scheduler} cannot be reached: {_worded(error)}"
        raise RunError(text) from None
    try:
        yield client
    finally:
        with suppress(Exception):
            client.close(timeout=CONNECTING)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the logs and warnings of Dask, which are many lines; what matters is raised."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(before)


def _worded(error: BaseException) -> str:
    return one_line(str(error) or type(error).__name__)
