"""C99 for firmware: a source and a header without allocation or global state, and an observer.

Sines and cosines are polynomials of the source itself, so that most scenes need no mathematical
library; numbers are `double` or `float`.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from eomgen.base.errors import SceneError
from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.codegen.sampling import clock_values
from eomgen.engine import implicit, printed, projection
from eomgen.engine.contact_runs import MOST_EVENTS
from eomgen.exports import Number, Options, Written
from eomgen.exports.steps import (
    contacts_of,
    method_of,
    model_for,
    nominals_of,
    size_of,
    start_of,
    step_of,
)
from eomgen.model.model import Model
from eomgen.program.ordering import ordered
from eomgen.store import interfaced_program_of
from eomgen.subset.languages import REALS
from eomgen.subset.text import Text
from eomgen.tables.integrators import INTEGRATORS

METHOD = "rk4"
"""The method of steps, if no other one is wanted."""
CIRCULAR = ("sin", "cos", "tan")
SINES = {
    "double": (
        *("1.5918129294866609e-10", "-2.5051131845003624e-08", "2.755731610255244e-06"),
        *("-0.00019841269836758574", "0.0083333333333309485", "-0.16666666666666665"),
    ),
    "float": ("-0.00019587890880412386", "0.0083327482706297495", "-0.16666664662314379"),
}
"""Factors of (sin r - r)/r³ in r², the highest power first: Chebyshev fits for |r| <= π/4."""
COSINES = {
    "double": (
        *("-1.1382632425521718e-11", "2.0876146268403198e-09", "-2.7557317271729793e-07"),
        *("2.4801587298765688e-05", "-0.0013888888888887397", "0.041666666666666665"),
    ),
    "float": ("2.4547942085071573e-05", "-0.0013888303035894866", "0.041666664659502207"),
}
"""Those of (cos r - 1 + r²/2)/r⁴."""
THIRDS = {
    "double": ("1.5707963267341256142", "6.0771005063039659766e-11", "2.0222662487959507324e-21"),
    "float": ("1.5703125", "0.00048351287841796875", "3.1391647865048132169e-7"),
}
"""π/2 in three parts; the products of the first two with a number of quarter turns are exact."""
FARTHEST = {"double": "1e6", "float": "4e4"}
"""Greatest angle, rad, for which they are."""
ERRORS = {"double": "2.3e-16", "float": "1.2e-7"}
"""Greatest errors of sine and cosine, as `tests/exports/test_firmware.py` measures them."""

LIMITS = {
    "": "no variables beside those of the caller, no loop whose length depends on data",
    "closes": "no variables beside those of the caller; there are at most "
    f"{projection.MOST} steps towards constraints",
    "solves": "iterations of a step are at most "
    f"{implicit.MAX_ITERATIONS}; it works in memory of its own, so one is made at a time",
}
"""What holds of explicit steps, of those with loops, and of implicit ones."""
LEFT_OUT = ("steps know no impacts: rigid contacts are left out of them",)
"""What is said of steps in `float` with rigid contacts."""
UNSAMPLED = ("numbers are `float`, which have no exact times of samples: these are left to you",)
"""What is said of controllers that sample, in `float`."""
AT_EVENTS = f"; rigid contacts may strike or open {MOST_EVENTS} times in a step"
"""What holds beside that of steps with rigid contacts."""
IN_FLOAT = {
    "ROUNDOFF": 4 * 2.0**-23,
    "NOISE": 1e-4,
    "NOTHING": 1e-5,
    "MET": 2.0**-22,
    "CLOSE": 1e-4,
    "SHORTEST": 1e-15,
    "LONGEST": 1e15,
}
"""Constants of the engine, for numbers of 24 bits."""


def files(model: Model, options: Options) -> Written:
    """The source, its header, and an example. Raises `SceneError` for a scene without states."""
    name = options.integrator or METHOD
    model = model_for(name, model)
    program, interface = interfaced_program_of(model)
    if not interface.states:
        raise SceneError("firmware: the scene has no states, so there is nothing to step")
    values = c.context(ordered(program), interface)
    number = options.number
    method = method_of(name, model, interface)
    name, start = interface.name, start_of(program, interface)
    size = size_of(interface, start)
    rest = options.simulation.rest_speed if options.simulation else None
    meets = interface.contacts and number == "double"
    more = [*printed.CONTACT_STEPS, ("add_compensated", {}), ("differences", {})] if meets else []
    clocks = clock_values(interface.sampling) if interface.sampling and number == "double" else None
    more += [(name, {}) for name in ("sample", "next_tick") if clocks]
    step = step_of(method, interface, size, REALS, _text(number), more)
    called = {f: name for f, name in values["functions"] if f not in (*CIRCULAR, "abs")}
    called |= {"sqrt": "sqrt"} if "sqrt_(" in step or method.solves else {}
    circular = [f for f in CIRCULAR if f in {f for f, _ in values["functions"]}]
    source = {
        **{key: value for key, value in values.items() if key != "functions"},
        "library": called.items(),
        "functions": circular,
        "suffix": "f" if number == "float" else "",
        "states": len(interface.states),
        "sines": SINES[number],
        "cosines": COSINES[number],
        "thirds": THIRDS[number],
        "farthest": FARTHEST[number],
        "sine_error": ERRORS[number],
        "step": step,
        **contacts_of(interface, size, rest),
        "contacts": len(interface.contacts) if meets else 0,
        "nominals": list(map(repr, nominals_of(program, interface, start, size))) if meets else [],
        "solves": method.solves,
        "implicit": "jacobian" in method.needed,
        "clocks": clocks,
    }
    kind = "solves" if method.solves else "closes" if interface.projected else ""
    header = {
        **c.header(values, interface),
        "real": number,
        "functions": circular,
        "method": INTEGRATORS[method.name].about,
        "contacts": meets,
        "clocks": clocks,
        "samplers": ", ".join(label.effect for label in interface.sampling),
        "limits": LIMITS[kind] + AT_EVENTS * bool(meets),
    }
    example = _example(interface, len(values["held"]))
    return Written(
        {
            f"{name}.c": render(c.TEMPLATES, "firmware.c.jinja", source),
            f"{name}.h": render(c.TEMPLATES, "firmware.h.jinja", header),
            f"{name}_observer.c": render(c.TEMPLATES, "firmware_example.c.jinja", example),
        },
        (
            *(LEFT_OUT if interface.contacts and not meets else ()),
            *(UNSAMPLED if interface.sampling and not clocks else ()),
        ),
    )


def _example(interface: Interface, held: int) -> dict[str, Any]:
    """The values of the example, for so many constants."""
    return {
        "scene": interface.name,
        "prefix": interface.name,
        "measured": interface.states[0].name,
        "index": 0,
        "coordinates": interface.coordinates,
        "held": held,
        "parameters": len(interface.parameters),
        "inputs": len(interface.inputs),
    }


def _text(number: Number) -> Text:
    """The engine's text for numbers of this type."""
    text = printed.text()
    if number == "double":
        return text
    modules: dict[str, Mapping[str, Any]] = {
        name: {**each, **{key: x for key, x in IN_FLOAT.items() if key in each}}
        for name, each in text.modules.items()
    }
    return replace(text, modules=modules)
