"""Long straight-line code divided into functions, for compilers.

The time to compile a function grows with the square of its length: registers are assigned to all of
its variables together. Values that a later function reads are passed on in an array. No operation
changes, nor do bits.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

Line = tuple[str, str]
"""A name, and the source of its value."""
MOST = 2000
"""Lines of a function."""
WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True)
class Part:
    """One function of a divided kernel.

    given  what it reads: names, and elements of arrays
    lines  what it computes
    kept   what later functions read: the index in the array, and the name
    """

    given: tuple[Line, ...]
    lines: tuple[Line, ...]
    kept: tuple[tuple[int, str], ...]


@dataclass(frozen=True)
class Division:
    """A kernel as functions in order, and what its results read from the array `between`.

    size  the length of that array
    """

    parts: tuple[Part, ...]
    given: tuple[Line, ...]
    size: int


def together(lines: Sequence[Line], pairs: re.Pattern[str]) -> list[Line]:
    """The same lines; where the sources of two match `pairs` with the same second group, the later
    one follows the earlier at once. It must depend on that group alone.
    """
    groups: dict[str, list[Line]] = {}
    for line in lines:
        if match := pairs.fullmatch(line[1]):
            groups.setdefault(match[2], []).append(line)
    made: list[Line] = []
    for line in lines:
        match = pairs.fullmatch(line[1])
        made += groups.pop(match[2], []) if match else [line]
    return made


def in_place(lines: Sequence[Line], given: Sequence[Line]) -> tuple[Line, ...]:
    """The same lines, which read elements of arrays where they use them. A compiler that reads many
    at the start stores most of them again.
    """
    known = dict(given)
    return tuple(
        (name, WORD.sub(lambda word: known.get(word[0], word[0]), source)) for name, source in lines
    )


def divided(
    lines: Sequence[Line], given: Sequence[Line], results: Sequence[str], most: int = MOST
) -> Division | None:
    """Lines divided into functions of at most `most`; None if there are hardly more."""
    if len(lines) <= 2 * most:
        return None
    pieces = [tuple(lines[i : i + most]) for i in range(0, len(lines), most)]
    sources = [[source for _, source in piece] for piece in pieces] + [list(results)]
    read = [dict.fromkeys(word for s in source for word in WORD.findall(s)) for source in sources]
    of = {name: number for number, piece in enumerate(pieces) for name, _ in piece}
    # A name of an earlier function, in the order in which it is first read by a later one.
    passed = dict.fromkeys(
        name for number, words in enumerate(read) for name in words if of.get(name, number) < number
    )
    place = {name: i for i, name in enumerate(passed)}
    known = dict(given)

    def taken(number: int) -> tuple[Line, ...]:
        earlier = {n: f"between[{place[n]}]" for n in read[number] if of.get(n, number) < number}
        return tuple((n, (known | earlier)[n]) for n in read[number] if n in known or n in earlier)

    parts = tuple(
        Part(taken(i), piece, tuple((place[name], name) for name, _ in piece if name in place))
        for i, piece in enumerate(pieces)
    )
    return Division(parts, taken(len(pieces)), len(place))
