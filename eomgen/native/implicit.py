"""Whole steps of implicit methods in compiled code, with the bits of the same steps in Python.

The library of a method serves all scenes with as many states: it calls the compiled derivative and
Jacobian of the scene, which are libraries of their own.
"""

import ctypes
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.engine.adaptive import UNUSUAL
from eomgen.engine.elimination import Factors
from eomgen.engine.few import plain_factors
from eomgen.engine.implicit import Stages
from eomgen.engine.methods import EQUAL, Root
from eomgen.engine.rattle import Linked
from eomgen.engine.rosenbrock import RodasRecords
from eomgen.engine.symmetric import Projected
from eomgen.native import checked, equal_steps
from eomgen.native.checked import Function, FunctionStructure
from eomgen.native.constrained import address, constraints, made_margins
from eomgen.native.constrained import context as of_constraints
from eomgen.native.functions import constants_of
from eomgen.native.memory import room
from eomgen.native.module import Kernels
from eomgen.native.strides import stride
from eomgen.run.compiled import Array, EqualSteps, Stretch, Stride
from eomgen.run.integrators import rattle
from eomgen.run.integrators.implicit_stages import projected_of, stages_of
from eomgen.run.integrators.rodas_5p import rodas
from eomgen.run.problem import Problem
from eomgen.run.projection import PROJECTS
from eomgen.subset.structures import filled, take

MAIN = "implicit.c"
NEEDED = ("derivative", "jacobian")
"""The functions that the methods call."""
EQUAL_STEPS: Root = ("equal_steps", {})
SYMMETRIC = ("constraint_jacobian", "constraint_rates")
"""Further functions for symmetric projection."""
RATTLE = ("derivative", "mass_matrix", "kinetic_slopes", "constraint_jacobian")
"""The functions that a step of RATTLE calls, beside those that keep constraints."""
DERIVATIVES = 2
"""Derivatives in such a step."""
LINKED = {
    "rates": "derivative",
    "inertia": "mass_matrix",
    "slopes": "kinetic_slopes",
    "gradients": "constraint_jacobian",
    "drift": "constraint_rates",
}
"""The functions of `Linkage` in C, and those of a module that they are."""
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
_POINTER, _WHOLE, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


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
        **of_constraints(),
        "engine": C.prelude + c_source(roots),
        "name": name,
        "root": roots[0][0],
        "states": states,
        "many": states >= MANY,
        "linked": [*LINKED],
    }
    return {MAIN: render(c.TEMPLATES, "implicit.c.jinja", context)}


