"""Whole steps of implicit methods in compiled code, with the bits of the same steps in Python.

The library of a method serves all scenes with as many states: it calls the compiled derivative and
Jacobian of the scene, which are libraries of their own.
"""

import ctypes
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.engine.adaptive import Bounds
from eomgen.engine.elimination import Factors
from eomgen.engine.methods import EQUAL, Root
from eomgen.engine.rattle import Linked
from eomgen.engine.rosenbrock import Rodas
from eomgen.engine.structures import filled, with_room
from eomgen.native import contact_runs, equal_steps, strides
from eomgen.native.mechanism import KERNELS, Mechanism
from eomgen.native.mechanism import context as of_mechanism
from eomgen.run.compiled import Array, EqualSteps, Stretch, Stride, WholeRun
from eomgen.run.integrators import rattle
from eomgen.run.integrators.implicit_stages import projected_of, stages_of
from eomgen.run.integrators.rodas_5p import between, rodas
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS

MAIN = "implicit.c"
EQUAL_STEPS: Root = ("equal_steps", {})
SYMMETRIC = ("constraint_jacobian", "constraint_rates")
"""Further functions for symmetric projection."""
RATTLE = ("derivative", "mass_matrix", "kinetic_slopes", "constraint_jacobian")
"""The functions that a step of RATTLE calls, beside those that keep constraints."""
DERIVATIVES = 2
"""Derivatives in such a step."""
OWN_STEPS = "linearly_implicit"
"""The method whose steps the module makes itself."""
GAUSS = {
    name: known["method"] for name, (what, known) in EQUAL.items() if what == "implicit_change"
}
"""The methods of equal steps."""
LIBRARY = "method"
"""The first word of a name of a method's library among the others."""
OPERATIONS = 1200, 5000
"""A method takes as long to compile as a function of about this many operations, for few and for
many states."""
MANY = 16
"""From so many states on loops over them gain from vectors."""
_NO_QUATERNIONS = np.empty(0, np.int64)
COUNTS = ("jacobians", "factorisations")
"""What Rodas5P counts beside derivatives."""


class Library(NamedTuple):
    """A method's library: its name, whether constraints are kept, the number of rigid contacts, and
    that of the results of `held`.
    """

    method: str
    constrained: bool = False
    contacts: int = 0
    pressed: int = 0

    @property
    def name(self) -> str:
        """Its name among other libraries."""
        parts = self.method, *map(int, self[1:])
        return f"{LIBRARY} {' '.join(map(str, parts))}"

    @classmethod
    def named(cls, name: str) -> "Library":
        """That of a name."""
        _, method, constrained, *sizes = name.split()
        return cls(method, constrained == "1", *map(int, sizes))


def sources(library: str, states: int) -> Mapping[str, str]:
    """The C source of a method for a number of states."""
    # Imported here because runs whose library is in the store do without the printer.
    from eomgen.engine.printed import c_source
    from eomgen.subset.languages import C

    of = Library.named(library)
    name = of.method
    roots: list[Root] = [(each, {}) for each in ("rosenbrock_step", "rodas_within")]
    if name in EQUAL:
        roots = [EQUAL[name], *[("rattle", {})] * (name in equal_steps.LEAPFROGS), EQUAL_STEPS]
        if of.constrained and name in GAUSS:
            roots[0] = ("projected_change", EQUAL[name][1])
        elif name == "leapfrog":
            del roots[0]
    else:
        roots += strides.ROOTS
    if of.contacts:
        roots += [*contact_runs.ROOTS, ("differences", {})]
    if name not in EQUAL:
        roots += contact_runs.THROUGH_EVENTS if of.contacts else contact_runs.WHOLE_RUNS
    context = {
        **of_mechanism(),
        **contact_runs.values(of.contacts, of.pressed),
        "engine": C.prelude + c_source(roots),
        "name": name,
        "equal": name in EQUAL,
        "adaptive": name not in EQUAL,
        "root": roots[0][0],
        "states": states,
        "many": states >= MANY,
    }
    return {MAIN: render(c.TEMPLATES, "implicit.c.jinja", context)}


