"""The process: entry point of the console script and `python -m eomgen`, and its signals."""

import gc
import signal
import sys
import time
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

STOPS = ("SIGINT", "SIGTERM", "SIGHUP")
AGAIN = 0.02
"""Delay after which a lost interrupt is raised again, s."""

TOGETHER = 0.5
"""Time within which several stops are one, s: `timeout` sends one to the process and one to its
group, and the second would break off what the first lets end.
"""

_stopped_by: list[int] = []
_stopped_at: list[float] = []


def main() -> int:
    """Run one command. The exit code is that of `commands.main.main`, or after a signal of `STOPS`
    128 plus its number, for example 130 for Ctrl-C.

    Each of these signals raises `KeyboardInterrupt`, so that no partial files remain and `simulate`
    writes what it has computed.
    """
    code = 128 + signal.SIGINT
    # Deriving creates many objects that stay alive. Scanning them on each collection would take a
    # fifth of the time. The threshold is global, which is fine since this process is only ours.
    gc.set_threshold(100_000, 20, 20)
    try:
        _listen()
        from eomgen.commands.main import (
            main as run,  # here, so that an interrupt during the import is caught
        )

        code = run()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException as error:  # an interrupted import may raise anything
        if not (_stopped_by or isinstance(error, KeyboardInterrupt)):
            raise
        with suppress(OSError):
            print("eomgen: interrupted", file=sys.stderr)
    finally:
        _listen_no_more()
    return 128 + _stopped_by[0] if _stopped_by else code


def _listen() -> None:
    for name in STOPS:
        number = getattr(signal, name, None)
        # A background job ignores SIGINT, and a job under nohup ignores SIGHUP: keep that.
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _stop_again)
        sys.unraisablehook = _lost


def _listen_no_more() -> None:
    """Ignore further signals, because the command is done and the exit code is known."""
    for name in STOPS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)


def _stop(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _stopped_at and now - _stopped_at[-1] < TOGETHER:
        return
    _stopped_by.append(number)
    _stopped_at.append(now)
    raise KeyboardInterrupt


def _stop_again(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _lost(about: "UnraisableHookArgs") -> None:
    """Raise an interrupt again that was lost where exceptions are ignored, such as in `__del__`."""
    if issubclass(about.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    else:
        sys.__unraisablehook__(about)


if __name__ == "__main__":
    sys.exit(main())
