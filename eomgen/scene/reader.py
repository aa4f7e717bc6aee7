"""From a file or a built-in name to a `Scene`, or to messages that say what to mend and where."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from eomgen.errors import SceneError, nearest
from eomgen.scene.schema import Scene

BUILT_IN = Path(__file__).parent.parent / "scenes"
LARGEST_FILE = 4_000_000
MOST_MESSAGES = 10


def built_in_names() -> tuple[str, ...]:
    """Names of the scenes that come with the program."""
    return tuple(sorted(path.stem for path in BUILT_IN.glob("*.toml")))


def find_scene(scene: str) -> Path:
    """The file of a scene given by path or built-in name. Raises `SceneError` if there is none."""
    if scene in built_in_names():
        return BUILT_IN / f"{scene}.toml"
    if not scene:
        raise SceneError("the scene's name is empty; give a file or a built-in name")
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
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise SceneError(f"{path.name}: cannot be read: {error.strerror}") from None
    if len(data) > LARGEST_FILE:
        raise SceneError(f"{path.name}: is larger than {LARGEST_FILE} bytes")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path.name}: is not UTF-8 text (byte {error.start})") from None
    return parse_scene(text, path.name)


def parse_scene(text: str, source: str = "scene") -> Scene:
    """Read a scene from TOML text; `source` names it in messages. Raises `SceneError`."""
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        why = "nested too deep" if isinstance(error, RecursionError) else str(error)
        raise SceneError(f"{source}: is not TOML: {why}") from None
    try:
        return Scene.model_validate(table)
    except ValidationError as error:
        lines = _lines(error.errors())
        more = len(lines) - MOST_MESSAGES
        tail = [f"{source}: and {more} more"] if more > 0 else []
        shown = [f"{source}: {line}" for line in lines[:MOST_MESSAGES]]
        raise SceneError("\n".join([*shown, *tail])) from None


def _lines(details: list[ErrorDetails]) -> list[str]:
    """One line for each place: a mistake fails every member of a union, the deepest says most."""
    lines: dict[str, str] = {}
    for detail in details:
        place = _place(detail["loc"])
        if detail["type"] == "unknown_key":
            place = f"{place}.{detail['ctx']['key']}"
        # That a value is none of a few words says less than what else is wrong with it.
        if place not in lines or detail["type"] != "literal_error":
            lines[place] = _line(detail)
    return [
        line
        for place, line in lines.items()
        if not any(other.startswith((f"{place}.", f"{place}[")) for other in lines)
    ]


def _line(detail: ErrorDetails) -> str:
    """One pydantic error as `place: value problem; remedy`."""
    kind, context = detail["type"], detail.get("ctx", {})
    value, place = _shown(detail["input"]), _place(detail["loc"])
    match kind:
        case "unknown_key":
            place = f"{place}.{context['key']}" if place else str(context["key"])
            return f"{place}: unknown key{context['hint']}"
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
            return f"{place}.type: unknown value '{tag}'{hint}"
        case "union_tag_not_found":
            return f"{place}.type: missing; it says what kind this is"
        case "literal_error":
            known = [
                word.strip("'") for word in context["expected"].replace(" or ", ", ").split(", ")
            ]
            hint = nearest(str(detail["input"]), known) or f"; known: {', '.join(known)}"
            return f"{place}: unknown value {value}{hint}"
        case "value_error":
            return f"{place}: {value} {context['error']}"
        case "finite_number":
            return f"{place}: {value} is not a finite number; give one that is"
        case "float_type":
            return f"{place}: {value} is not a number; give one"
        case "greater_than":
            return f"{place}: {value} is not positive; give a number > 0"
        case "too_long":
            return f"{place}: has more than {context['max_length']} entries"
        case "too_short" | "missing_required":
            return f"{place}: has too few entries; it needs {context.get('min_length', 1)}"
        case "string_type" | "tuple_type" | "dict_type" | "model_type" | "model_attributes_type":
            wanted = {"string_type": "a text", "tuple_type": "a list"}.get(kind, "a table")
            return f"{place}: {value} is not {wanted}; give one"
        case _:
            return f"{place}: {value}: {detail['msg'][0].lower()}{detail['msg'][1:]}"


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
            place += f".{part}" if place else part
    return place


def _shown(value: Any) -> str:
    try:
        text = repr(value)
    except RecursionError:
        text = "what is nested so deep"
    return text if len(text) <= 60 else f"{text[:57]}..."
