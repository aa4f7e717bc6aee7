"""The tables of a scene as functions of their keys, and what type checkers read of these."""

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from inspect import Parameter, Signature, getdoc
from typing import Any, get_args

from pydantic import ValidationError

from eomgen.language.base import Table
from eomgen.scene.mistakes import mistakes
from eomgen.scene.schema import Scene

STUB = '''"""The tables of a scene: see `entries.py`. Written by `tools/pages.py`."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from eomgen.language.base import Table
from eomgen.scene.schema import Scene as _Scene

'''
TYPES = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}
"""Types of Python by those of JSON."""


@cache
def tables() -> dict[str, type[Table]]:
    """All kinds of tables that a scene can hold, by the name of their function, in order."""
    return dict(sorted((_name(table), table) for table in _tables_in(Scene)))


def _tables_in(annotation: Any) -> Iterator[type[Table]]:
    """The tables that a value of this kind can hold, itself included."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
        for field in annotation.model_fields.values():
            yield from _tables_in(field.annotation)
    for part in get_args(annotation):
        yield from _tables_in(part)


def _kind(table: type[Table]) -> str:
    """The value of a table's key `type`; "" if it has none."""
    field = table.model_fields.get("type")
    kinds = get_args(field.annotation) if field else ()
    return str(kinds[0]) if len(kinds) == 1 else ""


def _name(table: type[Table]) -> str:
    """`SpringDamper` for the type `spring_damper`."""
    kind = _kind(table)
    return kind.title().replace("_", "") if kind else table.__name__.removesuffix("Table")


def maker(name: str) -> Callable[..., Table] | None:
    """The function that makes a table of its keys; None if there is none of that name. It raises
    `SceneError` with a line for each mistake.
    """
    table = tables().get(name)
    if table is None:
        return None
    known = {"type": kind} if (kind := _kind(table)) else {}

    def make(**keys: Any) -> Table:
        try:
            return table.model_validate({**known, **keys})
        except ValidationError as error:
            raise mistakes(error, name) from None

    make.__name__ = make.__qualname__ = name
    make.__doc__ = table.__doc__
    keys = [key for key in table.model_fields if key not in known]
    parameters = [Parameter(key, Parameter.KEYWORD_ONLY) for key in keys]
    make.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return make


def stub() -> str:
    """What type checkers and editors read of these functions."""
    schema = Scene.model_json_schema()
    shapes = {**schema["$defs"], Scene.__name__: schema}
    return STUB + "\n".join(
        line for name, table in tables().items() for line in _declared(name, shapes[table.__name__])
    )


def _declared(name: str, shape: Mapping[str, Any]) -> Iterator[str]:
    """The lines of one function; `shape` is the JSON Schema of its table."""
    yield from (f"def {name}(", "    *,")
    for key, value in shape["properties"].items():
        if key != "type":
            default = "" if key in shape.get("required", ()) else " = ..."
            yield f"    {key}: {' | '.join(_python(value))}{default},"
    yield f") -> {'_Scene' if name == 'Scene' else 'Table'}:"
    about = (getdoc(tables()[name]) or "").splitlines()
    quoted = [f'"""{about[0]}', *about[1:], '"""'] if about[1:] else [f'"""{about[0]}"""']
    yield from (f"    {line}".rstrip() for line in quoted)
    yield from ("    ...", "")


def _python(shape: Mapping[str, Any]) -> list[str]:
    """The types of Python that a JSON Schema allows, in order."""
    if "anyOf" in shape or "oneOf" in shape:
        parts = shape.get("anyOf") or shape["oneOf"]
        return list(dict.fromkeys(text for part in parts for text in _python(part)))
    if "$ref" in shape:
        return ["Table", "Mapping[str, Any]"]
    if "enum" in shape or "const" in shape:
        words = shape.get("enum") or [shape["const"]]
        return [f"Literal[{', '.join(map(json.dumps, words))}]"]
    if shape["type"] == "array":
        parts = shape.get("prefixItems") or [shape["items"]]
        inner = dict.fromkeys(text for part in parts for text in _python(part))
        return [f"Sequence[{' | '.join(inner)}]"]
    if shape["type"] == "object":
        return [f"Mapping[str, {' | '.join(_python(shape['additionalProperties']))}]"]
    return [TYPES[shape["type"]]]
