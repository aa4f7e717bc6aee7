"""Derivatives of formulas' functions, and of formulas by time, over any scalars."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eomgen.language.formula import Formula, Scalars, evaluate


def slope(
    function: str, value: Any, arguments: Sequence[Any], slopes: Sequence[Any], scalars: Scalars
) -> Any:
    """How a function of formulas changes where its arguments change by `slopes`.

    `value` is the function's own. Where it has a corner or a step, that of the piece it is on.
    """
    one, two = scalars.number(1.0), scalars.number(2.0)
    x, d = arguments, slopes
    match function:
        case "sin":
            return scalars.call("cos", x[0]) * d[0]
        case "cos":
            return -(scalars.call("sin", x[0]) * d[0])
        case "tan":
            return (one + value * value) * d[0]
        case "sqrt":
            return d[0] / (two * value)
        case "asin":
            return d[0] / scalars.call("sqrt", one - x[0] * x[0])
        case "acos":
            return -(d[0] / scalars.call("sqrt", one - x[0] * x[0]))
        case "atan":
            return d[0] / (one + x[0] * x[0])
        case "exp":
            return value * d[0]
        case "log":
            return d[0] / x[0]
        case "tanh":
            return (one - value * value) * d[0]
        case "abs":
            return scalars.call("select", x[0], d[0], -d[0])
        case "step":
            return scalars.number(0.0)
        case "atan2":
            return (x[1] * d[0] - x[0] * d[1]) / (x[1] * x[1] + x[0] * x[0])
        case "min":
            return scalars.call("select", x[1] - x[0], d[0], d[1])
        case "max":
            return scalars.call("select", x[0] - x[1], d[0], d[1])
        case "select":
            return scalars.call("select", x[0], d[1], d[2])
    raise AssertionError(f"no derivative is known for {function}")


@dataclass(frozen=True)
class _Dual:
    """A scalar and how fast it changes."""

    value: Any
    rate: Any

    def __add__(self, other: "_Dual") -> "_Dual":
        return _Dual(self.value + other.value, self.rate + other.rate)

    def __sub__(self, other: "_Dual") -> "_Dual":
        return _Dual(self.value - other.value, self.rate - other.rate)

    def __mul__(self, other: "_Dual") -> "_Dual":
        rate = self.rate * other.value + self.value * other.rate
        return _Dual(self.value * other.value, rate)

    def __truediv__(self, other: "_Dual") -> "_Dual":
        value = self.value / other.value
        return _Dual(value, (self.rate - value * other.rate) / other.value)

    def __neg__(self) -> "_Dual":
        return _Dual(-self.value, -self.rate)


class _Duals:
    """Such pairs as the scalars of formulas."""

    def __init__(self, scalars: Scalars) -> None:
        self._scalars = scalars

    def number(self, value: float) -> _Dual:
        """What does not change."""
        return self.still(self._scalars.number(value))

    def still(self, value: Any) -> _Dual:
        """A scalar that does not change."""
        return _Dual(value, self._scalars.number(0.0))

    def call(self, function: str, *arguments: _Dual) -> _Dual:
        """A function of formulas."""
        values = [argument.value for argument in arguments]
        rates = [argument.rate for argument in arguments]
        value = self._scalars.call(function, *values)
        return _Dual(value, slope(function, value, values, rates, self._scalars))


def with_rates(
    formula: Formula, names: Mapping[str, Any], time: Any, scalars: Scalars
) -> tuple[Any, Any, Any]:
    """A formula of `t` and of `names`, which do not change, with its first and second derivative
    by t, exactly; where it has corners (step, select, abs, min, max), those of its pieces.
    """
    once = _Duals(scalars)
    twice = _Duals(once)
    t = _Dual(_Dual(time, scalars.number(1.0)), once.number(1.0))
    still = {name: twice.still(once.still(value)) for name, value in names.items()}
    found = evaluate(formula, {**still, "t": t}, twice)
    return found.value.value, found.value.rate, found.rate.rate
