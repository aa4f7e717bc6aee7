"""An effect."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Scalar, Vector


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
