"""The source of functions of the engine in another language."""

import ast
from collections.abc import Iterable, Mapping
from typing import Any

from eomgen.subset.braces import Printer
from eomgen.subset.expander import Text
from eomgen.subset.kinds import fields_of, is_protocol, of_annotation
from eomgen.subset.languages import Language, type_of


def printed(
    text: Text,
    roots: Iterable[tuple[str, Mapping[str, Any]]],
    language: Language,
) -> str:
    """The source of functions of the engine and of all that they call, those called first. Each is
    given with values of its `Known` parameters.

    Raises `NotInSubsetError` for text outside the subset.
    """
    functions = text.expanded(roots)
    made = {d.name: d for d in functions}
    lines = list(_structures(text, made.values(), language)) if language.typed else []
    changes: dict[str, set[str]] = {}
    for d in functions:
        lines += ["", *Printer(text, made, d, language, changes).lines()]
    return "\n".join(lines).lstrip("\n") + "\n"


def _structures(
    text: Text, functions: Iterable[ast.FunctionDef], language: Language
) -> Iterable[str]:
    """C's structures of the records that are arguments."""
    kinds = (of_annotation(a.annotation).of for d in functions for a in d.args.args)
    for name in dict.fromkeys(kinds):
        record = text.classes.get(name)
        if record and not is_protocol(record):
            yield f"typedef struct {name} {{"
            for each, kind in fields_of(record).items():
                yield f"    {type_of(kind, language)}{each};"
            yield f"}} {name};"
