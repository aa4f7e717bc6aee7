"""The free joint of the plane: a body that nothing holds."""

from typing import Literal

from pydantic import Field

from eomgen.joints.base import WORLD, Coordinate
from eomgen.language.base import Identifier, Table


class Free(Table):
    """A body free in the plane: x, y of its centre of mass and its angle, in world axes."""

    type: Literal["free"]
    name: Identifier
    parent: Literal["world"] = "world"
    child: Identifier = Field(description="body that moves freely")
    coordinates: tuple[Identifier, Identifier, Identifier] | None = Field(
        default=None,
        description="names of x, y and angle; <child>_x, <child>_y, <child>_angle if absent",
    )

    def named_coordinates(self) -> tuple[Coordinate, ...]:
        """The joint's coordinates, in the order they take in `q`."""
        x, y, angle = self.coordinates or (
            f"{self.child}_x",
            f"{self.child}_y",
            f"{self.child}_angle",
        )
        return (
            Coordinate(x, "m", f"x of the centre of mass of {self.child}"),
            Coordinate(y, "m", f"y of the centre of mass of {self.child}"),
            Coordinate(angle, "rad", f"angle of {self.child} from the {WORLD}'s x axis"),
        )
