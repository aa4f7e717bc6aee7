"""Gears: two bodies that turn each other at a fixed ratio."""

import math
from collections.abc import Iterator
from typing import ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.formula import ZERO, Apply, Constant, Formula, Name, names_in
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.rewriting import difference, total
from eomgen.scene.constraints.base import ConstraintTable, Given, Linkage, Row, Ways
from eomgen.scene.constraints.formula import position_row
from eomgen.scene.constraints.meshing import Wheel, meshed, teeth_of
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.elements import Disc, Element, Layout, Round
from eomgen.scene.joints.base import WORLD

ONE = Constant(1.0)


class Transmission(ConstraintTable):
    """Two bodies turn about axes that one body carries; the angle of one is the other's times a
    ratio.
    """

    anchor_fields = ("body_1", "body_2", "carrier")

    body_1: Identifier = Field(description="body that turns")
    body_2: Identifier = Field(description="body that turns with it, or 'world'")
    carrier: Identifier | None = Field(
        default=None,
        description="body that carries both axes, if they are joined to different ones",
    )
    phase: Quantity = quantity(
        "rad",
        "angle of body_1 where that of body_2 is 0",
        default=ZERO,
        validate_default=False,
    )

    _angles: tuple[Formula, ...] = PrivateAttr(default=())
    """The angles of both bodies from their carrier, rad."""

    @model_validator(mode="after")
    def _two_bodies(self) -> Self:
        if self.body_1 == self.body_2:
            raise wrong("body_2", "is also body_1; name another body")
        return self

    def wheels(self, layout: Layout) -> list[Wheel]:
        """Both wheels as pictures show them."""
        own, ratio = map(layout.value, self.weights())
        radius = None if self.weights()[0] == ONE else own
        bodies = self.body_1, self.body_2
        return meshed(layout, bodies, self.carrier or WORLD, ratio / own, radius, self.opposed())

    def opposed(self) -> bool:
        """Whether the bodies turn in opposite senses."""
        raise NotImplementedError

    def weights(self) -> tuple[Formula, Formula]:
        """The factors of both angles, positive: radii, m, or 1 and a ratio."""
        raise NotImplementedError

    def placed(self, ways: Ways, location: str) -> Self:
        """With the angles of its bodies from the one that carries both."""
        carrier = self.carrier
        if carrier is None:
            carriers = [ways.parent(b) for b in (self.body_1, self.body_2) if b != WORLD]
            carrier = carriers[0]
            if any(other != carrier for other in carriers[1:]) or self.body_2 == carrier:
                raise SceneError(
                    f"{location}.carrier: missing; '{self.body_1}' and '{self.body_2}' are joined "
                    "to different bodies; name the one that carries both axes"
                )
        copy, angles = self.replaced(carrier=carrier), []
        for key in ("body_1", "body_2"):
            angle = ways.turn(getattr(self, key), carrier, f"{location}.{key}")
            if angle == ZERO:
                raise SceneError(
                    f"{location}.{key}: '{getattr(self, key)}' does not turn on '{carrier}'; name "
                    "a body that does, or another carrier"
                )
            angles.append(angle)
        copy._angles = tuple(angles)
        return copy

    def loop_part(self) -> Given | None:
        """The angle of the first body by that of the second, if it is a coordinate."""
        one, other = self._angles
        own, ratio = self.weights()
        if not isinstance(one, Name) or one.name in names_in(other):
            return None
        factor = ratio if own == ONE else Apply("/", (ratio, own))
        return Given(one.name, self._first(Apply("*", (factor, other))))

    def _first(self, turned: Formula) -> Formula:
        """The first angle, if the second turns the first one by so much."""
        return difference(self.phase, turned) if self.opposed() else total(turned, self.phase)

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row, of the constraint's name: a force if there are radii, or else a torque."""
        return [(self.name, "N m" if self.weights()[0] == ONE else "N")]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The way of the first body less that of the second."""
        (one, other), (own, ratio) = self._angles, self.weights()
        first = difference(one, self.phase)
        if own != ONE:
            first = Apply("*", (own, first))
        turned = Apply("*", (ratio, other))
        yield position_row(mechanism, Apply("+" if self.opposed() else "-", (first, turned)))


class Gear(Transmission):
    """Two gears mesh: `body_1` and `body_2` turn about axes that their `carrier` holds, in opposite
    senses, or `inside` a ring in the same sense. Give the numbers of `teeth`, the radii, or the
    `ratio`, which is the number of turns of `body_1` for one of `body_2`.

    The angles are those of joints, from the carrier, about the axes of the joints: axes that point
    the same way for spur gears; for bevel gears choose `inside` by the axes. A carrier that turns
    makes it a planetary gear. The world may be `body_2`, as a fixed ring gear.

    The multiplier is the torque on `body_1` that the gears transmit, N m; with radii it is the
    force between the teeth, N, counted in the sense in which `body_1` turns.
    """

    told = "Two gears mesh. λ is what turns the first."
    example: ClassVar[str] = """
