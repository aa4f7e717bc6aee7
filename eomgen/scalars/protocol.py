"""What equations are computed over: floats, arrays, extended numbers, tape nodes, symbols, duals.

Formulas, recursions and programs are written once over an abstract scalar. They add, subtract,
multiply, divide and negate scalars with the operators of Python; all else they ask of `Scalars`.
"""

from typing import Any, Protocol

Scalar = Any
"""A float, an array, a number of more digits, a node of a tape, a SymPy expression, a dual."""


class Scalars(Protocol):
    """What computations need of scalars besides + - * / and unary minus."""

    def number(self, value: Any) -> Scalar:
        """The scalar that stands for a double, or is next to a number of more digits."""

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas (`scalars.functions.FUNCTIONS`)."""

    def is_zero(self, value: Scalar) -> bool:
        """Whether a scalar is known to be 0 whatever its inputs; of two ways that then agree the
        shorter one is taken.
        """
        return bool(value == 0)

    def named(self, value: Scalar, name: str) -> Scalar:
        """The same scalar; programs remember the name."""
        return value
