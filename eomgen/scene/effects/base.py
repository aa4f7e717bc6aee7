"""The interface of effects: the `Mechanism` that they read and the loads that they return."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Literal, Protocol, Self

from eomgen.language.base import Identifier, Table
from eomgen.language.conditions import Condition
from eomgen.language.formula import Formula
from eomgen.language.rewriting import constant
from eomgen.scalars.exact import Real
from eomgen.scene.effects.elements import WORLD_INDEX, AtJoint, Element, Layout, Pull, Touching

Scalar = Any
"""SymPy expressions, program nodes or floats. Effects use only + - * / and `Mechanism.call`."""
Vector = tuple[Scalar, ...]
"""Two components in the plane, three in space."""


@dataclass(frozen=True)
class Input:
    """An input `u` of the generated module; it has its default, 0 in effects, unless given.

    At a joint `unit` and `about` may have alternatives: see `language.quantity.of_joint`.
    """

    name: str
    unit: str
    about: str
    default: float = 0.0


@dataclass(frozen=True)
class ExtraState:
    """A state that an effect adds, for example that of a controller or an actuator.

    `unit` and `about` are as for an `Input`.
    """

    name: str
    unit: str
    about: str
    initial: float


@dataclass(frozen=True)
class Sampling:
    """When an effect samples, and which states that sets.

    period, delay  of its samples, and from one to the change of what it holds, s
    noisy          names of sensors whose noise a sample needs
    sets           states that a sample sets at once
    holds          states that it sets after the delay, those after `sets`
    inputs         inputs of the scene that are among these
    seed           whole number from which noise follows
    """

    period: float
    delay: float
    noisy: tuple[str, ...]
    sets: tuple[str, ...]
    holds: tuple[str, ...]
    inputs: tuple[str, ...]
    seed: Formula

    @property
    def due(self) -> dict[str, tuple[str, ...]]:
        """For what is held the states with its next values, in the order in which they are due."""
        waiting = math.ceil(simplest(self.delay) / simplest(self.period))
        return {name: tuple(f"{name}_due_{i + 1}" for i in range(waiting)) for name in self.holds}


def simplest(x: float) -> Fraction:
    """The simplest fraction that rounds to a number: 1/100 for 0.01."""
    bound = 1
    while float(found := Fraction(x).limit_denominator(bound)) != x:
        bound *= 10
    return found


@dataclass(frozen=True)
class Load:
    """A force and a torque on a body.

    force    world axes, N
    at       point of application, from the centre of mass in body axes, m
    kind     the term of M v̇ + V + G = F to which it belongs: G or F
    torque   world axes, N m: one component in the plane, about z, three in space; () for none
    in_body  force and torque in body axes, if the scene gives them so. Rotating them to world axes
             and back would round them, and change the small moment of a force that almost passes
             through the centre of mass
    """

    body: str
    force: Vector
    at: Vector
    kind: Literal["gravity", "applied"]
    torque: Vector = ()
    in_body: tuple[Vector, Vector] | None = None


@dataclass(frozen=True)
class JointLoad:
    """A generalised force along one coordinate of a joint, N m or N. It acts on the child, its
    reaction on the parent.
    """

    joint: str
    force: Scalar
    coordinate: int = 0


@dataclass(frozen=True)
class Contact:
    """A rigid contact of two bodies, which touch where `gap` is 0.

    `normal` are the loads of a unit force that separates them. `tangents` are the loads of a unit
    friction force along each tangent: none, one in the plane, two in space. By virtual work the
    rate of the gap and the slip velocities are the powers of these loads.
    """

    name: str
    """A Python identifier, unique among contacts: "<effect>_<body>", "<effect>_<body>_3"."""
    effect: str
    """The effect's name."""
    gap: Scalar
    """Distance, m or rad; > 0 if they are apart."""
    normal: tuple[Load | JointLoad, ...]
    tangents: tuple[tuple[Load, ...], ...]
    restitution: Scalar
    """Coefficient of restitution, 0 to 1."""
    friction: Scalar
    """Coefficient of friction, >= 0."""
    slip_speed: Scalar
    """Slip below which friction is smoothed while the contact stays closed, m/s."""


