"""The weld: two bodies that move as one."""

from typing import Literal

from eomgen.scene.joints.base import Coordinate, JointTable, Primitive


class Weld(JointTable):
    """No motion at all; the child keeps its place in the parent."""

    type: Literal["weld"]

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """A weld has no coordinate."""
        return ()

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Nor a velocity."""
        return ()

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Nor a move."""
        return ()
