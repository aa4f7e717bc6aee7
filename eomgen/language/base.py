"""The base of the tables of a scene: no unknown keys, strict types, frozen values."""

import keyword
import re
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import Annotated, Any, ClassVar, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from eomgen.base.errors import nearest
from eomgen.base.frozen import FrozenDict
from eomgen.language.angles import by_unit, radians_of
from eomgen.language.formula import Formula

LONGEST_NAME = 100
MOST_HINTS = 10
"""Greatest number of unknown keys with a hint; a table may have thousands."""


class Table(BaseModel):
    """A table of the scene. Unknown keys are errors; values are frozen.

    example    an example in TOML, which the reference shows
    misplaced  keys that only similar tables have, with what is wrong about them here
    """

    example: ClassVar[str] = ""
    misplaced: ClassVar[Mapping[str, str]] = {}

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in cls.misplaced:
                if key in data:
                    raise PydanticCustomError("keys", cls.misplaced[key], {"key": key})
            known = [field.alias or name for name, field in cls.model_fields.items()]
            unknown = [str(key) for key in data if key not in known]
            # Messages show no more, and finding the nearest known key takes time.
            near = [nearest(key, known) for key in unknown[:MOST_HINTS]]
            hints = [hint or f"; known here: {', '.join(known)}" for hint in near]
            if unknown:
                pairs = list(zip_longest(unknown, hints, fillvalue=""))
                raise PydanticCustomError("unknown_keys", "unknown keys", {"keys": pairs})
            for key, table in data.items():
                _check_clashes(key, table)
        return data

    def model_post_init(self, _: Any) -> None:
        """Freeze the dictionaries among the values."""
        _freeze(self.__dict__)

    def replaced(self, **values: Any) -> Self:
        """A copy with some fields replaced by values of the right type, which are not checked."""
        _freeze(values)
        return self.model_copy(update=values)


def _freeze(fields: dict[str, Any]) -> None:
    """Replace the dictionaries among the values by frozen ones."""
    for name, value in fields.items():
        if isinstance(value, dict) and not isinstance(value, FrozenDict):
            fields[name] = FrozenDict(value)


def types_of(union: Any) -> dict[str, type[Table]]:
    """The tables of an annotated union, by their `type`."""
    tables = get_args(get_args(union)[0])
    return {str(get_args(t.model_fields["type"].annotation)[0]): t for t in tables}


def identifier(name: str) -> str:
    """A name as it stands in formulas and in code: with _ for each -."""
    return name.replace("-", "_")


def _check_clashes(key: str, table: Any) -> None:
    """Raise an error for two names in a table that are the same identifier."""
    seen: dict[str, str] = {}
    for name in table if isinstance(table, dict) else ():
        other = seen.setdefault(identifier(str(name)), str(name))
        if other != name:
            raise PydanticCustomError(
                "keys", "is the same name as '{other}'", {"key": f"{key}.{name}", "other": other}
            )


def _identifier(name: str) -> str:
    name = identifier(name)
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(
            "is not an identifier; use letters a-z, digits, _ and -, starting with a letter"
        )
    if keyword.iskeyword(name) or keyword.issoftkeyword(name):
        raise ValueError("is a Python keyword; choose another name")
    if len(name) > LONGEST_NAME:
        raise ValueError(f"is longer than {LONGEST_NAME} characters; choose a shorter name")
    if name.endswith("_") or "__" in name:
        raise ValueError("ends in _ or contains __; choose another name")
    return name


Identifier = Annotated[str, AfterValidator(_identifier)]
"""A name that is valid in Python, JavaScript and LaTeX; a - in it is read as _."""

LARGEST = 1e100
"""Largest absolute value of a number in a scene: its square does not overflow."""


def _size(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"is larger than {LARGEST:g}; choose other units")
    return value + 0.0  # -0.0 becomes 0.0


def _line(text: str) -> str:
    for i, character in enumerate(text):
        if not character.isprintable():
            raise ValueError(f"has a character at {i + 1} that cannot be printed; remove it")
    return text


Number = Annotated[float, Strict(), Field(allow_inf_nan=False), AfterValidator(_size)]
"""A finite number. Integers are accepted; text and booleans are not. Zero has no sign."""

AngleOrNumber = Annotated[
    Number,
    BeforeValidator(radians_of),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]}),
]
"""A number, or an angle with its unit, "90 deg", which becomes a number of rad."""
ByName = Annotated[
    dict[str, Number],
    BeforeValidator(by_unit),
    WithJsonSchema(
        {
            "type": "object",
            "additionalProperties": {"anyOf": [{"type": "number"}, {"type": "string"}]},
        }
    ),
]
"""Numbers by coordinate; an angle with its unit becomes a number of rad, or `<name>_deg`."""
Positive = Annotated[Number, Field(gt=0)]
Text = Annotated[str, Field(max_length=400), AfterValidator(_line)]


def formulas_in(value: object) -> Iterator[Formula]:
    """The formulas in a table, a mapping or a list, and in those that it holds."""
    if isinstance(value, Formula):
        yield value
    elif isinstance(value, Table):
        for name in type(value).model_fields:
            yield from formulas_in(getattr(value, name))
    elif isinstance(value, Mapping):
        yield from formulas_in(tuple(value.values()))
    elif isinstance(value, list | tuple):
        for part in value:
            yield from formulas_in(part)
