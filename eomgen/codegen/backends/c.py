"""The C backend: a C99 source and header without dependencies, suitable for firmware."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from eomgen.codegen.backends.conditions import Test, refusals
from eomgen.codegen.backends.division import divided
from eomgen.codegen.interface import Interface, Variable
from eomgen.codegen.kernels import Kernel, kernels_of
from eomgen.language.formula import names_in
from eomgen.program.printing import Dialect
from eomgen.program.program import Program
from eomgen.scalars.functions import FUNCTIONS
from eomgen.templating import render

SUFFIXES: tuple[str, ...] = (".c", ".h")
TEMPLATES = "c"
ABOUT = "C99 and a header: no allocation, no global state, double or float"
MAIN = "checked.c"
"""The source of a shared library to compile; it includes the others."""
KEYWORDS = (
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while _Bool _Complex _Imaginary asm typeof bool true false "
    "nullptr constexpr alignas alignof thread_local static_assert"
)
"""Keywords of C99 and later standards."""
MACROS = (
    "NAN INFINITY HUGE_VAL HUGE_VALF HUGE_VALL FP_NAN FP_INFINITE FP_ZERO FP_SUBNORMAL FP_NORMAL "
    "FP_ILOGB0 FP_ILOGBNAN MATH_ERRNO MATH_ERREXCEPT math_errhandling linux unix i386 "
    "DOMAIN SING OVERFLOW UNDERFLOW PLOSS TLOSS HUGE MAXFLOAT"
)
"""Macros of <math.h> or of compilers."""
OURS = (
    "y p u k out extra between real R failed several wide either before after shared column "
    "first many"
)
C_NAMES = {"abs": "fabs"}
"""Names of functions of formulas that differ in C."""
OWN = {
    "min": ("real a, real b", "b < a ? b : a"),
    "max": ("real a, real b", "b > a ? b : a"),
    "step": ("real x", "x > 0 ? R(1.0) : R(0.0)"),
    "select": ("real c, real a, real b", "c > 0 ? a : b"),
}
"""Functions that C lacks or defines otherwise: `fmin` ignores nan, and may return -0.0."""
CONSTANTS = (
    "M_E M_LOG2E M_LOG10E M_LN2 M_LN10 M_PI M_PI_2 M_PI_4 M_1_PI M_2_PI M_2_SQRTPI M_SQRT2 "
    "M_SQRT1_2"
)
"""Further macros of <math.h> on many systems."""
RESERVED = frozenset(
    [*f"{KEYWORDS} {MACROS} {OURS} {CONSTANTS}".split(), *FUNCTIONS, *(f"{f}_" for f in FUNCTIONS)]
)
DIALECT = Dialect({name: f"{name}_" for name in FUNCTIONS}, RESERVED, number="R({})")


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The source and its header.

    Compiled without contraction of products and sums (`-ffp-contract=off`, the default of
    `-std=c99` in GCC) and with the same mathematical library, each function returns the same bits
    as that of the Python module.
    """
    return _files(context(program, interface), interface)


def _files(values: Mapping[str, Any], interface: Interface) -> dict[str, str]:
    name = interface.name
    shared = {key: values[key] for key in _SHARED}
    return {
        f"{name}.c": render(TEMPLATES, "module.c.jinja", values),
        f"{name}.h": render(
            TEMPLATES,
            "module.h.jinja",
            {
                **shared,
                "guard": f"{name.upper()}_H",
                "title": _plain(interface.title),
                "form": interface.form,
                "states": _table(interface.states),
                "inputs": _table(interface.inputs),
                "parameters": _table(interface.parameters),
                "held": len(values["held"]),
                "left_out": interface.left_out,
            },
        ),
    }


def library(program: Program, interface: Interface) -> Mapping[str, str]:
    """The sources of a shared library: those of `files`, and `MAIN`, which includes them.

    `MAIN` defines `checked_NAME` and `columns_NAME` for each output, which report whether a result
    is valid.
    """
    values = context(program, interface)
    checked = {
        "prefix": interface.name,
        "states": len(interface.states),
        "inputs": len(interface.inputs),
        "parameters": len(interface.parameters),
        "held": len(values["held"]),
        "kernels": values["kernels"],
    }
    return {**_files(values, interface), MAIN: render(TEMPLATES, "checked.c.jinja", checked)}


_SHARED = ("scene", "prefix", "kernels")


