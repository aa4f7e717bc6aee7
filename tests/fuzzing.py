"""Scenes with something wrong in them, any number of them, and what must not come of any.

A scene comes from a built-in one by a few changes: letters, lines, keys, values, formulas, from
another scene or out of a list of what has broken readers before. Its number determines all of it.
"""

import random
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from campaign import Failure

from eomgen.base.errors import SceneError
from eomgen.base.text import LONGEST_LINE
from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import built_in_names, find_scene, parse_scene

LONGEST = 3000
"""Letters of the scenes that are changed: long ones take long."""
HANGS = 10.0
"""After this many seconds of its own processor time a reader hangs; a busy machine is no hang."""
VALUES = (
    *("0", "-1", "1e308", "-1e308", "nan", "inf", "-inf", "1e-320", "-0.0", "1_0", "0x1F", "true"),
    *("2026-01-01", "07:32:00", '""', "[]", "{}", "[[]]", "[1, 2, 3]", "[nan, 0]", '["m"]'),
    *('"world"', '"input"', '"free"', '"A"', '"2*x"', '"t"', '"1/0"', '"0/0"', '"(-1)**0.5"'),
    '"9**9**9**9"', "\"__import__('os').system('true')\"",
    '"().__class__.__bases__[0].__subclasses__()"',
    "\"open('x', 'w')\"", '"exec(1)"', '"lambda: 0"', '"[x for x in (1,)]"', '"{{7*7}}"',
    '"{% for x in y %}"', '"m; import os"', '"\\\\"', '"\\u0000"', '"é"', '"ｍ"',
    '"../../etc/passwd"', "'''a\n\"\"\"\nb'''", "9" * 400,
    '"' + "(" * 300 + "1" + ")" * 300 + '"',
    '"' + "-" * 3000 + '1"',
    '"' + "sin(" * 60 + "m" + ")" * 60 + '"',
    '"' + "+".join(["m"] * 2000) + '"', "[" * 200 + "]" * 200, "[" * 5000 + "]" * 5000,
    "{ a = " * 3000 + "1" + " }" * 3000, "9" * 5000, "-1" + "0" * 4299, "0x" + "f" * 30_000,
    "1e999", "1." + "1" * 20_000, "2026-01-01T00:00:00.123456+23:59", '"\\u001b[31mred\\u001b[0m"',
    '"a\\neomgen: forged"',
    '"\\u202egnp.exe\\u2028\\u009b2J\\u200d"',
    '"' + "k" * 20_000 + '"', '"' + "k " * 9_000 + '"', "[" + "1, " * 20_000 + "]",
    "{ value = 1, unit = 'kg', about = 'x' }",
    "{ value = 'm', unit = '' }",
)  # fmt: skip
KEYS = (
    *('"\\u001b[31mred"', '"a\\neomgen: forged"', '"\\u202e\\u2028\\u0085\\u009b"', '""', '" "'),
    *('"' + "k" * 20_000 + '"', '"' + "k " * 9_000 + '"', "a.b.c", ".".join("a" * 30)),
)
FORBIDDEN = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect", "exec")
"""What a scene may not bring about, by the names of Python's audit events; nor files opened."""


@cache
def texts() -> tuple[str, ...]:
    """The built-in scenes that are changed."""
    every = (find_scene(name).read_text() for name in built_in_names())
    return tuple(text for text in every if len(text) < LONGEST)


def scene(number: int) -> str:
    """The scene of a number."""
    r = random.Random(number)
    text = r.choice(texts())
    for _ in range(r.choice((1, 1, 1, 2, 3, 6))):
        text = r.choice(CHANGES)(text, r)
    return text


def _letters(text: str, r: random.Random) -> str:
    at, size = r.randrange(len(text) + 1), r.choice((0, 0, 1, 1, 2, 10))
    new = "".join(
        r.choice("[]{}=\"'#.,-+*/()\n\\ 0e_aé\0\r\t\x1b\x7f\x9b\u2028\u202e\ufeff")
        for _ in range(r.choice((0, 1, 2)))
    )
    return text[:at] + new + text[at + size :]


