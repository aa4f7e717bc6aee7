"""Validation errors of a scene as messages with location, problem and remedy."""

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from eomgen.base.errors import SYNONYMS, SceneError, nearest
from eomgen.base.text import brief
from eomgen.language.base import types_of
from eomgen.scene.constraints import AnyConstraint
from eomgen.scene.effects import Effect
from eomgen.scene.joints import Joint

MOST_MESSAGES = 10
TABLES = {"joints": Joint, "effects": Effect, "constraints": AnyConstraint}
"""The tables whose types differ, with the unions of their entries."""
REMARKS = {
    **dict.fromkeys(("rope", "cable"), ", or a tether if it may be slack"),
    **dict.fromkeys(("tether", "string", "cord"), ", or a rope if it is always taut"),
}
"""What else belongs to a word that means a type."""


def mistakes(error: ValidationError, source: str) -> SceneError:
    """Errors of pydantic as a `SceneError`: a line for each, which starts with `source`."""
    lines = _lines(error.errors())
    more = len(lines) - MOST_MESSAGES
    tail = [f"{source}: and {more} more"] if more > 0 else []
    return SceneError(*(f"{source}: {line}" for line in lines[:MOST_MESSAGES]), *tail)


def _lines(details: list[ErrorDetails]) -> list[str]:
    """One line for each location. A mistake in a union has an error for each member of the union,
    of which the most specific is kept.
    """
    lines: dict[str, tuple[int, str]] = {}
    outer: set[str] = set()
    for single in (single for detail in details for single in _split(detail)):
        detail = _for_whole_list(single)
        location, weight = _location(detail["loc"]), _weight(detail)
        if detail["type"] in ("unknown_key", "keys"):
            location = f"{location}.{brief(detail['ctx']['key'])}"
        outer |= {location[:i] for i, character in enumerate(location) if character in ".["}
        if location not in lines or weight >= lines[location][0]:
            lines[location] = weight, _line(detail)
    return [line for location, (_, line) in lines.items() if location not in outer]


def _split(detail: ErrorDetails) -> list[ErrorDetails]:
    """An error for each unknown key of a table; any other error unchanged."""
    if detail["type"] != "unknown_keys":
        return [detail]
    single: ErrorDetails = {**detail, "type": "unknown_key", "input": None}  # which may be long
    return [{**single, "ctx": {"key": key, "hint": hint}} for key, hint in detail["ctx"]["keys"]]


def _for_whole_list(detail: ErrorDetails) -> ErrorDetails:
    """An error of a list instead of its entry, if that is a list and not a number or vice versa."""
    location = detail["loc"]
    nested = detail["type"] in ("quantity", "float_type") and isinstance(detail["input"], list)
    flat = detail["type"] == "tuple_type"
    if not (location and isinstance(location[-1], int) and (nested or flat)):
        return detail
    kind = "list_of_lists" if nested else "list_of_no_lists"
    return {**detail, "type": kind, "loc": location[:-1]}


_SHAPES = ("tuple_type", "dict_type", "model_type", "model_attributes_type")


def _weight(detail: ErrorDetails) -> int:
    """How specific an error is: least for a value that is none of the words of a `Literal`, or is
    not a list or table; more if it is similar to such a word.
    """
    if detail["type"] == "literal_error":
        return 1 + isinstance(detail["input"], str) * bool(_hint(detail))
    return {"list_of_lists": 3, **dict.fromkeys(_SHAPES, 1)}.get(detail["type"], 2)


def _hint(detail: ErrorDetails) -> str:
    """A hint at a similar word. A number given as text is not a mistyped number."""
    given, known = str(detail["input"]), _expected(detail)
    return "" if given in known else nearest(given, known)


def _expected(detail: ErrorDetails) -> list[str]:
    """The words of a `Literal`."""
    text = str(detail.get("ctx", {})["expected"])
    return [word.strip("'") for word in text.replace(" or ", ", ").split(", ")]


