"""The rotational joint: a pin that two bodies share, or a body and the world."""

from typing import Literal

from pydantic import Field

from eomgen.joints.base import WORLD, Coordinate
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Vector, quantity


class Revolute(Table):
    """A pin: x_child = x_parent + r_parent - r_child (handout (21)).

    `r_parent` runs from the parent's centre of mass (or the world's origin) to the pin in the
    parent's axes, `r_child` from the child's centre of mass to the pin in the child's axes.
    """

    type: Literal["revolute"]
    name: Identifier
    parent: Identifier = Field(description="body on the inner side, or 'world'")
    child: Identifier = Field(description="body on the outer side")
    r_parent: Vector = quantity(
        "m", "pin from the parent's centre of mass", default=(ZERO, ZERO), validate_default=False
    )
    r_child: Vector = quantity(
        "m", "pin from the child's centre of mass", default=(ZERO, ZERO), validate_default=False
    )
    coordinate: Identifier | None = Field(
        default=None, description="name of the angle; <name>_angle if absent"
    )

    def named_coordinates(self) -> tuple[Coordinate, ...]:
        """The joint's one coordinate: the child's angle relative to the parent."""
        base = "the world's x axis" if self.parent == WORLD else self.parent
        name = self.coordinate or f"{self.name}_angle"
        return (Coordinate(name, "rad", f"angle of {self.child} from {base}"),)
