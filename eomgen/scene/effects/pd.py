"""A proportional-derivative controller of a joint."""

from typing import Literal

from eomgen.scene.effects.servo import Servo


class Pd(Servo):
    """A command c = k_p (target - q) + k_d (target_rate - v) to a joint; see `Servo`."""

    type: Literal["pd"]
