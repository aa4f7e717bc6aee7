"""A program's derivative in more digits than a double has: the same steps over longer numbers.

The numbers are MPFR's, correctly rounded, of as many bits as IEEE 754's quadruple precision: 34
decimal digits. Parameters, inputs and the initial state enter as the doubles they are; all that is
computed from them, what depends on parameters alone included, is computed in extended precision.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gmpy2
from gmpy2 import mpfr

from eomgen.program.kernel import kernel
from eomgen.program.program import Program
from eomgen.program.tape import TIME
from eomgen.run.problem import FloatArray
from eomgen.scalars.extended import BY_MPFR, Bits
from eomgen.scalars.functions import CORNERS

BITS = 113
"""Of the significand: unit roundoff 2^-113 = 1e-34."""
Extended = Any
"""A number of `BITS` bits, an `mpfr`, which has no type of its own for type checkers."""


def digits(bits: int = BITS) -> Any:
    """A `with` block in which extended numbers have this many bits; what has no value is nan
    there.
    """
    return gmpy2.context(precision=bits)


class CornerBranches:
    """The branch that each corner of a derivative takes, in the order of its steps.

    A derivative is smooth on one side of its corners. It goes on smoothly beyond them while its
    branches are held. So `branches` stay as they are until someone changes them. The next
    evaluation decides those that are not there yet. `margins` says how far each corner was from
    changing its branch in the last evaluation. A branch agrees with its margin if it is True and
    the margin is > 0, or False and < 0.
    """

    def __init__(self) -> None:
        self.branches: list[bool] = []
        self.margins: list[Extended] = []

    def _branch(self, margin: Extended) -> bool:
        if len(self.margins) == len(self.branches):
            self.branches.append(bool(margin > 0))
        self.margins.append(margin)
        return self.branches[len(self.margins) - 1]

    def functions(self) -> dict[str, Callable[..., Extended]]:
        """The functions that have corners, on the branches that are held."""
        branch = self._branch
        one, zero = mpfr(1), mpfr(0)
        return {
            "abs": lambda x: x if branch(x) else -x,
            "step": lambda x: one if branch(x) else zero,
            "min": lambda a, b: b if branch(a - b) else a,
            "max": lambda a, b: a if branch(a - b) else b,
            "select": lambda c, a, b: a if branch(c) else b,
            # max(x, 0) held beyond 0 is negative: its root is to have a value there.
            "sqrt": lambda x: gmpy2.sqrt(abs(x)),
        }


@dataclass(frozen=True, eq=False)
class Precise:
    """y' = f(t, y) in extended precision, to be used within `digits()`.

    derivative  f(t, y), ny extended numbers; t and y extended
    initial     (ny,), the initial state of doubles
    corner_branches
                the branch that each corner takes; None where there are none
    """

    derivative: Callable[[Extended, Sequence[Extended]], Sequence[Extended]]
    initial: tuple[Extended, ...]
    corner_branches: CornerBranches | None


def precise(
    program: Program,
    module: Any,
    parameters: Any,
    inputs: Any,
    initial: FloatArray,
    *,
    watched: bool = False,
    bits: int = BITS,
) -> Precise:
    """A program's derivative in extended precision, at given parameters and inputs.

    module              what was generated of the program; it tells names, order and defaults
    parameters, inputs  as `module.derivative` takes them; they must be valid there
    initial             the initial state of doubles, (ny,)
    watched             hold the ways that corners go, if there are any
    bits                of what depends on parameters alone
    """
    found = kernel(program, "derivative")
    corners = any(name in found.functions for name in CORNERS)
    corner_branches = CornerBranches() if watched and corners else None
    functions = {**BY_MPFR, **(corner_branches.functions() if corner_branches else {})}
    called = [functions[name] for name in found.functions]
    with digits(bits):
        known = found.known_values(_extended(parameters, module.PARAMETERS), Bits())
        fixed = _extended(inputs, module.INPUTS)
        start = tuple(map(mpfr, initial.tolist()))
    places = {name: i for i, name in enumerate(module.STATES)}

    def derivative(t: Extended, y: Sequence[Extended]) -> Sequence[Extended]:
        if corner_branches:
            corner_branches.margins = []
        return found.moving(known, [take(t, y) for take in taken], called)

    taken = [_taken(name, places, fixed) for name in found.inputs]
    return Precise(derivative, start, corner_branches)


def _taken(
    name: str, places: Mapping[str, int], fixed: Mapping[str, Extended]
) -> Callable[[Extended, Sequence[Extended]], Extended]:
    """What finds an input of the program at a time and a state."""
    if name in places:
        place = places[name]
        return lambda t, y: y[place]
    if name in fixed:
        value = fixed[name]
        return lambda t, y: value
    assert name == TIME, name
    return lambda t, y: t


def exact_parameters(module: Any, parameters: Any) -> dict[str, Extended]:
    """Parameters as a module takes them, by name, as extended numbers; to be used within
    `digits()`.
    """
    return _extended(parameters, module.PARAMETERS)


def _extended(given: Any, defaults: Mapping[str, float]) -> dict[str, Extended]:
    """Values by name, in order, or None for the defaults, as extended numbers by name."""
    if given is None:
        values = dict(defaults)
    elif hasattr(given, "keys"):
        values = {name: given.get(name, default) for name, default in defaults.items()}
    else:
        values = dict(zip(defaults, given, strict=True))
    return {name: mpfr(value) for name, value in values.items()}
