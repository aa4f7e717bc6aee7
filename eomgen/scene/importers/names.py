"""Names of other programs as names of a scene."""

import keyword
import re
import sys
from collections.abc import Collection, Iterable, Sequence

from eomgen.base.text import brief
from eomgen.scene.joints.base import WORLD

LONGEST = 60
"""Longer names are cut, so that names made from them are not too long either."""
TAKEN = frozenset(("t", "pi", WORLD))
"""Names that have a meaning in scenes."""


def identifiers(
    names: Iterable[str],
    kind: str,
    taken: Collection[str] = TAKEN,
    endings: Sequence[str] = (),
) -> dict[str, str]:
    """An identifier for each name, all different and none of `taken`.

    Names that are identifiers stay. Others begin or end with `kind` where they need more letters.
    Names with one of the `endings` stand for something else, so no other name is one of these.
    """
    listed = list(names)
    plain = {name: _plain(name, kind) for name in listed}
    reserved = {*taken, *(f"{stem}{ending}" for stem in plain.values() for ending in endings)}
    found = {name: name for name, stem in plain.items() if stem == name and name not in reserved}
    used = {*found, *reserved}
    for name, stem in plain.items():
        if name in found:
            continue
        stem = f"{stem}_{kind}" if stem in reserved else stem
        new, count = stem, 1
        while new in used:
            count += 1
            new = f"{stem}_{count}"
        found[name] = new
        used |= {new, *(f"{new}{ending}" for ending in endings)}
    return {name: found[name] for name in listed}


def scene_name(name: str, fallback: str) -> str:
    """The name of a scene; generated code must not hide a module of Python."""
    found = _plain(name or fallback, "robot")
    hides = found in sys.stdlib_module_names or found == "numpy"
    return f"{found}_robot" if hides else found


def _plain(name: str, kind: str) -> str:
    """A name of letters, digits and single underscores that begins with a letter."""
    found = re.sub(r"[^A-Za-z0-9]+", "_", name[: 4 * LONGEST]).strip("_")[:LONGEST].strip("_")
    if not found[:1].isalpha():
        found = f"{kind}_{found}".strip("_")
    is_word = keyword.iskeyword(found) or keyword.issoftkeyword(found)
    return f"{found}_{kind}" if is_word else found


def renamed(found: dict[str, str]) -> list[str]:
    """What was changed, as "'a b' is a_b", for remarks."""
    return [f"'{brief(name)}' is {new}" for name, new in found.items() if name != new]
