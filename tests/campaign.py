"""How much is tried: the ordinary run takes a part, `FULL=1 python -m pytest` takes everything."""

import os
from collections import Counter
from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")
FULL = "FULL" in os.environ
BUILT_IN = ("double_pendulum", "pendulum", "two_body", "two_body_forced")
"""The built-in scenes whose route is `closed`: SymPy's equations are there to be looked into."""


def is_kept(index: int, every: int) -> bool:
    """Whether a case is among the one in `every` that are tried, by the sum of the digits of its
    index. Equal distances would try only one of two routes that take turns.
    """
    total, rest = 0, index
    while rest:
        rest, digit = divmod(rest, every)
        total += digit
    return total % every == 0


def thinned(cases: Iterable[T], every: int) -> list[T]:
    """One in `every` of the cases; in a full run all of them."""
    return [case for i, case in enumerate(cases) if FULL or is_kept(i, every)]


def some(part: T, whole: T) -> T:
    """The part, or the whole in a full run."""
    return whole if FULL else part


class Failure(AssertionError):
    """What came of a case that must not come of any."""


def counted(
    outcome: Callable[[int], str], numbers: Iterable[int]
) -> tuple[Counter[str], list[str]]:
    """How often what came of cases that are made by number, and what failed, each with its number.

    `outcome` says in a word what came of a case, or raises `Failure`.
    """
    counts: Counter[str] = Counter()
    failures: list[str] = []
    for number in numbers:
        try:
            counts[outcome(number)] += 1
        except Failure as failure:
            failures.append(f"{number}: {failure}")
    return counts, failures


def among(words: str, well: tuple[str, ...]) -> str:
    """What came of a case, if it is one of these."""
    if words not in well:
        raise Failure(words)
    return words
