"""The process: what it does when it is told to stop. The console script and `python -m eomgen`."""

import gc
import signal
import sys
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

STOPS = ("SIGINT", "SIGTERM", "SIGHUP")
AGAIN = 0.02
"""Seconds after which a stop that got lost comes again."""

_stopped_by: list[int] = []


def main() -> int:
    """Run one command. The exit code is that of `eomgen.cli.main`; once the process was told to
    stop it is 128 and the signal's number, 130 for Ctrl-C, whatever the moment.

    Each of these signals is an interrupt, so that nothing half is left behind and `simulate` writes
    what it has computed.
    """
    code = 128 + signal.SIGINT
    # A program is a hundred thousand objects that are kept. The process is this program's own, so
    # that it may keep the collector from scanning them again and again, a fifth of the time.
    gc.set_threshold(100_000, 20, 20)
    try:
        _listen()
        from eomgen.cli import main as run  # here, where a stop during its imports is caught

        code = run()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException as error:  # an import that is stopped half way may raise anything
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
        # A job in the background ignores Ctrl-C, and one under nohup the end of the terminal.
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _stop_again)
        sys.unraisablehook = _lost


def _listen_no_more() -> None:
    """Nothing is left to be stopped, and the exit code is known."""
    for name in STOPS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)


def _stop(number: int, frame: FrameType | None) -> None:
    _stopped_by.append(number)
    raise KeyboardInterrupt


def _stop_again(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _lost(about: "UnraisableHookArgs") -> None:
    """A stop that came where nothing can be raised, as while something is deleted, comes again."""
    if issubclass(about.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    else:
        sys.__unraisablehook__(about)


if __name__ == "__main__":
    sys.exit(main())
