"""A bar on the terminal while something long runs, and silence in a pipe."""

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1."""

_BAR = 30
WIDEST = 500
"""Columns of a terminal that are used."""


def throttled(progress: Progress, interval: float = 0.1) -> Progress:
    """Return `progress` made deaf for `interval` seconds after each call it hears, but for 1."""
    due = 0.0

    def report(fraction: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due or fraction >= 1:
            due = now + interval
            progress(fraction)

    return report


@contextmanager
def terminal_progress(label: str) -> Iterator[Progress]:
    """Give a callable that draws a one-line bar on standard error, wiped when the block ends.

    Where standard error is no terminal the callable does nothing.
    """
    with terminal_line() as write:

        def draw(fraction: float) -> None:
            done = min(max(fraction, 0.0), 1.0)
            bar = "#" * round(done * _BAR)
            write(f"{label} [{bar:<{_BAR}}] {done:4.0%}")

        yield draw


@contextmanager
def terminal_notice(text: str) -> Iterator[None]:
    """Show a line on standard error while the block runs, if that is a terminal."""
    with terminal_line() as write:
        write(text)
        yield


@contextmanager
def terminal_line() -> Iterator[Callable[[str], None]]:
    """Give a function that rewrites one line on standard error, wiped when the block ends.

    Where standard error is no terminal it does nothing.
    """
    stream = sys.stderr
    if not stream.isatty():
        yield lambda text: None
        return
    # One column short of the edge, or the line would wrap and \r could not come back over it; and
    # COLUMNS may say anything.
    width = min(shutil.get_terminal_size().columns, WIDEST) - 1

    def write(text: str) -> None:
        stream.write("\r" + text[:width].ljust(width))
        stream.flush()

    try:
        yield write
    finally:
        write("")
        stream.write("\r")
        stream.flush()
