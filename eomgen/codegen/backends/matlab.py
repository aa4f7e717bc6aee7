"""The backend "matlab": functions for MATLAB and Octave, one a file, for `ode45` and its like."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from eomgen.base.errors import RunError
from eomgen.base.templating import render
from eomgen.codegen.interface import Function, Interface, Variable
from eomgen.codegen.kernels import kernels_of
from eomgen.program.printing import Dialect
from eomgen.program.program import Program, interpret
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.functions import FUNCTIONS

SUFFIXES: tuple[str, ...] = (".m",)
TEMPLATES = "matlab"
ABOUT = "functions for MATLAB and Octave that need no toolbox"
LONGEST = 63
"""Longest name of a variable or a function in MATLAB."""
RESERVED = frozenset(
    "y p u extra result break case catch classdef continue do else elseif end endfunction endif "
    "endswitch endwhile error for function global if isempty nargin numel otherwise parfor "
    "persistent return spmd switch try until while "
    # Functions that lines call, which a variable of that name would hide.
    "sin cos tan asin acos atan exp log tanh sqrt abs atan2 min max".split()
)
OWN = ("step", "select")
"""Functions of formulas that files define, with an underscore: no name of a scene ends in one."""
DIALECT = Dialect({name: f"{name}_" if name in OWN else name for name in FUNCTIONS}, RESERVED)


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """`NAME.m`, the derivative of the state, and `NAME_OUTPUT.m` for every other output of (t, y,
    p, u). Without arguments `NAME` returns the scene's initial state.

    Arithmetic is in doubles, in the program's order. Conditions on parameters are checked as far as
    they are positive masses and inertias. Raises `RunError` for a name that is too long for MATLAB.
    """
    made = {}
    for function in sorted(interface.functions, key=lambda f: f.name != "derivative"):
        if function.name == "initial_state" or function.extra or function.tangent:
            continue
        main = function.name == "derivative"
        name = interface.name if main else f"{interface.name}_{function.name}"
        made[f"{name}.m"] = _file(program, interface, function, name)
    return made


def _file(program: Program, interface: Interface, function: Function, name: str) -> str:
    """The source of one output as the function `name`."""
    alone = replace(program, outputs={function.name: program.outputs[function.name]})
    (kernel,), constants = kernels_of(alone, replace(interface, functions=(function,)), DIALECT)
    defaults = {p.name: p.default for p in interface.parameters}
    given = [*_given(constants.parameters, "p"), *constants.checked]
    lines = [*constants.lines, *_given(kernel.state, "y"), *_given(kernel.inputs, "u")]
    lines += kernel.block.lines
    for variable, _ in (*given, *lines, (name, "")):
        if len(variable) > LONGEST:
            raise RunError(
                f"matlab: {variable} has {len(variable)} letters, and MATLAB takes {LONGEST}; "
                "give the scene shorter names"
            )
    main = function.name == "derivative"
    start = interpret(program, "initial_state", defaults, FloatScalars()) if main else []
    called = {*kernel.block.functions, *constants.functions}
    context: dict[str, Any] = {
        "name": name,
        "scene": interface.name,
        "title": _plain(interface.title),
        "about": _plain(function.about),
        "start": [repr(float(x)) for x in start],
        "states": _table(interface.states),
        "inputs": _table(interface.inputs),
        "parameters": _table(interface.parameters),
        "given": given,
        "checks": [
            (_plain(check.about).replace("'", "''"), source, check.relation)
            for check, source in constants.checks
        ],
        "lines": lines,
        "rows": _rows(kernel.block.results, function.shape),
        "own": [f for f in OWN if f in called],
    }
    return render(TEMPLATES, "function.m.jinja", context)


def _rows(results: Sequence[str], shape: tuple[int, ...]) -> list[str]:
    """The rows of the result: of an output with three axes, those of the first two."""
    columns = max(1, shape[-1]) if len(shape) > 1 else 1
    return [", ".join(results[i : i + columns]) for i in range(0, len(results), columns)]


def _given(names: Sequence[str], array: str) -> list[tuple[str, str]]:
    """The variables that are used, each with the array element it reads."""
    return [(name, f"{array}({i + 1})") for i, name in enumerate(names) if name]


def _table(variables: Sequence[Variable]) -> list[tuple[str, str, str, str]]:
    """For each variable: name, unit, default, and what it is."""
    return [(v.name, _plain(v.unit), repr(float(v.default)), _plain(v.about)) for v in variables]


def _plain(text: str) -> str:
    """Text of a scene made safe for a comment or a text: ASCII, on one line."""
    return " ".join("".join(c if c.isprintable() and c.isascii() else " " for c in text).split())
