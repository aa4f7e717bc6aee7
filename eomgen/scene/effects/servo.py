"""The base of joint controllers: target, gains, saturation, and an actuator with lag."""

from collections.abc import Iterator

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import ExtraState, JointLoad, Mechanism, Resistance, Scalar
from eomgen.scene.effects.dofs import OnCoordinate
from eomgen.scene.effects.vectors import at_least_zero


class Servo(OnCoordinate):
    """A commanded torque c on the joint's child, with its reaction on the parent.

    At a prismatic joint it is a force. It is limited to ±`limit`, if given. With `lag` T the
    actuator's torque τ follows it by T dτ/dt = c - τ; τ is the state `<name>_torque`, initially 0.
    """

    name: Identifier
    target: Quantity = quantity("rad | m", "target of the coordinate", sees=("motion",))
    target_rate: Quantity = quantity(
        "rad/s | m/s", "target of the velocity", sees=("motion",), default=ZERO
    )
    stiffness: Quantity = quantity("N m/rad | N/m", "gain k_p of the deviation", "nonnegative")
    damping: Quantity = quantity(
        "N m s/rad | N s/m", "gain k_d of the velocity's deviation", "nonnegative", default=ZERO
    )
    limit: Quantity | None = quantity(
        "N m | N", "largest size of the command", "positive", default=None
    )
    lag: Quantity | None = quantity("s", "time constant of the actuator", "positive", default=None)
    allow_active: bool = Field(
        default=False, strict=True, description="whether gains may be negative"
    )

    def deviation(self, mechanism: Mechanism) -> Scalar:
        """Target minus coordinate, rad or m."""
        return mechanism.value(self.target) - mechanism.coordinate(
            self.joint, self.coordinate_index(mechanism)
        )

    def unlimited_command(self, mechanism: Mechanism) -> Scalar:
        """The command before saturation, N m or N."""
        rate_deviation = mechanism.value(self.target_rate) - mechanism.rate(
            self.joint, self.coordinate_index(mechanism)
        )
        stiffness, damping = mechanism.value(self.stiffness), mechanism.value(self.damping)
        return stiffness * self.deviation(mechanism) + damping * rate_deviation

    def command(self, mechanism: Mechanism) -> Scalar:
        """The command after saturation, N m or N."""
        command = self.unlimited_command(mechanism)
        if self.limit is None:
            return command
        limit = mechanism.value(self.limit)
        (command,) = mechanism.called("c", command)
        return mechanism.call("max", -limit, mechanism.call("min", limit, command))

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Those of its gains, while the command is within the limit and acts without lag."""
        if self.lag is not None:
            return
        gains = [
            at_least_zero(mechanism, mechanism.value(x)) for x in (self.stiffness, self.damping)
        ]
        if self.limit is not None:
            command = self.unlimited_command(mechanism)
            inside = mechanism.value(self.limit) - mechanism.call("abs", command)
            gains = [mechanism.call("select", inside, x, mechanism.zero) for x in gains]
        load = JointLoad(self.joint, mechanism.number(1.0), self.coordinate_index(mechanism))
        yield Resistance((load,), gains[0], gains[1])

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The torque of an actuator with lag, if there is one."""
        if self.lag is None:
            return ()
        about = f"torque of {self.name} | force of {self.name}"
        return (ExtraState(f"{self.name}_torque", "N m | N", about, 0.0),)

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Rate of the actuator's torque."""
        if self.lag is None:
            return ()
        difference = self.command(mechanism) - mechanism.state(f"{self.name}_torque")
        return (difference / mechanism.value(self.lag),)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """The command, or the torque of an actuator with lag."""
        if self.lag is None:
            yield JointLoad(self.joint, self.command(mechanism), self.coordinate_index(mechanism))
        else:
            yield JointLoad(
                self.joint, mechanism.state(f"{self.name}_torque"), self.coordinate_index(mechanism)
            )
