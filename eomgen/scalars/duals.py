"""Dual numbers: forward-mode differentiation of formulas."""

from dataclasses import dataclass
from typing import Any

from eomgen.scalars.functions import slope
from eomgen.scalars.protocol import Scalars


@dataclass(frozen=True)
class Dual:
    """A scalar and its derivative: a + b ε with ε² = 0."""

    value: Any
    rate: Any

    def __add__(self, other: "Dual") -> "Dual":
        return Dual(self.value + other.value, self.rate + other.rate)

    def __sub__(self, other: "Dual") -> "Dual":
        return Dual(self.value - other.value, self.rate - other.rate)

    def __mul__(self, other: "Dual") -> "Dual":
        rate = self.rate * other.value + self.value * other.rate
        return Dual(self.value * other.value, rate)

    def __truediv__(self, other: "Dual") -> "Dual":
        value = self.value / other.value
        return Dual(value, (self.rate - value * other.rate) / other.value)

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.rate)


class Duals(Scalars):
    """Dual numbers over other scalars."""

    def __init__(self, scalars: Scalars) -> None:
        self._scalars = scalars

    def number(self, value: float) -> Dual:
        """A constant."""
        return self.still(self._scalars.number(value))

    def still(self, value: Any) -> Dual:
        """A scalar with derivative 0."""
        return Dual(value, self._scalars.number(0.0))

    def is_zero(self, value: Dual) -> bool:
        """Whether value and derivative are known to be 0."""
        return self._scalars.is_zero(value.value) and self._scalars.is_zero(value.rate)

    def call(self, function: str, *arguments: Dual) -> Dual:
        """A function of formulas."""
        values = [argument.value for argument in arguments]
        rates = [argument.rate for argument in arguments]
        value = self._scalars.call(function, *values)
        return Dual(value, slope(function, value, values, rates, self._scalars))
