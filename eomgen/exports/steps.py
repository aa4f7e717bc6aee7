"""Steps of exported C: those of the engine, onto unit quaternions and the constraints of loops."""

import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eomgen.base.errors import RunError, nearest
from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.codegen.series import FIXED
from eomgen.engine import projection
from eomgen.engine.elimination import Factors
from eomgen.engine.implicit import Stages
from eomgen.engine.methods import METHODS, Root, Roots
from eomgen.engine.rattle import Linked
from eomgen.engine.rosenbrock import Rodas
from eomgen.engine.structures import extent, parts_of
from eomgen.engine.symmetric import Projected
from eomgen.engine.taylor import HIGHEST, Terms
from eomgen.model.elaborate import in_order
from eomgen.model.model import Model
from eomgen.program.program import Program, interpret
from eomgen.program.tape import TIME
from eomgen.program.taylor_text import SeriesText
from eomgen.run.integrators import INTEGRATORS, Adaptive, rattle
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.integrators.linearly_implicit import rigid
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Problem
from eomgen.run.sizes import mechanism_size, state_sizes
from eomgen.scalars.floats import FloatScalars
from eomgen.store import generated_code
from eomgen.subset.languages import Language
from eomgen.subset.text import Text
from eomgen.tables.integrators import INTEGRATORS as SPECS

_CALLS = {
    "runge_kutta": "system, t, y, h, step",
    "semi_implicit_euler": "system, positions, t, y, h, step",
    "leapfrog": "system, &split, t, y, h, step",
    "linearly_implicit": "system, t, y, h, step",
    "implicit_change": "system, t, h, y, &stages",
    "projected_change": "system, system, t, h, (real *)y, &stages, &room_of",
    "rattle": "system, t, (real *)y, h, &room_of, step",
}
"""What functions of the engine are given that make a step."""
_LINKAGE = {
    "off_by": "constraint_residuals",
    "drift_at": "constraint_rates",
    "rows_at": "constraint_jacobian",
    "rates_at": "derivative",
    "inertia_at": "mass_matrix",
    "slopes_at": "kinetic_slopes",
}
"""Functions of the module by those of the engine's `Linkage`."""
_GIVEN = {
    "projected_change": ("off_by", "drift_at", "rows_at"),
    "rattle": ("off_by", "rows_at", "rates_at", "inertia_at", "slopes_at"),
}
_RESISTED = ("implicit_step",)
_IMPLICIT = ("implicit_change", "projected_change", "rodas_step")


@dataclass(frozen=True)
class Method:
    """A method as exported code makes its steps.

    root   the function of the engine that makes a step, with its `Known` values
    of     if it is composed, the root of what it is composed of
    rates  the matrix by which velocities move positions, which leapfrog takes
    rows   whether the module has the Jacobian of constraints, as large ones have not
    """

    name: str
    root: Root
    of: Root | None = None
    rates: tuple[float, ...] = ()
    rows: bool = True

    @property
    def adapts(self) -> bool:
        """Whether it chooses the lengths of its steps."""
        return isinstance(INTEGRATORS[self.name], Adaptive)

    @property
    def linkage(self) -> list[tuple[str, str]]:
        """The functions of the engine's `Linkage` that it calls, with those of the module."""
        called = _LINKAGE if self.rows else {**_LINKAGE, "rows_at": _LINKAGE["drift_at"]}
        return [(name, called[name]) for name in _GIVEN.get(self._one[0], ())]

    @property
    def needed(self) -> tuple[str, ...]:
        """Functions of the module that it calls, beside the derivative and those of projection."""
        own = {"expanded": (FIXED,), **dict.fromkeys(_IMPLICIT, ("jacobian",))}
        own["linearly_implicit"] = _RESISTED
        return (
            *own.get(self._one[0], ()),
            *(name for _, name in self.linkage if name != "derivative"),
        )

    @property
    def solves(self) -> bool:
        """Whether the engine solves equations in a step."""
        return bool(self.needed) and self.needed != _RESISTED

    @property
    def roots(self) -> Iterator[Root]:
        """What is called of the engine."""
        yield self.root
        if self.of:
            yield self.of

    @property
    def _one(self) -> Root:
        return self.of or self.root

    def parts(self, interface: Interface, series: SeriesText | None = None) -> list["Part"]:
        """The records that a step is given, with room for their arrays, as for `series`."""
        (function, known), n = self._one, len(interface.states)
        many = len(known["method"].b) if "method" in known and function in _IMPLICIT else 1
        nq, nv, rows = interface.coordinates, interface.velocities, len(interface.constraints)
        found = []
        if function in ("implicit_change", "projected_change"):
            numbers = {"many": many, "positions": leading(interface), "STATES": n}
            found.append(Part("stages", Stages, numbers, {"change": "step->change"}))
        if function == "projected_change":
            count = len(interface.quaternions)
            numbers = {"n": nq, "nv": nv, "rows": rows, "many": count, "stages": many + 1}
            given = {"quaternions": "(int64_t *)quaternions" if count else "0"}
            found.append(Part("room_of", Projected, numbers | {"states": n}, given))
        if function == "rodas_step":
            found.append(Part("rodas", Rodas, {"positions": leading(interface), "STATES": n}))
            found.append(Part("newton", Factors, {"n": n}))
        if series:
            found.append(
                Part(
                    "room_of",
                    Terms,
                    {"FIRST": series.first, "PRODUCTS": series.products, "ORDERS": HIGHEST + 1},
                )
            )
        if function == "rattle":
            found.append(Part("room_of", Linked, {"n": nv, "rows": rows}))
        return [part for each in found for part in each.with_records()]

    def values(self, interface: Interface) -> dict[str, Any]:
        """Values for the template."""
        (function, known), composed = self._one, ""
        if self.of:
            composed = "_".join([self.root[0], *(each.name for each in self.root[1].values())])
        own = "_".join([function, *(each.name for each in known.values())])
        call = f"{own}({_CALLS[function]})" if function in _CALLS else ""
        return {
            "call": call,
            "composed": composed,
            "counts": function in (*_IMPLICIT, "rattle"),
            "stepped": function not in _IMPLICIT,
            "jacobian": function in _IMPLICIT,
            "resisted": function == "linearly_implicit",
            "linkage": self.linkage,
        }


