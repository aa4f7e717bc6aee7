"""The built-in scenes: their files, names and titles."""

import tomllib
from pathlib import Path

BUILT_IN = Path(__file__).parent.parent / "scenes"
START = BUILT_IN / "start" / "start.toml"
"""A scene with comments, to begin with."""


def built_in_names() -> tuple[str, ...]:
    """Names of the built-in scenes, in alphabetical order."""
    return tuple(sorted(path.stem for path in BUILT_IN.glob("*.toml")))


def titles() -> dict[str, str]:
    """The title of each built-in scene, by name.

    Only the part of each file before its first table is parsed; a whole scene takes much longer.
    """
    texts = {name: (BUILT_IN / f"{name}.toml").read_text("utf-8") for name in built_in_names()}
    return {name: tomllib.loads(text.partition("\n[")[0])["title"] for name, text in texts.items()}
