"""Floats as scalars, and NumPy arrays of them for many states at once."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eomgen.scalars.exact import Real
from eomgen.scalars.functions import BY_MATH, FUNCTIONS
from eomgen.scalars.protocol import Scalar, Scalars

BY_NUMPY: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in FUNCTIONS if hasattr(np, name)},
    **{f"a{name}": getattr(np, f"arc{name}") for name in ("sin", "cos", "tan", "tan2")},
    "step": lambda x: np.where(x > 0.0, 1.0, 0.0),
    "min": np.minimum,
    "max": np.maximum,
    "select": lambda c, a, b: np.where(c > 0.0, a, b),
}


class FloatScalars(Scalars):
    """Plain floats, by `math`."""

    def number(self, value: Real) -> float:
        """The nearest double."""
        return float(value)

    def call(self, function: str, *arguments: float) -> float:
        """A function of formulas."""
        return float(BY_MATH[function](*arguments))


class ArrayScalars(Scalars):
    """Floats or arrays (n,) of them, of one length n, by NumPy."""

    def number(self, value: Real) -> float:
        """The nearest double, the same in all entries."""
        return float(value)

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas, entry by entry."""
        return BY_NUMPY[function](*arguments)

    def is_zero(self, value: Scalar) -> bool:
        """Whether all entries are 0."""
        return value == 0.0 if isinstance(value, float) else not np.any(value)
