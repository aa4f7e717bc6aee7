"""Balls: numbers with a midpoint and a radius that hold what they stand for (python-flint)."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from eomgen.base.errors import RunError

flint: Any
try:
    flint = import_module("flint")
except ImportError:  # said where a proof is asked for
    flint = None

Ball = Any
"""A ball, `flint.arb`."""
Balls = list[Ball]
Matrix = Any
"""A matrix of balls, `flint.arb_mat`."""

SHORT = 53
"""Bits of balls whose radius is far above the rounding of doubles."""
EXACT = 4096
"""Bits with which sums of a few doubles are exact."""


def check_balls() -> None:
    """Raises `RunError` if python-flint is missing."""
    if flint is None:
        raise RunError(
            "certify: needs the package python-flint; install it with "
            "`pip install 'eomgen[certified]'`"
        )


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Operations on balls round to this number of bits."""
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


class OverBalls:
    """The scalars of computations over balls."""

    def number(self, value: Any) -> Ball:
        """The ball of a number, exact."""
        return value if isinstance(value, flint.arb) else flint.arb(float(value))

    def call(self, function: str, *arguments: Ball) -> Ball:
        """A function of balls."""
        return function_of(function)(*arguments)

    def is_zero(self, value: Ball) -> bool:
        """Whether a ball is exactly 0."""
        return bool(value == 0)

    def named(self, value: Ball, name: str) -> Ball:
        """The same ball."""
        return value


def function_of(name: str) -> Any:
    """A function of the program over balls."""
    return getattr(flint.arb, name)


def ball(middle: float, radius: float = 0.0) -> Ball:
    """The ball of doubles about a midpoint."""
    return flint.arb(middle, radius)


def span(low: Ball, high: Ball) -> Ball:
    """The ball of all that lies between two exact numbers."""
    return flint.arb(low).union(flint.arb(high))


def about_zero(size: Ball) -> Ball:
    """All numbers of at most this absolute value."""
    return flint.arb(0, size.abs_upper())


def exact_sum(a: Ball, b: Ball) -> Ball:
    """The sum of two exact numbers, exact."""
    with precision(EXACT):
        found = a + b
    assert found.is_exact()
    return found


def exact_difference(a: Ball, b: Ball) -> Ball:
    """The first less the second of two exact numbers, exact."""
    with precision(EXACT):
        found = a - b
    assert found.is_exact()
    return found


def middle(x: Ball) -> Ball:
    """The midpoint, exact."""
    return x.mid()


def size(x: Ball) -> float:
    """An upper bound of absolute values; infinite for what is not finite."""
    return _upwards(x.abs_upper()) if x.is_finite() else math.inf


def radius(x: Ball) -> float:
    """An upper bound of the radius; infinite for what is not finite."""
    return _upwards(x.rad()) if x.is_finite() else math.inf


def in_parts(x: Ball) -> tuple[float, float, float]:
    """The midpoint as the nearest double and what is left of it, and an upper bound of the distance
    of anything in the ball from the sum of both.
    """
    whole = float(x.mid())
    low = float((x.mid() - whole).mid())
    return whole, low, size(x - whole - low)


def _upwards(x: Ball) -> float:
    return math.nextafter(float(x.upper()), math.inf) if x != 0 else 0.0


def matrix(rows: list[Balls]) -> Matrix:
    """A matrix of balls from its rows."""
    return flint.arb_mat(rows)


def column(entries: Balls) -> Matrix:
    """A matrix of one column."""
    return flint.arb_mat(len(entries), 1, entries)
