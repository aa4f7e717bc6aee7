"""Errors that a user can correct. Messages are one line, with location, value and remedy."""

import difflib
import sys
from collections.abc import Collection, Iterable

from eomgen.text import one_line


class EomgenError(Exception):
    """An error in the user's input, with one or more lines of message.

    Each argument is one line; `text.one_line` makes untrusted text in it safe.
    """

    def __init__(self, *lines: str) -> None:
        self.lines = tuple(one_line(line) for line in lines)
        super().__init__("\n".join(self.lines))

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), self.lines


class SceneError(EomgenError):
    """A scene cannot be read, or does not describe a mechanism."""


class RunError(EomgenError):
    """A simulation cannot continue, or a file cannot be read or written."""


class InterruptedRunError(RunError):
    """An interrupt ended a run; the results up to then are kept."""


def report_refusal(error: EomgenError) -> None:
    """Print the lines of an error to standard error, each with the name of this program."""
    for line in error.lines:
        print(f"eomgen: {line}", file=sys.stderr)


ALIKE = 0.6
"""Least similarity of a hint: twice the number of common letters by that of all letters."""
LONGER = 2 / ALIKE - 1
"""A word this many times as long as a known one cannot be so similar. To compare takes long."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the known word nearest to `word`, or ``""``."""
    # Words that differ in case alone come first: rk45 is RK45 rather than rk4.
    names = list(known)
    if len(word) > LONGER * max(map(len, names), default=0):
        return ""
    close = [name for name in names if name.casefold() == word.casefold()]
    close = close or difflib.get_close_matches(word, names, n=1, cutoff=ALIKE)
    return f" (did you mean '{close[0]}'?)" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names for a message: the first twelve, and the number of others."""
    words = list(names)
    return ", ".join(words[:12]) + (f" and {len(words) - 12} more" if len(words) > 12 else "")


def check_known(name: str, place: str, known: Collection[str], what: str) -> None:
    """Raise `SceneError` unless a name is among the `known` ones, which are names of a `what`."""
    if name not in known:
        hint = nearest(name, known) or f"; known: {listed(known) or 'none'}"
        raise SceneError(f"{place}: no {what} is named '{name}'{hint}")
