"""Stops at the ends of a joint's range, as springs and dampers."""

from collections.abc import Callable, Iterator
from typing import Literal, Self

from pydantic import Field

from eomgen.effects.base import EffectTable, JointLoad, Mechanism, Scalar
from eomgen.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import Quantity, quantity


class JointStop(EffectTable):
    """Pushes a joint's coordinate q back into `low` to `high`, and does nothing within.

    Beyond a limit by x (q - high > 0 or q - low < 0) it puts -(k x + c dq/dt) on the child and back
    on the parent, a torque (N m) at a hinge, a force (N) at a slide; it never pulls towards the
    limit, however fast q comes back. Damping sets in with a jump. Potential energy is ½ k x².
    Either limit may be left out.
    """

    joint_fields = ("joint",)

    type: Literal["joint_stop"]
    joint: Identifier = Field(description="revolute or prismatic joint it acts on")
    low: Quantity | None = quantity("rad | m", "lower limit", default=None)
    high: Quantity | None = quantity("rad | m", "upper limit", default=None)
    stiffness: Quantity = quantity("N m/rad | N/m", "stiffness", "nonnegative")
    damping: Quantity = quantity(
        "N m s/rad | N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    def checked(self, dimensions: int, place: str) -> Self:
        """There is a limit."""
        if self.low is None and self.high is None:
            raise SceneError(f"{place}.low: missing, and high too; give one of them or both")
        return self

    def check_values(self, value: Callable[[Formula], float], place: str) -> None:
        """There is room between two limits."""
        if self.low is not None and self.high is not None:
            low, high = value(self.low), value(self.high)
            if not low < high:
                raise SceneError(
                    f"{place}.low: {low:g} is not below high, {high:g}; make low < high"
                )

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Equal and opposite on the joint's two bodies; the world takes its own."""
        beyond, nothing = self._beyond(mechanism), mechanism.number(0.0)
        back = mechanism.value(self.stiffness) * beyond
        if self.damping != ZERO:
            back = back + mechanism.value(self.damping) * mechanism.rate(self.joint)
            above = mechanism.call("max", back, nothing)
            below = mechanism.call("min", back, nothing)
            if self.low is None:
                below = nothing
            if self.high is None:
                above = nothing
            under = mechanism.call("select", -beyond, below, nothing)
            back = mechanism.call("select", beyond, above, under)
        yield JointLoad(self.joint, -back)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k x², J."""
        beyond = self._beyond(mechanism)
        return mechanism.number(0.5) * mechanism.value(self.stiffness) * (beyond * beyond)

    def _beyond(self, mechanism: Mechanism) -> Scalar:
        """How far q is beyond its limits, negative below: 0 within."""
        q = within = mechanism.coordinate(self.joint)
        if self.high is not None:
            within = mechanism.call("min", within, mechanism.value(self.high))
        if self.low is not None:
            within = mechanism.call("max", within, mechanism.value(self.low))
        return q - within
