"""What other packages add: entry points of installed packages, by group.

    [project.entry-points."eomgen.effects"]
    buoyancy = "my_package:Buoyancy"

eomgen.effects      a class derived from `scene.effects.base.EffectTable`; the name is its `type`
eomgen.joints       a class derived from `scene.joints.base.JointTable`, likewise
eomgen.constraints  a class derived from `scene.constraints.base.ConstraintTable`, likewise
eomgen.backends     a module or object that is a `codegen.backends.Backend`
eomgen.integrators  a `tables.integrators.IntegratorSpec`

Packages are code that the user installed, and are trusted as such: a scene names what they add, but
cannot add anything.
"""

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from eomgen.base.errors import EomgenError

GROUPS = ("effects", "joints", "constraints", "backends", "integrators")


@cache
def _found() -> tuple[tuple[Distribution, EntryPoint], ...]:
    """All entry points of our groups with their packages, by group and name."""
    groups = {f"eomgen.{group}" for group in GROUPS}
    both = [(d, e) for d in distributions() for e in d.entry_points if e.group in groups]
    return tuple(sorted(both, key=lambda each: (each[1].group, each[1].name, each[0].name)))


def added(group: str, own: Mapping[str, Any]) -> dict[str, Any]:
    """What packages add to a group, loaded, by name in alphabetical order.

    Raises `EomgenError` if one cannot be loaded, or has a name that is taken: by `own` or by
    another package.
    """
    found: dict[str, Any] = {}
    for package, point in _found():
        if point.group != f"eomgen.{group}":
            continue
        place = f"package {package.name}: {point.group}: {point.name}"
        if point.name in own or point.name in found:
            raise EomgenError(f"{place}: this name is taken; uninstall the package or rename it")
        try:
            found[point.name] = point.load()
        except Exception as error:  # whatever a package's own code raises
            reason = f"{type(error).__name__}: {error}"
            raise EomgenError(f"{place}: cannot be loaded: {reason}; uninstall it") from error
    return found


def added_tables(group: str, own: tuple[Any, ...], base: type) -> tuple[Any, ...]:
    """The classes of tables that packages add to a group, in the order of their types.

    Raises `EomgenError` as `added` does, and for what is not derived from `base` or has another
    `type` than its entry point's name.
    """
    types = {kind: each for each in own if (kind := type_of(each))}
    found = added(group, types)
    for name, table in found.items():
        if not (isinstance(table, type) and issubclass(table, base)) or type_of(table) != name:
            wanted = f"a class derived from {base.__name__} with type: Literal['{name}']"
            raise EomgenError(f"eomgen.{group}: {name}: is not {wanted}")
    return tuple(found.values())


def type_of(table: Any) -> str:
    """The `type` in scenes that selects a class; "" if it has none."""
    field = table.model_fields.get("type")
    values = getattr(field.annotation, "__args__", ()) if field else ()
    return str(values[0]) if values else ""


@cache
def digest() -> bytes:
    """A digest of what packages add: entry points, and the contents of the packages' files. It is
    a part of the key of generated code.
    """
    found = hashlib.sha256()
    for package, point in _found():
        line = f"{package.name} {package.version} {point.group} {point.name} {point.value}\n"
        found.update(line.encode())
    for name in dict.fromkeys(point.module.partition(".")[0] for _, point in _found()):
        for path in _files(name):
            found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.digest()


def _files(module: str) -> list[Path]:
    """The files of a top-level module or package, wherever it is installed."""
    spec = find_spec(module)
    if spec is None:
        return []
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    if not folders:
        return [Path(spec.origin)] if spec.origin else []
    every = (path for folder in folders for path in folder.rglob("*"))
    return sorted(path for path in every if path.suffix in (".py", ".jinja"))
