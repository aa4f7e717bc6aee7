"""A controller of a joint that leaves no deviation behind."""

from typing import Literal

from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import ExtraState, Mechanism, Scalar
from eomgen.scene.effects.servo import Servo


class Pid(Servo):
    """c = k_p e + k_d (target_rate - v) + k_i z, dz/dt = e, e = target - q; see `Servo`.

    z is the state `<name>_integral`. Where the command is cut off, it does not wind up: by back
    calculation dz/dt = e + (c_cut - c)/(k_i T), continuous at the limit, which pulls z back
    within the tracking time T, `tracking`, k_p/k_i unless given (Åström, Murray, Feedback
    Systems, section on integrator windup).
    """

    type: Literal["pid"]
    stiffness: Quantity = quantity("N m/rad | N/m", "gain k_p of the deviation", "positive")
    integral_gain: Quantity = quantity(
        "N m/(rad s) | N/(m s)", "gain k_i of the deviation's integral", "positive"
    )
    tracking: Quantity | None = quantity(
        "s", "time in which a cut-off command is tracked", "positive", default=None
    )

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The integral, and what an actuator brings along."""
        about = f"integral of the deviation of {self.name}"
        integral = ExtraState(f"{self.name}_integral", "rad s | m s", about, 0.0)
        return (integral, *super().states(dimensions))

    def wanted(self, mechanism: Mechanism) -> Scalar:
        """The command before it is cut off, N m or N."""
        integral = mechanism.state(f"{self.name}_integral")
        return super().wanted(mechanism) + mechanism.value(self.integral_gain) * integral

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """The deviation, less what winds up, and how an actuator follows."""
        rate = self.deviation(mechanism)
        if self.limit is not None:
            gain = mechanism.value(self.stiffness)
            if self.tracking is not None:
                gain = mechanism.value(self.integral_gain) * mechanism.value(self.tracking)
            rate = rate + (self.command(mechanism) - self.wanted(mechanism)) / gain
        return (rate, *super().rates(mechanism))
