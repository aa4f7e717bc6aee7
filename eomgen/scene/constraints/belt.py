"""A belt between two discs."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.formula import Constant, Formula
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.rewriting import times
from eomgen.scene.constraints.gear import Transmission
from eomgen.scene.effects.elements import Attachment, Cord, Disc, Layout, Round
from eomgen.scene.joints.base import WORLD


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

    def elements(self, layout: Layout) -> Iterator[Cord | Round]:
        """The belt, in the plane, and a disc of the world."""
        wheels = self.wheels(layout) if layout.dimensions == 2 else ()
        stops = tuple(Attachment(layout.bodies[wheel.body], wheel.at) for wheel in wheels)
        if not stops:
            return
        if self.body_2 == WORLD:
            yield Round("ball", self.name, stops[1].body, stops[1].at, self.radius_2)
        sign = -1.0 if self.crossed else 1.0
        yield Cord(self.name, stops, (self.radius_1, times(sign, self.radius_2)), closed=True)

    def discs(self, layout: Layout) -> Iterator[Disc]:
        """The discs of bodies."""
        for wheel in self.wheels(layout):
            if wheel.body != WORLD:
                yield Disc(wheel.body, wheel.at, Constant(wheel.radius))

    def opposed(self) -> bool:
        """A crossed one."""
        return self.crossed

    def weights(self) -> tuple[Formula, Formula]:
        """The radii."""
        return self.radius_1, self.radius_2
