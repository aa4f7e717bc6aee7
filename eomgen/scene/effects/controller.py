"""A controller whose states and torques are formulas of the scene."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier, Number, Table, Text
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import EffectTable, ExtraState, JointLoad, Mechanism, Scalar
from eomgen.scene.effects.elements import AtJoint, Layout

MOST = 100
"""Greatest number of states or of torques of one controller."""


class StateTable(Table):
    """A state z of a controller: dz/dt = `rate`, z(0) = `initial`."""

    initial: Number = 0.0
    rate: Quantity = quantity("1/s", "time derivative", sees=("motion",))
    unit: Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z0-9 /^*.()-]*$")] = ""
    about: Text = ""


class Controller(EffectTable):
    """dz/dt = f and τ = g, formulas of t, coordinates, velocities, inputs and states.

    `states = { z = { initial = 0.0, rate = "q - z" } }` defines the states by the names that
    formulas use. `torques = { joint = "-k*z" }` defines the torque of each joint, or the force if
    it is prismatic, on its child, with the reaction on its parent. Formulas cannot use rates or
    torques, so none depends on itself.
    """

    example: ClassVar[str] = """
[[effects]]
type = "controller"
name = "hold"
states = { z = { initial = 0.0, rate = "elbow_angle" } }
torques = { elbow = "-5*elbow_angle - 2*z" }
"""
    joint_fields = ("torques",)

    type: Literal["controller"]
    name: Identifier
    own_states: Annotated[dict[Identifier, StateTable], Field(max_length=MOST)] = Field(
        default={}, alias="states", description="its states by name"
    )
    torques: Annotated[dict[Identifier, Quantity], Field(min_length=1, max_length=MOST)] = quantity(
        "N m | N", "torque | force", sees=("motion",)
    )

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The states of the scene's table."""
        return tuple(
            ExtraState(name, state.unit, state.about or f"state of {self.name}", state.initial)
            for name, state in self.own_states.items()
        )

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Values of the states' formulas."""
        return tuple(mechanism.value(state.rate) for state in self.own_states.values())

    def elements(self, layout: Layout) -> Iterator[AtJoint]:
        """A servo at each joint."""
        for joint in self.torques:
            yield AtJoint("servo", self.name, layout.child(joint), 0, layout.symbol)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Values of the torques' formulas."""
        for joint, torque in self.torques.items():
            yield JointLoad(joint, mechanism.value(torque))
