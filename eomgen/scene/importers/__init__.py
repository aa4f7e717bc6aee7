"""Importers: robot files of other programs as scenes.

To add one, add its entry here and the module that the entry names, which has
`imported(path, root, wishes)`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from eomgen.base.errors import SceneError
from eomgen.scene.importers.imported import Imported, Wishes

if TYPE_CHECKING:
    from eomgen.scene.importers.xml_elements import Element


@dataclass(frozen=True)
class Importer:
    """One kind of robot file.

    about   its name
    module  in this package, with `imported(path: Path, root: Element, wishes: Wishes) -> Imported`
    """

    about: str
    module: str


IMPORTERS: Mapping[str, Importer] = {
    "robot": Importer("URDF", "urdf.robot"),
    "mujoco": Importer("MJCF", "mjcf.robot"),
}
"""By the name of the root element."""
SUFFIXES = (".urdf", ".xml", ".mjcf", ".xacro")


def is_robot_file(path: Path) -> bool:
    """Whether a file is a robot file, by the end of its name."""
    return path.suffix.lower() in SUFFIXES


def import_file(path: Path, wishes: Wishes | None = None) -> Imported:
    """A robot file as the tables of a scene, and remarks on what these lack.

    Raises `SceneError`, one line, for a file that cannot be read or is no robot.
    """
    from eomgen.scene.importers.xml_elements import read_xml

    root = read_xml(path)
    if root.tag not in IMPORTERS:
        known = ", ".join(f"{kind.about} <{tag}>" for tag, kind in IMPORTERS.items())
        raise SceneError(
            f"{path.name}:{root.line}: the root element is <{root.tag}>; known: {known}"
        )
    imported: Imported = _importer(root).imported(path, root, wishes or Wishes())
    return imported


def _importer(root: "Element") -> ModuleType:
    return import_module(f"{__name__}.{IMPORTERS[root.tag].module}")
