"""The ball (spherical) joint, with a unit quaternion for its orientation."""

from typing import ClassVar, Literal

from eomgen.scene.joints.base import Coordinate, Primitive, WithRotor


class Ball(WithRotor):
    """The child rotates about a point: world_R_child = world_R_parent E R(quaternion).

    E is the fixed rotation `orientation_deg`. The velocities are the angular velocity of the child
    relative to the parent, in the child's axes.
    """

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "ball"
parent = "arm"
child = "hand"
r_parent = [0, 0, -0.4]
r_child = [0, 0, 0.1]
"""
    spaces: ClassVar[tuple[int, ...]] = (3,)
    type: Literal["ball"]

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """A unit quaternion w, x, y, z."""
        return quaternion(self.name, self.child, self.parent)

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Three components of the angular velocity."""
        return angular_velocity(self.name, self.child, self.parent)

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """One spherical primitive."""
        return (Primitive("spherical"),)


def quaternion(prefix: str, child: str, parent: str) -> tuple[Coordinate, ...]:
    """The coordinates of an orientation: a unit quaternion w, x, y, z."""
    about = f"of the unit quaternion of {child} in {parent}"
    return tuple(Coordinate(f"{prefix}_q{part}", "", f"{part} {about}") for part in "wxyz")


def angular_velocity(prefix: str, child: str, parent: str) -> tuple[Coordinate, ...]:
    """The velocities of an orientation: the angular velocity in the child's axes."""
    about = f"of the angular velocity of {child} against {parent}, axes of {child}"
    return tuple(Coordinate(f"{prefix}_w{part}", "rad/s", f"{part} {about}") for part in "xyz")
