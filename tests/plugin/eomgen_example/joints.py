"""A joint."""

from typing import ClassVar, Literal

from eomgen.scene.joints.base import Coordinate, JointTable, Primitive


class Telescope(JointTable):
    """Two slides one after the other: along the parent's x, and along its y (z in space)."""

    example: ClassVar[str] = """
[[joints]]
name = "boom"
type = "telescope"
parent = "arm"
child = "hand"
"""
    type: Literal["telescope"]

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Two displacements."""
        return tuple(
            Coordinate(f"{self.name}_{part}", "m", f"displacement of {self.child}")
            for part in ("out", "up")
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Two prismatic ones."""
        up = (0.0, 1.0, 0.0) if dimensions == 2 else (0.0, 0.0, 1.0)
        return (Primitive("prismatic", (1.0, 0.0, 0.0)), Primitive("prismatic", up))
