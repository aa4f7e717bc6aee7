"""Rational numbers as scalars, by their residues modulo a large prime.

What is computed of random numbers is 0 where it is 0 for all numbers, and elsewhere with a
probability of about 1 / `PRIME` times its degree (Schwartz and Zippel). So ranks are those over the
rational functions, while numbers stay as long as the prime is.
"""

from fractions import Fraction
from math import isqrt
from random import Random
from typing import Any

from eomgen.scalars.protocol import Scalars

PRIME = 2**521 - 1
"""A Mersenne prime: fractions of numbers of up to 260 bits are known by their residues."""


class Residue:
    """A residue, with + - * / and unary minus."""

    __slots__ = ("n",)

    def __init__(self, n: int) -> None:
        self.n = n % PRIME

    def __add__(self, other: "Residue") -> "Residue":
        return Residue(self.n + other.n)

    def __sub__(self, other: "Residue") -> "Residue":
        return Residue(self.n - other.n)

    def __mul__(self, other: "Residue") -> "Residue":
        return Residue(self.n * other.n)

    def __truediv__(self, other: "Residue") -> "Residue":
        if not other.n:
            raise ZeroDivisionError("a residue is divided by 0")
        return Residue(self.n * pow(other.n, -1, PRIME))

    def __neg__(self) -> "Residue":
        return Residue(-self.n)

    def __eq__(self, other: object) -> bool:
        return self.n == (other.n if isinstance(other, Residue) else other)

    def __hash__(self) -> int:
        return hash(self.n)

    def __bool__(self) -> bool:
        return bool(self.n)

    def fraction(self) -> Fraction | None:
        """The fraction whose residue this is, if numerator and denominator are short: Wang, Guy and
        Davenport, P-adic reconstruction of rational numbers, 1982.
        """
        bound = isqrt(PRIME // 2)
        a, b, x, y = PRIME, self.n, 0, 1
        while b > bound:
            quotient = a // b
            a, b, x, y = b, a - quotient * b, y, x - quotient * y
        return Fraction(b, y) if abs(y) <= bound else None


class Residues(Scalars):
    """Residues as scalars. An angle has a random point of the unit circle, always the same one, as
    its cosine and sine: its multiples and sums are other angles, which have nothing to do with it.

    Other functions raise `ArithmeticError`.
    """

    def number(self, value: Any) -> Residue:
        """A double, or a number of more digits, exactly."""
        top, bottom = value.as_integer_ratio()
        return Residue(int(top)) / Residue(int(bottom))

    def call(self, function: str, *arguments: Residue) -> Residue:
        """The cosine or sine of an angle; 0 has those of 0."""
        if function not in ("cos", "sin"):
            raise ArithmeticError(f"{function} has no residue")
        (angle,) = arguments
        half = Residue(Random(angle.n).randrange(PRIME) if angle else 0)
        one, square = Residue(1), half * half
        return (half + half if function == "sin" else one - square) / (one + square)