def needed(name: str, problem: Problem) -> tuple[str, ...]:
    """The names of the libraries of functions that a method needs, and last that of its own."""
    projects = PROJECTS if problem.projection else ()
    if name == OWN_STEPS:
        return ("derivative", "implicit_step", *projects, Library(name).name)
    if name in equal_steps.LEAPFROGS:
        return (*RATTLE, *projects, Library(name, constrained=True).name)
    held = bool(projects) and name in GAUSS
    further = (*projects, *(SYMMETRIC if held else ()))
    if contacts := problem.contacts:
        many, states = len(contacts.names), len(problem.states)
        own = Library(name, held, many, states + 2 * many + len(contacts.drives))
        return (*KERNELS, *further, *contact_runs.FUNCTIONS, own.name)
    return (*KERNELS, *further, Library(name, held).name)


def equal(name: str, problem: Problem, of: Mechanism, library: ctypes.CDLL) -> EqualSteps:
    """The steps of a Gauss method, or of leapfrog with constraints."""
    if leaps := equal_steps.LEAPFROGS.get(name):
        n, rows = rattle.sizes_of(problem)
        room = _with(of, problem, room=with_room(Linked, n=n, rows=rows))
        call = equal_steps.Call(library.steps, room, _NO_QUATERNIONS)
        return EqualSteps(call.made, DERIVATIVES * leaps)
    quaternions = np.array(sum(problem.quaternions, ()), np.int64)
    if name == OWN_STEPS:
        return EqualSteps(equal_steps.Call(library.steps, of, quaternions).made, 0)
    many = len(GAUSS[name].b)
    room = _with(of, problem, stages=stages_of(many, problem))
    if problem.projection:
        room = _with(room, problem, room=projected_of(many, problem))
    call = equal_steps.Call(library.steps, room, quaternions)
    return EqualSteps(call.made, many, iterates=True)


def _with(of: Mechanism, problem: Problem, **room: Any) -> Mechanism:
    """A mechanism with records to work in, and the sizes of its states."""
    made = {name: filled(record) for name, record in room.items()}
    pointers = {name: ctypes.addressof(record) for name, record in made.items()}
    sizes = np.array(problem.sizes or np.ones(len(problem.states)))
    return of.having(room, made, sizes, nominal=sizes.ctypes.data, **pointers)


def rodas_5p(problem: Problem, of: Mechanism, library: ctypes.CDLL, stretch: Stretch) -> Stride:
    """Steps of Rodas5P."""
    solver, touched = stretch.solver, stretch.touched
    is_held = touched is not None and bool(touched.now.holds.any())
    run = _rodas(problem, stretch, is_held)
    run.h_last, run.error = solver.h_last, solver.error
    return strides.steps(_method(library.adaptive), _with_rodas(of, problem, run), stretch)


def through(problem: Problem, of: Mechanism, library: ctypes.CDLL, run: WholeRun) -> Array | None:
    """The rows of a run by Rodas5P, see `run.compiled.Compiled`."""
    own = _with_rodas(of, problem, _rodas(problem, run.stretch))
    return strides.rows_of(_method(library.through), own, run)


def _method(call: Any) -> strides.Method:
    return strides.Method(call, ("h_abs", "h_last", "error", "lost"), COUNTS, 4, between)


def _rodas(problem: Problem, stretch: Stretch, is_held: bool = False) -> Rodas:
    bounds = Bounds(stretch.atol, stretch.rtol, stretch.longest, stretch.until)
    timed = problem.timed or is_held
    return rodas(len(problem.states), bounds, problem.leading_positions, timed)


def _with_rodas(of: Mechanism, problem: Problem, run: Rodas) -> Mechanism:
    return _with(of, problem, stages=run, room=with_room(Factors, n=len(problem.states)))
