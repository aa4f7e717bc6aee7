"""The bases of effects on degrees of freedom of one joint, of several, or of all."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError, nearest
from eomgen.language.base import Identifier
from eomgen.language.formula import Formula
from eomgen.scene.effects.base import (
    EffectTable,
    JointLoad,
    Mechanism,
    Resistance,
    Scalar,
    Vector,
)
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.elements import AtJoint, Layout
from eomgen.scene.effects.vectors import dot, length, scale


@dataclass(frozen=True)
class Dof:
    """One degree of freedom with its own coordinate, or the three of a ball joint together.

    first      index of its first velocity among those of the joint
    value      the coordinate, rad or m; for a ball joint the angle of rotation, 0 to π, about the
               unit vector n
    direction  1, or n, which has the same components in the child's and the parent's axes
    rates      the velocities, rad/s or m/s; for a ball joint the angular velocity in the child's
               axes, so that dvalue/dt = direction · rates
    """

    joint: str
    first: int
    value: Scalar
    direction: Vector
    rates: Vector

    @property
    def rate(self) -> Scalar:
        """dvalue/dt."""
        return self.rates[0] if len(self.rates) == 1 else dot(self.direction, self.rates)

    def loads(self, forces: Sequence[Scalar]) -> Iterator[JointLoad]:
        """Loads on the child of generalised forces along its velocities."""
        for i, force in enumerate(forces):
            yield JointLoad(self.joint, force, self.first + i)

    def resisting(
        self, mechanism: Mechanism, stiffness: Scalar, damping: Scalar
    ) -> Iterator[Resistance]:
        """The same resistance along each of its velocities."""
        for i in range(len(self.rates)):
            load = JointLoad(self.joint, mechanism.number(1.0), self.first + i)
            yield Resistance((load,), stiffness, damping)

    def along(self, force: Scalar) -> tuple[Scalar, ...]:
        """The generalised forces along its velocities of a force along `direction`."""
        if len(self.rates) == 1:
            return (force,)
        return scale(force, self.direction)


def joint_dof(mechanism: Mechanism, joint: str, kind: str, index: int) -> Dof:
    """The degree of freedom whose first coordinate and velocity have this index in the joint."""
    if kind != "spherical":
        value, rate = mechanism.coordinate(joint, index), mechanism.rate(joint, index)
        return Dof(joint, index, value, (mechanism.number(1.0),), (rate,))
    w, *vector = (mechanism.coordinate(joint, index + i) for i in range(4))
    rates = tuple(mechanism.rate(joint, index + i) for i in range(3))
    # Quaternions (w, r) and (-w, -r) are the same rotation; with w >= 0 its angle is at most π.
    sine = length(mechanism, tuple(vector))
    half = mechanism.call("atan2", sine, mechanism.call("abs", w))
    per_sine = mechanism.number(1.0) / sine
    per_sine = mechanism.call("select", -w, -per_sine, per_sine)
    direction = mechanism.called("n", *scale(per_sine, vector))
    (angle,) = mechanism.called("beta", half + half)
    return Dof(joint, index, angle, direction, rates)


def spring_energy(mechanism: Mechanism, stiffness: Formula, stretches: Iterable[Scalar]) -> Scalar:
    """Σ ½ k s², J."""
    total = mechanism.zero
    for stretch in stretches:
        half = mechanism.number(0.5) * mechanism.value(stiffness)
        total = total + half * (stretch * stretch)
    return total


class OnJoints(EffectTable):
    """An effect on the degrees of freedom of `joint`, or of each of `joints`, which may be "all";
    or on one `coordinate` of a joint that has several.
    """

    dof_fields: ClassVar[tuple[str, ...]] = ("joint", "joints")

    joint: Identifier | None = Field(default=None, description="joint it acts on")
    joints: Literal["all"] | Annotated[tuple[Identifier, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="joints it acts on, if several; 'all' are all but the free ones",
    )
    coordinate: Identifier | None = Field(
        default=None, description="coordinate it acts on, if the joint has several"
    )

    @model_validator(mode="after")
    def _one_or_several(self) -> Self:
        if (self.joint is None) == (self.joints is None):
            what = "is missing" if self.joint is None else "is given in addition to 'joints'"
            raise wrong("joint", f"{what}; give one of joint, joints")
        if self.coordinate is not None and self.joint is None:
            raise wrong("coordinate", "belongs to one joint; name that joint as joint")
        listed = self.joints if isinstance(self.joints, tuple) else ()
        for i, name in enumerate(listed):
            if name in listed[:i]:
                raise wrong(f"joints[{i}]", f"'{name}' is listed twice; leave one out")
        return self

    def acted_on(self, joints: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
        """Names of the joints it acts on, among `joints` as in `Mechanism.joints`."""
        if self.joint is not None:
            return (self.joint,)
        return self.joints if isinstance(self.joints, tuple) else tuple(joints)

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Check that the joint has the coordinate."""
        if self.coordinate is not None:
            assert self.joint is not None
            known = _scalar_coordinates(joints, names, self.joint)
            _check_coordinate(self.coordinate, self.joint, known, location)

    def elements(self, layout: Layout) -> Iterator[AtJoint]:
        """A symbol at each coordinate that it acts on."""
        for joint in self.acted_on(layout.joints):
            names = layout.coordinates(joint)
            for index in range(len(layout.joints[joint])):
                if self.coordinate in (None, names[index]):
                    at = AtJoint("brake", self.name, layout.child(joint), index, layout.symbol)
                    yield self.drawn(at)

    def drawn(self, at: AtJoint) -> AtJoint:
        """The symbol at one coordinate: by default that of friction."""
        return at

    def dofs(self, mechanism: Mechanism) -> Iterator[Dof]:
        """The degrees of freedom that it acts on."""
        for joint in self.acted_on(mechanism.joints):
            for index, kind in enumerate(mechanism.joints[joint]):
                name = mechanism.coordinate_name(joint, index)
                if self.coordinate in (None, name):
                    yield joint_dof(mechanism, joint, kind, index)