[[constraints]]
type = "gear"
name = "mesh"
body_1 = "hand"
body_2 = "world"
carrier = "arm"
teeth_1 = 12
teeth_2 = 36
"""
    choices: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("teeth_1", "teeth_2"),
        ("radius_1", "radius_2"),
        ("ratio",),
    )

    type: Literal["gear"]
    teeth_1: Quantity | None = quantity("", "teeth of body_1", "positive", default=None)
    teeth_2: Quantity | None = quantity("", "teeth of body_2", "positive", default=None)
    radius_1: Quantity | None = quantity("m", "pitch radius of body_1", "positive", default=None)
    radius_2: Quantity | None = quantity("m", "pitch radius of body_2", "positive", default=None)
    ratio: Quantity | None = quantity(
        "", "turns of body_1 for one turn of body_2", "positive", default=None
    )
    inside: bool = Field(
        default=False, strict=True, description="whether one is a ring with its teeth inside"
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        given = [keys for keys in self.choices if any(getattr(self, k) is not None for k in keys)]
        if not given:
            raise wrong("teeth_1", "is missing; give teeth_1 and teeth_2, radii or a ratio")
        if len(given) > 1:
            raise wrong(given[1][0], f"is given in addition to '{given[0][0]}'; give one kind")
        for key in given[0]:
            if getattr(self, key) is None:
                raise wrong(key, "is missing; give that of both gears")
        return self

    def toothed(self, layout: Layout) -> Iterator[tuple[Wheel, int, float]]:
        """Both gears with their numbers of teeth, and where one has a tooth, or a ring a gap: where
        the second angle is 0 a tooth of one is in a gap of the other.
        """
        given = (self.teeth_1, self.teeth_2)
        own, ratio = map(layout.value, self.weights())
        teeth = teeth_of([layout.value(x) for x in given if x is not None], ratio / own)
        start = (layout.value(self.phase), 0.0)
        for k, wheel in enumerate(self.wheels(layout)):
            half = math.pi / teeth[1] if k == 1 and self.opposed() else 0.0
            yield wheel, teeth[k], wheel.meets - start[k] + half

    def elements(self, layout: Layout) -> Iterator[Element]:
        """Rings, and gears of the world."""
        for wheel, teeth, phase in self.toothed(layout) if layout.dimensions == 2 else ():
            if wheel.ring or wheel.body == WORLD:
                body, radius = layout.bodies[wheel.body], Constant(wheel.radius)
                yield Round(
                    "gear", self.name, body, wheel.at, radius, None, None, teeth, wheel.ring, phase
                )

    def discs(self, layout: Layout) -> Iterator[Disc]:
        """The other gears."""
        for wheel, teeth, phase in self.toothed(layout):
            if not (wheel.ring or wheel.body == WORLD):
                yield Disc(wheel.body, wheel.at, Constant(wheel.radius), teeth, phase)

    def opposed(self) -> bool:
        """External gears."""
        return not self.inside

    def weights(self) -> tuple[Formula, Formula]:
        """The radii, or 1 and the ratio."""
        if self.radius_1 is not None and self.radius_2 is not None:
            return self.radius_1, self.radius_2
        if self.teeth_1 is not None and self.teeth_2 is not None:
            return ONE, Apply("/", (self.teeth_2, self.teeth_1))
        assert self.ratio is not None
        return ONE, self.ratio
