"""Taylor series of solutions by heyoka (Biscani, Izzo, Revisiting high-order Taylor methods for
astrodynamics and celestial mechanics, MNRAS 504 (2021), 2614), an extra of this program.

heyoka is given the program as its expressions, the fixed numbers as parameters at run time. It
compiles them once in a process for each order.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from eomgen.codegen.interface import Interface
from eomgen.errors import RunError
from eomgen.native.taylor import fixed_values, system_of
from eomgen.program.program import Program
from eomgen.program.tape import ARITHMETIC, FUNCTIONS, TIME
from eomgen.program.taylor import Recurrences
from eomgen.run.compiled import Array, Series

ABSENT = (
    "integrator: heyoka is not installed; run: pip install 'eomgen[heyoka]', or take --integrator "
    "taylor"
)


def heyoka_series(made: Callable[[int], Any], values: Array) -> Series:
    """The series by one of heyoka's integrators for each order, at given fixed numbers."""

    def series(t: float, y: Array, order: int) -> Array:
        integrator = made(order)
        integrator.time, integrator.state[:], integrator.pars[:] = t, y, values
        integrator.step(write_tc=True)
        return np.array(integrator.tc.T)

    return series


def integrators_of(program: Program, interface: Interface) -> Callable[[int], Any]:
    """A function that makes heyoka's integrator of a program for an order, or returns that made.

    Raises `RunError` if heyoka is not installed, or if the solutions have no Taylor series.
    """
    try:
        import heyoka
    except ImportError:
        raise RunError(ABSENT) from None
    names = [state.name for state in interface.states]
    system = system_of(program, interface)
    equations = _equations(heyoka, system, names)

    @cache
    def made(order: int) -> Any:
        # heyoka's order is ceil(1 - log(tol) / 2).
        tolerance = math.exp(3 - 2 * order)
        return heyoka.taylor_adaptive(
            equations, [0.0] * len(names), pars=[0.0] * len(system.fixed), tol=tolerance
        )

    return made


def parameter_values(program: Program, interface: Interface, module: Any, p: Any, u: Any) -> Array:
    """The fixed numbers of a module at given parameters and inputs, as heyoka's parameters."""
    return np.array(list(fixed_values(system_of(program, interface), module, p, u).values()))


def _equations(heyoka: Any, system: Recurrences, names: list[str]) -> list[tuple[Any, Any]]:
    """The equations of a system as pairs of a variable and the expression of its derivative."""
    variables = dict(zip(names, heyoka.make_vars(*names), strict=True))
    values = {i: heyoka.par[n] for n, i in enumerate(system.fixed)}
    values |= {i: heyoka.time if n == TIME else variables[n] for n, i in system.given.items()}
    for i in system.steps:
        operation, operands, _, _ = system.program.steps[i]
        parts = [values[o] for o in operands]
        if operation in FUNCTIONS:
            values[i] = getattr(heyoka, operation)(*parts)
        else:
            values[i] = -parts[0] if operation == "neg" else ARITHMETIC[operation](*parts)
    return [(variables[name], values[i]) for name, i in zip(names, system.rates, strict=True)]
