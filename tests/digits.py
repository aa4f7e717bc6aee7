"""Numbers of 60 digits: Python's decimals, which add and multiply ten times as fast as mpmath's.

They do not mix with doubles; `number` takes these over exactly. Functions are mpmath's.
"""

import decimal
from collections.abc import Callable
from decimal import Decimal
from functools import cache, partial
from typing import Any

import mpmath

DIGITS = 60
decimal.getcontext().prec = DIGITS
STEP = Decimal(10) ** -20
"""Of central differences, which are off by its square."""

_MORE = mpmath.MPContext()
_MORE.dps = DIGITS + 5


def number(value: Any) -> Decimal:
    """A double, an integer or what a text says, exactly."""
    return Decimal(value)


@cache
def _by_mpmath(function: str, *arguments: Decimal) -> Decimal:
    # Kept, since outputs at one state share their angles.
    value = getattr(_MORE, function)(*(_MORE.mpf(str(x)) for x in arguments))
    return +Decimal(_MORE.nstr(value, _MORE.dps))


_OWN: dict[str, Callable[..., Any]] = {
    "sqrt": Decimal.sqrt,
    "abs": abs,
    "step": lambda x: number(x > 0),
    "min": min,
    "max": max,
    "select": lambda c, a, b: a if c > 0 else b,
}


def call(function: str, *arguments: Any) -> Any:
    """A function of formulas."""
    own = _OWN.get(function)
    return _by_mpmath(function, *arguments) if own is None else own(*arguments)


sqrt = Decimal.sqrt
sin, cos, exp = (partial(_by_mpmath, name) for name in ("sin", "cos", "exp"))


class Digits:
    """These numbers as scalars of a program or of the recursions."""

    def number(self, value: float) -> Decimal:
        """The double itself, exactly."""
        return number(value)

    def call(self, function: str, *arguments: Any) -> Any:
        """Any function of formulas."""
        return call(function, *arguments)

    def is_zero(self, value: Any) -> bool:
        """Whether it is 0 here."""
        return bool(value == 0)

    def named(self, value: Any, name: str) -> Any:
        """A number has no name."""
        return value
