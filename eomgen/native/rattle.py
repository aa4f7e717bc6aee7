"""Whole steps of RATTLE in compiled code, with the bits of the same steps in Python.

The step itself lies in the library of implicit methods, which calls the functions of the scene.
"""

import ctypes
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from eomgen.native import checked, equal_steps
from eomgen.native.checked import FunctionStructure
from eomgen.native.implicit import METHODS_LIBRARY, Iteration, System
from eomgen.native.module import Kernels
from eomgen.run.compiled import EqualSteps
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS

NEEDED = ("derivative", "mass_matrix", "kinetic_slopes", "constraint_jacobian", *PROJECTS)
"""The functions that a step calls."""
DERIVATIVES = 2
"""Derivatives in a step of RATTLE."""


class _Iteration(ctypes.Structure):
    """`constrained_iteration` of `templates/c/rattle.c.jinja`."""

    _fields_ = (
        ("iteration", Iteration),
        *((name, FunctionStructure) for name in ("derivative", "mass", "slopes")),
    )
    kept: Any


def steps(
    name: str,
    problem: Problem,
    module: Any,
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
    states, coordinates = len(problem.states), len(problem.positions)
    system = System(inputs=inputs.ctypes.data, states=states, positions=coordinates)
    square = coordinates * coordinates
    reals = np.empty(13 * square + 11 * coordinates)
    wholes = np.empty(2 * square + 4 * coordinates, np.int64)
    *called, rows = (FunctionStructure(*functions[name]) for name in NEEDED[:4])
    iteration = Iteration(ctypes.addressof(system), reals.ctypes.data, wholes.ctypes.data, rows)
    more = _Iteration(iteration, *called)
    more.kept = system, reals, wholes, inputs, libraries
    call = libraries[METHODS_LIBRARY][f"steps_{name}"]
    count = DERIVATIVES * equal_steps.LEAPFROGS[name]
    return EqualSteps(partial(equal_steps.made, call, more, inputs, functions, ()), count)
