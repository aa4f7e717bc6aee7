"""The universal joint: two revolute axes in series."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Numbers
from eomgen.scene.joints.base import Coordinate, Primitive, WithRotor, spatial


class Universal(WithRotor):
    """The child rotates about the first axis, and about the second, which moves with the first."""

    example: ClassVar[str] = """
[[joints]]
name = "elbow"
type = "universal"
parent = "arm"
child = "hand"
axes = [[1, 0, 0], [0, 1, 0]]
"""
    spaces: ClassVar[tuple[int, ...]] = (3,)
    type: Literal["universal"]
    axes: tuple[Numbers, Numbers] = Field(
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        description="two directions: in the joint's axes, and in these after the first rotation",
    )
    coordinates: tuple[Identifier, Identifier] | None = Field(
        default=None, description="names of the angles; <name>_angle_1, <name>_angle_2 if absent"
    )

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Two angles."""
        names = self.coordinates or (f"{self.name}_angle_1", f"{self.name}_angle_2")
        return tuple(
            Coordinate(name, "rad", f"{order} angle of {self.child} from {self.parent}")
            for name, order in zip(names, ("first", "second"), strict=True)
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Two revolute primitives."""
        return tuple(Primitive("revolute", spatial(axis)) for axis in self.axes)
