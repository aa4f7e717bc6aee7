"""The lines of a scene's file at which its tables and keys are, for messages.

`tomllib` gives no positions. Of a text that it has accepted this module reads the structure alone:
headers, keys, and the extent of values.
"""

import re
import tomllib
from bisect import bisect_right
from collections.abc import Generator, Iterable, Iterator, Mapping

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}(?!")'
    r"|'''.*?'{3,5}(?!')"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_OTHER = re.compile(r"[^,\]}#\n]+")
_HEADER = re.compile(r"\[\[?")
_SYNTAX = re.compile(r"\(at line (\d+), column \d+\)(?=$|; )")

MOST_PARTS = 100
"""Greatest number of parts of a key; locations of longer ones would take much memory."""


def with_lines(messages: Iterable[str], source: str, text: str) -> Iterator[str]:
    """Messages `source: location: …` as `source:8: location: …`, with the line of the location in
    the text, or of the table that it would be in. Others stay as they are.
    """
    lines: Mapping[str, int] | None = None
    for message in messages:
        rest = message.removeprefix(f"{source}: ")
        if rest == message:
            yield message
            continue
        if found := _SYNTAX.search(rest):
            yield f"{source}:{found[1]}: {rest}"
            continue
        lines = lines_of(text) if lines is None else lines
        line = line_of(rest.partition(": ")[0], lines)
        yield f"{source}:{line}: {rest}" if line else message


def line_of(location: str, lines: Mapping[str, int]) -> int:
    """The line of a location, as `joints[1].type`, or of what it is in; 0 if it is not there."""
    while location:
        if location in lines:
            return lines[location]
        location = location[: max(location.rfind("."), location.rfind("["), 0)]
    return 0


def lines_of(text: str) -> dict[str, int]:
    """The line of each table, key and entry of a list, by its location.

    For a text that `tomllib` refuses, those before the mistake.
    """
    found: dict[str, int] = {}
    breaks = [i for i, character in enumerate(text) if character == "\n"]
    try:
        for location, at in _Walk(text).document():
            found.setdefault(location, bisect_right(breaks, at - 1) + 1)
    except (RecursionError, ValueError):
        pass
    return found


class _Walk:
    """A walk through a text, which yields locations with their positions in it."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._counts: dict[str, int] = {}

    def document(self) -> Iterator[tuple[str, int]]:
        """All locations, in order. Raises `ValueError` where the text is no TOML."""
        table = ""
        while self._skip(_BLANK) < len(self._text):
            start = self._at
            if header := _HEADER.match(self._text, start):
                self._at = header.end()
                table = yield from self._header(self._key(), start, len(header[0]) == 2)
                self._take("]" * len(header[0]))
            else:
                yield from self._pair(table)

    def _header(
        self, parts: list[str], start: int, of_list: bool
    ) -> Generator[tuple[str, int], None, str]:
        """The parts of a header; returns the location of its table."""
        location = ""
        for i, part in enumerate(parts):
            location = _joined(location, part)
            yield location, start
            if of_list and i == len(parts) - 1:
                self._counts[location] = self._counts.get(location, 0) + 1
            if location in self._counts:
                location = f"{location}[{self._counts[location] - 1}]"
                yield location, start
        return location

    def _pair(self, table: str) -> Iterator[tuple[str, int]]:
        """A key and its value."""
        start = self._skip(_SPACE)
        for part in self._key():
            table = _joined(table, part)
            yield table, start
        self._take("=")
        yield from self._value(table)

    def _value(self, location: str) -> Iterator[tuple[str, int]]:
        self._skip(_SPACE)
        first = self._text[self._at : self._at + 1]
        if first == "[" or first == "{":
            self._at += 1
            yield from self._entries(location, "]" if first == "[" else "}")
        elif first == '"' or first == "'":
            self._match(_STRING)
        else:
            self._match(_OTHER)

    def _entries(self, location: str, end: str) -> Iterator[tuple[str, int]]:
        """The entries of a list, or the pairs of a table in one line."""
        count = 0
        while not self._text.startswith(end, self._skip(_BLANK)):
            if end == "]":
                yield f"{location}[{count}]", self._at
                yield from self._value(f"{location}[{count}]")
            else:
                yield from self._pair(location)
            count += 1
            self._skip(_BLANK)
            if self._text.startswith(",", self._at):
                self._at += 1
            elif not self._text.startswith(end, self._at):
                raise ValueError
        self._at += 1

    def _key(self) -> list[str]:
        """The parts of a dotted key."""
        parts: list[str] = []
        while len(parts) < MOST_PARTS:
            self._skip(_SPACE)
            if self._text.startswith(('"', "'"), self._at):
                parts.append(tomllib.loads(f"key = {self._match(_STRING)}")["key"])
            else:
                parts.append(self._match(_BARE))
            self._skip(_SPACE)
            if not self._text.startswith(".", self._at):
                return parts
            self._at += 1
        raise ValueError

    def _match(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self._text, self._at)
        if found is None:
            raise ValueError
        self._at = found.end()
        return found[0]

    def _skip(self, pattern: re.Pattern[str]) -> int:
        """Skip what matches, and return the position after it."""
        self._match(pattern)
        return self._at

    def _take(self, sign: str) -> None:
        self._skip(_SPACE)
        if not self._text.startswith(sign, self._at):
            raise ValueError
        self._at += len(sign)


def _joined(location: str, key: str) -> str:
    return f"{location}.{key}" if location else key
