"""Steps of equal length in compiled code, with the bits of the same steps made in Python.

They are `eomgen.engine.equal_steps`; the methods of this module are compiled with each scene's
derivative.
"""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.codegen.interface import Interface
from eomgen.engine.equal_steps import Course, Kept
from eomgen.engine.methods import EQUAL, Root
from eomgen.engine.structures import filled, take
from eomgen.engine.sums import Sum
from eomgen.native import contact_runs
from eomgen.native.mechanism import Mechanism
from eomgen.run.compiled import Constrained, EqualSteps, Touched
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.problem import Problem

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


def context(interface: Interface) -> dict[str, Any]:
    """The values of the template."""
    states = list(enumerate(interface.states))
    return {
        "methods": [(name, CALLS.get(name)) for name in METHODS],
        "positions": [i for i, state in states if state.position],
        "others": [i for i, state in states if not state.position],
    }


def steps(name: str, problem: Problem, of: Mechanism, library: ctypes.CDLL) -> EqualSteps:
    """The steps of a method of `METHODS`."""
    rates = split_of(problem).rates if name in LEAPFROGS else np.empty(0)
    own = of.having(rates, rates=rates.ctypes.data)
    call = Call(library[f"steps_{name}"], own, np.array(sum(problem.quaternions, ()), np.int64))
    return EqualSteps(call.made, METHODS[name])


@dataclass(frozen=True, eq=False)
class Call:
    """A function that makes steps of a mechanism. `quaternions` are the four states of each, one
    after another; none if the method is one that has none.
    """

    function: Any
    of: Mechanism
    quaternions: Any

    def made(
        self,
        t: float,
        at: Sum,
        course: Course,
        kept: Kept,
        constrained: Constrained | None,
        touched: Touched | None = None,
    ) -> int:
        """Make steps: see `run.compiled.EqualSteps`."""
        self.function.restype = ctypes.c_int64
        self.function.argtypes = [_POINTER, _REAL, *[_POINTER] * 4]
        of = self.of.holding(len(at.value), constrained, touched)
        start = [np.ascontiguousarray(array) for array in (at.value, at.lost)]
        course.rate, course.allowed = np.array(course.rate), np.ascontiguousarray(course.allowed)
        course.many, course.quaternions = len(self.quaternions) // 4, self.quaternions
        left = filled(kept)
        why: int = self.function(
            ctypes.byref(of),
            t,
            *(array.ctypes.data for array in start),
            ctypes.byref(filled(course)),
            ctypes.byref(left),
        )
        take(kept, left)
        if touched is not None:
            contact_runs.taken(touched, of.kept[-1])
        return why
