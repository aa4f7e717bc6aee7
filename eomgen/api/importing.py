"""Importing a robot file as a scene."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from eomgen.scene.importers import import_file
from eomgen.scene.importers.imported import Imported, Wishes
from eomgen.scene.reader import find_scene


def import_robot(
    path: str | PathLike[str],
    *,
    floating: bool = False,
    stops: bool = False,
    contacts: bool = False,
    self_contacts: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Imported:
    """Read a robot file, URDF or MJCF: its `tables`, as a scene's file holds them, and `remarks`.

    path      the file
    floating  of a URDF, whether its root link moves freely; else it is fixed to the world
    stops     whether the limits of joints are rigid stops without bounce; else a coordinate beyond
              them is reported
    contacts  whether collision geometry touches the ground, softly: the planes of an MJCF file's
              world; z = 0 for a URDF, which then starts on it if it moves freely
    self_contacts  whether it touches the ground and, between bodies that no joint connects, itself
              and fixed obstacles: at most 200 pairs of spheres, capsules and boxes
    allow     folders in which meshes and included files may lie, beside the file's own

    All functions that take a scene take `tables`, and the path of a robot file as well. `toml()`
    of the result is the text of a scene's file. With the loaded module of an MJCF file,
    `mujoco(module)` converts its states to `qpos` and `qvel` of MuJoCo and back; with that of a
    URDF, `pinocchio(module)` to `q` and `v` of Pinocchio. Raises `SceneError` for a file that is no
    robot.
    """
    allowed = tuple(map(Path, allow))
    wishes = Wishes(
        floating=floating,
        stops=stops,
        contacts=contacts,
        self_contacts=self_contacts,
        allowed=allowed,
    )
    return import_file(find_scene(str(path)), wishes)