def _lines(text: str, r: random.Random) -> str:
    lines = text.split("\n")
    i, j = r.randrange(len(lines)), r.randrange(len(lines))
    match r.randrange(4):
        case 0:
            del lines[i]
        case 1:
            lines.insert(j, lines[i])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case _:
            lines.insert(i, r.choice(r.choice(texts()).split("\n")))
    return "\n".join(lines)


def _values(text: str, r: random.Random) -> str:
    return _replaced(text, r, r"= *(.+)", r.choice(VALUES))


def _words(text: str, r: random.Random) -> str:
    """A word, in a formula or a name or a key, becomes another one of some scene."""
    words = re.findall(r"[A-Za-z_]\w*", r.choice(texts()))
    return _replaced(text, r, r"\b([A-Za-z_]\w*)\b", r.choice(words))


def _keys(text: str, r: random.Random) -> str:
    """A key becomes one that a terminal would obey, forges a line, or has no end."""
    return _replaced(text, r, r"(?m)(?:^|[{,]) *([a-z_]+) *=", r.choice(KEYS))


def _numbers(text: str, r: random.Random) -> str:
    number = r.choice(("0", "-1", "1e-300", "1e300", "1e16", "nan", "2", "-0.5", "1e-9", "1/3"))
    return _replaced(text, r, r"\b(\d[\d.e+-]*)\b", number)


def _replaced(text: str, r: random.Random, pattern: str, new: str) -> str:
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    match = r.choice(found)
    return text[: match.start(1)] + new + text[match.end(1) :]


CHANGES = (_letters, _lines, _values, _values, _words, _words, _numbers, _keys)


# What comes of them.


_events: list[str] | None = None


def _heard(event: str, given: Any) -> None:
    if _events is not None and (event.startswith(FORBIDDEN) or event == "open"):
        _events.append(f"{event} {given!r:.200}")


@contextmanager
def no_hang() -> Iterator[None]:
    """Raises `Failure` in what takes too much of the processor."""

    def hangs(*given: Any) -> None:
        raise Failure(f"hangs for {HANGS:g} s")

    before = signal.signal(signal.SIGPROF, hangs)
    signal.setitimer(signal.ITIMER_PROF, HANGS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def _watched() -> Iterator[list[str]]:
    """What happens meanwhile that should not."""
    global _events
    _events = heard = []
    try:
        with no_hang():
            yield heard
    finally:
        _events = None


def outcome(number: int) -> str:
    """What comes of the scene of a number: 'message' or 'model'. Raises `Failure` for anything
    else.
    """
    _listening()
    return _outcome(scene(number))


def _outcome(text: str) -> str:
    try:
        with _watched() as events:
            try:
                elaborate(parse_scene(text))
                found = "model"
            except SceneError as error:
                found = "message"
                _check_message(error)
    except Failure:
        raise
    except BaseException as error:
        raise Failure(f"{type(error).__name__}: {error}") from error
    if events:
        raise Failure(f"it brought about {events[0]}")
    return found


def _check_message(error: SceneError) -> None:
    """Raise `Failure` unless a message is a few lines that can be seen and have an end."""
    lines = str(error).split("\n")
    if not (str(error).strip() and lines == list(error.lines) and len(lines) <= 12):
        raise Failure(f"a message of {len(lines)} lines: {str(error)[:200]!r}") from None
    for line in lines:
        if not line.isprintable() or len(line) > LONGEST_LINE:
            raise Failure(f"a line of {len(line)} letters: {line[:200]!r}") from None


@cache
def _listening() -> None:
    """Hear what scenes bring about, once all that is imported late has been."""
    for text in texts():
        elaborate(parse_scene(text))
    for value in VALUES:
        _outcome(f'name = "x"\nbodies = [{{name = "a", mass = {value}, inertia_com = 1}}]')
    sys.addaudithook(_heard)
