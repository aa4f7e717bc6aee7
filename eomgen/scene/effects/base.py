"""What effects share: the `Mechanism` that they see, and the loads that they return."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, Self

from eomgen.language.base import Identifier, Table
from eomgen.language.conditions import Condition
from eomgen.language.formula import ZERO, Formula
from eomgen.scalars.exact import Real

Scalar = Any
"""SymPy expressions, program nodes or floats; effects add, subtract, multiply, divide, and call."""
Vector = tuple[Scalar, ...]
"""Two components in the plane, three in space."""


@dataclass(frozen=True)
class Input:
    """A commanded input `u` of the generated module; it is 0 unless given.

    At a joint `unit` and `about` may have alternatives: see `language.quantity.of_joint`.
    """

    name: str
    unit: str
    about: str


@dataclass(frozen=True)
class ExtraState:
    """A state that an effect adds, of a controller or an actuator for example.

    Its `unit` and `about` are like those of an `Input`.
    """

    name: str
    unit: str
    about: str
    initial: float


@dataclass(frozen=True)
class Load:
    """A force on one free body, and a torque.

    `force` in world axes (N) acts at `at`, from the centre of mass in body axes (m). `torque` in
    world axes (N m) has one component in the plane, about z, and three in space; () is none. `kind`
    says on which side of M v̇ + V + G = F it is. `in_body` has force and torque in body axes, if
    they are given so. Rotated to world axes and back they would be rounded, which would change the
    small moment of a force that almost passes through the centre of mass.
    """

    body: str
    force: Vector
    at: Vector
    kind: Literal["gravity", "applied"]
    torque: Vector = ()
    in_body: tuple[Vector, Vector] | None = None


@dataclass(frozen=True)
class JointLoad:
    """A force on one coordinate of a joint (N m or N): on the child, and back on the parent."""

    joint: str
    force: Scalar
    coordinate: int = 0


@dataclass(frozen=True)
class Contact:
    """A rigid contact of two things, which touch where `gap` is 0.

    `normal` are the loads of a unit force that drives them apart. `tangents` are the loads of a
    unit friction force along each tangent, on the same pair: none, one in the plane, two in space.
    By virtual work the gap's rate and the slip velocities are the powers of these loads.
    """

    name: str
    """A Python identifier, unique among contacts: "<effect>_<body>", "<effect>_<body>_3"."""
    effect: str
    """The effect's name."""
    gap: Scalar
    """m or rad, > 0 apart."""
    normal: tuple[Load | JointLoad, ...]
    tangents: tuple[tuple[Load, ...], ...]
    restitution: Scalar
    """0 to 1."""
    friction: Scalar
    """>= 0."""
    slip_speed: Scalar
    """m/s: smoothing of friction while they stay in touch."""


class Mechanism(Protocol):
    """The mechanism as an effect sees it. Vectors are in world axes unless stated otherwise."""

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""

    @property
    def magnitude(self) -> float:
        """The order of magnitude of its lengths, m: see `Model.magnitude`."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies."""

    @property
    def joints(self) -> Mapping[str, tuple[str, ...]]:
        """All joints that move but the free ones, each with its primitives in order: "revolute" or
        "prismatic" for a coordinate of its own, "spherical" for a quaternion.
        """

    def mass(self, body: str) -> Scalar:
        """Mass of a body, kg."""

    def height(self, body: str) -> Scalar:
        """World y of a body's centre of mass in the plane, z in space, m."""

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body, given from its centre of mass in body axes, m. The
        world is a body, too, with its origin for a centre of mass.
        """

    def point(self, name: str) -> tuple[str, Vector]:
        """A named point: its body, and where on it, from the centre of mass in body axes, m."""

    def velocity(self, body: str, at: Vector) -> Vector:
        """World velocity of such a point, m/s."""

    def angular_velocity(self, body: str) -> Vector:
        """Angular velocity of a body, rad/s: one component in the plane, three in space."""

    def outward(self, body: str, vector: Vector) -> Vector:
        """A vector of body axes in world axes."""

    def coordinate(self, joint: str, index: int = 0) -> Scalar:
        """A coordinate of a joint."""

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Its name."""

    def rate(self, joint: str, index: int = 0) -> Scalar:
        """A velocity of a joint."""

    def value(self, formula: Formula, **names: Scalar) -> Scalar:
        """Value of a quantity; in its formula may stand parameters, `t`, coordinates, velocities,
        inputs and extra states where the field lets them, and `names` besides.
        """

    def input(self, name: str) -> Scalar:
        """Value of an input."""

    def state(self, name: str) -> Scalar:
        """Value of an extra state."""

    def number(self, value: Real) -> Scalar:
        """A number as a scalar, a double or one of more digits (`language.exact`)."""

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas (`language.formula.FUNCTIONS`)."""


class Unmoved:
    """A mechanism for effects whose loads do not depend on the motion: see `is_plain`."""

    @property
    def magnitude(self) -> float:
        """Never asked for."""
        raise AssertionError

    def position(self, body: str, at: Vector) -> Vector:
        """Never asked for."""
        raise AssertionError(body)

    def point(self, name: str) -> tuple[str, Vector]:
        """Never asked for."""
        raise AssertionError(name)

    def velocity(self, body: str, at: Vector) -> Vector:
        """Never asked for."""
        raise AssertionError(body)

    def angular_velocity(self, body: str) -> Vector:
        """Never asked for."""
        raise AssertionError(body)

    def outward(self, body: str, vector: Vector) -> Vector:
        """Never asked for."""
        raise AssertionError(body)

    @property
    def joints(self) -> Mapping[str, tuple[str, ...]]:
        """Never asked for."""
        raise AssertionError

    def coordinate(self, joint: str, index: int = 0) -> Scalar:
        """Never asked for."""
        raise AssertionError(joint)

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Never asked for."""
        raise AssertionError(joint)

    def rate(self, joint: str, index: int = 0) -> Scalar:
        """Never asked for."""
        raise AssertionError(joint)

    def state(self, name: str) -> Scalar:
        """Never asked for."""
        raise AssertionError(name)

    def number(self, value: Real) -> Scalar:
        """Never asked for."""
        raise AssertionError(value)

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """Never asked for."""
        raise AssertionError(function)


