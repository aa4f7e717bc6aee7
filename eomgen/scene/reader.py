"""From a file or a built-in name to a `Scene`, or to messages that say what to mend and where."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from eomgen.errors import SceneError, nearest
from eomgen.files import read_plain
from eomgen.language.base import LARGEST
from eomgen.scene.schema import MOST, Scene
from eomgen.text import breaks_lines, brief

BUILT_IN = Path(__file__).parent.parent / "scenes"
LARGEST_FILE = 2_000_000
MOST_MESSAGES = 10
LONGEST_LIST = 10 * MOST
"""The state of as many free bodies as there may be is shorter."""
DEEPEST_KEY = 20
LARGEST_WHOLE = 2**1023
"""Whole numbers beyond it are no doubles: they are refused before anything makes one of them."""
REMEDY = f"give at most {LARGEST:g}, or choose other units"
_DEEP_KEY = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST_KEY}}}"""
)


def built_in_names() -> tuple[str, ...]:
    """Names of the scenes that come with the program."""
    return tuple(sorted(path.stem for path in BUILT_IN.glob("*.toml")))


def find_scene(scene: str) -> Path:
    """The file of a scene given by path or built-in name. Raises `SceneError` if there is none."""
    if scene in built_in_names():
        return BUILT_IN / f"{scene}.toml"
    if not scene:
        raise SceneError("the scene's name is empty; give a file or a built-in name")
    if breaks_lines(scene):
        raise SceneError(f"{scene}: has a control character in its name; rename it")
    path = Path(scene)
    try:
        folder, there = path.is_dir(), path.exists()
    except OSError as error:
        raise SceneError(f"{_shown(scene)}: cannot be read: {error.strerror}") from None
    if folder:
        raise SceneError(f"{scene}: is a folder; give a scene file in it")
    if not there:
        hint = nearest(scene, built_in_names()) or f"; known: {', '.join(built_in_names())}"
        raise SceneError(f"{scene}: no such file, nor a built-in scene{hint}")
    return path


def read_scene(scene: str | Path) -> Scene:
    """Read a scene from a path or by its built-in name.

    Raises `SceneError` with one line for each mistake: place, value, remedy.
    """
    path = find_scene(scene) if isinstance(scene, str) else scene
    data = read_plain(path, LARGEST_FILE, name=path.name, error=SceneError)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path.name}: is not UTF-8 text (byte {error.start})") from None
    return parse_scene(text, path.name)


def parse_scene(text: str, source: str = "scene") -> Scene:
    """Read a scene from TOML text; `source` names it in messages. Raises `SceneError`."""
    # The time that `tomllib` takes for a dotted key grows with the square of its length and more.
    if _DEEP_KEY.search(text):
        raise SceneError(f"{source}: is not read: a key has more than {DEEPEST_KEY} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{source}: is not TOML: nested too deep") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{source}: is not TOML: {error}") from None
    except ValueError:  # what Python says of it is advice to programmers
        raise SceneError(f"{source}: has a whole number of thousands of digits; {REMEDY}") from None
    return _scene(table, source)


def read_tables(tables: Mapping[Any, Any], source: str = "scene") -> Scene:
    """Read a scene from tables as a file would hold them; NumPy's numbers and arrays may stand for
    numbers and lists. Raises `SceneError`.
    """
    try:
        table = _plain(tables)
    except RecursionError:
        raise SceneError(f"{source}: is nested too deep") from None
    return _scene(table, source)


def _plain(value: Any) -> Any:
    """A value in the types that TOML is read to; others as they are, for the schema to refuse."""
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): _plain(x) for key, x in value.items()}
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(x) for x in value]
    return value


def _scene(table: dict[str, Any], source: str) -> Scene:
    """The scene of a table. Raises `SceneError` with a line for each mistake."""
    _check_sizes(table, source)
    try:
        return Scene.model_validate(table)
    except ValidationError as error:
        lines = _lines(error.errors())
        more = len(lines) - MOST_MESSAGES
        tail = [f"{source}: and {more} more"] if more > 0 else []
        shown = [f"{source}: {line}" for line in lines[:MOST_MESSAGES]]
        raise SceneError(*shown, *tail) from None


