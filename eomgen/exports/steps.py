"""Steps of exported C: those of the engine, onto unit quaternions and the constraints of loops."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine import projection
from eomgen.engine.printed import METHODS, Root, Roots
from eomgen.errors import RunError, nearest
from eomgen.model.model import Model
from eomgen.program.program import Program, interpret
from eomgen.run.integrators import INTEGRATORS, Adaptive
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.module import as_problem, load_module
from eomgen.run.sizes import mechanism_size
from eomgen.scalars.floats import FloatScalars
from eomgen.store import generated_code
from eomgen.subset.expander import Text
from eomgen.subset.languages import Language
from eomgen.templating import render

_AT = "system, t, y, h, step"
_CALLS = {
    "runge_kutta": f"{{}}({_AT})",
    "semi_implicit_euler": "{}(system, positions, t, y, h, step)",
    "leapfrog": "{}(system, &split, t, y, h, step)",
    "composed": f"{{}}({_AT})",
}
"""Calls of what makes an explicit step, by the name of the engine's function."""


@dataclass(frozen=True)
class Method:
    """A method as exported code makes its steps.

    root   the function of the engine that makes a step, with its `Known` values
    rates  the matrix by which velocities move positions, which leapfrog takes
    """

    name: str
    root: Root
    rates: tuple[float, ...] = ()

    @property
    def adapts(self) -> bool:
        """Whether it chooses the lengths of its steps."""
        return isinstance(INTEGRATORS[self.name], Adaptive)

    @property
    def needed(self) -> tuple[str, ...]:
        """Functions of the module that it calls, beside the derivative."""
        return ("jacobian",) if self.root[0] in ("implicit_change", "rodas_step") else ()

    @property
    def roots(self) -> Iterator[Root]:
        """What is called of the engine."""
        yield self.root
        if self.root[0] == "composed":
            yield "leapfrog", {}

    @property
    def values(self) -> dict[str, Any]:
        """Values for the template."""
        function, known = self.root
        own = "_".join([function, *(each.name for each in known.values())])
        return {
            "function": own,
            "call": _CALLS.get(function, "").format(own),
            "composed": function == "composed",
            "stages": len(known["method"].b) if function == "implicit_change" else 0,
            "jacobian": bool(self.needed),
        }


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
    splits = root[0] in ("leapfrog", "composed")
    if interface.projected and (splits or root[0] == "implicit_change"):
        raise RunError(f"integrator: {name} of exported code makes no steps of loops; take rk4")
    return Method(name, root, _rates(model) if splits else ())


def _rates(model: Model) -> tuple[float, ...]:
    """The constant matrix by which velocities move positions."""
    if model.form != "velocity":
        raise RunError("integrator: leapfrog of exported code needs form = 'velocity'; take rk4")
    problem = as_problem(load_module(generated_code(model).module))
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


def step_of(
    method: Method | None,
    interface: Interface,
    size: float,
    language: Language,
    text: Text,
    more: Roots = (),
) -> str:
    """C that puts states of a mechanism of this size, m, on its constraints, and makes steps by a
    method, if one is given. It has what the engine's `text` prints of the roots `more`, too.
    """
    # Imported here because the printer takes a while.
    from eomgen.subset.braces import printed

    places = [i for i, state in enumerate(interface.states) if state.position]
    rows = interface.constraints if interface.projected else ()
    roots: list[Any] = [*(method.roots if method else ()), *more]
    roots += [("normalised", {})] if interface.quaternions else []
    roots += [("moved_onto", {})] if rows else []
    values = {
        "prefix": interface.name,
        "engine": printed(text, roots, language),
        "quaternions": sum(interface.quaternions, ()),
        "row_sizes": [repr(size if force == "N" else 1.0) for _, force in rows],
        "on_constraints": projection.PROJECTED,
        "coordinates": interface.coordinates,
        "velocities": interface.velocities,
        "positions": places,
        "others": [i for i in range(len(interface.states)) if i not in places],
        "leading": leading(interface),
        "rates": [language.literal.format(repr(x)) for x in method.rates] if method else [],
        "method": method and method.values,
    }
    return render(c.TEMPLATES, "step.c.jinja", values)
