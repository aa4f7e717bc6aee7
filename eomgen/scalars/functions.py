"""The functions of formulas and programs: their names, arguments, values and derivatives."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from eomgen.scalars.protocol import Scalars

FUNCTIONS = {
    **dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "tanh"), 1),
    **dict.fromkeys(("sqrt", "abs", "step"), 1),
    **dict.fromkeys(("atan2", "min", "max"), 2),
    "select": 3,
}
"""Functions of a formula, with how many arguments each takes.

`step(x)` is 1 where x > 0 and else 0; `select(c, a, b)` is a where c > 0 and else b, which is also
what comparisons and `a if x < y else b` become. Both a and b are computed, so both must have a
value: write sqrt(max(x, 0)), not sqrt(x) if x > 0 else 0.
"""
CORNERS = ("abs", "max", "min", "select", "step")
"""Functions with a corner or a jump, where they change to another branch."""
BY_MATH: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    "abs": math.fabs,
    "step": lambda x: 1.0 if x > 0.0 else 0.0,
    "min": min,
    "max": max,
    "select": lambda c, a, b: a if c > 0.0 else b,
}
"""The functions of floats."""


def slope(
    function: str, value: Any, arguments: Sequence[Any], slopes: Sequence[Any], scalars: Scalars
) -> Any:
    """The directional derivative of a function, for the derivatives `slopes` of its arguments.

    `value` is the function's value. At a corner or a jump it is the derivative of the branch taken.
    """
    x, d, number = arguments, slopes, scalars.number
    match function:
        case "sin":
            return scalars.call("cos", x[0]) * d[0]
        case "cos":
            return -(scalars.call("sin", x[0]) * d[0])
        case "tan":
            return (number(1.0) + value * value) * d[0]
        case "sqrt":
            return d[0] / (number(2.0) * value)
        case "asin":
            return d[0] / scalars.call("sqrt", number(1.0) - x[0] * x[0])
        case "acos":
            return -(d[0] / scalars.call("sqrt", number(1.0) - x[0] * x[0]))
        case "atan":
            return d[0] / (number(1.0) + x[0] * x[0])
        case "exp":
            return value * d[0]
        case "log":
            return d[0] / x[0]
        case "tanh":
            return (number(1.0) - value * value) * d[0]
        case "abs":
            return scalars.call("select", x[0], d[0], -d[0])
        case "step":
            return number(0.0)
        case "atan2":
            return (x[1] * d[0] - x[0] * d[1]) / (x[1] * x[1] + x[0] * x[0])
        case "min":
            return scalars.call("select", x[1] - x[0], d[0], d[1])
        case "max":
            return scalars.call("select", x[0] - x[1], d[0], d[1])
        case "select":
            return scalars.call("select", x[0], d[1], d[2])
    raise AssertionError(f"no derivative is known for {function}")