@dataclass(frozen=True)
class Part:
    """A record of the engine for a step.

    numbers  of its fields, and those of which its arrays' sizes are made
    given    C of the arrays and records for which it has no room
    """

    name: str
    of: type
    numbers: Mapping[str, int]
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def record(self) -> str:
        """Its type."""
        return self.of.__name__

    def with_records(self) -> Iterator["Part"]:
        """The records in it, and then it."""
        given = dict(self.given)
        for name, (of, size) in parts_of(self.of).records.items():
            own = Part(f"{self.name}_{name}", of, {"n": extent(size, self.numbers)})
            given[name] = f"&{own.name}"
            yield own
        yield replace(self, given=given)

    @property
    def arrays(self) -> Iterator[tuple[str, str, str]]:
        """Type, name and size of the arrays that it has room for."""
        for name, (of, sizes) in parts_of(self.of).arrays.items():
            if name not in self.given:
                texts = (_NAME.sub(self._size, size) for size in sizes)
                number = "int64_t" if of is np.int64 else "real"
                yield number, f"{self.name}_{name}", " * ".join(texts)

    def _size(self, name: re.Match[str]) -> str:
        """The number of a name in a size; others are constants of the record's module."""
        return str({**vars(sys.modules[self.of.__module__]), **self.numbers}[name[0]])

    @property
    def own(self) -> Mapping[str, int]:
        """Its fields that are numbers, 0 if they are not given."""
        return {name: self.numbers.get(name, 0) for name in parts_of(self.of).numbers}

    @property
    def values(self) -> str:
        """C of its fields."""
        prefix = f"{self.name}_"
        found = {name: str(x) for name, x in self.own.items()}
        found |= {name.removeprefix(prefix): f"room->{name}" for _, name, _ in self.arrays}
        return ", ".join(f".{name} = {value}" for name, value in {**found, **self.given}.items())


_NAME = re.compile(r"[A-Za-z_]\w*")


def model_for(name: str, model: Model) -> Model:
    """The model as steps of a method take it: RATTLE those of all coordinates."""
    if name in SPECS and (own := SPECS[name].outputs):
        return replace(model, outputs=in_order((*model.outputs, *own)))
    if not (name in INTEGRATORS and SPECS[name].rattle and model.constraints):
        return model
    outputs = dict.fromkeys((*model.outputs, "mass_matrix", "kinetic_slopes"))
    kept = "projected" if model.loops_kept == "auto" else model.loops_kept
    return replace(model, loops_kept=kept, outputs=tuple(outputs))


def method_of(name: str, model: Model, interface: Interface, *, adaptive: bool = False) -> Method:
    """The method of that name for steps of a model, of equal length or, if they may be, `adaptive`.

    Raises `RunError` if there is no such method, or if it cannot make steps of the model.
    """
    taken = [n for n in METHODS if adaptive or not isinstance(INTEGRATORS[n], Adaptive)]
    if name not in taken:
        raise RunError(
            f"integrator: '{name}' makes no steps of exported code{nearest(name, taken)}; "
            f"these do: {', '.join(taken)}"
        )
    root = METHODS[name]
    if name == "linearly_implicit" and interface.contacts:
        raise RunError(rigid(interface.contacts[0].name))
    of: Root | None = ("leapfrog", {}) if root[0] == "composed" else None
    splits = (of or root)[0] == "leapfrog"
    rows = any(f.name == _LINKAGE["rows_at"] for f in interface.functions)
    if interface.projected and root[0] == "implicit_change":
        return Method(name, ("projected_change", root[1]), rows=rows)
    if interface.projected and splits:
        problem = _problem(model)
        try:
            rattle.prepare(problem)
        except RunError as error:
            raise RunError(f"{str(error).partition(';')[0]}; take gauss_4") from None
        steps: Root = ("rattle", {})
        return Method(name, root if of else steps, steps if of else None, rows=rows)
    return Method(name, root, of, _rates(model) if splits else ())


