"""How far a sweep is, and whether it shall stop: shared by threads, processes and compiled code."""

import threading
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

SIZE = 2
"""Number of 64-bit integers in its memory."""


class StoppedError(Exception):
    """Raised in runs that are not wanted any more."""


class Counter:
    """The number of members that have ended, and whether runs shall stop.

    memory, lock  of other processes; None for those of this one
    """

    def __init__(self, memory: Any = None, lock: AbstractContextManager[Any] | None = None) -> None:
        self._numbers = np.frombuffer(memory or bytearray(8 * SIZE), np.int64)
        self._lock: AbstractContextManager[Any] = lock or threading.Lock()

    @property
    def ended(self) -> int:
        """The number of members that have ended."""
        return int(self._numbers[0])

    def add(self, members: int = 1) -> None:
        """Count members that have ended. Raises `StoppedError` if runs shall stop."""
        with self._lock:
            self._numbers[0] += members
        self.check()

    def check(self) -> None:
        """Raise `StoppedError` if runs shall stop."""
        if self._numbers[1]:
            raise StoppedError

    def stop(self) -> None:
        """Let all runs stop soon."""
        self._numbers[1] = 1

    @property
    def addresses(self) -> tuple[int, int]:
        """The addresses of both numbers, for compiled code."""
        first = self._numbers.ctypes.data
        return first, first + 8
