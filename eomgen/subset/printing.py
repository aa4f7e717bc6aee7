"""The source of functions of the engine in another language."""

import ast
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from eomgen.subset.functions import Function, type_of
from eomgen.subset.languages import Language
from eomgen.subset.text import NotInSubsetError, Text, own_name

Roots = Iterable[tuple[str, Mapping[str, Any]]]


def printed(text: Text, roots: Roots, language: Language) -> str:
    """The source of functions of the engine and of all that they call, those called first. Each is
    given with values of its `Known` parameters.

    Raises `NotInSubsetError` for text outside the subset.
    """
    functions = functions_of_text(text, roots, language)
    lines = list(_structures(text, functions.values(), language)) if language.typed else []
    for name, function in functions.items():
        lines += ["", *function.lines(name)]
    source = "\n".join(lines).lstrip("\n") + "\n"
    return language.random + source if "uniform(" in source else source


def functions_of_text(
    text: Text, roots: Roots, language: Language, kind: Callable[..., Function] = Function
) -> dict[str, Function]:
    """The functions, by the names that they are printed with."""
    made: dict[str, Function] = {}
    begun: set[str] = set()

    def make(e: ast.AST, name: str, known: Mapping[str, Any]) -> Function:
        own = own_name(name, known)
        if own not in made:
            if own in begun:
                raise NotInSubsetError(e, "calls itself")
            begun.add(own)
            made[own] = kind(text, language, name, known, make)
        return made[own]

    for name, known in roots:
        make(text.functions[name], name, known)
    return made


def _structures(text: Text, functions: Iterable[Function], language: Language) -> Iterable[str]:
    """C's structures of the records that are arguments."""
    names = [x.of for f in functions for x in f.arguments.values()]
    for name in reversed(names):  # records in records come first
        names = [*(kind.of for kind in text.fields(name).values()), *names]
    for name in dict.fromkeys(names):
        if fields := text.fields(name):
            yield f"typedef struct {name} {{"
            for each, kind in fields.items():
                yield f"    {type_of(kind, language)}{each};"
            yield f"}} {name};"
