"""The particle joint: translation alone."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.scene.joints.base import Z_AXIS, Coordinate, Primitive, WithRotor


class Particle(WithRotor):
    """The child translates along all axes of the parent and does not rotate relative to it.

    A point mass is a body on a particle joint to the world: it needs no `inertia_com`, which is
    then 0. The coordinates are those of the child's point from the parent's, in the joint's axes.
    """

    example: ClassVar[str] = """
[[joints]]
name = "flight"
type = "particle"
parent = "world"
child = "hand"
"""
    needs_inertia = False

    type: Literal["particle"]
    coordinates: tuple[Identifier, ...] | None = Field(
        default=None,
        min_length=2,
        max_length=3,
        description="names of x and y, in space of x, y and z; <child>_x, … if absent",
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """A displacement along each axis."""
        axes = "xyz"[:dimensions]
        names = self.coordinates or tuple(f"{self.child}_{axis}" for axis in axes)
        return tuple(
            Coordinate(name, "m", f"displacement of {self.child} along {axis} of {self.parent}")
            for name, axis in zip(names, axes, strict=False)
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """A prismatic primitive along each axis."""
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), Z_AXIS)
        return tuple(Primitive("prismatic", axis) for axis in axes[:dimensions])