def _check_sizes(table: dict[str, Any], source: str) -> None:
    """Refuse lists that are too long and numbers that are too large before each entry is looked at.

    Raises `SceneError` that names the place.
    """
    rest: list[tuple[str, Any]] = [("", table)]
    while rest:
        place, value = rest.pop()
        most = MOST if place in Scene.model_fields else LONGEST_LIST
        if isinstance(value, list | dict) and place and len(value) > most:
            raise SceneError(f"{source}: {place}: has {len(value)} entries; give at most {most}")
        if isinstance(value, dict):
            rest += [(f"{place}.{brief(key)}".lstrip("."), entry) for key, entry in value.items()]
        elif isinstance(value, list):
            rest += [(f"{place}[{i}]", entry) for i, entry in enumerate(value)]
        elif isinstance(value, int) and abs(value) > LARGEST_WHOLE:
            raise SceneError(f"{source}: {place}: is a number of hundreds of digits; {REMEDY}")


def _lines(details: list[ErrorDetails]) -> list[str]:
    """One line for each place: a mistake fails every member of a union, the deepest says most."""
    lines: dict[str, tuple[int, str]] = {}
    outer: set[str] = set()
    for single in (single for detail in details for single in _singles(detail)):
        detail = _of_the_whole_list(single)
        place, weight = _place(detail["loc"]), _weight(detail)
        if detail["type"] in ("unknown_key", "keys"):
            place = f"{place}.{brief(detail['ctx']['key'])}"
        outer |= {place[:i] for i, character in enumerate(place) if character in ".["}
        if place not in lines or weight >= lines[place][0]:
            lines[place] = weight, _line(detail)
    return [line for place, (_, line) in lines.items() if place not in outer]


def _singles(detail: ErrorDetails) -> list[ErrorDetails]:
    """An error for each of the unknown keys of a table; any other error as it is."""
    if detail["type"] != "unknown_keys":
        return [detail]
    single: ErrorDetails = {**detail, "type": "unknown_key", "input": None}  # which may be long
    return [{**single, "ctx": {"key": key, "hint": hint}} for key, hint in detail["ctx"]["keys"]]


def _of_the_whole_list(detail: ErrorDetails) -> ErrorDetails:
    """One error of the list, not one of each entry, where lists stand for numbers or reversely."""
    location = detail["loc"]
    nested = detail["type"] in ("quantity", "float_type") and isinstance(detail["input"], list)
    flat = detail["type"] == "tuple_type"
    if not (location and isinstance(location[-1], int) and (nested or flat)):
        return detail
    kind = "list_of_lists" if nested else "list_of_no_lists"
    return {**detail, "type": kind, "loc": location[:-1]}


_SHAPES = ("tuple_type", "dict_type", "model_type", "model_attributes_type")


def _weight(detail: ErrorDetails) -> int:
    """How much an error says: least that a value is none of a few words, or is no list or table.

    A word that is nearly one of the few was meant to be it.
    """
    if detail["type"] == "literal_error":
        return 1 + isinstance(detail["input"], str) * bool(_hint(detail))
    return {"list_of_lists": 3, **dict.fromkeys(_SHAPES, 1)}.get(detail["type"], 2)


def _hint(detail: ErrorDetails) -> str:
    """The word that was nearly given, if one was; the text of a number is not nearly the number."""
    given, known = str(detail["input"]), _expected(detail)
    return "" if given in known else nearest(given, known)


def _expected(detail: ErrorDetails) -> list[str]:
    """The words that a literal may be."""
    text = str(detail.get("ctx", {})["expected"])
    return [word.strip("'") for word in text.replace(" or ", ", ").split(", ")]


