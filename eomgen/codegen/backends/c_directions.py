"""C for a Jacobian along directions: what depends on the state alone is computed once, the rest for
several directions at once, one in each lane of vector registers.

The vector extensions of GCC and clang compute all lanes by the operations of single numbers, so the
results have the bits of the C backend. Only libraries are made so; the source that users get stays
plain C99.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.codegen.backends.division import WORD, Division, Line, divided
from eomgen.codegen.interface import Interface
from eomgen.codegen.kernels import kernels_of
from eomgen.program.program import Program

LANES = 8
"""Directions at once. Narrower registers take several operations for each."""
CALL = re.compile(r"([A-Za-z]\w*_)\(")


def library(program: Program, interface: Interface) -> Mapping[str, str]:
    """The sources of `c.library` for a program with one output; a Jacobian is computed along
    several directions at once.
    """
    plain = c.library(program, interface)
    kernels, _ = kernels_of(program, interface, c.DIALECT)
    place = {name: i for i, name in enumerate(kernels[0].constants)}
    kernel = c.written(kernels[0], place)
    split = _split(kernel) if kernel["along"] and len(kernels) == 1 else None
    if split is None:
        return plain
    values = c.context(program, interface)
    assert [name for name, _ in values["held"]] == list(place)
    source = render(c.TEMPLATES, "module.c.jinja", {**values, "kernels": []})
    own = {"prefix": interface.name, "kernel": kernel, "lanes": LANES, **split}
    source += "\n" + render(c.TEMPLATES, "directions.c.jinja", own)
    return {**plain, f"{interface.name}.c": source}


def _split(kernel: dict[str, Any]) -> dict[str, Any] | None:
    """A kernel's lines before those that depend on directions, and these; None if these call a
    function that has no form for several numbers.
    """
    given: list[Line] = kernel["given"]
    varying = {name for name, source in given if source.startswith("extra[")}
    before: list[Line] = []
    after: list[Line] = []
    for name, source in kernel["lines"]:
        if varying.isdisjoint(WORD.findall(source)):
            before.append((name, source))
        else:
            if any(not varying.isdisjoint(WORD.findall(x)) for x in _arguments(source)):
                return None
            varying.add(name)
            after.append((name, source))
    results: list[str] = kernel["results"]
    wanted = dict.fromkeys(
        word for source in (*(x for _, x in after), *results) for word in WORD.findall(source)
    )
    computed = {name for name, _ in before}
    shared = [name for name in wanted if name in computed]
    known = [*given, *((name, f"shared[{i}]") for i, name in enumerate(shared))]
    return {
        "shared": shared,
        "before": _in_parts(before, given, shared),
        "after": _in_parts(after, known, results),
        "varying": varying,
    }


def _in_parts(lines: list[Line], given: list[Line], results: Sequence[str]) -> Division:
    """Lines in parts; all of them in what comes last if they are few."""
    division = divided(lines, given, results)
    if division is not None:
        return division
    read = dict.fromkeys(
        word for source in (*(x for _, x in lines), *results) for word in WORD.findall(source)
    )
    last = tuple(line for line in given if line[0] in read)
    return Division((), (*last, *lines), 0)


def _arguments(source: str) -> Iterator[str]:
    """The arguments of functions that take single numbers only: of all but `select_`, and of that
    its condition.
    """
    for match in CALL.finditer(source):
        depth, end = 1, match.end()
        while depth and not (depth == 1 and match[1] == "select_" and source[end] == ","):
            depth += {"(": 1, ")": -1}.get(source[end], 0)
            end += 1
        yield source[match.end() : end]
