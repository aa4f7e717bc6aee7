"""The JavaScript backend: an ES module of all outputs, and the function that the page animates."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from eomgen.codegen.backends.division import divided
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import Kernel, kernels_of
from eomgen.program.printing import Dialect, Names, print_block
from eomgen.program.program import Program
from eomgen.program.tape import TIME
from eomgen.scalars.functions import FUNCTIONS
from eomgen.templating import render

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

IN_PAGE = replace(
    DIALECT, reserved=RESERVED | {"K", "P", "between", "out", "i", "known", "prepare"}
)
"""The dialect for functions in a page."""
MOST = 300
"""Greatest number of lines of a function in a page: V8 does not optimise functions whose bytecode
is longer than 60 KB."""


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
        "rest": _rest([i.default for i in interface.inputs]),
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
        "state": _given(kernel.state, "y"),
        "inputs": _given(kernel.inputs, "u"),
        "extra": _given(kernel.extra, "extra"),
        "takes_extra": bool(function.extra),
        "lines": kernel.block.lines,
        "results": kernel.block.results,
    }


def _given(names: Sequence[str], array: str) -> list[tuple[str, str]]:
    """The variables that are used, each with the array element it reads."""
    return [(name, f"{array}[{i}]") for i, name in enumerate(names) if name]


def body_poses(program: Program, interface: Interface) -> str:
    """The source of `function bodyPoses(y, p)`, which computes the poses of all bodies from state
    and parameters; if joints are driven, of `bodyPoses(y, p, t)`. "" for a program without poses.

    It returns for each body [x, y, angle] in the plane, m and rad; in space the three rows, of four
    numbers each, of [world_R_body | position], 1 and m.
    """
    if "body_poses" not in program.outputs:
        return ""
    names = Names(program, DIALECT)
    poses = program.outputs["body_poses"]
    block = print_block(program, poses.nodes, names, DIALECT, fixed=True)
    states = [s.name for s in interface.states]
    parameters = [p.name for p in interface.parameters]
    used = {names[i] for i in block.constants}
    given = [
        *((names.safe(n), f"p[{i}]") for i, n in enumerate(parameters) if names.safe(n) in used),
        *((names.safe(n), f"y[{i}]") for i, n in enumerate(states) if n in block.inputs),
    ]
    rows = _bracketed(block.results, poses.shape[-1], ", ")
    if len(poses.shape) == 3:  # a matrix for each body
        rows = _bracketed(rows, poses.shape[-2], ",\n     ")
    context = {
        "timed": TIME in block.inputs,
        "own_functions": [(name, OWN[name]) for name in block.functions if name in OWN],
        "given": given,
        "lines": block.lines,
        "rows": rows,
    }
    return render(TEMPLATES, "poses.js.jinja", context)


def mechanism(
    program: Program, interface: Interface, contacts: Sequence[Mapping[str, Any]] = ()
) -> str:
    """The source of `const mechanism = …` of a page, an object of functions of (t, y, p, u).

    Each returns a Float64Array of the entries of an output in C order, or a number, and may use the
    same array for its next result. State y, parameters p and inputs u are arrays in the order of
    the interface. `held` and `impact` take an array of their further inputs last. `contacts` are
    described by tables, one for each, which the object has as `contacts`.
    """
    kernels, constants = kernels_of(program, interface, IN_PAGE)
    called = {f for kernel in kernels for f in kernel.block.functions} | {*constants.functions}
    names = tuple(dict.fromkeys(name for kernel in kernels for name in kernel.constants))
    place = {name: f"K[{i}]" for i, name in enumerate(names)}
    written = [_divided(kernel, place) for kernel in kernels]
    given = [(name, f"p[{i}]") for i, name in enumerate(constants.parameters)]
    context: dict[str, Any] = {
        "own_functions": [(name, OWN[name]) for name in OWN if name in called],
        "parameters": len(interface.parameters),
        "between": max(kernel["size"] for kernel in written),
        "constants": names,
        "given": given,
        "checked": list(constants.checked),
        "checks": [
            (check.about.replace('"', "'"), source, check.relation)
            for check, source in constants.checks
        ],
        "fixed": constants.lines,
        "kernels": written,
        "missing": [
            in_page(name)
            for name in ("gaps", "gap_rates", "impact", "held", "switching_functions")
            if name not in program.outputs
        ],
        "contacts": json.dumps(list(contacts)),
    }
    return render(TEMPLATES, "mechanism.js.jinja", context)


def in_page(name: str) -> str:
    """The name of an output in JavaScript: `bodyPoses`."""
    first, *others = name.split("_")
    return first + "".join(word.capitalize() for word in others)


def _divided(kernel: Kernel, place: Mapping[str, str]) -> dict[str, Any]:
    """A kernel as values for the template of a page, in parts if it is long."""
    function, block = kernel.function, kernel.block
    given = [
        *((name, place[name]) for name in kernel.constants),
        *_given(kernel.state, "y"),
        *_given(kernel.inputs, "u"),
        *_given(kernel.extra, "extra"),
    ]
    division = divided(block.lines, given, block.results, MOST)
    return {
        "name": in_page(function.name),
        "about": " ".join(function.about.split()),
        "number": not function.shape,
        "parts": division.parts if division else (),
        "given": list(division.given if division else given),
        "lines": [] if division else list(block.lines),
        "results": block.results,
        "size": division.size if division else 0,
    }


def _rest(defaults: Sequence[float]) -> str:
    """The source of the inputs that are not given."""
    return repr(list(defaults)) if any(defaults) else "INPUTS.map(() => 0)"


def _bracketed(parts: Sequence[str], width: int, between: str) -> list[str]:
    """The sources of arrays of `width` parts each."""
    groups = (parts[i : i + width] for i in range(0, len(parts), width))
    return [f"[{between.join(group)}]" for group in groups]
