"""`[definitions]`: names for formulas, put in the place of their names before anything is built."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from eomgen.errors import SceneError, nearest
from eomgen.language.base import Table
from eomgen.language.formula import CONSTANTS, DEEPEST, Apply, Formula, Name, names_in
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scene.schema import Scene

LARGEST = 2000
"""Most constants, names and operations of a definition once its own definitions are put in. What
is there several times is computed once; but it is read as often as it is there.
"""
TABLES = ("bodies", "joints", "chains", "points", "effects")


def with_definitions(scene: Scene, motion: Sequence[str]) -> Scene:
    """A scene without definitions, each of their names replaced by its formula wherever it stands.

    `motion` names what may change with the motion. Raises `SceneError` for a circle, an unknown
    name, a name for two things, or a formula that grows beyond bounds.
    """
    if not scene.definitions:
        return scene
    known = (*scene.parameters, *motion, *CONSTANTS)
    for name, formula in scene.definitions.items():
        if name in known:
            what = "a parameter" if name in scene.parameters else "something of the motion"
            what = "a number" if name in CONSTANTS else what
            raise SceneError(f"definitions.{name}: is the name of {what} too; rename one of them")
        _check_names(formula, (*known, *scene.definitions), f"definitions.{name}")
    meanings = _meanings(scene.definitions)
    tables = {
        key: tuple(
            _replaced(table, meanings, known, f"{key}[{i}]")
            for i, table in enumerate(getattr(scene, key))
        )
        for key in TABLES
    }
    return scene.replaced(definitions={}, **tables)


def _check_names(formula: Formula, known: Collection[str], location: str) -> None:
    for name in names_in(formula):
        if name not in known:
            hint = nearest(name, (*known, *FUNCTIONS)) or "; give it a value in [parameters]"
            raise SceneError(f"{location}: unknown parameter '{name}'{hint}")


def _meanings(definitions: Mapping[str, Formula]) -> dict[str, Formula]:
    """Each definition with those that it needs put in."""
    found: dict[str, Formula] = {}
    for start in definitions:
        path = [start]
        while path:
            name = path[-1]
            needed = dict.fromkeys(n for n in names_in(definitions[name]) if n in definitions)
            missing = next((n for n in needed if n not in found), None)
            if missing is None:
                path.pop()
                found[name] = _put_in(definitions[name], found)
                _check_size(found[name], name)
            elif missing in path:
                circle = [*path[path.index(missing) :], missing]
                reported = ", ".join(f"{a} needs {b}" for a, b in pairwise(circle))
                raise SceneError(
                    f"definitions.{missing}: is defined by itself: {reported}; break it"
                )
            else:
                path.append(missing)
    return found


def _put_in(formula: Formula, meanings: Mapping[str, Formula]) -> Formula:
    match formula:
        case Name(name):
            return meanings.get(name, formula)
        case Apply(operation, operands):
            return Apply(operation, tuple(_put_in(part, meanings) for part in operands))
    return formula


def _check_size(formula: Formula, name: str) -> None:
    for size, depth in enumerate(_depths(formula, 0), 1):
        if size > LARGEST or depth > DEEPEST:
            what = f"has more than {LARGEST} parts" if size > LARGEST else "is nested too deep"
            raise SceneError(
                f"definitions.{name}: {what} with its own definitions put in; make it simpler"
            )


def _depths(formula: Formula, depth: int) -> Iterator[int]:
    """How deep each part of a formula lies, but for what is far too deep."""
    yield depth
    if isinstance(formula, Apply) and depth <= DEEPEST:
        for part in formula.operands:
            yield from _depths(part, depth + 1)


def _replaced(
    table: Table, meanings: Mapping[str, Formula], known: Sequence[str], location: str
) -> Any:
    """A table with its formulas put in."""
    fields: dict[str, Any] = {}
    for field, info in type(table).model_fields.items():
        extra = info.json_schema_extra
        sees = extra.get("sees", ()) if isinstance(extra, dict) else ()
        local = [str(w) for w in sees if w != "motion"] if isinstance(sees, list | tuple) else []

        def put_in(value: Any, spot: str, local: Sequence[str] = local) -> Any:
            if isinstance(value, Table):
                return _replaced(value, meanings, known, spot)
            if isinstance(value, tuple):
                return tuple(put_in(part, f"{spot}[{i}]") for i, part in enumerate(value))
            if isinstance(value, dict):
                return {key: put_in(part, f"{spot}.{key}") for key, part in value.items()}
            if not isinstance(value, Formula):
                return value
            _check_names(value, (*known, *local, *meanings), spot)
            for name in names_in(value):
                hidden = [n for n in (name, *names_in(meanings.get(name, value))) if n in local]
                if name in meanings and hidden:
                    raise SceneError(
                        f"{spot}: '{hidden[0]}' of definition '{name}' is predefined here; "
                        "rename it where it comes from"
                    )
            return _put_in(value, meanings)

        fields[field] = put_in(getattr(table, field), f"{location}.{info.alias or field}")
    return table.replaced(**fields)