@dataclass(frozen=True)
class Resistance:
    """How fast a load grows against motion: along `loads`, those of a unit force, whose power is
    the speed of the motion, the force falls by `stiffness` for each m or rad and by `damping` for
    each m/s or rad/s.

    Steps that are implicit in stiff forces take it: it need not be exact, but the matrix of all
    resistances of an effect together must not be negative. `change` is by how much the force along
    the loads is greater at the end of a step at these velocities; None if the stiffness says it.
    """

    loads: tuple[Load | JointLoad, ...]
    stiffness: Scalar
    damping: Scalar
    change: Scalar | None = None


class Mechanism(Protocol):
    """What effects can read of a mechanism. Vectors are in world axes unless stated otherwise."""

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""

    @property
    def magnitude(self) -> float:
        """The order of magnitude of lengths, m: see `Model.magnitude`."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies."""

    @property
    def masses(self) -> Mapping[str, Formula]:
        """Mass of each body, kg."""

    @property
    def zero(self) -> Scalar:
        """The number 0."""

    @property
    def joints(self) -> Mapping[str, tuple[str, ...]]:
        """The primitives, in order, of each joint that is neither free nor a weld: "revolute" or
        "prismatic" for a coordinate, "spherical" for a quaternion.
        """

    def height(self, body: str) -> Scalar:
        """World y of a body's centre of mass in the plane, z in space, m."""

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body, m; `at` is from the centre of mass in body axes. For
        the body "world" it is from the origin.
        """

    def point(self, name: str) -> tuple[str, Vector]:
        """The body of a named point, and its position from the centre of mass in body axes, m."""

    def velocity(self, body: str, at: Vector) -> Vector:
        """World velocity of a point as in `position`, m/s."""

    def angular_velocity(self, body: str) -> Vector:
        """Angular velocity of a body, rad/s: one component in the plane, three in space."""

    def outward(self, body: str, vector: Vector) -> Vector:
        """A vector that is given in body axes, in world axes."""

    def coordinate(self, joint: str, index: int = 0) -> Scalar:
        """Value of a coordinate of a joint, rad or m, or a component of its quaternion."""

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Name of a coordinate of a joint."""

    def rate(self, joint: str, index: int = 0) -> Scalar:
        """Value of a velocity of a joint, rad/s or m/s."""

    def value(self, formula: Formula, **names: Scalar) -> Scalar:
        """Value of a quantity. Its formula may use parameters, `names`, and where the field allows
        it `t`, coordinates, velocities, inputs and extra states.
        """

    def input(self, name: str) -> Scalar:
        """Value of an input."""

    def state(self, name: str) -> Scalar:
        """Value of an extra state."""

    def number(self, value: Real) -> Scalar:
        """A number as a scalar."""

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """Value of a function of `scalars.functions.FUNCTIONS`."""

    def rounded(self, value: Scalar, quantum: Scalar) -> Scalar:
        """The multiple of `quantum` that is nearest to a value."""

    def called(self, letter: str, *values: Scalar) -> Vector:
        """The values themselves, a scalar or the components of a vector. A derivation shows them by
        this letter, with their formula beside it.
        """


