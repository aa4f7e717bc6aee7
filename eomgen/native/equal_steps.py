"""Steps of equal length in compiled code, with the bits of the same steps made in Python.

They are `eomgen.engine.equal_steps`; the methods of this module are compiled with each scene's
derivative.
"""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from eomgen.codegen.interface import Interface
from eomgen.engine.equal_steps import Course, Kept
from eomgen.engine.methods import EQUAL, Root
from eomgen.engine.sums import Sum
from eomgen.native import contact_runs
from eomgen.native.checked import Function
from eomgen.native.constrained import address, constraints
from eomgen.run.compiled import Array, Constrained, EqualSteps, Touched
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.problem import Problem
from eomgen.subset.structures import filled, take

LEAPFROGS = {
    name: len(known["of"].parts) if known else 1
    for name, (what, known) in EQUAL.items()
    if what in ("leapfrog", "composed")
}
"""The steps of leapfrog in a step of a method."""
METHODS = {
    name: known["method"].stages if known else 2
    for name, (what, known) in EQUAL.items()
    if what in ("runge_kutta", "semi_implicit_euler")
} | LEAPFROGS
"""The derivatives in a step, by the name of the method."""


def roots_of(*names: str) -> list[Root]:
    """What of the engine's text methods are."""
    return [*(EQUAL[name] for name in names), *[EQUAL["leapfrog"]] * (names[0] in LEAPFROGS)]


_POINTER, _REAL = ctypes.c_void_p, ctypes.c_double
_AT, _SPLIT = "t, y, h, step", "(int64_t *)positions, (int64_t *)others, m->system->rates"
CALLS = {
    **{name: f"runge_kutta_{name}(m->system, {_AT})" for name in ("euler", "rk4")},
    "semi_implicit_euler": f"semi_implicit_euler(m->system, positions, {_AT})",
    "leapfrog": f"leapfrog(m->system, &(Split){{ {_SPLIT} }}, {_AT})",
}


class System(ctypes.Structure):
    """See `templates/c/runs.c.jinja`."""

    _fields_ = tuple((name, _POINTER) for name in ("k", "u", "rates", "events"))


def context(interface: Interface) -> dict[str, Any]:
    """The values of the template."""
    states = list(enumerate(interface.states))
    return {
        "methods": [(name, CALLS.get(name)) for name in METHODS],
        "positions": [i for i, state in states if state.position],
        "others": [i for i, state in states if not state.position],
    }


def steps(
    library: ctypes.CDLL,
    name: str,
    constants: Any,
    inputs: Array,
    functions: Mapping[str, Function],
    problem: Problem,
) -> EqualSteps:
    """The steps of a method, at the constants of parameters and at inputs; `functions` keep
    constraints, and are those of rigid contacts.
    """
    rates = split_of(problem).rates if name in LEAPFROGS else np.empty(0)
    system = System(ctypes.cast(constants, _POINTER), inputs.ctypes.data, rates.ctypes.data)
    system.kept = constants, inputs, rates
    held = inputs, functions, sum(problem.quaternions, ())
    return EqualSteps(partial(made, library[f"steps_{name}"], system, *held), METHODS[name])


def made(
    call: Any,
    system: ctypes.Structure,
    inputs: Array | None,
    functions: Mapping[str, Function],
    quaternions: Sequence[int],
    t: float,
    at: Sum,
    course: Course,
    kept: Kept,
    constrained: Constrained | None,
    touched: Touched | None = None,
) -> int:
    """Make steps, with the arguments of `run.compiled.EqualSteps`.

    call    the method's function
    system  what the method is given
    functions    that keep constraints, and those of rigid contacts, by name
    quaternions  the four states of each, one after another
    """
    call.restype = ctypes.c_int64
    call.argtypes = [_POINTER, _POINTER, _POINTER, _REAL, *[_POINTER] * 4]
    keeps = constraints(functions, constrained, inputs, len(at.value))
    ends = None
    if touched is not None and inputs is not None:
        ends = contact_runs.events(functions, touched, inputs)
        system.events = ctypes.addressof(ends)
    start = [np.ascontiguousarray(array) for array in (at.value, at.lost)]
    places = np.array(quaternions, np.int64)
    limits = np.array(course.rate), np.ascontiguousarray(course.allowed)
    course.rate, course.allowed = limits
    course.many, course.quaternions = len(quaternions) // 4, places
    left = filled(kept)
    why: int = call(
        ctypes.byref(system),
        address(keeps),
        None if ends is None else ctypes.addressof(ends),
        t,
        *(array.ctypes.data for array in start),
        ctypes.byref(filled(course)),
        ctypes.byref(left),
    )
    take(kept, left)
    if touched is not None and ends is not None:
        contact_runs.taken(touched, ends)
    return why
