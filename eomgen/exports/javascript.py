"""An ES module of a scene: the functions of the JavaScript backend, and a step of the engine."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from eomgen.base.errors import SceneError
from eomgen.base.templating import render
from eomgen.codegen.backends import javascript
from eomgen.codegen.interface import Interface
from eomgen.codegen.sampling import clock_values
from eomgen.codegen.system import SamplingLabel
from eomgen.engine.contacts import Place, Touching
from eomgen.engine.printed import CONTACT_STEPS, text
from eomgen.exports import Options, Written
from eomgen.exports.steps import (
    Method,
    Part,
    contacts_of,
    method_of,
    model_for,
    nominals_of,
    roots_of,
    size_of,
    sizes_of,
    start_of,
)
from eomgen.model.model import Model
from eomgen.store import interfaced_program_of
from eomgen.subset.languages import JAVASCRIPT
from eomgen.tables.integrators import INTEGRATORS

METHOD = "rk4"
"""The method of steps, if no other one is wanted."""


def files(model: Model, options: Options) -> Written:
    """The module. Raises `SceneError` for a scene without states, `RunError` as `method_of`."""
    name = options.integrator or METHOD
    model = model_for(name, model)
    program, interface = interfaced_program_of(model)
    if not interface.states:
        raise SceneError("javascript: the scene has no states, so there is nothing to step")
    method = method_of(name, model, interface)
    start = start_of(program, interface)
    size = size_of(interface, start)
    rest = options.simulation.rest_speed if options.simulation else None
    met = contacts_of(interface, size, rest)
    sizes = {"CONTACTS": met["contacts"], "PRESSED": met["pressed"], "STATES": len(start)}
    nominals = nominals_of(program, interface, start, size) if interface.contacts else ()
    values = {
        "rest_speeds": met.pop("rest"),
        **met,
        "now": _fields(Part("now", Touching, sizes)),
        "at": _fields(Part("at", Place, sizes)),
        "nominals": list(map(repr, nominals)),
    }
    ((file, module),) = javascript.files(program, interface).items()
    return Written({file: module + _step(method, interface, size, values)})


def _step(method: Method, interface: Interface, size: float, contacts: Mapping[str, Any]) -> str:
    """The source of `step`, with values for its rigid contacts."""
    # Imported here because the printer takes a while.
    from eomgen.subset.printing import printed

    values, roots = method.values(interface), [*roots_of(method, interface)]
    if contacts["contacts"]:
        roots += [*CONTACT_STEPS, ("press", {}), ("add_compensated", {}), ("differences", {})]
    if interface.sampling:
        roots += [("sample", {}), ("next_tick", {})]
    context: dict[str, Any] = {
        **sizes_of(method, interface, size),
        "states": len(interface.states),
        "velocities": interface.velocities,
        "projection": ["constraint_residuals", "project_position", "project_velocity"],
        "linkage": [name for _, name in method.linkage],
        **contacts,
        "engine": JAVASCRIPT.prelude + printed(text(), roots, JAVASCRIPT),
        "method": {**values, "call": _of_c(values["call"])},
        "parts": [{"name": p.name, "fields": _fields(p)} for p in method.parts(interface)],
        "rates": list(map(repr, method.rates)),
        "tangent": any(f.name == "jacobian" and f.tangent for f in interface.functions),
        "clocks": clocks_in_javascript(interface.sampling) if interface.sampling else "",
        "about": INTEGRATORS[method.name].about,
        "rest": javascript.rest_of(interface),
    }
    return render(javascript.TEMPLATES, "step.js.jinja", context)


def clocks_in_javascript(sampling: Sequence[SamplingLabel]) -> str:
    """The fields of `engine.sampling.Clocks` in JavaScript, at the start and without seeds."""
    fields = []
    values = clock_values(sampling)
    for name, value in vars(values).items():
        if isinstance(value, tuple):
            kind = "Float64Array" if name in ("periods", "lags") else "Int32Array"
            fields.append(f"{name}: {kind}.of({', '.join(map(str, value))})")
        else:
            fields.append(f"{name}: {value}")
    room = {"seeds": values.many, "made": values.many, "moved": values.many, "noise": values.noises}
    return ", ".join([*fields, *(f"{n}: new Float64Array({size})" for n, size in room.items())])


def _of_c(text: str) -> str:
    """JavaScript of what C is given."""
    return re.sub(r"&|\(\w+ \*\)", "", text).replace("->", ".")


def _fields(part: Part) -> str:
    """JavaScript of a record."""
    kinds = {"int64_t": "Int32Array", "real": "Float64Array"}
    arrays = {
        name.removeprefix(f"{part.name}_"): f"new {kinds[kind]}({size})"
        for kind, name, size in part.arrays
    }
    numbers = {name: str(x) for name, x in part.own.items()}
    given = {name: _of_c(value) for name, value in part.given.items()}
    return ", ".join(f"{name}: {value}" for name, value in {**numbers, **arrays, **given}.items())
