"""A proportional-derivative controller of a joint."""

from typing import ClassVar, Literal

from eomgen.scene.effects.servo import Servo


class Pd(Servo):
    """A command c = k_p (target - q) + k_d (target_rate - v) to a joint.

    The command acts on the joint's child, with its reaction on the parent: a torque, at a prismatic
    joint a force. It is limited to ±`limit`, if given. With `lag` T the torque τ follows the
    command by T dτ/dt = c - τ; τ is the state `<name>_torque`, initially 0.
    """

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
