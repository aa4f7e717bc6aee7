"""A spring and damper at a joint of one coordinate."""

from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field

from eomgen.effects.base import EffectTable, JointLoad, Mechanism, Scalar
from eomgen.effects.spring import check_law
from eomgen.language.base import Identifier
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity


class JointSpring(EffectTable):
    """Pulls a joint's coordinate q back to `rest`: -(k s + c ds/dt) with s = q - rest.

    A torque (N m, s in rad) at a hinge, a force (N, s in m) at a slide, on the child and back on
    the parent. A `law` over `stretch` s and `rate` ds/dt stands for k s; positive pulls back.
    Potential energy is ½ k s²; a law has none, what it gives and takes is power.
    """

    joint_fields = ("joint",)

    type: Literal["joint_spring"]
    joint: Identifier = Field(description="revolute or prismatic joint it acts on")
    stiffness: Quantity = quantity(
        "N m/rad | N/m", "stiffness", "nonnegative", default=ZERO, validate_default=False
    )
    damping: Quantity = quantity(
        "N m s/rad | N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    rest: Quantity = quantity("rad | m", "coordinate at rest", default=ZERO, validate_default=False)
    law: Quantity | None = quantity(
        "N m | N",
        "pull back in place of stiffness",
        sees=("motion", "stretch", "rate"),
        default=None,
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    def checked(self, dimensions: int, place: str) -> Self:
        """Something must pull, and a law stands alone."""
        check_law(self, self.law, place)
        return self

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Equal and opposite on the joint's two bodies; the world takes its own."""
        rate, stretch = mechanism.rate(self.joint), self._stretch(mechanism)
        if self.law is not None:
            back = mechanism.value(self.law, stretch=stretch, rate=rate)
        else:
            back = mechanism.value(self.stiffness) * stretch
        yield JointLoad(self.joint, -(back + mechanism.value(self.damping) * rate))

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k s², J."""
        if self.law is not None:
            return mechanism.number(0.0)
        stretch = self._stretch(mechanism)
        return mechanism.number(0.5) * mechanism.value(self.stiffness) * (stretch * stretch)

    def _stretch(self, mechanism: Mechanism) -> Scalar:
        return mechanism.coordinate(self.joint) - mechanism.value(self.rest)
