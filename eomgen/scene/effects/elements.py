"""What a picture shows beside bodies: springs, contacts, motors, fields and the like.

Each effect of a scene becomes elements, whose numbers are formulas of parameters. Points are from
the body's centre of mass in body axes, or from the world's origin, m. A body is an index, -1 for
the world; a joint is the index of its child.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Protocol

from eomgen.language.formula import Formula

WORLD_INDEX = -1

Vector = tuple[Formula, ...]


class Layout(Protocol):
    """What effects can read of a model in order to say how they are drawn."""

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""

    @property
    def bodies(self) -> Mapping[str, int]:
        """The index of each body, -1 for "world"."""

    @property
    def joints(self) -> Mapping[str, tuple[str, ...]]:
        """As of a `Mechanism`: the kinds of the primitives of joints that move."""

    @property
    def coil(self) -> Formula:
        """Radius of a coil, m."""

    @property
    def symbol(self) -> Formula:
        """Radius of what is drawn at a joint, m."""

    def child(self, joint: str) -> int:
        """The index of a joint's child."""

    def coordinates(self, joint: str) -> tuple[str, ...]:
        """The names of a joint's coordinates."""

    def point(self, name: str) -> tuple[int, Vector]:
        """The body of a named point, and where on it."""

    def value(self, formula: Formula) -> float:
        """The value of a quantity at the scene's parameters."""

    def axle(self, body: str, carrier: str) -> tuple[Vector, Vector] | None:
        """The point about which a body turns on another one, on it and on the other one; None if
        they are not joined, and neither are both to a third one.
        """

    def wheel_axis(self, body: int, at: Vector) -> Vector | None:
        """The axis about which a body rotates if it does so about a point of it; () in the plane,
        None if it does not.
        """


@dataclass(frozen=True)
class Attachment:
    """A point of a body."""

    body: int
    at: Vector


@dataclass(frozen=True)
class Link:
    """A spring, a damper or both between two points, a rope, which is slack below `rest`, m, or a
    pull, which no thing transmits.
    """

    kind: Literal["coil", "damper", "spring_damper", "rope", "pull"]
    effect: str
    start: Attachment
    end: Attachment
    rest: Formula | None
    radius: Formula


@dataclass(frozen=True)
class Cord:
    """A rope or a belt over `stops`: points, and discs about them with `radii`, m: positive if it
    goes round them counterclockwise, 0 for points. A `closed` one goes on to the first one.
    """

    kind: ClassVar[str] = "cord"
    effect: str
    stops: tuple[Attachment, ...]
    radii: tuple[Formula, ...]
    closed: bool = False


@dataclass(frozen=True)
class AtJoint:
    """Something at a coordinate of a joint.

    torsion  a spring at the joint with its `rest`
    motor    a motor, a servo (which has a controller), or a drive that prescribes the coordinate
    stop     limits `low` and `high`, either of which may be absent
    brake    friction
    """

    kind: Literal["torsion", "motor", "servo", "drive", "stop", "brake"]
    effect: str
    joint: int
    coordinate: int
    radius: Formula
    rest: Formula | None = None
    low: Formula | None = None
    high: Formula | None = None


@dataclass(frozen=True)
class Round:
    """A sphere, a circle in the plane, at a point of a body.

    ball      that of a contact; of radius 0 it is a point
    wheel     that of a contact whose body rotates about it: `axis` is its axis in the body's axes;
              None in the plane
    obstacle  that of a force field, which acts within `reach` of its surface
    gear      a ring with teeth inside, or a gear of the world; a tooth, or a gap of a ring, is at
              the angle `phase` from the body's x axis, rad
    """

    kind: Literal["ball", "wheel", "obstacle", "gear"]
    effect: str
    body: int
    at: Vector
    radius: Formula
    reach: Formula | None = None
    axis: Vector | None = None
    teeth: int = 0
    ring: bool = False
    phase: float = 0.0


