"""The C backend: a C99 source and header without dependencies, suitable for firmware."""

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends.conditions import Test, refusals
from eomgen.codegen.backends.division import Line, Part, divided, in_place, together
from eomgen.codegen.interface import Interface, Variable
from eomgen.codegen.kernels import Kernel, elements, kernels_of
from eomgen.language.formula import names_in
from eomgen.program.ordering import ordered
from eomgen.program.printing import Dialect
from eomgen.program.program import Program
from eomgen.scalars.functions import FUNCTIONS

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
    "first many AGAIN APART"
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
DIALECT = Dialect(
    {name: f"{name}_" for name in FUNCTIONS},
    RESERVED,
    number="R({})",
    assigned=frozenset({"sin", "cos"}),
)
OURS_IN_VECTORS = (
    "V I N EACH LANES INLINE STATES INPUTS CONSTANTS WIDTH RAISED either size_of any root columns "
    "times reduced_angle bits_from sine_and_cosine put loaded lanes_of beside begin unit "
    "suspicious l i fused plus_product product_minus minus_product from_row to_row finite_lanes "
    "FUSED SUM EVERY AGAIN APART PLAIN TOGETHER SIZE slopes"
)
VECTORS = replace(
    DIALECT,
    functions={name: f"{name}_v" for name in FUNCTIONS},
    reserved=RESERVED | {*OURS_IN_VECTORS.split(), *(f"{name}_v" for name in FUNCTIONS)},
    number="N({})",
)
"""The dialect for vectors of states."""
EACH = ("tan", "asin", "acos", "atan", "exp", "log", "tanh")
"""Functions of one number that the mathematical library computes for each lane."""
SMALL = 100
"""Below this number of operations, a kernel for vectors is a part of what calls it."""
ANGLE = re.compile(r"(sin|cos)_v?\((\w+)\)")
"""A sine or cosine of a variable; both of one angle are computed together."""


def files(program: Program, interface: Interface) -> Mapping[str, str]:
    """The source and its header.

    Compiled without contraction of products and sums (`-ffp-contract=off`, the default of
    `-std=c99` in GCC) and with the same mathematical library, each function returns the same bits
    as that of the Python module.
    """
    return files_of(context(ordered(program), interface), interface)


def files_of(values: Mapping[str, Any], interface: Interface) -> dict[str, str]:
    """The same from the values for their templates."""
    name = interface.name
    return {
        f"{name}.c": render(TEMPLATES, "module.c.jinja", values),
        f"{name}.h": render(
            TEMPLATES, "module.h.jinja", {**header(values, interface), "form": interface.form}
        ),
    }


def header(values: Mapping[str, Any], interface: Interface) -> dict[str, Any]:
    """Values for a header, from those for the source."""
    return {
        **{key: values[key] for key in _SHARED},
        "guard": f"{interface.name.upper()}_H",
        "title": _plain(interface.title),
        "states": _table(interface.states),
        "inputs": _table(interface.inputs),
        "parameters": _table(interface.parameters),
        "held": len(values["held"]),
        "left_out": interface.left_out,
    }


def library(program: Program, interface: Interface, *, vectors: bool = False) -> Mapping[str, str]:
    """The sources of a shared library: those of `files`, and `MAIN`, which includes them.

    `MAIN` defines `checked_NAME` and `columns_NAME` for each output, which report whether a result
    is valid.

    vectors  whether columns of the derivative are computed in vector registers; it has the same
             bits, but takes as long again to compile
    """
    program = ordered(program)
    values = context(program, interface)
    wanted = ("derivative",) if vectors else ()
    checked = {
        **sizes(values, interface),
        "kernels": values["kernels"],
        "vectors": {k["name"]: k for k in in_vectors(program, interface, VECTORS, wanted)},
    }
    return {**files_of(values, interface), MAIN: render(TEMPLATES, "checked.c.jinja", checked)}


def sizes(values: Mapping[str, Any], interface: Interface) -> dict[str, Any]:
    """What a file that includes the source knows of it, from the values for the source."""
    return {
        "prefix": interface.name,
        "states": len(interface.states),
        "inputs": len(interface.inputs),
        "parameters": len(interface.parameters),
        "held": len(values["held"]),
        "each": [(name, C_NAMES.get(name, name)) for name in EACH],
    }


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
        "kernels": [in_parts(written(kernel, place)) for kernel in kernels],
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
            *elements(kernel.state, "y"),
            *elements(kernel.inputs, "u"),
            *elements(kernel.extra, "extra"),
        ],
        "lines": block.lines,
        "results": block.results,
        "operations": kernel.counts["total"],
        "how": "INLINE " if kernel.counts["total"] < SMALL else "static ",
    }


def in_vectors(
    program: Program, interface: Interface, dialect: Dialect, wanted: Collection[str]
) -> list[dict[str, Any]]:
    """The kernels of these outputs for vectors of states, as values for the templates."""
    kernels, _ = kernels_of(program, interface, dialect)
    # The constants are those of the scalar kernels, in their order; only names may differ.
    held = dict.fromkeys(name for kernel in kernels for name in kernel.constants)
    place = {name: i for i, name in enumerate(held)}
    return [
        in_parts(written(kernel, place), paired)
        for kernel in kernels
        if kernel.function.name in wanted
    ]


def in_parts(
    kernel: dict[str, Any], rewritten: Callable[[Sequence[Line]], Sequence[Line]] = tuple
) -> dict[str, Any]:
    """The same kernel, in parts if it is long; `rewritten` is applied to the lines of each."""
    lines = together(kernel["lines"], ANGLE)
    division = divided(lines, kernel["given"], kernel["results"])
    given: Sequence[Line] = kernel["given"]
    parts: tuple[Part, ...] = ()
    if division is not None:
        given, lines = division.given, []
        parts = tuple(
            replace(part, lines=in_place(rewritten(part.lines), part.given))
            for part in division.parts
        )
    results = in_place([("", result) for result in kernel["results"]], given)
    return {
        **kernel,
        "lines": in_place(rewritten(lines), given),
        "results": [source for _, source in results],
        "parts": parts,
        "between": max(1, division.size) if division else 0,
    }


def paired(lines: Sequence[Line]) -> list[Line]:
    """Lines in which a sine and a cosine of one angle, one after another, are computed together;
    they are statements with an empty name.
    """
    made: list[Line] = []
    first, before = "", None
    for name, source in lines:
        match = ANGLE.fullmatch(source)
        if match and before and match[2] == before[2]:
            sine, cosine = (first, name) if match[1] == "cos" else (name, first)
            made[-1:] = [
                ("", f"V {sine}, {cosine}"),
                ("", f"sine_and_cosine({match[2]}, &{sine}, &{cosine})"),
            ]
        else:
            made.append((name, source))
        first, before = name, match
    return made


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
