"""A force from outside at a point of a body."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from eomgen.effects.base import Input, Load, Mechanism, Scalar
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Vector, quantity


class ExternalForce(Table):
    """A force f_e in world axes at r_e of a body (handout (29)-(34)).

    `force = "input"` makes its components the inputs `<name>_x`, `<name>_y` and, in space,
    `<name>_z`.
    """

    type: Literal["external_force"]
    name: Identifier
    body: Identifier = Field(description="body it acts on")
    at: Vector = quantity("m", "point from the centre of mass", default=(), validate_default=False)
    force: Literal["input"] | Vector = quantity("N", "force", union_mode="left_to_right")

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """One input a component if the force is one."""
        if self.force != "input":
            return ()
        about = f"force {self.name} on {self.body}"
        return tuple(
            Input(f"{self.name}_{axis}", "N", f"{about}, {axis}") for axis in "xyz"[:dimensions]
        )

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The force itself."""
        at = tuple(mechanism.value(part) for part in self.at)
        if isinstance(self.force, tuple):
            force = tuple(mechanism.value(part) for part in self.force)
        else:
            force = tuple(mechanism.input(i.name) for i in self.inputs(mechanism.dimensions))
        yield Load(self.body, force, at, "applied")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """None: an external force brings energy in or takes it out."""
        return mechanism.value(ZERO)
