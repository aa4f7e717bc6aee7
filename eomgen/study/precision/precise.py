"""A program's derivative in extended precision: the same operations on longer numbers.

The numbers are MPFR's, correctly rounded, with the significand of IEEE 754 quadruple precision: 34
decimal digits. Parameters, inputs and the initial state are doubles; all that is computed from them
is extended, including the constants that depend on parameters alone.
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
"""Bits of the significand: unit roundoff 2^-113 = 1e-34."""
Extended = Any
"""A number of `BITS` bits, an `mpfr`, for which there are no type stubs."""


def digits(bits: int = BITS) -> Any:
    """A `with` block where extended numbers have this many bits, and undefined values are nan."""
    return gmpy2.context(precision=bits)


class CornerBranches:
    """The branch that a derivative takes at each of its corners, in the order of its operations.

    With fixed branches a derivative is smooth beyond its corners, too. So `branches` change only if
    the user changes them; the next evaluation adds those that are missing. `margins` are the
    arguments of the corners in the last evaluation: a branch agrees with its margin if it is True
    and the margin is > 0, or False and < 0.
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
        """The functions that have corners, on the fixed branches."""
        branch = self._branch
        one, zero = mpfr(1), mpfr(0)
        return {
            "abs": lambda x: x if branch(x) else -x,
            "step": lambda x: one if branch(x) else zero,
            "min": lambda a, b: b if branch(a - b) else a,
            "max": lambda a, b: a if branch(a - b) else b,
            "select": lambda c, a, b: a if branch(c) else b,
            # On a fixed branch max(x, 0) may be negative; its root must still have a value.
            "sqrt": lambda x: gmpy2.sqrt(abs(x)),
        }


@dataclass(frozen=True, eq=False)
class Precise:
    """y' = f(t, y) in extended precision, to be used within `digits()`.

    derivative  f(t, y), ny extended numbers; t and y extended
    initial     (ny,), the initial state of doubles
    corner_branches
                the branch at each corner; None if there are no corners or they are not fixed
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
    fix_branches: bool = False,
    bits: int = BITS,
) -> Precise:
    """A program's derivative in extended precision, at given parameters and inputs.

    module              the module generated from the program; gives names, order and defaults
    parameters, inputs  as `module.derivative` takes them; they must be valid
    initial             the initial state in doubles, (ny,)
    fix_branches        whether to fix the branches at corners, if there are any
    bits                bits of the constants that depend on parameters alone
    """
    found = kernel(program, "derivative")
    corners = any(name in found.functions for name in CORNERS)
    corner_branches = CornerBranches() if fix_branches and corners else None
    functions = {**BY_MPFR, **(corner_branches.functions() if corner_branches else {})}
    called = [functions[name] for name in found.functions]
    with digits(bits):
        known = found.known_values(_extended(parameters, module.PARAMETERS), Bits())
        fixed = _extended(inputs, module.INPUTS)
        start = tuple(map(mpfr, initial.tolist()))
    indices = {name: i for i, name in enumerate(module.STATES)}

    def derivative(t: Extended, y: Sequence[Extended]) -> Sequence[Extended]:
        if corner_branches:
            corner_branches.margins = []
        return found.moving(known, [value(t, y) for value in values], called)

    values = [_input(name, indices, fixed) for name in found.inputs]
    return Precise(derivative, start, corner_branches)


def _input(
    name: str, indices: Mapping[str, int], fixed: Mapping[str, Extended]
) -> Callable[[Extended, Sequence[Extended]], Extended]:
    """The function of t and y that gives the value of an input of the program."""
    if name in indices:
        index = indices[name]
        return lambda t, y: y[index]
    if name in fixed:
        value = fixed[name]
        return lambda t, y: value
    assert name == TIME, name
    return lambda t, y: t


def exact_parameters(module: Any, parameters: Any) -> dict[str, Extended]:
    """A module's parameters as extended numbers, by name; to be called within `digits()`."""
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