def _problem(model: Model) -> Problem:
    """The motion of a model, for methods that do not take all."""
    return as_problem(load_module(generated_code(model).module))


def _rates(model: Model) -> tuple[float, ...]:
    """The constant matrix by which velocities move positions."""
    if model.form != "velocity":
        raise RunError("integrator: leapfrog of exported code needs form = 'velocity'; take rk4")
    problem = _problem(model)
    try:
        return tuple(split_of(problem).rates.ravel().tolist())
    except RunError as error:
        raise RunError(f"{str(error).partition(';')[0]}; take rk4") from None


def start_of(program: Program, interface: Interface) -> tuple[float, ...]:
    """The scene's initial state."""
    defaults = {p.name: p.default for p in interface.parameters}
    return tuple(interpret(program, "initial_state", defaults, FloatScalars()))


def size_of(interface: Interface, start: Iterable[float]) -> float:
    """The size of the mechanism with this initial state, m."""
    variables = (*interface.states, *interface.inputs, *interface.parameters)
    first = {s.name: x for s, x in zip(interface.states, start, strict=True)}
    lengths = {p.name: p.default for p in interface.parameters}
    return float(mechanism_size({v.name: v.unit for v in variables}, lengths, first))


def leading(interface: Interface) -> int:
    """The number of positions if these are the first states; else 0."""
    places = [i for i, state in enumerate(interface.states) if state.position]
    return len(places) if places == list(range(len(places))) else 0


def roots_of(method: Method, interface: Interface) -> Iterator[Root]:
    """What a step calls of the engine, onto unit quaternions and constraints."""
    yield from method.roots
    if interface.quaternions:
        yield "normalised", {}
    if interface.projected:
        yield "moved_onto", {}


def sizes_of(method: Method, interface: Interface, size: float) -> dict[str, Any]:
    """Values for templates: which states are positions, quaternions, the sizes of constraints."""
    states = list(enumerate(interface.states))
    rows = interface.constraints if interface.projected else ()
    return {
        "positions": [i for i, state in states if state.position],
        "others": [i for i, state in states if not state.position],
        "quaternions": sum(interface.quaternions, ()),
        "row_sizes": [repr(size if force == "N" else 1.0) for _, force in rows],
        "on_constraints": projection.PROJECTED,
        "coordinates": interface.coordinates,
    }


def contacts_of(interface: Interface, size: float, rest: float | None) -> dict[str, Any]:
    """Values for templates: the rigid contacts of a mechanism of this size, m; `rest` is the speed
    below which they do not bounce, m/s or rad/s, or None.
    """
    sizes = [size if contact.unit == "m" else 1.0 for contact in interface.contacts]
    pressed = [f.shape[0] for f in interface.functions if f.name == "held"]
    return {
        "contacts": len(sizes),
        "pressed": pressed[0] if sizes else 0,
        "gap_sizes": list(map(repr, sizes)),
        "rest": ["-1.0" if rest is None else repr(rest / size) for size in sizes],
    }


def nominals_of(
    program: Program, interface: Interface, starts: tuple[float, ...], size: float
) -> tuple[float, ...]:
    """The sizes of the states of a mechanism of this size, m. Raises `RunError` if there is no
    derivative at the initial state.
    """
    names = [state.name for state in interface.states]
    units = {v.name: v.unit for v in (*interface.states, *interface.inputs, *interface.parameters)}
    given = {v.name: v.default for v in (*interface.inputs, *interface.parameters)}
    given |= {TIME: 0.0, **dict(zip(names, starts, strict=True))}
    try:
        slope = interpret(program, "derivative", given, FloatScalars())
    except (ArithmeticError, ValueError):
        slope = [math.nan]
    if not all(map(math.isfinite, slope)):
        raise RunError("the equations have no solution at the initial state; change that state")
    sizes = state_sizes(names, units, np.array(starts), np.array(slope), size)
    return tuple(sizes.tolist())


def step_of(
    method: Method,
    interface: Interface,
    size: float,
    language: Language,
    text: Text,
    more: Roots = (),
    series: SeriesText | None = None,
) -> str:
    """C that makes steps of a mechanism of this size, m, by a method, and puts states on its
    constraints. It has what the engine's `text` prints of the roots `more`, too.
    """
    # Imported here because the printer takes a while.
    from eomgen.subset.printing import printed

    values = {
        **sizes_of(method, interface, size),
        "prefix": interface.name,
        "engine": printed(text, [*roots_of(method, interface), *more], language),
        "velocities": interface.velocities,
        "rates": [language.literal.format(repr(x)) for x in method.rates],
        "method": method.values(interface),
        "parts": method.parts(interface, series),
    }
    return render(c.TEMPLATES, "step.c.jinja", values)
