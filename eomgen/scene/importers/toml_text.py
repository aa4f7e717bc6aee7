"""Tables as TOML text, which `tomllib` reads back unchanged."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from eomgen.base.text import one_line

_BARE = re.compile(r"[A-Za-z0-9_-]+")
LONGEST_LINE = 100


def toml_text(tables: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """The text of a scene's file: its comments, single values, then tables and lists of tables.

    Numbers have all their digits. Raises `TypeError` for a value that TOML lacks.
    """
    lines = [f"# {one_line(comment)}" for comment in comments]
    lines += _pairs(tables)
    for key, value in tables.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{_key(key)}]", *_inner(value)]
        elif _is_list_of_tables(value):
            for table in value:
                lines += ["", f"[[{_key(key)}]]", *_inner(table)]
    return "\n".join(lines) + "\n"


def _pairs(tables: Mapping[str, Any]) -> Iterator[str]:
    for key, value in tables.items():
        if not isinstance(value, Mapping) and not _is_list_of_tables(value):
            yield f"{_key(key)} = {_value(value)}"


def _inner(table: Mapping[str, Any]) -> Iterator[str]:
    """The pairs of a table; what is in it stands in lines of its own, tables in braces."""
    for key, value in table.items():
        line = f"{_key(key)} = {_value(value)}"
        if len(line) > LONGEST_LINE and isinstance(value, list):
            yield f"{_key(key)} = ["
            yield from (f"    {_value(entry)}," for entry in value)
            yield "]"
        else:
            yield line


def _is_list_of_tables(value: Any) -> bool:
    listed = isinstance(value, list) and bool(value)
    return listed and all(isinstance(entry, Mapping) for entry in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _value(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case float() | int():
            return repr(value)
        case str():
            return _text(value)
        case Mapping():
            inner = ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case list() | tuple():
            return f"[{', '.join(map(_value, value))}]"
    raise TypeError(f"TOML has no value of type {type(value).__name__}")


def _text(text: str) -> str:
    """A basic string; JSON's escapes are TOML's, except that TOML also escapes DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
