"""A joint whose coordinate follows a formula of time."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.formula import Formula
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.effects.elements import AtJoint, Layout


class Driven(EffectTable):
    """Prescribes the coordinate of a joint by `coordinate`, a formula of `t` and parameters.

    The coordinate is not a state. Its rate and acceleration are exact derivatives of the formula;
    for step, select, abs, min and max they are those of the branch, so a jump gives no impulse. The
    output `driving_forces` is the generalised force of the drive along the coordinate, N m for a
    revolute and N for a prismatic joint, on the child, with its reaction on the parent. It lacks
    the forces of rigid contacts, which are known only in a run. The drive is a constraint, not a
    load.
    """

    example: ClassVar[str] = """
[[effects]]
type = "driven"
name = "crank"
joint = "shoulder"
coordinate = "0.5*sin(6*t)"
"""
    joint_fields = ("joint",)

    type: Literal["driven"]
    joint: Identifier = Field(description="revolute or prismatic joint it drives")
    coordinate: Quantity = quantity("rad | m", "coordinate", sees=("t",))

    def prescribes(self) -> tuple[str, Formula]:
        """Its joint and its coordinate."""
        return self.joint, self.coordinate

    def elements(self, layout: Layout) -> Iterator[AtJoint]:
        """A drive at the joint."""
        yield AtJoint("drive", self.name, layout.child(self.joint), 0, layout.symbol)
