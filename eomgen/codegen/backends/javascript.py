"""The JavaScript backend: an ES module of all outputs, and the function that the page animates."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends.division import divided
from eomgen.codegen.interface import Interface, Variable
from eomgen.codegen.kernels import Kernel, elements, kernels_of
from eomgen.codegen.series import series_functions
from eomgen.program.ordering import ordered
from eomgen.program.printing import Dialect
from eomgen.program.program import Program
from eomgen.program.tape import TIME
from eomgen.program.taylor_text import SeriesText
from eomgen.scalars.functions import FUNCTIONS
from eomgen.subset.languages import JAVASCRIPT

SUFFIXES: tuple[str, ...] = (".js",)
TEMPLATES = "javascript"
ABOUT = "an ES module that needs nothing"
RESERVED = frozenset(
    "y p u k t extra step select Math Number Array Map Error JSON break case catch class const "
    "continue debugger default delete do else enum eval export extends false finally for function "
    "if implements import in instanceof interface let new null package private protected public "
    "return static super switch this throw true try typeof var void while with yield await async "
    "of get set arguments undefined NaN".split()
) - {TIME}
OWN = {
    "step": "(x) => (x > 0 ? 1 : 0)",
    "select": "(c, a, b) => (c > 0 ? a : b)",
}
"""Functions of formulas that JavaScript lacks."""
DIALECT = Dialect({name: name if name in OWN else f"Math.{name}" for name in FUNCTIONS}, RESERVED)

IN_PAGE = replace(DIALECT, reserved=RESERVED)
"""The dialect for functions in a page, in which no name of a scene occurs."""
OF_PAGE = (
    *("initial_state", "derivative", "kinetic_energy", "potential_energy", "joint_forces"),
    *("body_poses", "body_velocities", "loads", "geometry"),
    *("switching_functions", "switching_functions_of_time"),
    *("gaps", "gap_rates", "impact", "held"),
    *("constraint_residuals", "project_position", "project_velocity", "constraint_margins"),
    *("constraint_rates", "constraint_jacobian", "mass_matrix", "kinetic_slopes", "fixed"),
    *("velocity_force", "effect_forces", "constraint_forces", "samples", "seeds"),
    "implicit_step",
)
"""The outputs that a page uses."""
MOST = 300
"""Lines of a part of a function in a page; up to twice as many are one function. V8 does not
optimise functions whose bytecode is longer than 60 KB; a line takes up to 100 bytes of it."""


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The module, one file, with `derivative(t, y, p, u)` and all other outputs.

    States, parameters and inputs are arrays in the order of `STATES`, `PARAMETERS`, `INPUTS`. An
    output is a flat array of its entries in C order. Arithmetic is in doubles, in the program's
    order; functions of `Math` may differ from Python's in the last digit.
    """
    kernels, constants = kernels_of(program, interface, DIALECT)
    called = {f for kernel in kernels for f in kernel.block.functions} | {*constants.functions}
    context: dict[str, Any] = {
        "scene": interface.name,
        "title": " ".join(interface.title.split()).replace("*/", "* /"),
        "form": interface.form,
        "states": [(s.name, s.unit) for s in interface.states],
        "rest": rest_of(interface),
        "inputs": [(i.name, i.unit) for i in interface.inputs],
        "parameters": [(p.name, repr(p.default), p.unit) for p in interface.parameters],
        "shapes": [(k.function.name, list(k.function.shape)) for k in kernels],
        "own_functions": [(name, OWN[name]) for name in OWN if name in called],
        "parameter_names": ", ".join(constants.parameters),
        "checked": constants.checked,
        "checks": [
            (check.about.replace('"', "'"), source, check.relation)
            for check, source in constants.checks
        ],
        "fixed": constants.lines,
        "kernels": [_written(kernel) for kernel in kernels],
    }
    return {f"{interface.name}.js": render(TEMPLATES, "module.js.jinja", context)}


def _written(kernel: Kernel) -> dict[str, Any]:
    """A kernel as values for the template."""
    function = kernel.function
    return {
        "name": function.name,
        "about": function.about.replace("*/", "* /"),
        "constants": ", ".join(kernel.constants),
        "state": elements(kernel.state, "y"),
        "inputs": elements(kernel.inputs, "u"),
        "extra": elements(kernel.extra, "extra"),
        "takes_extra": bool(function.extra),
        "lines": kernel.block.lines,
        "results": kernel.block.results,
    }


