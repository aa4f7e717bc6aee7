"""Standard streams that do not fail, even if they are closed, full, unread or limited to ASCII.

A failing stream must not end a command before its files are written. The failure is recorded and
reported at the end.
"""

import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO, cast

from eomgen.base.text import escaped, spelled


class Steady(io.TextIOBase):
    """A text stream whose methods never raise.

    Control characters are escaped, except line breaks, and a carriage return at the start of a
    text. Characters that the encoding lacks are spelled out. `failure` is the exception of the
    first write that failed; nothing is written after it.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._stream.encoding or "ascii"

    def write(self, text: str) -> int:
        start = text[:1] if text.startswith("\r") else ""
        shown = start + "\n".join(map(escaped, text[len(start) :].split("\n")))
        try:
            shown.encode(self.encoding)
        except UnicodeEncodeError:
            shown = spelled(shown, self.encoding)
        self._try(lambda: self._stream.write(shown))
        return len(text)

    def flush(self) -> None:
        if not self._stream.closed:  # by whoever made it; an object that is finalised flushes
            self._try(self._stream.flush)

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()

    def lost(self) -> str:
        """Why output was lost; "" if none was, or if its reader closed the pipe."""
        self.flush()
        if self.failure is None or isinstance(self.failure, BrokenPipeError):
            return ""
        return self.failure.strerror or str(self.failure)

    def _try(self, action: Callable[[], object]) -> None:
        if self.failure is not None:
            return
        try:
            action()
        except OSError as error:
            self.failure = error
            with suppress(OSError):  # so that buffered output does not fail at exit
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, self.fileno())
                os.close(null)


@contextmanager
def steady_streams() -> Iterator[Steady]:
    """Replace standard output and standard error by steady streams; yields the former.

    A closed stream is replaced by the null device.
    """
    for number in range(3):  # else a file opened later gets this number, and output of C libraries
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as null:  # noqa: PTH123
        output, errors = (Steady(stream or null) for stream in before)
        sys.stdout, sys.stderr = cast(TextIO, output), cast(TextIO, errors)
        try:
            yield output
        finally:
            errors.flush()
            output.flush()
            sys.stdout, sys.stderr = before
