"""A motor at a joint."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import Input, JointLoad, Mechanism
from eomgen.scene.effects.dofs import OnCoordinate


class Motor(OnCoordinate):
    """A torque τ on the joint's child and -τ on its parent (handout (35), (36)).

    At a prismatic joint it is a force. With `torque = "input"` it is the input `<name>`.
    """

    told = (
        "A torque on the joint's child, with its reaction on the parent. | "
        "A force on the joint's child, with its reaction on the parent."
    )
    example: ClassVar[str] = """
[[effects]]
type = "motor"
name = "drive"
joint = "elbow"
torque = "input"
"""
    input_field: ClassVar[str] = "torque"
    symbol = "motor"

    type: Literal["motor"]
    torque: Literal["input"] | Quantity = quantity(
        "N m | N", "torque | force", sees=("motion",), union_mode="left_to_right"
    )

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """The input with `torque = "input"`."""
        if self.torque != "input":
            return ()
        about = f"motor torque at {self.joint} | motor force at {self.joint}"
        return (Input(self.name, "N m | N", about),)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """A load on the child, with its reaction on the parent."""
        if self.torque == "input":
            torque = mechanism.input(self.name)
        else:
            torque = mechanism.value(self.torque)
        yield JointLoad(self.joint, torque, self.coordinate_index(mechanism))

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True if its input is 0."""
        return self.idle(inputs, dimensions)
