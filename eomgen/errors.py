"""Errors that are the user's to mend: one clear line each, with place, value and remedy."""

import difflib
import sys
from collections.abc import Collection, Iterable

from eomgen.text import one_line


class EomgenError(Exception):
    """A fault in what the user gave, in one line or several fit for the terminal.

    Each argument is a line and stays one, whatever text of others is in it: see `text.one_line`.
    """

    def __init__(self, *lines: str) -> None:
        self.lines = tuple(one_line(line) for line in lines)
        super().__init__("\n".join(self.lines))

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), self.lines


class SceneError(EomgenError):
    """A scene that cannot be read or makes no mechanism."""


class RunError(EomgenError):
    """A simulation, or a file it needs or writes, that cannot go on."""


class InterruptedRunError(RunError):
    """A run that an interrupt ended; what it had computed is kept."""


def report_refusal(error: EomgenError) -> None:
    """Say on standard error what is wrong, each line as one of this program."""
    for line in error.lines:
        print(f"eomgen: {line}", file=sys.stderr)


ALIKE = 0.6
"""Least similarity of a hint: twice the number of common letters by that of all letters."""
LONGER = 2 / ALIKE - 1
"""A word this many times as long as a known one cannot be so similar. To compare takes long."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the known word nearest to `word`, or ``""``."""
    # Small and capital letters are the least of differences: rk45 is RK45 rather than rk4.
    names = list(known)
    if len(word) > LONGER * max(map(len, names), default=0):
        return ""
    close = [name for name in names if name.casefold() == word.casefold()]
    close = close or difflib.get_close_matches(word, names, n=1, cutoff=ALIKE)
    return f" (did you mean '{close[0]}'?)" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names in a message, the first few of many."""
    words = list(names)
    return ", ".join(words[:12]) + (f" and {len(words) - 12} more" if len(words) > 12 else "")


def check_known(name: str, place: str, known: Collection[str], what: str) -> None:
    """Raise `SceneError` unless a name is one of those `known`, of a `what`."""
    if name not in known:
        hint = nearest(name, known) or f"; known: {listed(known) or 'none'}"
        raise SceneError(f"{place}: no {what} is named '{name}'{hint}")
