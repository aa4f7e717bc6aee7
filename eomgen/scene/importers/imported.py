"""What an importer takes and returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.scene.importers.conventions import Convention
from eomgen.scene.importers.conversion import Conversion, conversion
from eomgen.scene.importers.toml_text import toml_text


@dataclass(frozen=True)
class Wishes:
    """What a user wants of an import, beyond what the file says.

    floating  the root link moves freely instead of being fixed to the world
    stops     the limits of joints are rigid stops
    contacts  collision geometry touches the ground
    self_contacts  it touches the ground and itself
    allowed   folders that files named in the robot file may lie in, beside its own folder
    """

    floating: bool = False
    stops: bool = False
    contacts: bool = False
    self_contacts: bool = False
    allowed: tuple[Path, ...] = ()


@dataclass(frozen=True, repr=False)
class Imported(Displayed):
    """A robot file as a scene.

    tables      what the scene's TOML would hold: texts, numbers, lists, tables
    remarks     a sentence for each kind of thing in the file that the scene lacks or that was
                changed
    convention  the order and frames of coordinates and velocities in MuJoCo or Pinocchio
    """

    shown = ("tables", "remarks")

    tables: Mapping[str, Any]
    remarks: tuple[str, ...]
    convention: Convention

    def toml(self) -> str:
        """The text of a scene's file that gives the same scene, with the remarks as comments."""
        return toml_text(self.tables, self.remarks)

    def mujoco(self, module: Any) -> Conversion:
        """States of a loaded module as `qpos` and `qvel` of MuJoCo, and back; of an MJCF file.

        Raises `RunError` for a file of another kind, or a module of another robot.
        """
        return self._conversion("MuJoCo", module)

    def pinocchio(self, module: Any) -> Conversion:
        """States of a loaded module as `q` and `v` of Pinocchio, and back; of a URDF file.

        Pinocchio's model is that of `buildModelFromUrdf`, if the root moves freely with a
        `JointModelFreeFlyer`; without `mimic`. Raises `RunError` for a file of another kind, a
        module of another robot, or where Pinocchio's robot moves otherwise.
        """
        return self._conversion("Pinocchio", module)

    def _conversion(self, program: str, module: Any) -> Conversion:
        if program != self.convention.program:
            raise RunError(f"{program}: the file is one of {self.convention.program}'s")
        return conversion(self.convention, module)
