"""What an importer takes and returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eomgen.scene.importers.toml_text import toml_text


@dataclass(frozen=True)
class Wishes:
    """What a user wants of an import, beyond what the file says.

    floating  the root link moves freely instead of being fixed to the world
    stops     the limits of joints are rigid stops
    allowed   folders that files named in the robot file may lie in, beside its own folder
    """

    floating: bool = False
    stops: bool = False
    allowed: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Imported:
    """A robot file as a scene.

    tables   what the scene's TOML would hold: texts, numbers, lists, tables
    remarks  a sentence for each kind of thing in the file that the scene lacks or that was changed
    """

    tables: Mapping[str, Any]
    remarks: tuple[str, ...] = ()

    def toml(self) -> str:
        """The text of a scene's file that gives the same scene, with the remarks as comments."""
        return toml_text(self.tables, self.remarks)
