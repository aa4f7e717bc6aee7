"""Interval arithmetic: intervals that enclose the results of operations and functions.

A straight-line program run over intervals encloses all values that it computes for the times or
states in them (Moore, Kearfott, Cloud, Introduction to Interval Analysis, chapters 5 and 6). Bounds
are widened by a few units in the last place for rounding.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_WIDER = 4 * 2.0**-52


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from `low` to `high`; from -∞ to ∞ if nothing is known."""

    low: float
    high: float

    def __add__(self, other: "Interval | float") -> "Interval":
        a = _as_interval(other)
        return _hull(self.low + a.low, self.high + a.high)

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    def __sub__(self, other: "Interval | float") -> "Interval":
        return self + -_as_interval(other)

    def __rsub__(self, other: float) -> "Interval":
        return -self + other

    def __mul__(self, other: "Interval | float") -> "Interval":
        if other is self:
            size = _abs(self)
            return _hull(size.low * size.low, size.high * size.high)
        a = _as_interval(other)
        return _hull(*(x * y for x in (self.low, self.high) for y in (a.low, a.high)))

    def __truediv__(self, other: "Interval | float") -> "Interval":
        a = _as_interval(other)
        if a.low <= 0 <= a.high:
            return ANYTHING
        return _hull(*(x / y for x in (self.low, self.high) for y in (a.low, a.high)))

    def __rtruediv__(self, other: float) -> "Interval":
        return _as_interval(other) / self

    __radd__ = __add__
    __rmul__ = __mul__


ANYTHING = Interval(-math.inf, math.inf)


def _as_interval(value: "Interval | float") -> Interval:
    return value if isinstance(value, Interval) else Interval(value, value)


def _hull(*values: float) -> Interval:
    """The smallest interval that contains some numbers, widened for their rounding errors."""
    if any(map(math.isnan, values)):
        return ANYTHING
    low, high = min(values), max(values)
    return Interval(
        low - _WIDER * abs(low) if math.isfinite(low) else -math.inf,
        high + _WIDER * abs(high) if math.isfinite(high) else math.inf,
    )


def _growing(function: Callable[[float], float], low: float, high: float) -> Callable[..., Any]:
    """The interval version of a function that is increasing on its domain, `low` to `high`."""

    def applied(x: Interval | float) -> Interval:
        a = _as_interval(x)
        if a.high < low or a.low > high:
            return ANYTHING
        try:
            return _hull(function(max(a.low, low)), function(min(a.high, high)))
        except (ArithmeticError, ValueError):
            return ANYTHING

    return applied


def _minus_acos(a: float) -> float:
    return -math.acos(a)


def _exp(a: float) -> float:
    return math.exp(a) if a < 709 else math.inf


def _log(a: float) -> float:
    return math.log(a) if a > 0 else -math.inf


def _wave(peak: float, function: Callable[[float], float]) -> Callable[..., Any]:
    """The interval version of sine or cosine, with a maximum at `peak`."""

    def applied(x: Interval | float) -> Interval:
        a = _as_interval(x)
        if not (math.isfinite(a.low) and math.isfinite(a.high)):
            return Interval(-1.0, 1.0)
        ends = function(a.low), function(a.high)
        reach = _WIDER * (abs(a.low) + abs(a.high))

        def contains(x: float) -> bool:
            first = x + 2 * math.pi * math.ceil((a.low - reach - x) / (2 * math.pi))
            return first <= a.high + reach

        high = 1.0 if contains(peak) else max(ends)
        low = -1.0 if contains(peak + math.pi) else min(ends)
        return _hull(low, high)

    return applied


def _tan(x: Interval | float) -> Interval:
    a = _as_interval(x)
    if not a.high - a.low < math.pi or math.cos(a.low) * math.cos(a.high) <= 0:
        return ANYTHING
    if math.floor(a.low / math.pi + 0.5) != math.floor(a.high / math.pi + 0.5):
        return ANYTHING
    return _hull(math.tan(a.low), math.tan(a.high))


def _abs(x: Interval | float) -> Interval:
    a = _as_interval(x)
    if a.low <= 0 <= a.high:
        return Interval(0.0, max(-a.low, a.high))
    return a if a.low > 0 else -a


def _atan2(y: Interval | float, x: Interval | float) -> Interval:
    a, b = _as_interval(y), _as_interval(x)
    if b.low <= 0 and a.low <= 0 <= a.high:  # contains the origin or the branch cut
        return Interval(-math.pi, math.pi)
    return _hull(*(math.atan2(s, c) for s in (a.low, a.high) for c in (b.low, b.high)))


def _min(x: Interval | float, y: Interval | float) -> Interval:
    a, b = _as_interval(x), _as_interval(y)
    return Interval(min(a.low, b.low), min(a.high, b.high))


def _step(x: Interval | float) -> Interval:
    a = _as_interval(x)
    return Interval(float(a.low > 0), float(a.high > 0))


def _select(c: Interval | float, x: Interval | float, y: Interval | float) -> Interval:
    condition, a, b = _as_interval(c), _as_interval(x), _as_interval(y)
    if condition.low > 0:
        return a
    if condition.high <= 0:
        return b
    return Interval(min(a.low, b.low), max(a.high, b.high))


BY_INTERVALS: dict[str, Callable[..., Interval]] = {
    "sin": _wave(math.pi / 2, math.sin),
    "cos": _wave(0.0, math.cos),
    "tan": _tan,
    "asin": _growing(math.asin, -1.0, 1.0),
    "acos": lambda x: -_growing(_minus_acos, -1.0, 1.0)(x),
    "atan": _growing(math.atan, -math.inf, math.inf),
    "exp": _growing(_exp, -math.inf, math.inf),
    "log": _growing(_log, 0.0, math.inf),
    "tanh": _growing(math.tanh, -math.inf, math.inf),
    "sqrt": _growing(math.sqrt, 0.0, math.inf),
    "abs": _abs,
    "atan2": _atan2,
    "min": _min,
    "max": lambda x, y: -_min(-_as_interval(x), -_as_interval(y)),
    "step": _step,
    "select": _select,
}
"""Interval versions of the functions of formulas, by name."""
