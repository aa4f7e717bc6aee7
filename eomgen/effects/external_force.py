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

    `force = "input"` makes its components the inputs `<name>_x` and `<name>_y`.
    """

    type: Literal["external_force"]
    name: Identifier
    body: Identifier = Field(description="body it acts on")
    at: Vector = quantity(
        "m", "point from the centre of mass", default=(ZERO, ZERO), validate_default=False
    )
    force: Literal["input"] | Vector = quantity("N", "force", union_mode="left_to_right")

    def inputs(self) -> tuple[Input, ...]:
        """Two inputs if the force is one."""
        if self.force != "input":
            return ()
        about = f"force {self.name} on {self.body}"
        return (
            Input(f"{self.name}_x", "N", f"{about}, x"),
            Input(f"{self.name}_y", "N", f"{about}, y"),
        )

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The force itself."""
        at = (mechanism.value(self.at[0]), mechanism.value(self.at[1]))
        if isinstance(self.force, tuple):
            force = (mechanism.value(self.force[0]), mechanism.value(self.force[1]))
        else:
            force = (mechanism.input(f"{self.name}_x"), mechanism.input(f"{self.name}_y"))
        yield Load(self.body, force, at, mechanism.value(ZERO), "applied")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """None: an external force brings energy in or takes it out."""
        return mechanism.value(ZERO)
