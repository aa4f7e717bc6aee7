"""Soft or rigid stops at the limits of a joint's coordinate."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.conditions import Condition, a_part, are_zero, in_order
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import Contact, JointLoad, Mechanism, Resistance, Scalar
from eomgen.scene.effects.dofs import Dof, OnJoints, spring_energy
from eomgen.scene.effects.elements import AtJoint
from eomgen.scene.effects.vectors import LEAST_SQUARE, at_least_zero, negative


class JointStop(OnJoints):
    """Keeps a joint's coordinate q between `low` and `high`; either limit may be absent.

    Beyond a limit by x (q - high > 0 or q - low < 0) a torque (N m) or force (N) -(k x + c dq/dt)
    acts on the child, with its reaction on the parent. It never pulls towards the limit, however
    fast q returns, and damping starts with a jump. The potential energy is ½ k x². At a ball joint
    q is the angle of rotation, which has no `low`. With `restitution` instead of stiffness the stop
    is rigid and of a single coordinate: it exerts no load, and each limit is a contact,
    `<effect>_low` and `<effect>_high`.
    """

    example: ClassVar[str] = """
[[effects]]
type = "joint_stop"
name = "limit"
joint = "elbow"
low = 0.0
high = 2.5
stiffness = 200.0
damping = 1.0
"""
    type: Literal["joint_stop"]
    low: Quantity | None = quantity("rad | m", "lower limit", default=None)
    high: Quantity | None = quantity("rad | m", "upper limit", default=None)
    stiffness: Quantity = quantity(
        "N m/rad | N/m", "stiffness", "nonnegative", default=ZERO, validate_default=False
    )
    damping: Quantity = quantity(
        "N m s/rad | N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    restitution: Quantity | None = quantity("", "coefficient of restitution, 0 to 1", default=None)
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that there is a limit, and either stiffness or restitution."""
        if self.low is None and self.high is None:
            raise SceneError(f"{location}.low: missing, as is high; give one of them or both")
        given = self.model_fields_set
        if self.restitution is None and "stiffness" not in given:
            raise SceneError(f"{location}.stiffness: missing; give it or a restitution")
        for key in ("stiffness", "damping", "allow_active"):
            if self.restitution is not None and key in given:
                raise SceneError(
                    f"{location}.{key}: a restitution replaces it; give only one of them"
                )
        return self

    def conditions(self, location: str) -> Iterator[Condition]:
        """low < high, and restitution is from 0 to 1."""
        if self.restitution is not None:
            yield a_part(f"{location}.restitution", self.restitution)
        if self.low is not None and self.high is not None:
            yield in_order(f"{location}.low", self.low, self.high)

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Check that ball joints have no `low`, and that a rigid stop has one coordinate."""
        super().check_dofs(joints, names, location)
        acted_on = self.acted_on(joints)
        for joint in acted_on:
            if "spherical" in joints[joint] and self.low is not None:
                raise SceneError(
                    f"{location}.low: the angle of a ball joint ('{joint}') is never below 0; give "
                    "high"
                )
        if self.restitution is not None:
            if self.joints is not None:
                raise SceneError(
                    f"{location}.joints: a rigid stop acts on one joint; name it as joint"
                )
            if self.coordinate is None and len(joints[acted_on[0]]) > 1:
                raise SceneError(
                    f"{location}.coordinate: missing; a rigid stop acts on one coordinate, and "
                    f"'{self.joint}' has {', '.join(names[acted_on[0]])}"
                )

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Loads on the child, with reactions on the parent."""
        if self.restitution is not None:
            return
        for dof in self.dofs(mechanism):
            yield from dof.loads(negative(dof.along(self._back(mechanism, dof))))

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Those of stops that push back where the step leads; what reaches a limit only within the
        step has that force for a part of it, as contacts.
        """
        if self.restitution is not None:
            return
        one, nothing = mechanism.number(1.0), mechanism.zero
        slopes = [
            at_least_zero(mechanism, mechanism.value(x)) for x in (self.stiffness, self.damping)
        ]
        for dof in self.dofs(mechanism):
            step, here = h * dof.rate, self._beyond(mechanism, dof)
            inside = here * here
            value = mechanism.call("select", inside, dof.value, dof.value + step)
            ahead = replace(dof, value=value)
            there, force = self._beyond(mechanism, ahead), self._back(mechanism, ahead)
            size = mechanism.call("abs", step)
            size = mechanism.call("max", size, mechanism.number(LEAST_SQUARE))
            part = mechanism.call("select", inside, one, mechanism.call("abs", there) / size)
            share = mechanism.call("select", force * there, part, nothing)
            stiffness, damping = (share * x for x in slopes)
            change = mechanism.call("select", inside, -(stiffness * step), -(part * force))
            yield Resistance(tuple(dof.loads(dof.along(one))), stiffness, damping, change)

    def _back(self, mechanism: Mechanism, dof: Dof) -> Scalar:
        """k x + c dq/dt, N m or N, if it pushes back from the limit, else 0."""
        beyond, nothing = self._beyond(mechanism, dof), mechanism.zero
        back = mechanism.value(self.stiffness) * beyond
        if self.damping == ZERO:
            return back
        back = back + mechanism.value(self.damping) * dof.rate
        above = mechanism.call("max", back, nothing)
        below = mechanism.call("min", back, nothing)
        if self.low is None:
            below = nothing
        if self.high is None:
            above = nothing
        or_below = mechanism.call("select", -beyond, below, nothing)
        return mechanism.call("select", beyond, above, or_below)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k x², J; 0 for a rigid stop."""
        if self.restitution is not None:
            return mechanism.zero
        excesses = (self._beyond(mechanism, dof) for dof in self.dofs(mechanism))
        return spring_energy(mechanism, self.stiffness, excesses)

    def limited(self, joints: Mapping[str, tuple[str, ...]]) -> Sequence[str]:
        """Those that it acts on."""
        return self.acted_on(joints)

    def drawn(self, at: AtJoint) -> AtJoint:
        """Its limits."""
        return replace(at, kind="stop", low=self.low, high=self.high)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """It does if it is soft and has no damping."""
        return self.restitution is None and are_zero(values, self.damping)

    def overlap(self, mechanism: Mechanism) -> Scalar:
        """How far the farthest coordinate is beyond a soft stop, rad or m."""
        farthest = mechanism.zero
        if self.restitution is not None:
            return farthest
        for dof in self.dofs(mechanism):
            beyond = mechanism.call("abs", self._beyond(mechanism, dof))
            farthest = mechanism.call("max", farthest, beyond)
        return farthest

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """One name for each limit of a rigid stop."""
        ends = (("low", self.low), ("high", self.high))
        rigid = self.restitution is not None
        return tuple(f"{self.name}_{end}" for end, limit in ends if rigid and limit is not None)

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """For a rigid stop the gaps q - low and high - q, without friction."""
        if self.restitution is None:
            return ()
        (dof,), one = self.dofs(mechanism), mechanism.number(1.0)
        ends = []
        if self.low is not None:
            ends.append((dof.value - mechanism.value(self.low), one))
        if self.high is not None:
            ends.append((mechanism.value(self.high) - dof.value, -one))
        restitution, none = mechanism.value(self.restitution), mechanism.zero
        return tuple(
            Contact(
                name,
                self.name,
                gap,
                tuple(dof.loads(dof.along(sign))),
                (),
                restitution,
                none,
                one,
            )
            for name, (gap, sign) in zip(self.contact_names(()), ends, strict=True)
        )

    def _beyond(self, mechanism: Mechanism, dof: Dof) -> Scalar:
        """How far q is beyond its limits, rad or m: negative below, 0 within."""
        q = within = dof.value
        if self.high is not None:
            within = mechanism.call("min", within, mechanism.value(self.high))
        if self.low is not None:
            within = mechanism.call("max", within, mechanism.value(self.low))
        return mechanism.called("x", q - within)[0]
