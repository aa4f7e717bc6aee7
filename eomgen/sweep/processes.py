"""The chunks of a sweep in processes of this machine, which end with the one that started them."""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing.connection import wait
from multiprocessing.context import BaseContext
from typing import Any, TypeAlias

import numpy as np

from eomgen.base.errors import RunError
from eomgen.sweep.counter import SIZE, Counter, StoppedError
from eomgen.sweep.members import Arrays, Task
from eomgen.sweep.together import run_chunk

Pipe: TypeAlias = Any
"""An end of a pipe, whose class depends on the system."""
Job = tuple[int, np.ndarray]
"""The number of a chunk, and the values of its members."""
PAUSE = 0.2
"""Time between two looks at how far the members are, s."""
UNGUARDED = 'a script needs `if __name__ == "__main__":` around what starts workers'
ENDED = f"a worker process ended unexpectedly: out of memory perhaps; {UNGUARDED}"
GRACE = 2.0
"""Time that workers have to end when they are not wanted any more, s."""
STOPS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]


def by_processes(
    task: Task, jobs: Sequence[Job], workers: int, running: Callable[[int], None]
) -> Iterator[tuple[int, Arrays]]:
    """The chunks as they come; `running` is told how many members of others have ended.

    Raises `RunError` if a process dies, and what a run raises.
    """
    left, done, busy = iter(jobs), 0, dict[Pipe, tuple[int, int]]()

    def give(pipe: Pipe) -> None:
        for number, values in islice(left, 1):
            with _alive():
                pipe.send(values)
            busy[pipe] = number, len(values)

    with _team(workers) as (counter, team):
        sent = pickle.dumps(task)
        for pipe in team:
            with _alive():
                pipe.send_bytes(sent)
            give(pipe)
        while busy:
            ready: list[Pipe] = wait(list(busy), PAUSE)
            for pipe in ready:
                with _alive():
                    found = pipe.recv()
                number, members = busy.pop(pipe)
                if isinstance(found, Exception):
                    raise found
                give(pipe)
                done += members
                yield number, found
            running(max(0, counter.ended - done))


@contextmanager
def _alive() -> Iterator[None]:
    """Raise `RunError` if the process at the other end of a pipe has died."""
    try:
        yield
    except (EOFError, OSError):
        time.sleep(PAUSE)  # a stop of all processes may come to the workers first
        raise RunError(ENDED) from None


@contextmanager
def _team(count: int) -> Iterator[tuple[Counter, Mapping[Pipe, Any]]]:
    """A counter, and processes by the pipes to them, which have ended when it is left."""
    start: Any = _start()
    try:
        memory = start.Array("q", SIZE)
    except ImportError:  # in a browser
        raise RunError("this Python cannot start processes; give workers=1") from None
    counter, team = Counter(memory.get_obj(), memory.get_lock()), dict[Pipe, Any]()
    try:
        with _held():
            for _ in range(count):
                here, there = start.Pipe()
                process = start.Process(target=_work, args=(there, memory), daemon=True)
                _begin(process)
                there.close()
                team[here] = process
        yield counter, team
    finally:
        try:
            counter.stop()
            for pipe in team:
                with suppress(OSError):
                    pipe.send(None)
            due = time.monotonic() + GRACE
            for process in team.values():
                process.join(max(0.0, due - time.monotonic()))
        finally:  # also if a second stop comes meanwhile
            for process in team.values():
                process.kill()


def _begin(process: Any) -> None:
    """Start a process. Raises `RunError` in a script that starts workers while it is imported:
    where processes are no copies, each imports the script, and would start its own.
    """
    try:
        process.start()
    except RuntimeError:  # this is such a process
        raise RunError(UNGUARDED) from None
    except (EOFError, ConnectionError):  # the one from which copies are made has ended
        raise RunError(ENDED) from None


def _start() -> BaseContext:
    """How processes are started: as is usual, but not as copies of one in which JAX runs, whose
    threads would be missing there.
    """
    usual = multiprocessing.get_start_method()
    return multiprocessing.get_context("spawn" if "jax" in sys.modules else usual)


@contextmanager
def _held() -> Iterator[None]:
    """Hold stops back, where the system can: a process that has just been copied would take them as
    this one does.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(pipe: Pipe, memory: Any) -> None:
    """A worker: takes a task and values of members, and sends what their runs give."""
    _listen()
    counter = Counter(memory.get_obj(), memory.get_lock())
    with suppress(EOFError, OSError):  # nobody is there any more
        task: Task = pickle.loads(pipe.recv_bytes())
        while (values := pipe.recv()) is not None:
            pipe.send_bytes(pickle.dumps(_result(task, values, counter)))


def _listen() -> None:
    """Leave Ctrl-C to the main process, which a terminal sends it too; end at any other stop, and
    with the main process, however it ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in STOPS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow(ended: int) -> None:
        wait([ended])
        os._exit(1)

    threading.Thread(target=follow, args=(parent.sentinel,), daemon=True).start()


def _result(task: Task, values: np.ndarray, counter: Counter) -> Arrays | Exception:
    """The results of members, nothing if they are not wanted any more, or an error."""
    try:
        return run_chunk(task, values, counter)
    except StoppedError:
        return {}
    except Exception as error:
        error.add_note(f"in a worker process:\n{traceback.format_exc()}")
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            return RunError(f"a worker process: {type(error).__name__}: {error}")
        return error