def mechanism(
    program: Program,
    interface: Interface,
    contacts: Sequence[Mapping[str, Any]] = (),
    series: SeriesText | None = None,
) -> str:
    """The source of `const mechanism = …` of a page, an object of functions of (t, y, p, u).

    Each returns a Float64Array of the entries of an output in C order, or a number, and may use the
    same array for its next result. State y, parameters p and inputs u are arrays in the order of
    the interface. `held` and `impact` take an array of their further inputs last. `contacts` are
    described by tables, one for each, which the object has as `contacts`. Its `constraints` are the
    units of their forces, "N" or "N m". Its `series` are those whose text is given, or null.
    """
    program, interface = _numbered(*_of_page(program, interface))
    kernels, constants = kernels_of(program, interface, IN_PAGE, sharing=True)
    called = {f for kernel in kernels for f in kernel.block.functions} | {*constants.functions}
    names = tuple(dict.fromkeys(name for kernel in kernels for name in kernel.constants))
    place = {name: f"K[{i}]" for i, name in enumerate(names)}
    written = [_divided(kernel, place) for kernel in kernels]
    context: dict[str, Any] = {
        "own_functions": [(name, OWN[name]) for name in OWN if name in called],
        "parameters": len(interface.parameters),
        "between": max(kernel["size"] for kernel in written),
        "passed": max(len(kernel["passed"]) for kernel in written),
        "constants": names,
        "given": [(name, f"p[{i}]") for i, name in enumerate(constants.parameters)],
        "checked": list(constants.checked),
        "checks": [
            (check.about.replace('"', "'"), source, check.relation)
            for check, source in constants.checks
        ],
        "fixed": constants.lines,
        "kernels": written,
        "missing": [in_page(name) for name in OF_PAGE if name not in program.outputs],
        "contacts": json.dumps(list(contacts)),
        "constraints": json.dumps([force for _, force in interface.constraints]),
        "series": series,
        "series_functions": series_functions(series, JAVASCRIPT) if series else "",
    }
    return render(TEMPLATES, "mechanism.js.jinja", context)


def _of_page(program: Program, interface: Interface) -> tuple[Program, Interface]:
    """The same with those outputs only that a page uses."""
    outputs = {name: output for name, output in program.outputs.items() if name in OF_PAGE}
    functions = tuple(f for f in interface.functions if f.name in OF_PAGE)
    program = ordered(replace(program, outputs=outputs))
    return program, replace(interface, functions=functions)


def _numbered(program: Program, interface: Interface) -> tuple[Program, Interface]:
    """The same with short names: y0 for the first state, likewise p0, u0, and x0 for the further
    inputs; other variables have no names of their own.
    """
    extra = dict.fromkeys(name for f in interface.functions for name in f.extra)
    groups = {
        "y": [s.name for s in interface.states],
        "p": [p.name for p in interface.parameters],
        "u": [i.name for i in interface.inputs],
        "x": list(extra),
    }
    short = {name: f"{letter}{i}" for letter, own in groups.items() for i, name in enumerate(own)}
    steps = tuple(
        step._replace(value=short.get(str(step.value), step.value))
        if step.operation == "input"
        else step
        for step in program.steps
    )

    def renamed(variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        return tuple(replace(x, name=short[x.name]) for x in variables)

    functions = tuple(
        replace(f, extra=tuple(short[name] for name in f.extra)) for f in interface.functions
    )
    return replace(program, steps=steps, names={}), replace(
        interface,
        states=renamed(interface.states),
        parameters=renamed(interface.parameters),
        inputs=renamed(interface.inputs),
        functions=functions,
    )


def in_page(name: str) -> str:
    """The name of an output in JavaScript: `bodyPoses`."""
    first, *others = name.split("_")
    return first + "".join(word.capitalize() for word in others)


def _divided(kernel: Kernel, place: Mapping[str, str]) -> dict[str, Any]:
    """A kernel as values for the template of a page, in parts if it is long."""
    function, block, base = kernel.function, kernel.block, kernel.base
    given = [
        *((name, place[name]) for name in kernel.constants),
        *elements(kernel.state, "y"),
        *elements(kernel.inputs, "u"),
        *elements(kernel.extra, "extra"),
        *((name, f"passed[{i}]") for i, name in enumerate(kernel.taken) if name != "_"),
    ]
    # What is passed on is stored beside the results.
    results = (*block.results, *kernel.passed)
    division = divided(block.lines, given, results, MOST)
    return {
        "name": in_page(function.name),
        "about": " ".join(function.about.split()),
        "number": not function.shape,
        "base": in_page(base.function.name) if base else "",
        "parts": division.parts if division else (),
        "given": list(division.given if division else given),
        "lines": [] if division else list(block.lines),
        "results": block.results,
        "passed": kernel.passed,
        "size": division.size if division else 0,
    }


def rest_of(interface: Interface) -> str:
    """The source of the inputs that are not given."""
    defaults = [i.default for i in interface.inputs]
    return repr(list(defaults)) if any(defaults) else "INPUTS.map(() => 0)"
