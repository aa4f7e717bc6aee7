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

from eomgen.run.problem import Floats
from eomgen.scalars.extended import BY_MPFR
from eomgen.scalars.functions import CORNERS

BITS = 113
"""Of the significand: unit roundoff 2^-113 = 1e-34."""
Long = Any
"""A number of `BITS` bits, an `mpfr`, which has no type of its own for type checkers."""


def digits(bits: int = BITS) -> Any:
    """A `with` block in which long numbers have this many bits; what has no value is nan there."""
    return gmpy2.context(precision=bits)


class Watch:
    """Which way each corner of a derivative goes, in the order of its steps.

    On one side of its corners a derivative is smooth, and goes on smoothly beyond them while its
    ways are held. So `ways` stay as they are until someone turns them; what is not there yet is
    decided by the next evaluation. `margins` tells how far each was from turning in the last
    evaluation: a way is right where it is True and its margin > 0, or False and < 0.
    """

    def __init__(self) -> None:
        self.ways: list[bool] = []
        self.margins: list[Long] = []

    def _goes(self, margin: Long) -> bool:
        if len(self.margins) == len(self.ways):
            self.ways.append(bool(margin > 0))
        self.margins.append(margin)
        return self.ways[len(self.margins) - 1]

    def functions(self) -> dict[str, Callable[..., Long]]:
        """The functions that have corners, going the ways that are held."""
        goes = self._goes
        one, zero = mpfr(1), mpfr(0)
        return {
            "abs": lambda x: x if goes(x) else -x,
            "step": lambda x: one if goes(x) else zero,
            "min": lambda a, b: b if goes(a - b) else a,
            "max": lambda a, b: a if goes(a - b) else b,
            "select": lambda c, a, b: a if goes(c) else b,
            # max(x, 0) held beyond 0 is negative: its root is to have a value there.
            "sqrt": lambda x: gmpy2.sqrt(abs(x)),
        }


@dataclass(frozen=True, eq=False)
class Precise:
    """y' = f(t, y) in long numbers, to be used within `digits()`.

    derivative  f(t, y), ny long numbers; t and y long
    initial     (ny,), the initial state of doubles
    watch       holds the ways that corners go; None where there are none
    """

    derivative: Callable[[Long, Sequence[Long]], Sequence[Long]]
    initial: tuple[Long, ...]
    watch: Watch | None


def precise(
    module: Any,
    parameters: Any,
    inputs: Any,
    initial: Floats,
    *,
    watched: bool = False,
    bits: int = BITS,
) -> Precise:
    """A generated module's derivative over long numbers, at given parameters and inputs.

    parameters, inputs  as `module.derivative` takes them; they must be valid there
    initial             the initial state of doubles, (ny,)
    watched             hold the ways that corners go, if there are any
    bits                of what depends on parameters alone
    """
    names = inspect.signature(module._derivative).parameters
    watch = Watch() if watched and any(name in names for name in CORNERS) else None
    with digits(bits):
        functions = {**BY_MPFR, **(watch.functions() if watch else {})}
        constants = constants_of(module, parameters)["derivative"]
        u = _long(inputs, module.INPUTS)
        start = tuple(map(mpfr, initial.tolist()))
        kernel = _over(module._derivative, functions)
    called = {name: functions[name] for name in names if name in functions}
    timed = "t" in names

    def derivative(t: Long, y: Sequence[Long]) -> Sequence[Long]:
        if watch:
            watch.margins = []
        time = {"t": t} if timed else {}
        return cast(Sequence[Long], kernel(y, constants, u, **time, **called))

    return Precise(derivative, start, watch)


def constants_of(module: Any, parameters: Any) -> Mapping[str, tuple[Long, ...]]:
    """What each function of a module takes that depends on parameters alone, in long numbers; to be
    used within `digits()`.
    """
    given = _long(parameters, module.PARAMETERS)
    return cast(Mapping[str, tuple[Long, ...]], _over(module._fixed, BY_MPFR)(*given))


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
