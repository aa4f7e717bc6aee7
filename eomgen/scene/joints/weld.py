"""The weld: a rigid connection of two bodies."""

from typing import ClassVar, Literal

from eomgen.scene.joints.base import Coordinate, JointTable, Primitive


class Weld(JointTable):
    """The child is fixed to the parent."""

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "weld"
parent = "arm"
child = "hand"
r_parent = [0.4, 0]
orientation_deg = 90
"""
    type: Literal["weld"]

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """None."""
        return ()

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """None."""
        return ()

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """None."""
        return ()
