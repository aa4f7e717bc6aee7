"""Whole steps of implicit methods in compiled code, with the bits of the same steps in Python.

The library of a method serves all scenes with as many states: it calls the compiled derivative and
Jacobian of the scene, which are libraries of their own.
"""

import ctypes
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.engine.adaptive import UNUSUAL, Bounds
from eomgen.engine.elimination import Factors
from eomgen.engine.methods import EQUAL, Root
from eomgen.engine.rattle import Linked
from eomgen.native import equal_steps
from eomgen.native.mechanism import KERNELS, Mechanism, made_margins
from eomgen.native.mechanism import context as of_mechanism
from eomgen.native.strides import records_of, stride
from eomgen.run.compiled import EqualSteps, Stretch, Stride
from eomgen.run.integrators import rattle
from eomgen.run.integrators.implicit_stages import projected_of, stages_of
from eomgen.run.integrators.rodas_5p import rodas
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS
from eomgen.subset.structures import filled, with_room

MAIN = "implicit.c"
EQUAL_STEPS: Root = ("equal_steps", {})
SYMMETRIC = ("constraint_jacobian", "constraint_rates")
"""Further functions for symmetric projection."""
RATTLE = ("derivative", "mass_matrix", "kinetic_slopes", "constraint_jacobian")
"""The functions that a step of RATTLE calls, beside those that keep constraints."""
DERIVATIVES = 2
"""Derivatives in such a step."""
GAUSS = {
    name: known["method"] for name, (what, known) in EQUAL.items() if what == "implicit_change"
}
"""The methods of equal steps."""
LIBRARY = "implicit"
"""The first word of a name of a method's library among the others."""
OPERATIONS = 1200, 5000
"""A method takes as long to compile as a function of about this many operations, for few and for
many states."""
MANY = 16
"""From so many states on loops over them gain from vectors."""
_NO_QUATERNIONS = np.empty(0, np.int64)
_POINTER, _REAL = ctypes.c_void_p, ctypes.c_double


def library_of(name: str, constrained: bool) -> str:
    """The name of a method's library."""
    return f"{LIBRARY} {name}{' constrained' * constrained}"


def sources(library: str, states: int) -> Mapping[str, str]:
    """The C source of a method for a number of states."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import C

    _, name, *constrained = library.split()
    roots: list[Root] = [("rodas_many", {})]
    if name in EQUAL:
        roots = [EQUAL[name], *[("rattle", {})] * (name in equal_steps.LEAPFROGS), EQUAL_STEPS]
        if constrained and name in GAUSS:
            roots[0] = ("projected_change", EQUAL[name][1])
        elif name == "leapfrog":
            del roots[0]
    context = {
        **of_mechanism(),
        "engine": C.prelude + c_source(roots),
        "name": name,
        "root": roots[0][0],
        "states": states,
        "many": states >= MANY,
    }
    return {MAIN: render(c.TEMPLATES, "implicit.c.jinja", context)}


def needed(name: str, problem: Problem) -> tuple[str, ...]:
    """The names of the libraries of functions that a method needs, and last that of its own."""
    projects = PROJECTS if problem.projection else ()
    if name in equal_steps.LEAPFROGS:
        return (*RATTLE, *projects, library_of(name, True))
    held = bool(projects) and name in GAUSS
    return (*KERNELS, *projects, *(SYMMETRIC if held else ()), library_of(name, held))


def equal(name: str, problem: Problem, of: Mechanism, library: ctypes.CDLL) -> EqualSteps:
    """The steps of a Gauss method, or of leapfrog with constraints."""
    if leaps := equal_steps.LEAPFROGS.get(name):
        n, rows = rattle.sizes_of(problem)
        room = _with(of, room=with_room(Linked, n=n, rows=rows))
        call = equal_steps.Call(library.steps, room, _NO_QUATERNIONS)
        return EqualSteps(call.made, DERIVATIVES * leaps)
    many = len(GAUSS[name].b)
    room = _with(of, stages=stages_of(many, problem))
    if problem.projection:
        room = _with(room, room=projected_of(many, problem))
    quaternions = np.array(sum(problem.quaternions, ()), np.int64)
    call = equal_steps.Call(library.steps, room, quaternions)
    return EqualSteps(call.made, many, iterates=True)


def _with(of: Mechanism, **room: Any) -> Mechanism:
    """A mechanism with records to work in."""
    made = {name: filled(record) for name, record in room.items()}
    pointers = {name: ctypes.addressof(record) for name, record in made.items()}
    return of.having(room, made, **pointers)


def rodas_5p(problem: Problem, of: Mechanism, library: ctypes.CDLL, stretch: Stretch) -> Stride:
    """Steps of Rodas5P, which may be watched with switching functions of time alone only, and have
    no rigid contacts; none if they are to be `dense`.
    """
    watched, solver, held = stretch.watched, stretch.solver, stretch.constrained
    assert stretch.touched is None and not (watched and watched.ends)
    ny, most = len(problem.states), 0 if stretch.dense else stretch.most
    bounds = Bounds(stretch.atol, stretch.rtol, stretch.longest, stretch.until)
    run = rodas(ny, bounds, problem.leading_positions, problem.timed)
    run.h_abs, run.h_last, run.error = solver.h_abs, solver.h_last, solver.error
    run.lost[:] = solver.lost
    margins = made_margins(held, most)
    quaternions = np.array(sum(problem.quaternions, ()), np.int64)
    given = {"quaternions": quaternions, "many": len(problem.quaternions)}
    kept, records = records_of(stretch, most, margins=margins[1:], **given)
    system = _with(of, room=with_room(Factors, n=ny)).holding(ny, held, None)
    start, clear = np.ascontiguousarray(solver.y), watched.clear if watched else math.inf
    call = library.steps
    call.restype = ctypes.c_int64
    call.argtypes = [*[_POINTER] * 2, _REAL, _REAL, *[_POINTER] * 2]
    why = call(
        *map(ctypes.byref, (system, filled(run))),
        *(solver.t, clear, start.ctypes.data),
        ctypes.byref(records),
    )
    counts = {"jacobians": kept.jacobians, "factorisations": kept.factorisations}
    least = margins[: records.made + 1] if held else None
    memory = "h_abs", "h_last", "error", "lost"
    return stride(kept, records, memory, why != UNUSUAL, counts, margins=least)
