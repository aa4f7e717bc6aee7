"""From a file or a built-in name to a `Scene`, or to messages that say what to mend and where."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from eomgen.errors import SceneError, nearest
from eomgen.files import read_plain
from eomgen.language.base import LARGEST
from eomgen.scene.built_in import BUILT_IN, built_in_names
from eomgen.scene.mistakes import mistakes, shown
from eomgen.scene.schema import MOST, Scene
from eomgen.text import breaks_lines, brief

LARGEST_FILE = 2_000_000
LONGEST_LIST = 10 * MOST
"""The state of as many free bodies as there may be is shorter."""
DEEPEST_KEY = 20
LARGEST_WHOLE = 2**1023
"""Whole numbers beyond it are no doubles: they are refused before anything makes one of them."""
REMEDY = f"give at most {LARGEST:g}, or choose other units"
_DEEP_KEY = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST_KEY}}}"""
)


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
        raise SceneError(f"{shown(scene)}: cannot be read: {error.strerror}") from None
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
        raise mistakes(error, source) from None


def _check_sizes(table: dict[str, Any], source: str) -> None:
    """Refuse lists that are too long and numbers that are too large before each entry is looked at.

    Raises `SceneError` that names the place.
    """
    rest: list[tuple[str, Any]] = [("", table)]
    while rest:
        location, value = rest.pop()
        most = MOST if location in Scene.model_fields else LONGEST_LIST
        if isinstance(value, list | dict) and location and len(value) > most:
            raise SceneError(f"{source}: {location}: has {len(value)} entries; give at most {most}")
        if isinstance(value, dict):
            rest += [
                (f"{location}.{brief(key)}".lstrip("."), entry) for key, entry in value.items()
            ]
        elif isinstance(value, list):
            rest += [(f"{location}[{i}]", entry) for i, entry in enumerate(value)]
        elif isinstance(value, int) and abs(value) > LARGEST_WHOLE:
            raise SceneError(f"{source}: {location}: is a number of hundreds of digits; {REMEDY}")