class System(ctypes.Structure):
    """`problem` of `templates/c/implicit.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in NEEDED),
        *((name, _POINTER) for name in ("constants", "jacobian_constants", "inputs")),
        ("quaternions", _POINTER),
        *((name, _WHOLE) for name in ("count", "states", "positions", "timed")),
    )
    kept: Any


class Solver(ctypes.Structure):
    """`Solver` of `templates/c/linkage.c.jinja`."""

    _fields_ = (
        *((name, _POINTER) for name in ("system", "held")),
        *((name, FunctionStructure) for name in LINKED),
        *((name, _WHOLE) for name in ("states", "coordinates", "velocities", "rows")),
        *((name, _POINTER) for name in ("stages", "newton", "room", "first", "second", "third")),
    )
    kept: Any


def solver(
    system: System,
    functions: Mapping[str, Function],
    sizes: tuple[int, int, int],
    stages: Stages | None = None,
    newton: Factors | None = None,
    room: Linked | Projected | None = None,
    factors: Sequence[Factors] = (),
) -> Solver:
    """What the steps of a system are made with: the numbers of its coordinates, velocities and
    constraints; stages and their factors; room and factors for the constraints.
    """
    records = [None if x is None else filled(x) for x in (stages, newton, room, *factors)]
    found = (functions.get(name) for name in LINKED.values())
    made = Solver(
        ctypes.addressof(system),
        None,
        *(FunctionStructure(*of) if of else FunctionStructure() for of in found),
        *(system.states, *sizes),
        *(None if x is None else ctypes.addressof(x) for x in records),
    )
    made.kept = system, functions, stages, newton, room, factors, records
    return made


class Given(NamedTuple):
    """A problem of a module at given parameters and inputs, and compiled code for it.

    library    that of the method
    functions  those of the functions that it needs
    origin     the module that had the constants of its parameters, if this one has perturbed ones
    """

    problem: Problem
    module: Any
    library: ctypes.CDLL
    functions: Mapping[str, ctypes.CDLL]
    values: tuple[Any, Any]
    origin: Any


def needed(name: str, problem: Problem) -> tuple[str, ...]:
    """The names of the libraries of functions that a method needs, and last that of its own."""
    projects = PROJECTS if problem.projection else ()
    if name in equal_steps.LEAPFROGS:
        return (*RATTLE, *projects, library_of(name, True))
    held = bool(projects) and name in GAUSS
    return (*NEEDED, *projects, *(SYMMETRIC if held else ()), library_of(name, held))


def steps(name: str, given: Given) -> Any:
    """The steps of a method, or those of leapfrog with constraints: `Steps` of Rodas5P, and
    `EqualSteps`; None if there are none for these parameters or inputs.
    """
    problem, module, libraries, (p, u) = given.problem, given.module, given.functions, given.values
    leaps = equal_steps.LEAPFROGS.get(name, 0)
    called = (*PROJECTS, *(RATTLE if leaps else SYMMETRIC))
    names = [name for name in libraries if name in called]
    functions = checked.functions(module, {name: libraries[name] for name in names}, p)
    kernels, call = Kernels(module, libraries["derivative"]), given.library.steps
    inputs = kernels.given(u)
    if len(functions) < len(names) or inputs is None:
        return None
    if leaps:
        n, rows = rattle.sizes_of(problem)
        system = System(inputs=inputs.ctypes.data, states=len(problem.states), positions=n)
        room, factors = rattle.linked(n, rows), [plain_factors(k) for k in (n, n, rows)]
        with_room = solver(system, functions, (n, n, rows), room=room, factors=factors)
        with_room.libraries = given, inputs
        held = with_room, inputs, functions, ()
        return EqualSteps(partial(equal_steps.made, call, *held), DERIVATIVES * leaps)
    constants = constants_of(kernels, "derivative", p, given.origin)
    others = constants_of(Kernels(module, libraries["jacobian"]), "jacobian", p, given.origin)
    if constants is None or others is None:
        return None
    quaternions = np.array(problem.quaternions, np.int64)
    system = System(
        *(ctypes.cast(libraries[name][f"{module.NAME}_{name}"], _POINTER) for name in NEEDED),
        *(ctypes.cast(each, _POINTER) for each in (constants, others)),
        *(inputs.ctypes.data, quaternions.ctypes.data),
        *(len(problem.quaternions), len(problem.states)),
        *(problem.leading_positions, problem.timed),
    )
    system.kept = constants, others, inputs, quaternions, given
    if name in GAUSS:
        return _gauss(name, problem, call, system, (inputs, functions))
    call.restype = ctypes.c_int64
    call.argtypes = [*[_POINTER] * 4, _REAL, _REAL, _POINTER, _POINTER]
    return partial(_rodas_5p, call, system, functions, inputs)


def _gauss(
    name: str, problem: Problem, call: Any, system: System, given: tuple[Array, Any]
) -> EqualSteps:
    """Steps of a Gauss method, with inputs and functions that keep constraints."""
    many, n = len(GAUSS[name].b), system.states
    stages, newton = stages_of(many, n, system.positions), plain_factors(many * n)
    room, factors, sizes = None, list[Factors](), (0, 0, 0)
    if problem.projection:
        room = projected_of(many, problem)
        sizes = room.n, room.nv, room.rows
        factors = [plain_factors(k) for k in (n, 2 * room.rows)]
    held = solver(system, given[1], sizes, stages, newton, room, factors)
    of = held, *given, sum(problem.quaternions, ())
    return EqualSteps(partial(equal_steps.made, call, *of), many, iterates=True)


def _rodas_5p(
    call: Any,
    system: System,
    functions: Mapping[str, Function],
    inputs: Array | None,
    stretch: Stretch,
) -> Stride:
    """Steps of Rodas5P, which may be watched with switching functions of time alone only, and have
    no `sizes`; none if they are to be `dense`.
    """
    watched, solver, held = stretch.watched, stretch.solver, stretch.constrained
    assert stretch.sizes is None and not (watched and watched.ends)
    ny, most = system.states, 0 if stretch.dense else stretch.most
    limits = stretch.until, stretch.longest, stretch.rtol
    run = rodas(ny, stretch.atol, limits, system.positions, bool(system.timed))
    run.h_abs, run.h_last, run.error = solver.h_abs, solver.h_last, solver.error
    run.lost[:] = solver.lost
    margins = made_margins(held, most)
    sizes = {"most": most, "STATES": ny, "count": len(stretch.times), "times": stretch.times}
    kept, records = room(
        RodasRecords, rows=np.empty((len(stretch.times), ny)), margins=margins[1:], **sizes
    )
    keeps = constraints(functions, held, inputs, ny)
    factors, clear = plain_factors(ny), watched.clear if watched else math.inf
    start = np.ascontiguousarray(solver.y)
    why = call(
        ctypes.byref(system),
        address(keeps),
        *(ctypes.byref(filled(record)) for record in (run, factors)),
        *(solver.t, clear, start.ctypes.data),
        ctypes.byref(records),
    )
    take(kept, records)
    n, memory = kept.made, ("h_abs", "h_last", "error", "lost")
    return stride(kept, n, memory, why != UNUSUAL, margins=margins[: n + 1] if held else None)
