"""A massless rod between two points."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, Vector, quantity
from eomgen.scene.constraints.base import Bar, ConstraintTable, Linkage, Row
from eomgen.scene.effects.base import Load
from eomgen.scene.effects.elements import Attachment, Layout, Link
from eomgen.scene.effects.vectors import dot, negative, sub
from eomgen.scene.joints.base import WORLD


class Distance(ConstraintTable):
    """Two points keep their distance: |x_1 - x_2| = `length`, as if by a massless rod.

    The multiplier is the force with which the rod pushes the points apart, N; in tension it is
    negative.
    """

    told = "Two points keep their distance, as if by a massless rod. λ pushes them apart."
    example: ClassVar[str] = """
[[constraints]]
type = "distance"
name = "rod"
body_1 = "world"
at_1 = [0.3, -1.0]
body_2 = "hand"
length = 0.5
"""
    anchor_fields = ("body_1", "body_2")
    vector_fields = ("at_1", "at_2")
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {"at_1": ("body_1",), "at_2": ("body_2",)}

    type: Literal["distance"]
    body_1: Identifier = Field(description="body of its first end, or 'world'")
    at_1: Vector = quantity(
        "m", "first end from the centre of mass", default=(), validate_default=False
    )
    body_2: Identifier = Field(description="body of its second end, or 'world'")
    at_2: Vector = quantity(
        "m", "second end from the centre of mass", default=(), validate_default=False
    )
    length: Quantity = quantity("m", "distance", "positive")

    @field_validator("body_2")
    @classmethod
    def _another_body(cls, name: str, info: ValidationInfo) -> str:
        if name == info.data.get("body_1"):
            raise ValueError("is also body_1, whose points keep their distance; name another body")
        return name

    @property
    def internal(self) -> bool:
        """True between two bodies."""
        return WORLD not in (self.body_1, self.body_2)

    def loop_part(self) -> Bar:
        """Itself."""
        return Bar(((self.body_1, self.at_1), (self.body_2, self.at_2)), self.length)

    def elements(self, layout: Layout) -> Iterator[Link]:
        """A line, drawn as a rope."""
        ends = ((self.body_1, self.at_1), (self.body_2, self.at_2))
        one, other = (Attachment(layout.bodies[body], at) for body, at in ends)
        yield Link("rope", self.name, one, other, self.length, layout.symbol)

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row, of the constraint's name."""
        return [(self.name, "N")]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """|x_1 - x_2| - length, along the line between the points."""
        at_1, at_2 = (tuple(map(mechanism.value, at)) for at in (self.at_1, self.at_2))
        ends = mechanism.position(self.body_1, at_1), mechanism.position(self.body_2, at_2)
        d = mechanism.called("d", *sub(*ends))
        (far,) = mechanism.called("s", mechanism.call("sqrt", dot(d, d)))
        u = mechanism.called("u", *(x / far for x in d))
        loads = (
            Load(self.body_1, u, at_1, "applied"),
            Load(self.body_2, negative(u), at_2, "applied"),
        )
        yield Row(far - mechanism.value(self.length), loads)
