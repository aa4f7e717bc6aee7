"""A spring and damper at a joint."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal, Self

from pydantic import Field

from eomgen.base.errors import SceneError
from eomgen.language.conditions import are_zero
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.effects.base import JointLoad, Mechanism, Resistance, Scalar
from eomgen.scene.effects.dofs import Dof, OnJoints, spring_energy
from eomgen.scene.effects.elements import AtJoint
from eomgen.scene.effects.spring import check_law, law_slopes


class JointSpring(OnJoints):
    """A torque or force -(k s + c ds/dt) on a joint's coordinate q, with s = q - rest.

    A torque (N m, s in rad) at a revolute joint, a force (N, s in m) at a prismatic one, on the
    child, with the reaction on the parent. A `law` of `stretch` s and `rate` ds/dt replaces k s; it
    is positive towards `rest`. The potential energy is ½ k s²; a law has none, so its work counts
    as that of an applied force. At a ball joint s is the angle of rotation, 0 to π, about the axis
    n, and the torque is -k s n - c ω; its `rest` is 0, and the torque reverses at s = π.
    """

    told = (
        "A torque -(k s + c ds/dt) on a joint's angle q, with s = q - rest. | "
        "A force -(k s + c ds/dt) on a joint's slide q, with s = q - rest."
    )
    example: ClassVar[str] = """
[[effects]]
type = "joint_spring"
name = "tendon"
joint = "elbow"
stiffness = 3.0
damping = 0.1
rest = 0.5
"""
    type: Literal["joint_spring"]
    stiffness: Quantity = quantity(
        "N m/rad | N/m", "stiffness", "nonnegative", default=ZERO, validate_default=False
    )
    damping: Quantity = quantity(
        "N m s/rad | N s/m", "damping", "nonnegative", default=ZERO, validate_default=False
    )
    rest: Quantity = quantity("rad | m", "coordinate at rest", default=ZERO, validate_default=False)
    law: Quantity | None = quantity(
        "N m | N",
        "restoring torque or force in place of stiffness",
        sees=("motion", "stretch", "rate"),
        default=None,
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether stiffness and damping may be negative"
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check that there is stiffness, damping or a law, but not stiffness and a law."""
        check_law(self, self.law, location)
        return self

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Check that `rest` is 0 at ball joints."""
        super().check_dofs(joints, names, location)
        for joint in self.acted_on(joints):
            if "spherical" in joints[joint] and self.rest != ZERO:
                raise SceneError(
                    f"{location}.rest: at a ball joint ('{joint}') it is 0; leave it out"
                )

    def loads(self, mechanism: Mechanism) -> Iterator[JointLoad]:
        """Loads on the child, with reactions on the parent."""
        for dof in self.dofs(mechanism):
            stretch = self._stretch(mechanism, dof)
            if self.law is not None:
                back = mechanism.value(self.law, stretch=stretch, rate=dof.rate)
            else:
                back = mechanism.value(self.stiffness) * stretch
            damping = mechanism.value(self.damping)
            pairs = zip(dof.along(back), dof.rates, strict=True)
            yield from dof.loads([-(force + damping * rate) for force, rate in pairs])

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterator[Resistance]:
        """Of a ball joint as for small angles, alike about all axes."""
        for dof in self.dofs(mechanism):
            stiffness, damping = law_slopes(
                self, mechanism, self._stretch(mechanism, dof) if self.law else None, dof.rate
            )
            yield from dof.resisting(mechanism, stiffness, damping)

    def drawn(self, at: AtJoint) -> AtJoint:
        """A torsion spring, or a coil along a slider."""
        return replace(at, kind="torsion", rest=self.rest)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """True without damping and without a law."""
        return self.law is None and are_zero(values, self.damping)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """½ k s², J; 0 with a law."""
        if self.law is not None:
            return mechanism.zero
        stretches = (self._stretch(mechanism, dof) for dof in self.dofs(mechanism))
        return spring_energy(mechanism, self.stiffness, stretches)

    def _stretch(self, mechanism: Mechanism, dof: Dof) -> Scalar:
        return dof.value - mechanism.value(self.rest)
