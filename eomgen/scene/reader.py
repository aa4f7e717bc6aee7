"""Reading a scene from a file, a built-in name, text or tables. Errors are `SceneError`s."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from eomgen.base.errors import SceneError, nearest
from eomgen.base.files import read_plain
from eomgen.base.text import breaks_lines, brief
from eomgen.language.base import LARGEST
from eomgen.scene.built_in import BUILT_IN, built_in_names
from eomgen.scene.importers import import_file, is_robot_file
from eomgen.scene.importers.imported import Imported
from eomgen.scene.lines import with_lines
from eomgen.scene.mistakes import mistakes, shown
from eomgen.scene.schema import MOST, Scene

LARGEST_FILE = 2_000_000
LONGEST_LIST = 10 * MOST
"""More than the number of states of `MOST` free bodies."""
DEEPEST_KEY = 20
LARGEST_WHOLE = 2**1023
"""Larger whole numbers overflow a double, so they are refused before any conversion."""
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
        beside = sorted(file.name for file in path.parent.glob("*.toml"))
        names = built_in_names()
        hint = f" (did you mean '{path}.toml'?)" if f"{path.name}.toml" in beside else ""
        hint = hint or nearest(scene, names) or nearest(path.name, beside)
        hint = hint or f"; known: {', '.join(names)}"
        raise SceneError(f"{scene}: no such file or built-in scene{hint}")
    return path


def read_scene(scene: str | Path) -> Scene:
    """Read a scene from a path or by its built-in name. A robot file (URDF, MJCF) is imported, and
    what the scene lacks of it is in `remarks`.

    Raises `SceneError` with a message for each mistake: line of the file, location, value, remedy.
    """
    path = find_scene(scene) if isinstance(scene, str) else scene
    if is_robot_file(path):
        return imported_scene(import_file(path), path.name)
    text = scene_text(path)
    try:
        return parse_scene(text, path.name)
    except SceneError as error:
        raise SceneError(*with_lines(error.lines, path.name, text)) from None


def scene_text(path: Path) -> str:
    """The text of a scene's file. Raises `SceneError` if it cannot be read, or is not UTF-8."""
    data = read_plain(path, LARGEST_FILE, name=path.name, error=SceneError)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path.name}: is not UTF-8 text (byte {error.start})") from None


def parse_scene(text: str, source: str = "scene") -> Scene:
    """Read a scene from TOML text; `source` names it in messages. Raises `SceneError`."""
    # `tomllib` takes time for a dotted key that grows at least with the square of its length.
    if _DEEP_KEY.search(text):
        raise SceneError(f"{source}: a key has more than {DEEPEST_KEY} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{source}: is not TOML: nested too deep") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{source}: is not TOML: {error}{_toml_remedy(str(error))}") from None
    except ValueError:  # Python's message is advice to programmers
        raise SceneError(f"{source}: has a whole number of thousands of digits; {REMEDY}") from None
    return _scene(table, source)


def _toml_remedy(message: str) -> str:
    """What to do about the mistakes that are made most, which the parser's message leaves open."""
    if message.startswith(("Cannot declare", "Cannot overwrite")):
        return "; a key stands once in a table; lists of tables have double brackets, [[effects]]"
    return "; a text stands in quotes" if message.startswith("Invalid value") else ""


def read_tables(tables: Mapping[Any, Any], source: str = "scene") -> Scene:
    """Read a scene from tables with the content of a file; numbers and lists may be NumPy's numbers
    and arrays. Raises `SceneError`.
    """
    try:
        table = _plain(tables)
    except RecursionError:
        raise SceneError(f"{source}: is nested too deep") from None
    return _scene(table, source)


def imported_scene(imported: Imported, source: str) -> Scene:
    """The scene of an imported file, which `source` names. Raises `SceneError`."""
    return read_tables(imported.tables, source).with_remarks(imported.remarks)


def _plain(value: Any) -> Any:
    """A value in the types of `tomllib`. The schema refuses values of other types."""
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): _plain(x) for key, x in value.items()}
    if hasattr(value, "tolist"):  # a NumPy number or array
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
    """Raise `SceneError` for a list that is too long or a whole number that is too large.

    This bounds the time of the validation that follows.
    """
    pending: list[tuple[str, Any]] = [("", table)]
    while pending:
        location, value = pending.pop()
        most = MOST if location in Scene.model_fields else LONGEST_LIST
        if isinstance(value, list | dict) and location and len(value) > most:
            raise SceneError(f"{source}: {location}: has {len(value)} entries; give at most {most}")
        if isinstance(value, dict):
            pending += [
                (f"{location}.{brief(key)}".lstrip("."), entry) for key, entry in value.items()
            ]
        elif isinstance(value, list):
            pending += [(f"{location}[{i}]", entry) for i, entry in enumerate(value)]
        elif isinstance(value, int) and abs(value) > LARGEST_WHOLE:
            raise SceneError(f"{source}: {location}: has hundreds of digits; {REMEDY}")
