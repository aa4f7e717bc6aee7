"""The model: a scene whose every name is resolved; bodies in a tree, parents before children."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import TypeGuard

from eomgen.language.conditions import Condition, require
from eomgen.language.formula import Constant, Formula, evaluate
from eomgen.language.quantity import Parameter
from eomgen.scalars.exact import Real, radians
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import Driven, Effect
from eomgen.scene.effects.base import ExtraState, Input
from eomgen.scene.joints import Free, Joint, Revolute
from eomgen.scene.joints.base import Coordinate
from eomgen.scene.schema import Form, LeftOut, Route


@dataclass(frozen=True)
class Body:
    """A body and the joint that holds it. `parent` is an index into the bodies, -1 the world.

    `inertia_com` about the centre of mass in body axes: one moment in the plane; in space xx, yy,
    zz, xy, xz, yz. `positions` and `velocities` are all the joint's, whether states or not; see
    `Model.joint_indices`.
    """

    name: str
    mass: Formula
    inertia_com: tuple[Formula, ...]
    joint: Joint
    parent: int
    positions: tuple[Coordinate, ...]
    velocities: tuple[Coordinate, ...]

    @property
    def plain(self) -> int:
        """How many of its coordinates have a rate of their own: all but those of a quaternion,
        which are four for three velocities.
        """
        turns = len(self.positions) != len(self.velocities)
        return len(self.positions) - (4 if turns else 0)

    @property
    def moment(self) -> Formula:
        """The moment of inertia of a planar body."""
        assert len(self.inertia_com) == 1, "in the plane only"
        return self.inertia_com[0]


@dataclass(frozen=True)
class Point:
    """A named point: `body` is an index, `at` runs from its centre of mass in body axes."""

    name: str
    body: int
    at: tuple[Formula, ...]


@dataclass(frozen=True)
class Prescribed:
    """A coordinate that is no state: `value` is a formula of t and parameters, or a number if it is
    locked. `by` is the name of the effect that drives it.
    """

    position: Coordinate
    velocity: Coordinate
    value: Formula
    by: str | None

    @property
    def locked(self) -> bool:
        """Whether it stays as it is."""
        return self.by is None


def prescribed_of(
    bodies: Sequence[Body], effects: Iterable[Effect], locked: Mapping[str, float]
) -> tuple[Prescribed, ...]:
    """The coordinates that are no states: driven ones in the order of the bodies, then locked ones.

    `locked` holds the values of those, by name.
    """
    drives = {e.joint: e for e in effects if isinstance(e, Driven)}
    driven, fast = [], []
    for body in bodies if drives or locked else ():
        for x, v in zip(body.positions, body.velocities, strict=False):
            if drive := drives.get(body.joint.name):
                driven.append(Prescribed(x, v, drive.coordinate, drive.name))
            elif x.name in locked:
                fast.append(Prescribed(x, v, Constant(locked[x.name]), None))
    return (*driven, *fast)


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
    """The joints that move but the free ones, each with the kinds of its primitives."""
    return {
        body.joint.name: tuple(primitive.kind for primitive in body.joint.primitives(dimensions))
        for body in bodies
        if body.positions and not isinstance(body.joint, Free)
    }


@dataclass(frozen=True)
class JointIndex:
    """Where a body's joint stands among all coordinates and all velocities, which are those of the
    state, then the driven ones, then the locked ones, each in the order of the bodies.
    """

    body: Body
    q: tuple[int, ...]
    v: tuple[int, ...]

    @property
    def plain(self) -> tuple[tuple[int, int], ...]:
        """Each coordinate that has a rate of its own, and that."""
        end = self.body.plain
        return tuple(zip(self.q[:end], self.v[:end], strict=True))

    @property
    def quaternion(self) -> tuple[int, ...]:
        """The other coordinates, w, x, y, z of a quaternion; or none."""
        return self.q[self.body.plain :]

    @property
    def spin(self) -> tuple[int, ...]:
        """The velocities of that."""
        return self.v[self.body.plain :]


@dataclass(frozen=True)
class Model:
    """A mechanism with everything that acts on it, as `elaborate` makes it of a scene.

    It knows nothing of pictures, nor of integrators.

    `conditions` are what values of the parameters keep.
    `states` are those that effects bring along, after coordinates and velocities.
    `locked` holds each coordinate that is held fast, by name, with its value; `locked_deg` those
    of them that the scene gives in degrees, in which a quarter turn is one.
    `notices` say what was put right on the way, a line each.
    """

    name: str
    title: str
    dimensions: int
    parameters: tuple[Parameter, ...]
    conditions: tuple[Condition, ...]
    inputs: tuple[Input, ...]
    bodies: tuple[Body, ...]
    points: tuple[Point, ...]
    effects: tuple[Effect, ...]
    states: tuple[ExtraState, ...]
    initial_q: tuple[float, ...]
    initial_v: tuple[float, ...]
    outputs: tuple[str, ...]
    form: Form
    route: Route
    locked: tuple[tuple[str, float], ...] = ()
    locked_deg: tuple[tuple[str, float], ...] = ()
    leave_out: tuple[LeftOut, ...] = ()
    notices: tuple[str, ...] = ()

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The coordinates of the state, in the order of `q`."""
        return positions_of(self.bodies, self.prescribed)

    @cached_property
    def velocities(self) -> tuple[Coordinate, ...]:
        """The velocities of the state, in the order of `v`."""
        return velocities_of(self.bodies, self.prescribed)

    @cached_property
    def prescribed(self) -> tuple[Prescribed, ...]:
        """The coordinates that are no states: driven ones in the order of the bodies, then locked
        ones.
        """
        return prescribed_of(self.bodies, self.effects, dict(self.locked))

    @property
    def driven(self) -> tuple[Prescribed, ...]:
        """Those of them that a drive moves."""
        return tuple(c for c in self.prescribed if not c.locked)

    @cached_property
    def joint_indices(self) -> tuple[JointIndex, ...]:
        """Where each body's joint stands among the coordinates and velocities."""
        given = self.prescribed
        positions = (*self.coordinates, *(c.position for c in given))
        velocities = (*self.velocities, *(c.velocity for c in given))
        q = {c.name: i for i, c in enumerate(positions)}
        v = {c.name: i for i, c in enumerate(velocities)}
        return tuple(
            JointIndex(
                b, tuple(q[c.name] for c in b.positions), tuple(v[c.name] for c in b.velocities)
            )
            for b in self.bodies
        )

    @property
    def first_position(self) -> tuple[int, ...]:
        """For each body its joint's first coordinate, where nothing is prescribed."""
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=0))[:-1]

    @property
    def first_velocity(self) -> tuple[int, ...]:
        """For each body its joint's first velocity, where nothing is prescribed."""
        return tuple(accumulate((len(b.velocities) for b in self.bodies), initial=0))[:-1]

    @property
    def angle_index(self) -> tuple[int, ...]:
        """For each planar body the index of the coordinate that turns it: its joint's last; where
        nothing is prescribed.
        """
        return tuple(accumulate((len(b.positions) for b in self.bodies), initial=-1))[1:]

    @property
    def quaternions(self) -> tuple[tuple[int, int, int, int], ...]:
        """Indices in `q` of each unit quaternion."""
        found = []
        for index in self.joint_indices:
            if index.quaternion:
                w, x, y, z = index.quaternion
                found.append((w, x, y, z))
        return tuple(found)

    @property
    def carriers(self) -> tuple[int, ...]:
        """For each velocity of the state how many others carry it; pairs that M couples."""
        nv, depth = len(self.velocities), list[int]()
        found = [0] * nv
        for index in self.joint_indices:
            above = depth[index.body.parent] if index.body.parent >= 0 else 0
            for i in index.v:
                if i < nv:
                    found[i] = above
                    above += 1
            depth.append(above)
        return tuple(found)

    @property
    def holding(self) -> tuple[Body, ...]:
        """The bodies whose joint transmits forces: all but those that nothing holds."""
        given = {c.position.name for c in self.prescribed}
        return tuple(
            body
            for body in self.bodies
            if not isinstance(body.joint, Free) or any(c.name in given for c in body.positions)
        )

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """Parameter values of the scene, by name."""
        return {p.name: p.default for p in self.parameters}

    def quantities(self) -> Iterator[Formula]:
        """Every quantity of bodies, joints, points and effects, in order."""
        for body in self.bodies:
            yield from (body.mass, *body.inertia_com)
        for table in (*(body.joint for body in self.bodies), *self.effects):
            for field in type(table).model_fields:
                value = getattr(table, field)
                for part in value if isinstance(value, tuple) else (value,):
                    if isinstance(part, Formula):
                        yield part
        for point in self.points:
            yield from point.at

    def locked_angle(self, name: str) -> Real:
        """The value of a locked angle, rad, of more digits than a double has."""
        degrees = dict(self.locked_deg)
        return radians(degrees[name]) if name in degrees else dict(self.locked)[name]

    @cached_property
    def magnitude(self) -> float:
        """The order of its lengths, a power of 2^40: 1 for all from a micrometre to a megametre.

        What has to be near nothing beside any of them counts in it: for ordinary scenes, in metres.
        """
        lengths = [p.default for p in self.parameters if p.unit == "m"]
        pairs = zip(self.coordinates, self.initial_q, strict=False)
        lengths += [value for coordinate, value in pairs if coordinate.unit == "m"]
        largest = max(map(abs, lengths), default=0.0)
        if not (largest > 0 and math.isfinite(largest)):
            return 1.0
        return float(2.0 ** (40 * round(math.log2(largest) / 40)))

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The same model with other values for some parameters.

        Raises `SceneError` for values that a scene may not have.
        """
        parameters = (replace(p, default=values.get(p.name, p.default)) for p in self.parameters)
        model = replace(self, parameters=tuple(parameters))
        require(self.conditions, model.defaults)
        return model

    def value(self, formula: Formula) -> float:
        """A quantity's value at the scene's parameters."""
        return float(evaluate(formula, self.defaults, FloatScalars()))


def off_centre(joint: Joint) -> TypeGuard[Revolute]:
    """Whether a pin holds its child away from the centre of mass, as its structure says."""
    return isinstance(joint, Revolute) and not all(is_zero(r) for r in joint.r_child)


def is_zero(formula: Formula) -> bool:
    """Whether a quantity is a bare 0: structure, no parameter."""
    return isinstance(formula, Constant) and formula.value == 0.0