class OnCoordinate(EffectTable):
    """An effect on the coordinate of `joint`, or on that `coordinate` of one that has several."""

    dof_fields: ClassVar[tuple[str, ...]] = ("joint",)
    symbol: ClassVar[Literal["motor", "servo"]] = "servo"
    """What pictures show at the joint."""

    joint: Identifier = Field(description="joint it acts on")
    coordinate: Identifier | None = Field(
        default=None, description="coordinate it acts on, if the joint has several"
    )

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Check that the joint has the coordinate, or only one."""
        known = _scalar_coordinates(joints, names, self.joint)
        if not known:
            raise SceneError(f"{location}.joint: '{self.joint}' is a ball joint and has no angle")
        if self.coordinate is None and len(known) > 1:
            raise SceneError(
                f"{location}.coordinate: missing; '{self.joint}' has {', '.join(known)}: give one"
            )
        _check_coordinate(self.coordinate, self.joint, known, location)

    def elements(self, layout: Layout) -> Iterator[AtJoint]:
        """A motor or a servo."""
        names = layout.coordinates(self.joint)
        k = names.index(self.coordinate) if self.coordinate else 0
        yield AtJoint(self.symbol, self.name, layout.child(self.joint), k, layout.symbol)

    def coordinate_index(self, mechanism: Mechanism) -> int:
        """Index of the coordinate in its joint."""
        if self.coordinate is None:
            return 0
        count = len(mechanism.joints[self.joint])
        names = [mechanism.coordinate_name(self.joint, i) for i in range(count)]
        return names.index(self.coordinate)


def _scalar_coordinates(
    joints: Mapping[str, tuple[str, ...]], names: Mapping[str, Sequence[str]], joint: str
) -> Sequence[str]:
    """The coordinates of revolute and prismatic primitives of a joint."""
    return names[joint][: sum(kind != "spherical" for kind in joints[joint])]


def _check_coordinate(name: str | None, joint: str, known: Sequence[str], location: str) -> None:
    if name is not None and name not in known:
        hint = nearest(name, known) or f"; known: {', '.join(known) or 'none'}"
        raise SceneError(f"{location}.coordinate: '{joint}' has no angle or slide '{name}'{hint}")
