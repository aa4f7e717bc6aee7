"""A module's derivative in more digits than a double has: the same steps over longer numbers.

The numbers are MPFR's, correctly rounded, of as many bits as IEEE 754's quadruple precision: 34
decimal digits. Parameters, inputs and the initial state enter as the doubles they are; all that is
computed from them, what depends on parameters alone included, is computed in long numbers.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import Any, cast

import gmpy2
from gmpy2 import mpfr

from eomgen.language.formula import FUNCTIONS as FORMULA_FUNCTIONS
from eomgen.run.problem import Floats

BITS = 113
"""Of the significand: unit roundoff 2^-113 = 1e-34."""
Long = Any
"""A number of `BITS` bits, an `mpfr`, which has no type of its own for type checkers."""


def digits(bits: int = BITS) -> Any:
    """A `with` block in which long numbers have this many bits.

    There, as with floats, a number without a value raises `ArithmeticError`.
    """
    return gmpy2.context(precision=bits, trap_invalid=True, trap_divzero=True)


FUNCTIONS: dict[str, Callable[..., Long]] = {
    **{name: getattr(gmpy2, name) for name in FORMULA_FUNCTIONS if hasattr(gmpy2, name)},
    "abs": abs,
    "step": lambda x: mpfr(x > 0),
    "min": min,
    "max": max,
    "select": lambda c, a, b: a if c > 0 else b,
}
"""What generated code may call."""


@dataclass(frozen=True, eq=False)
class Precise:
    """y' = f(t, y) in long numbers, to be used within `digits()`.

    derivative  f(t, y), ny long numbers; t and y long
    initial     (ny,), the initial state of doubles
    """

    derivative: Callable[[Long, Sequence[Long]], Sequence[Long]]
    initial: tuple[Long, ...]


def precise(
    module: Any,
    parameters: Any,
    inputs: Any,
    initial: Floats,
    functions: Mapping[str, Callable[..., Long]] = FUNCTIONS,
) -> Precise:
    """A generated module's derivative over long numbers, at given parameters and inputs.

    parameters, inputs  as `module.derivative` takes them; they must be valid there
    initial             the initial state of doubles, (ny,)
    functions           what the module's functions are to be
    """
    with digits():
        # The module keeps constants by value, and a long 1 is equal to a double 1: go round that.
        constants = _over(module._constants.__wrapped__, functions)(
            _long(parameters, module.PARAMETERS)
        )["derivative"]
        u = _long(inputs, module.INPUTS)
        start = tuple(map(mpfr, initial.tolist()))
        kernel = _over(module._derivative, functions)
    names = inspect.signature(kernel).parameters
    called = {name: functions[name] for name in names if name in functions}
    timed = "t" in names

    def derivative(t: Long, y: Sequence[Long]) -> Sequence[Long]:
        time = {"t": t} if timed else {}
        return cast(Sequence[Long], kernel(y, constants, u, **time, **called))

    return Precise(derivative, start)


def _over(function: Any, functions: Mapping[str, Callable[..., Long]]) -> Any:
    """A function of a generated module over long numbers: its steps, with its numbers as long ones
    and other functions in the place of `math`'s.

    Where numbers remained doubles, two of them that meet would be rounded to a double.
    """
    code = function.__code__
    numbers = tuple(mpfr(c) if isinstance(c, float) else c for c in code.co_consts)
    return FunctionType(
        code.replace(co_consts=numbers),
        {**function.__globals__, **functions},
        argdefs=function.__defaults__,
    )


def _long(given: Any, defaults: Mapping[str, float]) -> tuple[Long, ...]:
    """Values by name, in order, or None for the defaults, as long numbers."""
    if given is None:
        values = list(defaults.values())
    elif hasattr(given, "keys"):
        values = [given.get(name, default) for name, default in defaults.items()]
    else:
        values = list(given)
    return tuple(mpfr(value) for value in values)
