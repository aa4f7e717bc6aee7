"""Standard output and standard error as they may be: closed, full, read by nobody, or of ASCII.

None of that ends a command before its files are written. What a stream could not take is known
afterwards, and then it is said.
"""

import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO, cast

from eomgen.text import escaped, spelled


class Steady(io.TextIOBase):
    """A stream that takes every text and never raises.

    Characters that a terminal would obey are escaped, all but line breaks and a return to the
    line's beginning at the very start; those that the encoding lacks are spelled. `failure` is what
    the first write that failed raised, after which nothing more is written.
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
        self._tried(lambda: self._stream.write(shown))
        return len(text)

    def flush(self) -> None:
        self._tried(self._stream.flush)

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()

    def lost(self) -> str:
        """Why something was not written; "" if all was, or if its reader went, who has enough."""
        self.flush()
        if self.failure is None or isinstance(self.failure, BrokenPipeError):
            return ""
        return self.failure.strerror or str(self.failure)

    def _tried(self, action: Callable[[], object]) -> None:
        if self.failure is not None:
            return
        try:
            action()
        except OSError as error:
            self.failure = error
            with suppress(OSError):  # what is still in buffers is to fail no more
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self.fileno())
                os.close(nowhere)


@contextmanager
def steady_streams() -> Iterator[Steady]:
    """Put steady streams in the place of standard output, which is given, and standard error.

    A closed one is as good as one that leads nowhere.
    """
    for number in range(3):  # or a file opened later would get this number, and what C prints
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # noqa: PTH123
        output, errors = (Steady(stream or nowhere) for stream in before)
        sys.stdout, sys.stderr = cast(TextIO, output), cast(TextIO, errors)
        try:
            yield output
        finally:
            errors.flush()
            output.flush()
            sys.stdout, sys.stderr = before
