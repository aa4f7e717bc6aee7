"""A motor at a joint."""

from collections.abc import Collection, Iterator, Mapping
from typing import Literal

from eomgen.language.formula import names_in
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import Input, JointLoad, Mechanism
from eomgen.scene.effects.dofs import OnCoordinate


class Motor(OnCoordinate):
    """A torque τ, +τ on the joint's child and -τ on its parent (handout (35), (36)).

    At a sliding joint it is a force. `torque = "input"` makes it the input `<name>`.
    """

    type: Literal["motor"]
    torque: Literal["input"] | Quantity = quantity(
        "N m | N", "torque | force", sees=("motion",), union_mode="left_to_right"
    )

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """One input if the torque is one."""
        if self.torque != "input":
            return ()
        about = f"motor torque at {self.joint} | motor force at {self.joint}"
        return (Input(self.name, "N m | N", about),)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Equal and opposite loads on the joint's two bodies."""
        if self.torque == "input":
            torque = mechanism.input(self.name)
        else:
            torque = mechanism.value(self.torque)
        yield JointLoad(self.joint, torque, self.coordinate_index(mechanism))

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """It does while its inputs are 0."""
        return self.idle(inputs, dimensions)

    def is_plain(self, parameters: Collection[str]) -> bool:
        """Unless its formula uses the motion or the time, or it is on one coordinate of several."""
        if self.coordinate is not None:
            return False
        return self.torque == "input" or all(n in parameters for n in names_in(self.torque))