def _line(detail: ErrorDetails) -> str:
    """One pydantic error as `place: value problem; remedy`."""
    kind, context = detail["type"], detail.get("ctx", {})
    value, place = _shown(detail["input"]), _place(detail["loc"])
    match kind:
        case "unknown_key":
            key = brief(context["key"])
            place = f"{place}.{key}" if place else key
            return f"{place}: unknown key{context['hint']}"
        case "keys":
            return f"{place}.{context['key']}: {detail['msg']}"
        case "missing":
            if place.endswith("]"):
                return f"{place}: missing; the list is too short"
            return f"{place}: missing; every such table needs it"
        case "quantity":
            return f"{place}: {value} {detail['msg']}"
        case "union_tag_invalid":
            known = [tag.strip().strip("'") for tag in context["expected_tags"].split(",")]
            tag = str(context["tag"])
            hint = nearest(tag, known) or f"; known: {', '.join(known)}"
            return f"{place}.type: unknown value '{brief(tag)}'{hint}"
        case "union_tag_not_found":
            return f"{place}.type: missing; it says what kind this is"
        case "literal_error":
            hint = _hint(detail) or f"; known: {', '.join(_expected(detail))}"
            return f"{place}: unknown value {value}{hint}"
        case "value_error":
            return f"{place}: {value} {context['error']}"
        case "finite_number":
            return f"{place}: {value} is not a finite number; give one that is"
        case "float_type":
            return f"{place}: {value} is not a number; give one"
        case "greater_than":
            return f"{place}: {value} is not positive; give a number > 0"
        case "greater_than_equal":
            return f"{place}: {value} is too small; give at least {context['ge']}"
        case "less_than_equal":
            return f"{place}: {value} is too large; give at most {context['le']}"
        case "bool_type":
            return f"{place}: {value} is neither true nor false; give one"
        case "int_type" | "int_from_float" | "int_parsing":
            return f"{place}: {value} is not a whole number; give one"
        case "too_long" | "too_short":
            return f"{place}: has {_entries(detail)}; give {_wanted_entries(place, context)}"
        case "list_of_lists":
            return f"{place}: has lists in it; give everything in one list"
        case "list_of_no_lists":
            return f"{place}: has entries that are no lists; give a list of lists"
        case "string_type" | "tuple_type" | "dict_type" | "model_type" | "model_attributes_type":
            wanted = {"string_type": "a text", "tuple_type": "a list"}.get(kind, "a table")
            return f"{place}: {value} is not {wanted}; give one"
        case _:
            return f"{place}: {value}: {detail['msg'][0].lower()}{detail['msg'][1:]}"


def _entries(detail: ErrorDetails) -> str:
    count = len(detail["input"])
    return "1 entry" if count == 1 else f"{count} entries"


def _wanted_entries(place: str, context: dict[str, Any]) -> str:
    if place.endswith("inertia_com"):
        return "one number in the plane, in space [xx, yy, zz] or those and xy, xz, yz"
    if "min_length" in context:
        return f"at least {context['min_length']}"
    return f"at most {context['max_length']}"


_UNION_MEMBERS = (
    "literal[",
    "tuple[",
    "dict[",
    "function-plain",
    "function-after[",
    "tuple-",
    "float",
    "ParameterTable",
)
_TAGGED = {"joints", "effects", "shapes"}


def _place(location: tuple[int | str, ...]) -> str:
    """`joints[1].parent` from pydantic's location, without the union members it names."""
    place, after_index_of = "", ""
    for i, part in enumerate(location):
        if isinstance(part, int):
            place += f"[{part}]"
            after_index_of = str(location[i - 1])
        elif after_index_of in _TAGGED:
            after_index_of = ""  # the tag of a union: type = "revolute"
        elif part == "[key]" or part.startswith(_UNION_MEMBERS):
            continue
        else:
            place += f".{brief(part)}" if place else brief(part)
    return place


def _shown(value: Any) -> str:
    try:
        text = repr(value)
    except RecursionError:
        text = "what is nested so deep"
    return brief(text)
