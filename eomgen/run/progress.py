"""A progress bar on the terminal for long work; nothing if standard error is a pipe."""

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float], None]
"""Called with the fraction done, 0 to 1."""

_BAR = 30
SOON = 0.3
"""Time after which the rest is estimated, s."""
TICK = 0.5
"""Time between two states of a notice, s."""
WIDEST = 500
"""Greatest number of columns used."""


def throttled(progress: Progress, interval: float = 0.1) -> Progress:
    """`progress` without the calls within `interval` s of the one before, except for fraction 1."""
    due = 0.0

    def report(fraction: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due or fraction >= 1:
            due = now + interval
            progress(fraction)

    return report


@contextmanager
def terminal_progress(label: str, *, countdown: bool = True) -> Iterator[Progress]:
    """Yield a function that draws a bar on one line of standard error, erased when the block ends.

    With `countdown` it also shows about how long the rest will take, if it goes on as since the
    first call. If standard error is not a terminal, the function does nothing.
    """
    with terminal_line() as write:
        first: tuple[float, float] | None = None

        def draw(fraction: float) -> None:
            nonlocal first
            done = min(max(fraction, 0.0), 1.0)
            bar = "#" * round(done * _BAR)
            now = time.monotonic()
            first = first or (now, done)
            left = ""
            if countdown and done > first[1] and now - first[0] > SOON:
                left = rough_time((now - first[0]) * (1 - done) / (done - first[1]))
            write(f"{label} [{bar:<{_BAR}}] {done:4.0%}{left and f', about {left} left'}")

        yield draw


def rough_time(seconds: float) -> str:
    """A time in words: "8 s", "5 min", "3.2 h"."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5970 else f"{seconds / 3600:.1f} h"


@contextmanager
def terminal_notice(text: str, expected: float | None = None) -> Iterator[None]:
    """Show a line on standard error during the block, if that is a terminal: the text, the time
    passed, and that left if the block is `expected` to take so long, s.
    """
    with terminal_line() as write:
        write(text)
        if not sys.stderr.isatty():
            yield
            return
        began, over = time.monotonic(), threading.Event()

        def report() -> None:
            while not over.wait(TICK):
                spent = time.monotonic() - began
                left = f", about {rough_time(expected - spent)} left" if expected else ""
                if expected and spent > expected:
                    left = ", longer than last time"
                write(f"{text} {rough_time(spent)}{left}")

        reporter = threading.Thread(target=report, daemon=True)
        reporter.start()
        try:
            yield
        finally:
            over.set()
            reporter.join()


@contextmanager
def terminal_line() -> Iterator[Callable[[str], None]]:
    """Yield a function that rewrites one line on standard error, erased when the block ends.

    If standard error is not a terminal, it does nothing.
    """
    stream = sys.stderr
    if not stream.isatty():
        yield lambda text: None
        return
    # One column less, because \r does not return to the start of a line that wraps. COLUMNS may
    # have any value.
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
