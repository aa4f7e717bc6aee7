"""Numbers of many digits as scalars of formulas, recursions and programs."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from eomgen.language.formula import FUNCTIONS

DIGITS = 60
MP = mpmath.MPContext()
"""Numbers of this context work in `DIGITS` digits, wherever they are."""
MP.dps = DIGITS

_ONE_BY_ONE: dict[str, Callable[..., Any]] = {
    **{name: getattr(MP, name) for name in FUNCTIONS if hasattr(MP, name)},
    "abs": abs,
    "step": lambda x: MP.mpf(x > 0),
    "min": min,
    "max": max,
    "select": lambda c, a, b: a if c > 0 else b,
}
_CALLED = {name: np.frompyfunc(f, FUNCTIONS[name], 1) for name, f in _ONE_BY_ONE.items()}
"""The functions of formulas, of numbers and of arrays of them."""


class Digits:
    """60-digit numbers, or arrays of them, as scalars."""

    def number(self, value: float) -> Any:
        """The double itself, exactly."""
        return MP.mpf(value)

    def call(self, function: str, *arguments: Any) -> Any:
        """Any function of formulas."""
        return _CALLED[function](*arguments)

    def is_zero(self, value: Any) -> bool:
        """Whether it is 0 here, everywhere in an array."""
        return bool(np.all(value == 0))

    def named(self, value: Any, name: str) -> Any:
        """A number has no name."""
        return value


def exact(values: Any) -> Any:
    """Doubles, one or an array of them, as 60-digit numbers: exactly the same."""
    array = np.asarray(values)
    return np.array([MP.mpf(x) for x in array.ravel()], dtype=object).reshape(array.shape)