class EffectTable(Table):
    """The base of effects' tables: keys, inputs, states, loads and energy. Defaults are empty."""

    body_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name a body, or list some; `anchor_fields` may name the world, too."""
    anchor_fields: ClassVar[tuple[str, ...]] = ()
    point_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that list named points of the scene."""
    joint_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name a revolute or prismatic joint, or hold a table by such names."""
    dof_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name a joint that moves and is not free, list some, or are "all"."""
    vector_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that hold a vector: as many components as there are dimensions, or left out."""

    name: Identifier

    def checked(self, dimensions: int, location: str) -> Self:
        """The effect itself, or one adapted to `dimensions`.

        Raises `SceneError`, naming the field after `location`, for errors beyond the schema.
        """
        return self

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Raise `SceneError` for a joint with a degree of freedom that it cannot act on.

        `joints` has the kinds of the primitives of all that move but the free ones, `names` the
        coordinates.
        """

    def conditions(self, location: str) -> Iterable[Condition]:
        """Conditions on its quantities besides their own bounds; `location` is the effect's."""
        return ()

    def inputs(self, dimensions: int) -> tuple[Input, ...]:
        """The inputs that it adds."""
        return ()

    def states(self, dimensions: int) -> tuple[ExtraState, ...]:
        """The states that it adds."""
        return ()

    def rates(self, mechanism: Mechanism) -> tuple[Scalar, ...]:
        """Time derivatives of its states, in their order."""
        return ()

    def loads(self, mechanism: Mechanism) -> Iterable[Load | JointLoad]:
        """Its loads on bodies and joints."""
        return ()

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Names of its rigid contacts in a mechanism with these bodies."""
        return ()

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """Its rigid contacts, which are events of a run instead of loads."""
        return ()

    def overlap(self, mechanism: Mechanism) -> Scalar:
        """The greatest depth of its soft contacts or stops, m or rad; 0 if none is pressed in."""
        return mechanism.number(0.0)

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """Potential energy, J; 0 for an effect without one."""
        return mechanism.value(ZERO)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """Whether exact motion keeps the sum of kinetic and potential energy in spite of it: it has
        a potential energy for all that it does, or does no work.

        At these `values` of the parameters and of `inputs`, of which those not named are 0. What is
        not known to keep it counts as if it did not.
        """
        return False

    def idle(self, inputs: Mapping[str, float], dimensions: int) -> bool:
        """Whether it takes inputs, and all of them are 0."""
        wanted = self.inputs(dimensions)
        return bool(wanted) and not any(inputs.get(given.name) for given in wanted)

    def is_plain(self, parameters: Collection[str]) -> bool:
        """Whether its loads depend only on parameters, inputs and its bodies' poses, as the closed
        form requires.
        """
        return False

    def why_not_plain(self) -> str:
        """Why it is not plain, in a few words."""
        return "that depends on the motion"