@dataclass(frozen=True)
class Disc:
    """A disc of a body that a rope, a belt or a gear turns. With `teeth` it is a gear, with a tooth
    at the angle `phase` from the body's x axis, rad.
    """

    body: str
    at: Vector
    radius: Formula
    teeth: int = 0
    phase: float = 0.0


@dataclass(frozen=True)
class Touching:
    """A sphere of a body, a circle in the plane, or a box of half sizes `corners` rounded by the
    radius, with which it touches others; or a capsule to its other `end`, or an ellipsoid. Boxes
    and ellipsoids are turned by angles about x, then y, then z.
    """

    body: str
    at: Vector
    radius: Formula
    corners: Vector | None
    end: Vector | None = None
    semi_axes: Vector | None = None
    orientation_deg: tuple[float, ...] = ()


@dataclass(frozen=True)
class Plane:
    """The plane n·x = `offset` of a contact with unit normal n, in the axes of its body."""

    kind: ClassVar[str] = "plane"
    effect: str
    body: int
    normal: Vector
    offset: Formula


@dataclass(frozen=True)
class GroundLine:
    """The ground over a line along x (0) or y (1): places along it and heights there, m; `across`
    is where the line is on the other axis.
    """

    axis: int
    across: float
    points: tuple[tuple[float, Formula], ...]


@dataclass(frozen=True)
class Heights:
    """The ground of a contact below a height, a formula of x, and y in space; the lines that
    pictures show of it.
    """

    kind: ClassVar[str] = "heights"
    effect: str
    formula: Formula | None
    lines: tuple[GroundLine, ...] = ()


@dataclass(frozen=True)
class Field:
    """A force field about a centre, or the force that a formula gives on a point at rest.

    `points` are where pictures show it by arrows, m, world axes, and `forces` what it is there, N.
    `formula` is that of the scene, with the point's position x, y, z and velocity vx, vy, vz.
    """

    kind: ClassVar[str] = "field"
    effect: str
    form: str
    center: Vector | None = None
    points: tuple[Vector, ...] = ()
    forces: tuple[Vector, ...] = ()
    formula: Vector | None = None


@dataclass(frozen=True)
class Wind:
    """A fluid's velocity, m/s, world axes, which pictures show at the point `at`, m.

    `formula` is that of the scene, as of a field; `velocity` is its value at that point, None if it
    depends on more than parameters and time.
    """

    kind: ClassVar[str] = "wind"
    effect: str
    at: Vector
    velocity: Vector | None = None
    formula: Vector | None = None


@dataclass(frozen=True)
class Attraction:
    """A point of the world that attracts bodies."""

    kind: ClassVar[str] = "attraction"
    effect: str
    center: Vector
    bodies: tuple[int, ...]


@dataclass(frozen=True)
class Pull:
    """The point at which an external force acts on a body, or the body on which a torque does."""

    kind: Literal["force", "torque"]
    effect: str
    body: int
    at: Vector


@dataclass(frozen=True)
class Weight:
    """Uniform gravity along a unit vector, world axes."""

    kind: ClassVar[str] = "gravity"
    effect: str
    direction: Vector


@dataclass(frozen=True)
class Support:
    """What a joint with the world or a slider needs to be seen.

    base  a mark at the point of the world that holds a joint; `axis` points to the ground, along
          which the bodies are on the other side
    rail  a line on the parent (-1 for the world) through `at` along `axis`, unit, in the parent's
          axes, from `low` to `high`, m
    """

    kind: Literal["base", "rail"]
    joint: int
    body: int
    at: Vector
    radius: Formula
    axis: Vector | None = None
    low: Formula | None = None
    high: Formula | None = None


Element = (
    Link
    | Cord
    | AtJoint
    | Round
    | Plane
    | Heights
    | Field
    | Wind
    | Attraction
    | Pull
    | Weight
    | Support
)


def without_formula(element: Element) -> Element:
    """An element without the formula of a scene, which may depend on the motion."""
    return (
        replace(element, formula=None) if isinstance(element, Field | Wind | Heights) else element
    )
