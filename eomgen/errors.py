"""Errors that are the user's to mend: one clear line each, with place, value and remedy."""

import difflib
from collections.abc import Iterable


class EomgenError(Exception):
    """A fault in what the user gave; its text is one line fit for the terminal."""


class SceneError(EomgenError):
    """A scene that cannot be read or makes no mechanism."""


class RunError(EomgenError):
    """A simulation, or a file it needs or writes, that cannot go on."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the known word nearest to `word`, or ``""``."""
    # Small and capital letters are the least of differences: rk45 is RK45 rather than rk4.
    names = list(known)
    close = [name for name in names if name.casefold() == word.casefold()]
    close = close or difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    return f" (did you mean '{close[0]}'?)" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names in a message, the first few of many."""
    words = list(names)
    return ", ".join(words[:12]) + (f" and {len(words) - 12} more" if len(words) > 12 else "")