_SENTENCES = {
    "quantity": "{value} {msg}",
    "value_error": "{value} {error}",
    "finite_number": "{value} is not a finite number; give one that is",
    "float_type": "{value} is not a number; give one",
    "greater_than": "{value} is not positive; give a number > 0",
    "greater_than_equal": "{value} is too small; give at least {ge}",
    "less_than_equal": "{value} is too large; give at most {le}",
    "bool_type": "{value} is neither true nor false; give one",
    **dict.fromkeys(
        ("int_type", "int_from_float", "int_parsing"), "{value} is not a whole number; give one"
    ),
    "list_of_lists": "has lists in it; give everything in one list",
    "list_of_no_lists": "has entries that are not lists; give a list of lists",
    "string_type": "{value} is not a text; give one",
    "tuple_type": "{value} is not a list; give one",
    **dict.fromkeys(
        ("dict_type", "model_type", "model_attributes_type"), "{value} is not a table; give one"
    ),
}
"""What is said of an error, after its location."""


def _line(detail: ErrorDetails) -> str:
    """One pydantic error as `location: value problem; remedy`."""
    kind, context = detail["type"], detail.get("ctx", {})
    value, location = shown(detail["input"]), _location(detail["loc"])
    match kind:
        case "unknown_key":
            key = brief(context["key"])
            location = f"{location}.{key}" if location else key
            return f"{location}: unknown key{context['hint']}"
        case "keys":
            return f"{location}.{context['key']}: {detail['msg']}".lstrip(".")
        case "missing":
            if location.endswith("]"):
                return f"{location}: missing; the list is too short"
            return f"{location}: missing; every such table needs it"
        case "union_tag_invalid":
            known = [tag.strip().strip("'") for tag in context["expected_tags"].split(",")]
            tag = str(context["tag"])
            hint = elsewhere(tag, location) or nearest(tag, known) or f"; known: {', '.join(known)}"
            return f"{location}.type: unknown value '{brief(tag)}'{hint}"
        case "union_tag_not_found":
            return f"{location}.type: missing; it says what kind this is"
        case "literal_error":
            hint = _hint(detail) or f"; known: {', '.join(_expected(detail))}"
            return f"{location}: unknown value {value}{hint}"
        case "too_long" | "too_short":
            return f"{location}: has {_entries(detail)}; give {_wanted_entries(location, context)}"
        case "tuple_type" if isinstance(detail["input"], dict):
            return f"{location}: is one table, not a list; write [[{location}]]"
    if kind in _SENTENCES:
        said = _SENTENCES[kind].format(**{**context, "value": value, "msg": detail["msg"]})
        return f"{location}: {said}"
    return f"{location}: {value}: {detail['msg'][0].lower()}{detail['msg'][1:]}"


def elsewhere(word: str, location: str) -> str:
    """A hint at the table for which a type, or a word that means one, is; "" if `location` is in
    that table, or for any other word.
    """
    kind = SYNONYMS.get(word.casefold(), word)
    for table, union in TABLES.items():
        if kind in types_of(union) and not location.startswith(table):
            more = REMARKS.get(word.casefold(), "")
            return f"; that is a table [[{table}]] with type = '{kind}'{more}"
    return ""


def _entries(detail: ErrorDetails) -> str:
    count = len(detail["input"])
    return "1 entry" if count == 1 else f"{count} entries"


def _wanted_entries(location: str, context: dict[str, Any]) -> str:
    if location.endswith("inertia_com"):
        return "one number in the plane; in space [xx, yy, zz], or those and xy, xz, yz"
    if "min_length" in context:
        return f"at least {context['min_length']}"
    return f"at most {context['max_length']}"


_UNION_MEMBERS = (
    "literal[",
    "tuple[",
    "dict[",
    "function-plain",
    "function-after[",
    "function-before[",
    "tuple-",
    "float",
    "ParameterTable",
    "InputTable",
)
_TAGGED = {"joints", "effects", "constraints", "shapes"}


def _location(parts: tuple[int | str, ...]) -> str:
    """Pydantic's location as text, `joints[1].parent`, without names of union members."""
    location, after_index_of = "", ""
    for i, part in enumerate(parts):
        if isinstance(part, int):
            location += f"[{part}]"
            after_index_of = str(parts[i - 1])
        elif after_index_of in _TAGGED:
            after_index_of = ""  # the tag of a union: type = "revolute"
        elif part == "[key]" or part.startswith(_UNION_MEMBERS):
            continue
        else:
            location += f".{brief(part)}" if location else brief(part)
    return location


def shown(value: Any) -> str:
    """A value as short text for messages."""
    try:
        text = repr(value)
    except RecursionError:
        text = "a value that is nested too deep"
    return brief(text)
