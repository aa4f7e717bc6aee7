"""Extended precision as scalars of formulas, recursions and programs: mpmath's and MPFR's
numbers.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import gmpy2
import mpmath
import numpy as np
from gmpy2 import mpfr

from eomgen.scalars.exact import Real
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scalars.protocol import Scalars

DIGITS = 60
MP = mpmath.MPContext()
"""The context of mpmath's numbers: they have `DIGITS` digits everywhere."""
MP.dps = DIGITS


def _functions(library: Any, number: Callable[[bool], Any]) -> dict[str, Callable[..., Any]]:
    return {
        **{name: getattr(library, name) for name in FUNCTIONS if hasattr(library, name)},
        "abs": abs,
        "step": lambda x: number(x > 0),
        "min": min,
        "max": max,
        "select": lambda c, a, b: a if c > 0 else b,
    }


_BY_MPMATH = _functions(MP, MP.mpf)
BY_MPFR = _functions(gmpy2, mpfr)
"""The functions of formulas for MPFR's numbers, in the precision of gmpy2's context."""


class Digits(Scalars):
    """60-digit numbers as scalars."""

    def number(self, value: Real) -> Any:
        """A double exactly; the nearest number to one of more digits."""
        if isinstance(value, float | int):
            return MP.mpf(value)
        with sixty_digits():
            return MP.mpf(tuple(map(int, mpfr(value).as_mantissa_exp())))

    def call(self, function: str, *arguments: Any) -> Any:
        """Any function of formulas."""
        return _BY_MPMATH[function](*arguments)


def exact(values: Any) -> Any:
    """Doubles, one or an array of them, exactly as 60-digit numbers."""
    array = np.asarray(values)
    return np.array([MP.mpf(x) for x in array.ravel()], dtype=object).reshape(array.shape)


class Bits(Scalars):
    """MPFR's numbers as scalars, in the precision of gmpy2's context. They add and multiply ten
    times as fast as mpmath's.
    """

    def number(self, value: Real) -> Any:
        """A double exactly, in any context; the nearest number to one of more digits."""
        return mpfr(value, 53) if isinstance(value, float) else mpfr(value)

    def call(self, function: str, *arguments: Any) -> Any:
        """A function of formulas."""
        return BY_MPFR[function](*arguments)


@contextmanager
def sixty_digits() -> Iterator[None]:
    """A context in which MPFR's numbers have `DIGITS` digits, and undefined values raise
    `ArithmeticError`.
    """
    with gmpy2.context(precision=MP.prec, trap_divzero=True, trap_invalid=True):
        yield


def out_of_bits(numbers: Iterable[Any]) -> list[Any]:
    """MPFR's numbers exactly as mpmath's."""
    return [MP.mpf(tuple(map(int, x.as_mantissa_exp()))) for x in numbers]
