"""Expansion of `[definitions]`: each name in a scene's formulas is replaced by its formula."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from eomgen.base.errors import SceneError, nearest
from eomgen.language.base import Table
from eomgen.language.formula import CONSTANTS, DEEPEST, Apply, Formula, meant, names_in
from eomgen.language.rewriting import with_names
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scene.schema import Scene

LARGEST = 2000
"""Largest number of constants, names and operations of an expanded definition.

Repeated subexpressions count each time: the program computes them once, but every pass over the
formula visits each of them.
"""
TABLES = ("bodies", "joints", "chains", "points", "effects", "constraints")
"""The tables of a scene whose formulas may use definitions."""


def with_definitions(scene: Scene, motion: Sequence[str]) -> Scene:
    """The scene with all definitions expanded, and none left.

    `motion` names the variables that change with the motion. Raises `SceneError` for a definition
    that depends on itself, an unknown name, a name with two meanings, or an expanded formula that
    is too large.
    """
    if not scene.definitions:
        return scene
    known = (*scene.parameters, *motion, *CONSTANTS)
    for name, formula in scene.definitions.items():
        if name in known:
            what = "a parameter" if name in scene.parameters else "a quantity of the motion"
            what = "a number" if name in CONSTANTS else what
            raise SceneError(f"definitions.{name}: is also the name of {what}; rename one of them")
        _check_names(formula, (*known, *scene.definitions), f"definitions.{name}")
    expanded = _expanded_definitions(scene.definitions)
    tables = {
        key: tuple(
            _expanded_table(table, expanded, known, f"{key}[{i}]")
            for i, table in enumerate(getattr(scene, key))
        )
        for key in TABLES
    }
    return scene.replaced(definitions={}, **tables)


def _check_names(formula: Formula, known: Collection[str], location: str) -> None:
    for name in names_in(formula):
        if name not in known:
            hint = meant(formula, known) or nearest(name, (*known, *FUNCTIONS))
            hint = hint or "; give it a value in [parameters]"
            raise SceneError(f"{location}: unknown parameter '{name}'{hint}")


def _expanded_definitions(definitions: Mapping[str, Formula]) -> dict[str, Formula]:
    """Each definition with the definitions that it uses expanded."""
    expanded: dict[str, Formula] = {}
    for start in definitions:
        path = [start]
        while path:
            name = path[-1]
            used = dict.fromkeys(n for n in names_in(definitions[name]) if n in definitions)
            missing = next((n for n in used if n not in expanded), None)
            if missing is None:
                path.pop()
                expanded[name] = with_names(definitions[name], expanded)
                _check_size(expanded[name], name)
            elif missing in path:
                cycle = [*path[path.index(missing) :], missing]
                chain = ", ".join(f"{a} needs {b}" for a, b in pairwise(cycle))
                raise SceneError(
                    f"definitions.{missing}: is defined in terms of itself: {chain}; break it"
                )
            else:
                path.append(missing)
    return expanded


def _check_size(formula: Formula, name: str) -> None:
    for size, depth in enumerate(_depths(formula, 0), 1):
        if size > LARGEST or depth > DEEPEST:
            what = f"has more than {LARGEST} parts" if size > LARGEST else "is nested too deep"
            raise SceneError(
                f"definitions.{name}: {what} once its own definitions are expanded; make it simpler"
            )


def _depths(formula: Formula, depth: int) -> Iterator[int]:
    """The depth of each part of a formula, down to one level below `DEEPEST`."""
    yield depth
    if isinstance(formula, Apply) and depth <= DEEPEST:
        for part in formula.operands:
            yield from _depths(part, depth + 1)


def _expanded_table(
    table: Table, expanded: Mapping[str, Formula], known: Sequence[str], location: str
) -> Any:
    """A table with the definitions in its formulas expanded."""
    fields: dict[str, Any] = {}
    for field, info in type(table).model_fields.items():
        extra = info.json_schema_extra
        sees = extra.get("sees", ()) if isinstance(extra, dict) else ()
        local = [str(w) for w in sees if w != "motion"] if isinstance(sees, list | tuple) else []

        def expand(value: Any, at: str, local: Sequence[str] = local) -> Any:
            if isinstance(value, Table):
                return _expanded_table(value, expanded, known, at)
            if isinstance(value, tuple):
                return tuple(expand(part, f"{at}[{i}]") for i, part in enumerate(value))
            if isinstance(value, dict):
                return {key: expand(part, f"{at}.{key}") for key, part in value.items()}
            if not isinstance(value, Formula):
                return value
            _check_names(value, (*known, *local, *expanded), at)
            for name in names_in(value):
                hidden = [n for n in (name, *names_in(expanded.get(name, value))) if n in local]
                if name in expanded and hidden:
                    raise SceneError(
                        f"{at}: '{hidden[0]}' of definition '{name}' is predefined here; "
                        "rename it where it is defined"
                    )
            return with_names(value, expanded)

        value = getattr(table, field)
        expanded_value = expand(value, f"{location}.{info.alias or field}")
        if expanded_value != value:  # a field that is replaced counts as given
            fields[field] = expanded_value
    return table.replaced(**fields)
