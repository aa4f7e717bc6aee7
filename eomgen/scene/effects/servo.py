"""What controllers of a joint share: target, gains, saturation, and an actuator with lag."""

from collections.abc import Iterator

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import ExtraState, JointLoad, Mechanism, Scalar
from eomgen.scene.effects.dofs import OnCoordinate


class Servo(OnCoordinate):
    """A command to a joint, on its child and back on its parent.

    At a sliding joint it is a force. The command is cut off at ±`limit`, if there is one. With
    `lag` T the actuator's torque τ follows it by T dτ/dt = c - τ; τ is the state `<name>_torque`
    and starts at 0.
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

    def wanted(self, mechanism: Mechanism) -> Scalar:
        """The command before saturation, N m or N."""
        late = mechanism.value(self.target_rate) - mechanism.rate(
            self.joint, self.coordinate_index(mechanism)
        )
        stiffness, damping = mechanism.value(self.stiffness), mechanism.value(self.damping)
        return stiffness * self.deviation(mechanism) + damping * late

    def command(self, mechanism: Mechanism) -> Scalar:
        """The command, N m or N."""
        wanted = self.wanted(mechanism)
        if self.limit is None:
            return wanted
        limit = mechanism.value(self.limit)
        return mechanism.call("max", -limit, mechanism.call("min", limit, wanted))

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The torque of an actuator with lag."""
        if self.lag is None:
            return ()
        about = f"torque of {self.name} | force of {self.name}"
        return (ExtraState(f"{self.name}_torque", "N m | N", about, 0.0),)

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """How it follows the command."""
        if self.lag is None:
            return ()
        short = self.command(mechanism) - mechanism.state(f"{self.name}_torque")
        return (short / mechanism.value(self.lag),)

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """The command, or what the actuator makes of it."""
        if self.lag is None:
            yield JointLoad(self.joint, self.command(mechanism), self.coordinate_index(mechanism))
        else:
            yield JointLoad(
                self.joint, mechanism.state(f"{self.name}_torque"), self.coordinate_index(mechanism)
            )
