"""What a model consists of: bodies in a tree, points on them, coordinates that follow a formula."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from eomgen.language.formula import Constant, Formula
from eomgen.scene.effects import Effect
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Coordinate


@dataclass(frozen=True)
class Body:
    """A body and the joint that connects it to its parent.

    parent       index of the parent among the bodies, -1 for the world
    inertia_com  about the centre of mass, in body axes, kg m²: one moment in the plane; in space
                 xx, yy, zz, xy, xz, yz
    positions    all coordinates of the joint, whether states or prescribed
    velocities   all velocities of the joint, likewise
    com          the centre of mass in the frame in which the scene gives points, m; () if that is
                 its origin. All points of the model are from the centre of mass
    notices      what elaboration accepted with a reservation
    """

    name: str
    mass: Formula
    inertia_com: tuple[Formula, ...]
    joint: Joint
    parent: int
    positions: tuple[Coordinate, ...]
    velocities: tuple[Coordinate, ...]
    com: tuple[Formula, ...] = ()
    notices: tuple[str, ...] = ()

    @property
    def plain(self) -> int:
        """The number of coordinates whose time derivative is a velocity of the joint.

        The coordinates after them are the four of a quaternion, whose velocities are the three
        components of an angular velocity.
        """
        has_quaternion = len(self.positions) != len(self.velocities)
        return len(self.positions) - (4 if has_quaternion else 0)

    @property
    def moment(self) -> Formula:
        """The moment of inertia of a planar body about its centre of mass, kg m²."""
        assert len(self.inertia_com) == 1, "in the plane only"
        return self.inertia_com[0]


@dataclass(frozen=True)
class Point:
    """A named point: the index of its body, and its position `at` from the body's centre of mass,
    in body axes, m.
    """

    name: str
    body: int
    at: tuple[Formula, ...]


@dataclass(frozen=True)
class Prescribed:
    """A coordinate whose motion is given, so that it is not a state.

    value  a formula of t and parameters; of a locked coordinate a constant
    by     the name of the effect that drives it, None if it is locked
    """

    position: Coordinate
    velocity: Coordinate
    value: Formula
    by: str | None

    @property
    def locked(self) -> bool:
        """Whether the coordinate is constant."""
        return self.by is None


def prescribed_of(
    bodies: Sequence[Body], effects: Iterable[Effect], locked: Mapping[str, float]
) -> tuple[Prescribed, ...]:
    """The prescribed coordinates: driven ones in the order of the bodies, then locked ones.

    `locked` maps the names of locked coordinates to their values.
    """
    drives = {drive[0]: (drive[1], e.name) for e in effects if (drive := e.prescribes())}
    driven, constant = [], []
    for body in bodies if drives or locked else ():
        for x, v in zip(body.positions, body.velocities, strict=False):
            if body.joint.name in drives:
                driven.append(Prescribed(x, v, *drives[body.joint.name]))
            elif x.name in locked:
                constant.append(Prescribed(x, v, Constant(locked[x.name]), None))
    return (*driven, *constant)


def positions_of(
    bodies: Iterable[Body], prescribed: Iterable[Prescribed]
) -> tuple[Coordinate, ...]:
    """The coordinates of bodies that are states, in order."""
    given = {c.position.name for c in prescribed}
    return tuple(c for body in bodies for c in body.positions if c.name not in given)


def velocities_of(
    bodies: Iterable[Body], prescribed: Iterable[Prescribed]
) -> tuple[Coordinate, ...]:
    """The velocities of bodies that are states, in order."""
    given = {c.velocity.name for c in prescribed}
    return tuple(c for body in bodies for c in body.velocities if c.name not in given)


def dofs_of(bodies: Iterable[Body], dimensions: int) -> dict[str, tuple[str, ...]]:
    """The joints that have coordinates, except free ones, with the kinds of their primitives."""
    return {
        body.joint.name: tuple(primitive.kind for primitive in body.joint.primitives(dimensions))
        for body in bodies
        if body.positions and body.joint.holds
    }


@dataclass(frozen=True)
class JointIndex:
    """The indices of a joint's coordinates `q` and velocities `v`.

    They count all coordinates, or velocities: those of the state, then the driven ones, then the
    locked ones, each in the order of the bodies.
    """

    body: Body
    q: tuple[int, ...]
    v: tuple[int, ...]

    @property
    def plain(self) -> tuple[tuple[int, int], ...]:
        """Pairs of a coordinate and the velocity that is its time derivative; see `Body.plain`."""
        end = self.body.plain
        return tuple(zip(self.q[:end], self.v[:end], strict=True))

    @property
    def quaternion(self) -> tuple[int, ...]:
        """The coordinates w, x, y, z of the joint's quaternion; () if it has none."""
        return self.q[self.body.plain :]

    @property
    def spin(self) -> tuple[int, ...]:
        """The velocities that belong to the quaternion: an angular velocity; () if none."""
        return self.v[self.body.plain :]
