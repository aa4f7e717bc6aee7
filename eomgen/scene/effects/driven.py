"""A joint whose coordinate follows a formula of time."""

from typing import Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import EffectTable


class Driven(EffectTable):
    """The joint's coordinate is `coordinate`, a formula of `t` and parameters; it is no state.

    Rate and acceleration are the formula's exact derivatives; where it has a corner (step, select,
    abs, min, max) those of the pieces, so that a jump gives no impulse. What the drive takes for it
    is the output `driving_forces`: a torque (N m) at a hinge, a force (N) at a slide, on the child
    along the coordinate and back on the parent, but for the forces of rigid contacts, which only a
    run knows. It is a constraint rather than a load, and so the
    derivation itself carries it out.
    """

    joint_fields = ("joint",)

    type: Literal["driven"]
    joint: Identifier = Field(description="revolute or prismatic joint it drives")
    coordinate: Quantity = quantity("rad | m", "coordinate", sees=("t",))
