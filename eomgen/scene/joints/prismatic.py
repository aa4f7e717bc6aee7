"""The prismatic joint."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Number
from eomgen.language.quantity import Numbers
from eomgen.scene.joints.base import WORLD, Coordinate, Geared, Primitive, spatial


class Prismatic(Geared):
    """The child translates along `axis` and does not rotate relative to the parent."""

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "prismatic"
parent = "arm"
child = "hand"
axis = [1, 0]
coordinate = "reach"
"""
    type: Literal["prismatic"]
    axis: Numbers = Field(description="direction in the child's axes")

    limits: tuple[Number, Number] | None = Field(
        default=None, description="range of the coordinate; leaving it is reported, not prevented"
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """The displacement of the joint's point on the child from that on the parent, m."""
        base = "the world" if self.parent == WORLD else self.parent
        name = self.coordinate or f"{self.name}_slide"
        return (Coordinate(name, "m", f"displacement of {self.child} relative to {base}"),)

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Its rate."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """One prismatic primitive."""
        return (Primitive("prismatic", spatial(self.axis)),)
