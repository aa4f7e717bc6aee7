"""What joint types share."""

from dataclasses import dataclass

WORLD = "world"
"""The name of the ground: the parent of every tree's first joint."""


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of a joint. Its velocity is called `<name>_dot`."""

    name: str
    unit: str
    about: str

    @property
    def rate(self) -> str:
        """Name of the coordinate's time derivative."""
        return f"{self.name}_dot"
