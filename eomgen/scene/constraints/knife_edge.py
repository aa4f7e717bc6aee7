"""A knife edge: a skate, a blade or a thin wheel that does not slip sideways."""

from collections.abc import Iterator
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.language.quantity import Numbers
from eomgen.scene.constraints.base import Linkage, Row
from eomgen.scene.constraints.between import OnOther, checked_direction, unit
from eomgen.scene.effects.touching import normal_loads


class KnifeEdge(OnOther):
    """The point `at` of `body` does not move across the edge: its velocity relative to `other` has
    no component along `across`, a direction in the axes of `body`. This restricts velocities only:
    the point can come to any position. `other_at` has no effect.

    The multiplier is the force along `across` on the body, N.
    """

    told = "A point does not move across an edge."
    example: ClassVar[str] = """
[[constraints]]
type = "knife_edge"
name = "blade"
body = "hand"
across = [0, 1]
"""
    type: Literal["knife_edge"]
    across: Numbers = Field(description="direction across the edge, in body axes")

    def checked(self, dimensions: int, location: str) -> Self:
        """Check the direction."""
        across = checked_direction(self.across, dimensions, f"{location}.across")
        return self.replaced(across=across)

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row, of the constraint's name."""
        return [(self.name, "N")]

    def velocity_rows(self, dimensions: int) -> list[str]:
        """The row."""
        return [self.name]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The velocity across the edge."""
        e = unit(mechanism, self.body, self.across)
        touch = self.touch(mechanism, e, mechanism.zero)
        yield Row(None, normal_loads(touch, mechanism.number(1.0)))
