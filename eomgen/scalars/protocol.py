"""The protocol of scalars: floats, arrays, extended precision, tape nodes, symbols, dual numbers.

Formulas, recursions and programs are written once, over an abstract scalar. They add, subtract,
multiply, divide and negate scalars with Python's operators. `Scalars` provides everything else.
"""

from typing import Any, Protocol

Scalar = Any
"""A float, an array, an extended-precision number, a tape node, a SymPy expression, a dual."""


class Scalars(Protocol):
    """What computations need besides + - * / and unary minus."""

    def number(self, value: Any) -> Scalar:
        """The scalar of a double; of a number with more digits, the nearest scalar."""

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas (`scalars.functions.FUNCTIONS`)."""

    def is_zero(self, value: Scalar) -> bool:
        """Whether a scalar is known to be 0 for all inputs. Computations then omit its terms."""
        return bool(value == 0)

    def named(self, value: Scalar, name: str) -> Scalar:
        """The same scalar; a program records the name."""
        return value
