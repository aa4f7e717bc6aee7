"""Errors that a user can correct. Messages are one line, with location, value and remedy."""

import difflib
import sys
from collections.abc import Collection, Iterable

from eomgen.base.text import one_line


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
"""Least similarity of a hint: twice the number of common letters, divided by all letters."""
LONGER = 2 / ALIKE - 1
"""A word more than this many times as long as a known one is never that similar."""


SYNONYMS = {
    **dict.fromkeys("hinge pin pivot rotary rotational continuous".split(), "revolute"),
    **dict.fromkeys("slider slide sliding linear translational".split(), "prismatic"),
    **dict.fromkeys("fixed rigid".split(), "weld"),
    **dict.fromkeys("spherical socket".split(), "ball"),
    **dict.fromkeys("cardan hooke".split(), "universal"),
    **dict.fromkeys("floating freeflyer".split(), "free"),
    **dict.fromkeys("rack screw mimic".split(), "coupling"),
    **dict.fromkeys("gears gearing meshing".split(), "gear"),
    **dict.fromkeys("sprocket timing_belt chain_drive".split(), "belt"),
    **dict.fromkeys("cable tendon tackle hoist winch drum".split(), "rope"),
    **dict.fromkeys("string cord leash sling".split(), "tether"),
    **dict.fromkeys("damper dashpot".split(), "spring"),
    **dict.fromkeys("link strut".split(), "distance"),
    **dict.fromkeys("wheel tyre tire".split(), "rolling"),
    **dict.fromkeys("actuator drive".split(), "motor"),
    **dict.fromkeys("limit endstop".split(), "joint_stop"),
    **dict.fromkeys("ground base earth fixed_frame origin".split(), "world"),
}
"""Words of other programs and of workshops for what has another name here."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the known word of the same meaning or the one nearest
    to `word`, or ``""``.
    """
    names = list(known)
    if (meant := SYNONYMS.get(word.casefold())) in names:
        return f" (did you mean '{meant}'?)"
    # Words that differ in case alone come first: rk45 is RK45 rather than rk4.
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
