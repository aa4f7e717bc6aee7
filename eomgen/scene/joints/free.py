"""The free joint: a body with all degrees of freedom."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier, Table
from eomgen.language.formula import Formula
from eomgen.scene.joints.ball import angular_velocity, quaternion
from eomgen.scene.joints.base import WORLD, Z_AXIS, Coordinate, Orientation, Primitive

PLANE, SPACE = 2, 3


class Free(Table):
    """A body that moves freely in the plane or in space.

    In the plane its coordinates are x, y of the centre of mass in world axes, and its angle. In
    space they are x, y, z of the centre of mass and the unit quaternion of world_R_body; its
    velocities are that of the centre of mass in world axes and the angular velocity in body axes.
    """

    example: ClassVar[str] = """
[[joints]]
name = "flight"
type = "free"
child = "hand"
"""
    spaces: ClassVar[tuple[int, ...]] = (PLANE, SPACE)
    holds: ClassVar[bool] = False
    needs_inertia: ClassVar[bool] = True
    r_parent: ClassVar[tuple[Formula, ...]] = ()
    r_child: ClassVar[tuple[Formula, ...]] = ()
    orientation_deg: ClassVar[float | tuple[float, float, float]] = 0.0
    orientation: ClassVar[Orientation | None] = None
    loop: ClassVar[bool] = False
    misplaced: ClassVar[Mapping[str, str]] = {
        "loop": "a free joint holds nothing, so it closes no loop; leave the joint out"
    }
    type: Literal["free"]
    name: Identifier
    parent: Literal["world"] = "world"
    child: Identifier = Field(description="body that moves freely")
    coordinates: tuple[Identifier, Identifier, Identifier] | None = Field(
        default=None,
        description="names of x, y and angle, in space of x, y and z; <child>_x, … if absent",
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """The coordinates, in the order of `q`."""
        last = "angle" if dimensions == PLANE else "z"
        names = self.coordinates or (f"{self.child}_x", f"{self.child}_y", f"{self.child}_{last}")
        axes = "xyz"[:dimensions]
        translation = tuple(
            Coordinate(name, "m", f"{axis} of the centre of mass of {self.child}")
            for name, axis in zip(names, axes, strict=False)
        )
        if dimensions == PLANE:
            about = f"angle of {self.child} from the {WORLD}'s x axis"
            return (*translation, Coordinate(names[2], "rad", about))
        return (*translation, *quaternion(self.child, self.child, WORLD))

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Rates of the coordinates, but the angular velocity for the quaternion."""
        positions = self.positions(dimensions)
        if dimensions == PLANE:
            return tuple(c.rate for c in positions)
        rates = tuple(c.rate for c in positions[:SPACE])
        return (*rates, *angular_velocity(self.child, self.child, WORLD))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Prismatic primitives along the world's axes, then a revolute or a spherical one."""
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), Z_AXIS)
        slides = tuple(Primitive("prismatic", axis) for axis in axes[:dimensions])
        return (
            *slides,
            Primitive("revolute", Z_AXIS) if dimensions == PLANE else Primitive("spherical"),
        )
