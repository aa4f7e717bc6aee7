"""A constraint."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.constraints.base import ConstraintTable, Linkage, Row
from eomgen.scene.effects.base import Load


class Level(ConstraintTable):
    """The centre of mass of a body keeps its `height`; the multiplier is the upward force, N."""

    example: ClassVar[str] = """
[[constraints]]
type = "level"
name = "rail"
body = "hand"
height = 0.5
"""
    body_fields = ("body",)

    type: Literal["level"]
    body: Identifier = Field(description="the body")
    height: Quantity = quantity("m", "height of its centre of mass")

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row."""
        return [(self.name, "N")]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """Height above the given one; the load is a unit force upwards."""
        centre = (mechanism.number(0.0),) * mechanism.dimensions
        height = mechanism.position(self.body, centre)[-1]
        up = (*centre[:-1], mechanism.number(1.0))
        yield Row(height - mechanism.value(self.height), (Load(self.body, up, centre, "applied"),))
