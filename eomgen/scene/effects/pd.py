"""A proportional-derivative controller of a joint."""

from typing import ClassVar, Literal

from eomgen.scene.effects.servo import Servo


class Pd(Servo):
    """A command c = k_p (target - q) + k_d (target_rate - v) to a joint."""

    example: ClassVar[str] = """
[[effects]]
type = "pd"
name = "servo"
joint = "elbow"
target = "0.5*sin(2*t)"
stiffness = 20.0
damping = 2.0
limit = 5.0
"""
    type: Literal["pd"]
