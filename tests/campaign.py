"""How much is tried: the ordinary run takes a part, `FULL=1 python -m pytest` takes everything."""

import os
from collections.abc import Iterable
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
