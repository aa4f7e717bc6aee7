"""The planar joint: translation in a plane of the parent and rotation about its normal."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.scene.joints.base import Z_AXIS, Coordinate, JointTable, Primitive


class Planar(JointTable):
    """The child translates along x and y of the joint's axes, and rotates about z."""

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "planar"
parent = "arm"
child = "hand"
"""
    type: Literal["planar"]
    coordinates: tuple[Identifier, Identifier, Identifier] | None = Field(
        default=None,
        description="names of x, y and angle; <name>_x, <name>_y, <name>_angle if absent",
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Two displacements and an angle."""
        x, y, angle = self.coordinates or (
            f"{self.name}_x",
            f"{self.name}_y",
            f"{self.name}_angle",
        )
        return (
            Coordinate(x, "m", f"displacement of {self.child} along x of {self.parent}"),
            Coordinate(y, "m", f"displacement of {self.child} along y of {self.parent}"),
            Coordinate(angle, "rad", f"angle of {self.child} from {self.parent}"),
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Two prismatic primitives, then a revolute one."""
        return (
            Primitive("prismatic", (1.0, 0.0, 0.0)),
            Primitive("prismatic", (0.0, 1.0, 0.0)),
            Primitive("revolute", Z_AXIS),
        )
