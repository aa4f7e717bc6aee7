"""The revolute joint between two bodies, or between a body and the world."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.quantity import Numbers
from eomgen.scene.joints.base import WORLD, Z_AXIS, Coordinate, Geared, Primitive, spatial


class Revolute(Geared):
    """A pin: x_child = x_parent + r_parent - r_child (handout (21)).

    `r_parent` is the pin's position from the parent's centre of mass (or the world's origin) in the
    parent's axes, `r_child` that from the child's centre of mass in the child's axes. In the plane
    the axis is z.
    """

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "revolute"
parent = "arm"
child = "hand"
r_parent = [0.4, 0]
r_child = [-0.1, 0]
coordinate = "bend"
"""
    type: Literal["revolute"]
    axis: Numbers | None = Field(default=None, description="direction in space; z if absent")

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """The child's angle relative to the parent."""
        base = "the world's x axis" if self.parent == WORLD else self.parent
        if dimensions == 3:
            base = "the world" if self.parent == WORLD else self.parent
        name = self.coordinate or f"{self.name}_angle"
        return (Coordinate(name, "rad", f"angle of {self.child} from {base}"),)

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Its rate."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """One revolute primitive."""
        return (Primitive("revolute", spatial(self.axis or Z_AXIS)),)
