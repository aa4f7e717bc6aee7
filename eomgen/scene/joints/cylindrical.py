"""The cylindrical joint: translation along an axis and rotation about it."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Numbers
from eomgen.scene.joints.base import Z_AXIS, Coordinate, JointTable, Primitive, spatial


class Cylindrical(JointTable):
    """The child translates along `axis` and rotates about it."""

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "cylindrical"
parent = "arm"
child = "hand"
axis = [1, 0, 0]
"""
    spaces: ClassVar[tuple[int, ...]] = (3,)
    type: Literal["cylindrical"]
    axis: Numbers = Field(default=Z_AXIS, description="direction in the child's axes")
    coordinates: tuple[Identifier, Identifier] | None = Field(
        default=None, description="names of slide and angle; <name>_slide, <name>_angle if absent"
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Displacement and angle."""
        slide, angle = self.coordinates or (f"{self.name}_slide", f"{self.name}_angle")
        return (
            Coordinate(slide, "m", f"displacement of {self.child} relative to {self.parent}"),
            Coordinate(angle, "rad", f"angle of {self.child} from {self.parent}"),
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """A prismatic, then a revolute primitive, on one axis."""
        axis = spatial(self.axis)
        return (Primitive("prismatic", axis), Primitive("revolute", axis))