class EffectTable(Table):
    """The base of effects: keys, inputs, states, loads and energy. By default there are none."""

    body_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name one body or several; those of `anchor_fields` may also name the world."""
    anchor_fields: ClassVar[tuple[str, ...]] = ()
    point_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that list named points of the scene."""
    joint_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name a revolute or prismatic joint, or are tables with such names as keys."""
    dof_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that name one joint or several, neither free nor weld, or are "all"."""
    vector_fields: ClassVar[tuple[str, ...]] = ()
    """Fields with a vector that has one component for each dimension, or is absent."""
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """For each field with a point of a body the fields that name the body or bodies."""
    direction_fields: ClassVar[tuple[str, ...]] = ()
    """Fields with a fixed direction in the world, or None."""
    told: ClassVar[str] = ""
    """What it is, as a derivation says it; "" for the first paragraph of its description. It may
    have alternatives by joint: see `language.quantity.of_joint`.
    """
    single: ClassVar[bool] = False
    """Whether a scene has at most one of it."""
    input_field: ClassVar[str] = ""
    """The field that may be "input"."""

    name: Identifier

    @property
    def type_name(self) -> str:
        """Its `type` in scenes."""
        return str(getattr(self, "type", ""))

    def checked(self, dimensions: int, location: str) -> Self:
        """The effect itself, or a copy with fields adapted to `dimensions`.

        Raises `SceneError` for errors that the schema cannot express; its message starts with
        `location` and the field.
        """
        return self

    def check_dofs(
        self,
        joints: Mapping[str, tuple[str, ...]],
        names: Mapping[str, Sequence[str]],
        location: str,
    ) -> None:
        """Raise `SceneError` for a joint with a degree of freedom that it cannot act on.

        `joints` are those of `Mechanism.joints`; `names` are the names of their coordinates.
        """

    def conditions(self, location: str) -> Iterable[Condition]:
        """Conditions on quantities beyond the bounds of each; `location` is that of the effect."""
        return ()

    def notices(self, values: Mapping[str, float]) -> Iterable[str]:
        """What looks like a mistake but is not one for certain, at these values of parameters; each
        starts with the key.
        """
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

    def sampling(self) -> Sampling | None:
        """When it samples; None if it does not."""
        return None

    def samples(self, mechanism: Mechanism, noise: Mapping[str, Scalar]) -> Sequence[Scalar]:
        """What a sample gives `Sampling.sets` and `holds`, with a normal number for each noise."""
        return ()

    def resistances(self, mechanism: Mechanism, h: Scalar) -> Iterable[Resistance]:
        """How its loads resist motion in a step of length h, s; none for loads that are not
        stiff.
        """
        return ()

    def contact_names(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Names of its rigid contacts in a mechanism with these bodies."""
        return ()

    def contacts(self, mechanism: Mechanism) -> tuple[Contact, ...]:
        """Its rigid contacts. They exert no loads; a run handles them as events."""
        return ()

    def overlap(self, mechanism: Mechanism) -> Scalar:
        """The greatest depth of its soft contacts or stops, m or rad; 0 if none overlaps."""
        return mechanism.zero

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """Potential energy, J; 0 for an effect without one."""
        return mechanism.zero

    def elements(self, layout: Layout) -> Iterable[Element]:
        """What pictures show of it: by default its points of bodies and the joints it names."""
        places = {body: key for key, naming in self.points_of.items() for body in naming}
        for field in (*self.body_fields, *self.anchor_fields):
            at = getattr(self, places.get(field, ""), ()) or constant(*[0.0] * layout.dimensions)
            for body in self.named((field,), tuple(layout.bodies)):
                if layout.bodies[body] != WORLD_INDEX:
                    yield Pull("force", self.name, layout.bodies[body], at)
        for joint in self.named((*self.joint_fields, *self.dof_fields), tuple(layout.joints)):
            yield AtJoint("motor", self.name, layout.child(joint), 0, layout.symbol)

    def prescribes(self) -> tuple[str, Formula] | None:
        """The joint whose coordinate it prescribes, and the formula; None if it exerts loads."""
        return None

    @property
    def uniform(self) -> bool:
        """Whether its loads are those of one `acceleration` of all bodies."""
        return False

    def acceleration(self, mechanism: Mechanism) -> Vector:
        """The acceleration of free fall that it gives bodies, world axes, m/s²; () for none."""
        return ()

    def limited(self, joints: Mapping[str, tuple[str, ...]]) -> Sequence[str]:
        """The joints whose coordinates it keeps within limits, among those of a mechanism."""
        return ()

    def switched(self, switch: Formula) -> Self | None:
        """The effect times a parameter; None if its loads and energy are to be multiplied."""
        return None

    def from_centres(self, centres: Mapping[str, tuple[Formula, ...]]) -> Mapping[str, Any]:
        """Fields beside points that change with the `centres` of mass of bodies that have frames
        of their own.
        """
        return {}

    def named(self, fields: Sequence[str], every: Sequence[str]) -> list[str]:
        """The bodies or joints that some fields name; "all" are `every` one."""
        names: list[str] = []
        for field in fields:
            value = getattr(self, field)
            names += every if value == "all" else [value] if isinstance(value, str) else value or ()
        return names

    def shapes_in_contact(self, bodies: Sequence[str]) -> Iterable[Touching]:
        """The shapes with which bodies touch others, in a mechanism with these bodies."""
        return ()

    def lengths(self) -> Iterable[Formula]:
        """Lengths that say how large a mechanism without links is, m."""
        return ()

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """Whether its loads conserve energy: they have a potential, or do no work.

        `values` are those of the parameters; `inputs` that are not named are 0. False if this is
        not known.
        """
        return False

    def idle(self, inputs: Mapping[str, float], dimensions: int) -> bool:
        """Whether it has inputs and all of them are 0."""
        own = self.inputs(dimensions)
        return bool(own) and not any(inputs.get(i.name) for i in own)
