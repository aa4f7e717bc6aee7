"""A proportional-integral-derivative controller of a joint."""

from typing import ClassVar, Literal

from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import ExtraState, Mechanism, Scalar
from eomgen.scene.effects.servo import Servo


class Pid(Servo):
    """c = k_p e + k_d (target_rate - v) + k_i z, dz/dt = e, e = target - q.

    The command acts on the joint's child, with its reaction on the parent: a torque, at a prismatic
    joint a force. It is limited to ±`limit`, if given. With `lag` T the torque τ follows the
    command by T dτ/dt = c - τ; τ is the state `<name>_torque`, initially 0.

    z is the state `<name>_integral`. While the command is limited, back-calculation prevents
    windup: dz/dt = e + (c_limited - c)/(k_i T), with the tracking time T, `tracking`, by default
    k_p/k_i (Åström, Murray, Feedback Systems, section on integrator windup).
    """

    example: ClassVar[str] = """
[[effects]]
type = "pid"
name = "servo"
joint = "elbow"
target = 0.5
stiffness = 20.0
damping = 2.0
integral_gain = 10.0
"""
    type: Literal["pid"]
    stiffness: Quantity = quantity("N m/rad | N/m", "gain k_p of the deviation", "positive")
    integral_gain: Quantity = quantity(
        "N m/(rad s) | N/(m s)", "gain k_i of the deviation's integral", "positive"
    )
    tracking: Quantity | None = quantity(
        "s", "tracking time of the protection against windup", "positive", default=None
    )

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The integral, and the state of an actuator with lag."""
        about = f"integral of the deviation of {self.name}"
        integral = ExtraState(f"{self.name}_integral", "rad s | m s", about, 0.0)
        return (integral, *super().states(dimensions))

    def unlimited_command(self, mechanism: Mechanism) -> Scalar:
        """The command before saturation, N m or N."""
        integral = mechanism.state(f"{self.name}_integral")
        return super().unlimited_command(mechanism) + mechanism.value(self.integral_gain) * integral

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Rate of the integral, with back-calculation, and of an actuator with lag."""
        rate = self.deviation(mechanism)
        if self.limit is not None:
            gain = mechanism.value(self.stiffness)
            if self.tracking is not None:
                gain = mechanism.value(self.integral_gain) * mechanism.value(self.tracking)
            rate = rate + (self.command(mechanism) - self.unlimited_command(mechanism)) / gain
        return (rate, *super().rates(mechanism))
