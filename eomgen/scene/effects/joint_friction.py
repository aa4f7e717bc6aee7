"""Friction in a joint."""

from collections.abc import Iterator
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import JointLoad, Mechanism, Resistance, Scalar, Vector
from eomgen.scene.effects.dofs import OnJoints
from eomgen.scene.effects.vectors import add, at_least_zero, length, negative, scale

LEAST_SLIP = 1e-6
"""Below this part of its speed Coulomb friction is linear to the last digit."""


class JointFriction(OnJoints):
    """Friction -(b v + C tanh(v/speed)) against the rate v of a joint's coordinate.

    A torque (N m) or a force (N) on the child, with its reaction on the parent. Coulomb friction C
    is smoothed: at |v| = `speed` it is 76 % of C, at 3 `speed` 99.5 %. There is no exact sticking:
    under a load F < C the joint creeps at speed · artanh(F/C).
    """

    example: ClassVar[str] = """
[[effects]]
type = "joint_friction"
name = "bearing"
joint = "elbow"
viscous = 0.02
coulomb = 0.1
speed = 0.01
"""
    type: Literal["joint_friction"]
    viscous: Quantity = quantity(
        "N m s/rad | N s/m",
        "viscous friction",
        "nonnegative",
        default=ZERO,
        validate_default=False,
    )
    coulomb: Quantity = quantity(
        "N m | N", "Coulomb friction", "nonnegative", default=ZERO, validate_default=False
    )
    speed: Quantity | None = quantity(
        "rad/s | m/s", "speed within which Coulomb friction is smoothed", "positive", default=None
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether friction may be negative"
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that there is friction, and a speed if and only if there is Coulomb friction."""
        if not self.model_fields_set & {"viscous", "coulomb"}:
            raise SceneError(f"{location}.viscous: missing; give it, or coulomb and speed")
        if "coulomb" in self.model_fields_set and self.speed is None:
            raise SceneError(
                f"{location}.speed: missing; coulomb is smoothed as tanh(rate/speed); give a small "
                "value"
            )
        if "coulomb" not in self.model_fields_set and self.speed is not None:
            raise SceneError(f"{location}.speed: it smooths coulomb, which is missing; give both")
        return self

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Loads on the child, with reactions on the parent."""
        viscous = mechanism.value(self.viscous)
        for dof in self.dofs(mechanism):
            friction = scale(viscous, dof.rates)
            if self.speed is not None:
                friction = add(friction, self._coulomb(mechanism, dof.rates))
            yield from dof.loads(negative(friction))

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """That of the secant, b + C tanh(|v|/speed)/|v|: friction never overshoots rest."""
        for dof in self.dofs(mechanism):
            damping = at_least_zero(mechanism, mechanism.value(self.viscous))
            if self.speed is not None:
                coulomb, speed = mechanism.value(self.coulomb), mechanism.value(self.speed)
                least = mechanism.number(LEAST_SLIP) * speed
                size = mechanism.call("max", length(mechanism, dof.rates), least)
                secant = coulomb * mechanism.call("tanh", size / speed) / size
                damping = damping + at_least_zero(mechanism, secant)
            yield from dof.resisting(mechanism, mechanism.zero, damping)

    def _coulomb(self, mechanism: Mechanism, rates: Vector) -> Vector:
        """C tanh(|v|/speed) v/|v|, N m or N."""
        assert self.speed is not None
        coulomb, speed = mechanism.value(self.coulomb), mechanism.value(self.speed)
        if len(rates) == 1:
            return (coulomb * mechanism.call("tanh", rates[0] / speed),)
        size = length(mechanism, rates)
        factor = coulomb * mechanism.call("tanh", size / speed) / size
        return scale(factor, rates)
