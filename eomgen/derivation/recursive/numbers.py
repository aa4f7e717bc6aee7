"""Plain floats as scalars of the recursions."""

from eomgen.derivation.recursive.vectors import Scalar
from eomgen.language.formula import BY_MATH


class FloatScalars:
    """What `Scalars` asks for, by `math`."""

    def number(self, value: float) -> float:
        """The value itself."""
        return value

    def call(self, function: str, *arguments: float) -> float:
        """A function of formulas."""
        return float(BY_MATH[function](*arguments))

    def is_zero(self, value: Scalar) -> bool:
        """Whether it is 0 here; then the shorter of two ways that agree is taken."""
        return bool(value == 0.0)

    def named(self, value: Scalar, name: str) -> Scalar:
        """A float has no name."""
        return value
