"""A belt between two discs."""

from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.formula import Formula
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.constraints.gear import Transmission


class Belt(Transmission):
    """A belt or chain that does not slip connects discs of two bodies, which turn about axes that
    their `carrier` holds, in the same sense, or in opposite senses if it is `crossed`. The discs
    are around the axes.

    The angles are those of joints, from the carrier. The belt is tight on both sides: the
    multiplier is the difference of its two tensions, N, counted in the sense in which `body_1`
    turns.
    """

    told = "A belt connects two discs without slip. λ is the difference of its tensions."
    example: ClassVar[str] = """
[[constraints]]
type = "belt"
name = "drive"
body_1 = "hand"
body_2 = "world"
carrier = "arm"
radius_1 = 0.05
radius_2 = 0.2
"""
    type: Literal["belt"]
    radius_1: Quantity = quantity("m", "radius of the disc of body_1", "positive")
    radius_2: Quantity = quantity("m", "radius of the disc of body_2", "positive")
    crossed: bool = Field(default=False, strict=True, description="whether it crosses itself")

    def opposed(self) -> bool:
        """A crossed one."""
        return self.crossed

    def weights(self) -> tuple[Formula, Formula]:
        """The radii."""
        return self.radius_1, self.radius_2
