"""The weld: a rigid connection of two bodies."""

from typing import Literal

from eomgen.scene.joints.base import Coordinate, JointTable, Primitive


class Weld(JointTable):
    """The child is fixed to the parent."""

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
