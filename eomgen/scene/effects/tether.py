"""A tether: a string that pulls while it is taut and is slack otherwise."""

from collections.abc import Iterator, Sequence
from typing import ClassVar, Literal, Self

from eomgen.base.errors import SceneError
from eomgen.language.conditions import Condition, a_part
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.rewriting import times
from eomgen.scene.effects.base import Contact, Mechanism
from eomgen.scene.effects.elements import Element, Layout
from eomgen.scene.effects.spans import drawn, section_of, spans_of
from eomgen.scene.effects.through import Through


class Tether(Through):
    """A massless string of fixed `length`, which does not stretch: it keeps its way `through`
    points, rings and discs from getting longer, see `points of ropes`, and is slack while the way
    is shorter.

    It is a rigid contact with the gap `length` - way, without friction. Where it becomes taut it
    pulls with an impulse, and the way shortens at `restitution` times the speed at which it got
    longer. While it is taut its tension is not negative; it becomes slack where that would be.
    """

    told = "A string keeps its way from getting longer than its length, and is slack otherwise."
    example: ClassVar[str] = """
[[effects]]
type = "tether"
name = "leash"
length = 1.2
through = [{ body = "world", at = [0.3, 0.5] }, { body = "hand" }]
"""
    type: Literal["tether"]
    length: Quantity = quantity("m", "length", "positive")
    restitution: Quantity = quantity(
        "", "coefficient of restitution, 0 to 1", default=ZERO, validate_default=False
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check its points: it slides over discs, and does not end on one."""
        last = len(self.through) - 1
        for i, point in enumerate(self.through):
            if point.grips or (point.radius is not None and i in (0, last)):
                raise SceneError(
                    f"{location}.through[{i}].radius: a string that may be slack turns no disc; "
                    "leave it out, or take the constraint 'rope'"
                )
        return super().checked(dimensions, location)

    def conditions(self, location: str) -> Iterator[Condition]:
        """Restitution is from 0 to 1."""
        yield a_part(f"{location}.restitution", self.restitution)

    def lengths(self) -> tuple[Formula, ...]:
        """That of a span."""
        return (times(1 / (len(self.through) - 1), self.length),)

    def elements(self, layout: Layout) -> Iterator[Element]:
        """Its way."""
        yield from drawn(self.name, self.stops(), self.length, layout)

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Its own name."""
        return (self.name,)

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """The length less the way; a tension separates."""
        stops = self.stops()
        spans = spans_of(mechanism, stops, near=True)
        way, pulls = section_of(mechanism, stops, spans, {}, ())
        gap = mechanism.value(self.length) - way
        restitution, none = mechanism.value(self.restitution), mechanism.zero
        one = mechanism.number(1.0)
        return (Contact(self.name, self.name, gap, pulls, (), restitution, none, one),)