def context(program: Program, interface: Interface) -> dict[str, Any]:
    """Values for the template of the source."""
    kernels, constants = kernels_of(program, interface, DIALECT)
    refused = refusals(interface, DIALECT)
    called = {f for kernel in kernels for f in kernel.block.functions}
    called |= {*constants.functions, *refused.functions}
    held = dict.fromkeys(name for kernel in kernels for name in kernel.constants)
    place = {name: i for i, name in enumerate(held)}
    checks = [
        (f"{source} {check.relation} 0", _quoted(f"{check.about} is {check.problem}"))
        for check, source in constants.checks
    ]
    tests = [(_test(test), _quoted(_test_words(test))) for test in refused.tests]
    return {
        "scene": interface.name,
        "prefix": interface.name,
        "functions": [(f, C_NAMES.get(f, f)) for f in FUNCTIONS if f in called and f not in OWN],
        "own_functions": [(f, *OWN[f]) for f in OWN if f in called],
        "parameters": [
            (name, parameter.name, repr(parameter.default))
            for name, parameter in zip(constants.parameters, interface.parameters, strict=True)
        ],
        "refused": refused.lines,
        "tests": tests,
        "checked": constants.checked,
        "checks": checks,
        "fixed": constants.lines,
        "held": list(place.items()),
        "kernels": [_in_parts(written(kernel, place)) for kernel in kernels],
    }


def written(kernel: Kernel, place: Mapping[str, int]) -> dict[str, Any]:
    """A kernel as values for the templates."""
    function, block = kernel.function, kernel.block
    size = math.prod(function.shape)
    along = len(function.extra) if function.tangent else 0
    return {
        "name": f"{function.name}_along" if along else function.name,
        "whole": function.name if along else "",
        "about": _plain(function.about),
        "shape": " x ".join(map(str, function.shape)) or "1",
        "rows": size // along if along else size,
        "size": size,
        "lengths": function.shape,
        "along": along,
        "takes_extra": bool(function.extra),
        "beside": len(function.extra),
        "given": [
            *((name, f"k[{place[name]}]") for name in kernel.constants),
            *_places(kernel.state, "y"),
            *_places(kernel.inputs, "u"),
            *_places(kernel.extra, "extra"),
        ],
        "unused": [
            word
            for word, used in (
                ("t", kernel.time),
                ("y", any(kernel.state)),
                ("k", bool(kernel.constants)),
                ("u", any(kernel.inputs)),
                ("extra", not function.extra or any(kernel.extra)),
                ("out", bool(block.results)),
            )
            if not used
        ],
        "lines": block.lines,
        "results": block.results,
        "operations": kernel.counts["total"],
    }


def _in_parts(kernel: dict[str, Any]) -> dict[str, Any]:
    """The same kernel in parts, if it is long."""
    division = divided(kernel["lines"], kernel["given"], kernel["results"])
    if division is None:
        return {**kernel, "parts": (), "between": 0}
    parts = {"given": division.given, "lines": (), "parts": division.parts}
    return {**kernel, **parts, "between": max(1, division.size)}


def _places(names: Sequence[str], array: str) -> list[tuple[str, str]]:
    """The variables that are used, each with the array element it reads."""
    return [(name, f"{array}[{i}]") for i, name in enumerate(names) if name]


def _table(variables: Sequence[Variable]) -> list[tuple[int, str, str, str, str]]:
    return [
        (i, v.name, _plain(v.unit), _plain(v.about), repr(v.default))
        for i, v in enumerate(variables)
    ]


def _test(test: Test) -> str:
    """The source of a condition that is false for nan."""
    over = "<" if test.condition.strict else "<="
    parts = [f"R({test.condition.low!r}) {over} {test.value}"]
    if test.condition.high != math.inf:
        parts.append(f"{test.value} <= R({test.condition.high!r})")
    return " && ".join(parts)


def _test_words(test: Test) -> str:
    names = ", ".join(dict.fromkeys(names_in(test.condition.value)))
    return f"parameters {names}: {test.condition.location} is out of bounds"


def _plain(text: str) -> str:
    """Text of a scene made safe for a comment: ASCII, on one line, without comment delimiters."""
    kept = "".join(c if c.isprintable() and c.isascii() else " " for c in text)
    return " ".join(kept.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").split())


def _quoted(text: str) -> str:
    """Text as a C string literal, without `??`, which would begin a trigraph."""
    return '"' + _plain(text).replace('"', "'").replace("??", "? ?") + '"'
