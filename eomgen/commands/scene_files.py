"""The commands `show`, `new` and `copy`, on the files of scenes."""

import argparse
import re
from pathlib import Path

from eomgen.base.errors import RunError
from eomgen.base.files import write_whole
from eomgen.scene.built_in import START
from eomgen.scene.importers import is_robot_file
from eomgen.scene.reader import LARGEST_FILE, find_scene, parse_scene, scene_text

_NAME = re.compile(r"""^name\s*=\s*("[^"\n]*"|'[^'\n]*')""", re.MULTILINE)
_SCHEMA = re.compile(r"\A#:schema .*\n")


def show(given: argparse.Namespace) -> int:
    """Print the file of a scene."""
    print(scene_text(find_scene(given.scene)), end="")
    return 0


def new(given: argparse.Namespace) -> int:
    """Write a small scene with comments, which runs, to begin with."""
    _write(scene_text(START), given.name, given.force)
    print(f"    eomgen simulate {given.name.with_suffix('.toml')} runs it")
    return 0


def copy(given: argparse.Namespace) -> int:
    """Copy a scene, which takes the name of its new file."""
    path = find_scene(given.scene)
    if is_robot_file(path):
        raise RunError(f"{path}: is a robot file; eomgen import writes it as a scene")
    _write(scene_text(path), given.name or Path(path.name), given.force)
    return 0


def _write(text: str, name: Path, force: bool) -> None:
    """Write a scene's text to NAME.toml, with the name of the file. Raises `SceneError`."""
    if name.name in ("", ".."):
        raise RunError(f"'{name}' is no name of a file; give one, swing for example")
    path = name if name.suffix == ".toml" else name.with_name(f"{name.name}.toml")
    if path.exists() and not force:
        raise RunError(f"{path}: exists; choose another name, or give --force")
    top, bracket, rest = _SCHEMA.sub("", text).partition("\n[")
    # The editor's schema lies beside the built-in scenes only.
    renamed = _NAME.sub(lambda _: f'name = "{path.stem}"', top, count=1) + bracket + rest
    if len(renamed) > LARGEST_FILE:
        raise RunError(f"{path}: the scene is larger than {LARGEST_FILE} characters")
    parse_scene(renamed, path.name)
    write_whole(path, renamed, force=force)
    print(f"wrote {path}")
