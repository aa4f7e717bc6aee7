"""A module's derivative in more digits than a double has: the same steps over longer numbers.

The numbers are MPFR's, correctly rounded, of as many bits as IEEE 754's quadruple precision: 34
decimal digits. Parameters, inputs and the initial state enter as the doubles they are; all that is
computed from them, what depends on parameters alone included, is computed in long numbers.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import FunctionType
from typing import Any

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
    "abs": lambda x: abs(mpfr(x)),
    "step": lambda x: mpfr(1 if x > 0 else 0),
    "min": lambda a, b: mpfr(min(a, b)),
    "max": lambda a, b: mpfr(max(a, b)),
    "select": lambda c, a, b: mpfr(a if c > 0 else b),
}
"""What generated code may call. Each gives a long number, even where it only passes on a constant:
two floats that met would be rounded to a float."""


@dataclass(frozen=True, eq=False)
class Precise:
    """y' = f(t, y) in long numbers, to be used within `digits()`.

    derivative  f(t, y), a list of ny long numbers; t and y long
    initial     (ny), the initial state of doubles
    """

    derivative: Callable[[Long, Sequence[Long]], list[Long]]
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
        values = _long(parameters, module.PARAMETERS)
        # The module keeps constants by value, and a long 1 is equal to a double 1: go round that.
        fixed = _over(module._constants.__wrapped__, functions)(values)["derivative"]
        constants = tuple(map(mpfr, fixed))
        u = _long(inputs, module.INPUTS)
        kernel = module._derivative
        arguments = inspect.signature(kernel).parameters
        call = partial(kernel, **{f: functions[f] for f in arguments if f in functions})
        timed = "t" in arguments
        start = tuple(map(mpfr, initial.tolist()))

    def derivative(t: Long, y: Sequence[Long]) -> list[Long]:
        slopes = call(y, constants, u, t=t) if timed else call(y, constants, u)
        return [mpfr(slope) for slope in slopes]

    return Precise(derivative, start)


def _over(function: Any, functions: Mapping[str, Callable[..., Long]]) -> Any:
    """A function of a generated module with other functions in the place of `math`'s."""
    return FunctionType(function.__code__, {**function.__globals__, **functions})


def _long(given: Any, defaults: Mapping[str, float]) -> tuple[Long, ...]:
    """Values by name, in order, or None for the defaults, as long numbers."""
    if given is None:
        values = list(defaults.values())
    elif hasattr(given, "keys"):
        values = [given.get(name, default) for name, default in defaults.items()]
    else:
        values = list(given)
    return tuple(mpfr(float(value)) for value in values)
