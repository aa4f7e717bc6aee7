"""A scene as plain tables, the content of a file that gives the same scene."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from eomgen.language.formula import Angle, Apply, Constant, Name, written
from eomgen.scene.schema import Scene


def tables_of(scene: Scene) -> dict[str, Any]:
    """The tables from which `read_tables` makes an equal scene: texts, numbers, lists, tables.

    Keys that the scene does not give are left out. Formulas are texts with all their brackets.
    """
    found: dict[str, Any] = _plain(scene)
    return found


def _plain(value: Any) -> Any:
    match value:
        case Angle():
            return f"{value.value!r} rad"
        case Constant():
            return value.value
        case Name() | Apply():
            return written(value)
        case BaseModel():
            fields = type(value).model_fields
            given = [name for name in fields if name in value.model_fields_set]
            return {fields[name].alias or name: _plain(getattr(value, name)) for name in given}
        case Mapping():
            return {key: _plain(part) for key, part in value.items()}
        case list() | tuple():
            return [_plain(part) for part in value]
    return value
