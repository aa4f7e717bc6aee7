"""A pulley: a disc that a rope turns."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, Vector, quantity
from eomgen.scene.constraints.rope import Taut
from eomgen.scene.effects.spans import Stop
from eomgen.scene.effects.through import Sense


class Pulley(Taut):
    """A rope runs from a point of `body_1` over the disc of `radius` about the point `at` of `body`
    to a point of `body_2`, and turns the disc: it does not slip. It is a `rope` over one disc that
    grips, in the plane.

    The multipliers are the tensions on the side of `body_1` and on that of `body_2`, N.
    """

    told = "A rope turns a disc without slip. λ are the tensions of its two parts."
    example: ClassVar[str] = """
[[constraints]]
type = "pulley"
name = "wheel"
body = "hand"
radius = 0.1
body_1 = "world"
at_1 = [-0.3, -2.0]
body_2 = "world"
at_2 = [0.9, -2.0]
"""
    body_fields = ("body",)
    anchor_fields = ("body_1", "body_2")
    vector_fields = ("at", "at_1", "at_2")
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "at": ("body",),
        "at_1": ("body_1",),
        "at_2": ("body_2",),
    }

    type: Literal["pulley"]
    body: Identifier = Field(description="body that is or carries the disc")
    at: Vector = quantity(
        "m", "centre of the disc, from the centre of mass", default=(), validate_default=False
    )
    radius: Quantity = quantity("m", "radius of the disc", "positive")
    body_1: Identifier = Field(description="body at the rope's first end, or 'world'")
    at_1: Vector = quantity(
        "m", "first end from the centre of mass", default=(), validate_default=False
    )
    body_2: Identifier = Field(description="body at the rope's second end, or 'world'")
    at_2: Vector = quantity(
        "m", "second end from the centre of mass", default=(), validate_default=False
    )
    winds: Sense = Field(
        default="clockwise", description="sense in which the rope goes round, from its first end"
    )

    def stops(self) -> tuple[Stop, ...]:
        """One end, the disc, the other end."""
        return (
            Stop(self.body_1, self.at_1),
            Stop(self.body, self.at, self.radius, self.winds != "clockwise", True),
            Stop(self.body_2, self.at_2),
        )
