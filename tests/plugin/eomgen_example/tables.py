"""An effect, a joint and a constraint."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.constraints.base import ConstraintTable, Linkage, Row
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Scalar, Vector
from eomgen.scene.joints.base import Coordinate, JointTable, Primitive


class Buoyancy(EffectTable):
    """A body in still water: an upward force `lift` times depth, where its centre is below 0."""

    example: ClassVar[str] = """
[[effects]]
type = "buoyancy"
name = "water"
body = "hand"
lift = 200.0
"""
    body_fields = ("body",)

    type: Literal["buoyancy"]
    body: Identifier = Field(description="the body")
    lift: Quantity = quantity("N/m", "force for each metre of depth", "nonnegative")

    def _depth(self, mechanism: Mechanism) -> tuple[Scalar, Vector]:
        centre = (mechanism.number(0.0),) * mechanism.dimensions
        height = mechanism.position(self.body, centre)[-1]
        return mechanism.call("max", -height, mechanism.number(0.0)), centre

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """One force, upwards, at the centre of mass."""
        depth, centre = self._depth(mechanism)
        force = (*centre[:-1], mechanism.value(self.lift) * depth)
        yield Load(self.body, force, centre, "applied")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ lift depth²."""
        depth, _ = self._depth(mechanism)
        return mechanism.number(0.5) * mechanism.value(self.lift) * depth * depth

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """Always."""
        return True


class Telescope(JointTable):
    """Two slides one after the other: along the parent's x, and along its y (z in space)."""

    example: ClassVar[str] = """
[[joints]]
name = "boom"
type = "telescope"
parent = "arm"
child = "hand"
"""
    type: Literal["telescope"]

    def positions(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Two displacements."""
        return tuple(
            Coordinate(f"{self.name}_{part}", "m", f"displacement of {self.child}")
            for part in ("out", "up")
        )

    def velocities(self, dimensions: int) -> tuple[Coordinate, ...]:
        """Their rates."""
        return tuple(c.rate for c in self.positions(dimensions))

    def primitives(self, dimensions: int) -> tuple[Primitive, ...]:
        """Two prismatic ones."""
        up = (0.0, 1.0, 0.0) if dimensions == 2 else (0.0, 0.0, 1.0)
        return (Primitive("prismatic", (1.0, 0.0, 0.0)), Primitive("prismatic", up))


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
