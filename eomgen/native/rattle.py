"""Whole steps of RATTLE in compiled code, with the bits of the same steps in Python.

The step itself lies in a library of implicit methods, which calls the functions of the scene.
"""

import ctypes
from collections.abc import Mapping
from functools import partial
from typing import Any

from eomgen.engine.few import plain_factors
from eomgen.native import checked, equal_steps
from eomgen.native.implicit import System, solver
from eomgen.native.module import Kernels
from eomgen.run.compiled import EqualSteps
from eomgen.run.integrators.rattle import linked, sizes_of
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS

NEEDED = ("derivative", "mass_matrix", "kinetic_slopes", "constraint_jacobian", *PROJECTS)
"""The functions that a step calls."""
DERIVATIVES = 2
"""Derivatives in a step of RATTLE."""


def steps(
    name: str,
    problem: Problem,
    module: Any,
    methods: ctypes.CDLL,
    libraries: Mapping[str, ctypes.CDLL],
    p: Any,
    u: Any,
) -> EqualSteps | None:
    """The steps of a method, leapfrog or one composed of it, for a problem of a module at given
    parameters and inputs; None if there are none for these.
    """
    functions = checked.functions(module, {name: libraries[name] for name in NEEDED}, p)
    inputs = Kernels(module, libraries["derivative"]).given(u)
    if len(functions) < len(NEEDED) or inputs is None:
        return None
    n, rows = sizes_of(problem)
    system = System(inputs=inputs.ctypes.data, states=len(problem.states), positions=n)
    room, factors = linked(n, rows), [plain_factors(k) for k in (n, n, rows)]
    given = solver(system, functions, (n, n, rows), room=room, factors=factors)
    given.libraries = libraries, inputs
    call = methods.steps
    count = DERIVATIVES * equal_steps.LEAPFROGS[name]
    return EqualSteps(partial(equal_steps.made, call, given, inputs, functions, ()), count)
