"""A motor at a joint of one coordinate."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from eomgen.effects.base import Input, JointLoad, Mechanism, Scalar
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity


class Motor(Table):
    """A torque τ, +τ on the joint's child and -τ on its parent (handout (35), (36)).

    At a sliding joint it is a force. `torque = "input"` makes it the input `<name>`.
    """

    type: Literal["motor"]
    name: Identifier
    joint: Identifier = Field(description="revolute or prismatic joint it drives")
    torque: Literal["input"] | Quantity = quantity("N m", "torque", union_mode="left_to_right")

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """One input if the torque is one."""
        if self.torque != "input":
            return ()
        return (Input(self.name, "N m", f"motor torque at {self.joint}"),)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Equal and opposite on the joint's two bodies; the world takes its own."""
        if self.torque == "input":
            torque = mechanism.input(self.name)
        else:
            torque = mechanism.value(self.torque)
        yield JointLoad(self.joint, torque)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """None: a motor brings energy in or takes it out."""
        return mechanism.value(ZERO)
