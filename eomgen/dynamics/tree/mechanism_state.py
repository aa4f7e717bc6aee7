"""A mechanism at a state, over any scalars: what effects may ask of it (effects.base.Mechanism)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import Axes, TreeKinematics, tree_kinematics
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.dynamics.tree.motion import Twist, velocities
from eomgen.dynamics.tree.observables import (
    Origins,
    frame_origins,
    orientation,
    position,
    velocity,
)
from eomgen.dynamics.tree.vectors import Vec, in_space, times, zeros
from eomgen.language.formula import Formula, evaluate, names_in
from eomgen.language.rates import with_rates
from eomgen.model.model import JointIndex, Model, dofs_of
from eomgen.model.partials import gradient_of, partials_of
from eomgen.scalars.exact import Real
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.constraints.base import Partials, Row
from eomgen.scene.effects.base import Vector
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Values:
    """Values of all that a model leaves open: parameters, inputs and extra states by name, q and v
    of the state in order, and the time, s.
    """

    parameters: Mapping[str, Scalar]
    inputs: Mapping[str, Scalar]
    q: Sequence[Scalar]
    v: Sequence[Scalar]
    states: Mapping[str, Scalar] = field(default_factory=dict)
    time: Scalar = 0.0


class MechanismState:
    """The kinematics of a model at given values, for effects and recursions.

    Each property is computed once, when it is first used. `nv` is the number of velocities of the
    state, `moved` the number of these and the driven ones. A `linkage` over the same parameters may
    be passed for reuse.
    """

    def __init__(
        self,
        model: Model,
        values: Values,
        scalars: Scalars,
        axes: Axes | None = None,
        linkage: Linkage | None = None,
    ) -> None:
        self.model = model
        self.values = values
        self.scalars = scalars
        self.axes: Axes = axes or ("world" if model.dimensions == 2 else "own")
        self.dimensions = model.dimensions
        self.bodies = tuple(body.name for body in model.bodies)
        self.masses = {body.name: body.mass for body in model.bodies}
        self.zero = scalars.number(0.0)
        self.nv = len(model.velocities)
        self.moved = self.nv + len(model.driven)
        self._linkage = linkage

    # What effects may ask (effects.base.Mechanism).

    @cached_property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """The joints that move but the free ones, each with the kinds of its primitives."""
        return dofs_of(self.model.bodies, self.dimensions)

    def height(self, body: str) -> Scalar:
        """World y of a body's centre of mass in the plane, z in space, m."""
        return self.centre(self.index[body])[self.dimensions - 1]

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body, m."""
        return self._cut(
            at if body == WORLD else self.point_position(self.index[body], self._in_space(at))
        )

    @property
    def magnitude(self) -> float:
        """The order of magnitude of its lengths, m."""
        return self.model.magnitude

    def point(self, name: str) -> tuple[str, Vector]:
        """A named point: its body, and where on it, m."""
        point = next(point for point in self.model.points if point.name == name)
        return self.bodies[point.body], tuple(self.value(part) for part in point.at)

    def velocity(self, body: str, at: Vector) -> Vector:
        """World velocity of a point of a body, m/s."""
        if body == WORLD:
            return self._cut(zeros(self.scalars))
        return self._cut(self.point_velocity(self.index[body], self._in_space(at))[0])

    def angular_velocity(self, body: str) -> Vector:
        """Angular velocity of a body, world axes, rad/s."""
        if body == WORLD:
            w = zeros(self.scalars)
        else:
            w = self.point_velocity(self.index[body], zeros(self.scalars))[1]
        return w if self.dimensions == 3 else w[2:]

    def outward(self, body: str, vector: Vector) -> Vector:
        """A vector of body axes in world axes."""
        if body == WORLD:
            return vector
        rotated = times(
            orientation(self.linkage, self.kinematics, self.index[body], self.scalars),
            self._in_space(vector),
        )
        return self._cut(rotated)

    def coordinate(self, joint: str, index: int = 0) -> Scalar:
        """A coordinate of a joint."""
        return self.q[self.joint_indices[joint].q[index]]

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Its name."""
        return self.joint_indices[joint].body.positions[index].name

    def rate(self, joint: str, index: int = 0) -> Scalar:
        """A velocity of a joint."""
        return self.v[self.joint_indices[joint].v[index]]

    def value(self, formula: Formula, **names: Scalar) -> Scalar:
        """A quantity."""
        return evaluate(formula, {**self.names, **names} if names else self.names, self.scalars)

    def partials(self, formula: Formula, by: Literal["positions", "velocities"]) -> Partials:
        """A formula with its derivatives, by dual numbers along one coordinate at a time."""
        return partials_of(formula, by, self.model, self.names, self.scalars)

    def gradient(
        self, formula: Formula, names: Mapping[str, Scalar]
    ) -> tuple[Scalar, Vector, Scalar]:
        """A formula of `names`, t and parameters with its derivatives by the names and by t."""
        given = {**self.values.parameters, "t": self.values.time}
        return gradient_of(formula, names, given, self.scalars)

    def input(self, name: str) -> Scalar:
        """An input."""
        return self.values.inputs[name]

    def state(self, name: str) -> Scalar:
        """An extra state."""
        return self.values.states[name]

    def number(self, value: Real) -> Scalar:
        """A number."""
        return self.scalars.number(value)

    def call(self, function: str, *arguments: Scalar) -> Scalar:
        """A function of formulas."""
        return self.scalars.call(function, *arguments)

    def called(self, letter: str, *values: Scalar) -> Vector:
        """The values themselves."""
        return values

    @cached_property
    def names(self) -> dict[str, Scalar]:
        """The values of all names that formulas may use."""
        model, values = self.model, self.values
        positions = (*model.coordinates, *(c.position for c in model.prescribed))
        velocities = (*model.velocities, *(c.velocity for c in model.prescribed))
        return {
            "t": values.time,
            **values.inputs,
            **values.states,
            **{c.name: x for c, x in zip(positions, self.q, strict=True)},
            **{c.name: x for c, x in zip(velocities, self.v, strict=True)},
            **values.parameters,
        }

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each body by its name."""
        return {name: k for k, name in enumerate(self.bodies)}

    @cached_property
    def joint_indices(self) -> dict[str, JointIndex]:
        """Indices of each joint's coordinates and velocities, by its name."""
        return {index.body.joint.name: index for index in self.model.joint_indices}

    @cached_property
    def given(self) -> list[tuple[Scalar, Scalar, Scalar]]:
        """Value, rate and acceleration of each prescribed coordinate."""
        found = []
        for c in self.model.prescribed:
            used = (name for name in names_in(c.value) if name != "t")
            names = {name: self.values.parameters[name] for name in used}
            motion = with_rates(c.value, names, self.values.time, self.scalars)
            words = (c.position.name, c.velocity.name, c.velocity.acceleration)
            x, v, a = (self.scalars.named(x, w) for x, w in zip(motion, words, strict=True))
            found.append((x, v, a))
        return found

    @cached_property
    def q(self) -> list[Scalar]:
        """All coordinates: those of the state, then the prescribed ones."""
        return [*self.values.q, *(x for x, _, _ in self.given)]

    @cached_property
    def v(self) -> list[Scalar]:
        """All velocities, in the same order."""
        return [*self.values.v, *(v for _, v, _ in self.given)]

    def _in_space(self, vector: Vector) -> Vec:
        return in_space(vector, self.scalars)

    def _cut(self, vector: Vector) -> Vector:
        return tuple(vector[: self.dimensions])

    # Kinematics.

    @cached_property
    def linkage(self) -> Linkage:
        """Frames and mounts."""
        return self._linkage or make_linkage(self.model, self.values.parameters, self.scalars)

    @cached_property
    def kinematics(self) -> TreeKinematics:
        """Tree kinematics at q, in the axes of the recursions."""
        return tree_kinematics(self.linkage, self.q, self.axes, self.scalars)

    @cached_property
    def in_world(self) -> TreeKinematics:
        """Tree kinematics at q, in world axes."""
        if self.axes == "world":
            return self.kinematics
        return tree_kinematics(self.linkage, self.q, "world", self.scalars)

    @cached_property
    def in_own_axes(self) -> TreeKinematics:
        """Tree kinematics at q, in the frames' own axes."""
        if self.axes == "own":
            return self.kinematics
        return tree_kinematics(self.linkage, self.q, "own", self.scalars)

    @cached_property
    def origins(self) -> Origins:
        """Origins of the frames in the world, m."""
        return frame_origins(self.kinematics, self.scalars)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all constraints but those that follow from others, in the order of the
        model's `rows`.
        """
        found = [row for constraint in self.model.constraints for row in constraint.rows(self)]
        names, dropped = (name for name, _ in self.model.every_row), self.model.dropped
        return tuple(row for name, row in zip(names, found, strict=True) if name not in dropped)

    def centre(self, body: int) -> Vec:
        """Centre of mass of a body in the world, m."""
        return self.point_position(body, zeros(self.scalars))

    def point_position(self, body: int, at: Vec) -> Vec:
        """A point of a body in the world, m; `at` from the centre of mass, in body axes."""
        return position(self.linkage, self.kinematics, self.origins, body, at, self.scalars)

    def angle(self, body: int) -> Scalar:
        """The angle of a planar body from the world's x axis, rad."""
        mount = self.linkage.mounts[body]
        if mount.frame < 0:
            return self.scalars.number(mount.angle)
        return self.kinematics.angles[mount.frame].and_more(mount.angle, self.scalars)

    @cached_property
    def twists(self) -> tuple[Twist, ...]:
        """Velocities of the frames, in the links' axes."""
        return velocities(self.kinematics, self.v, self.scalars)

    def point_velocity(self, body: int, at: Vec) -> tuple[Vec, Vec]:
        """Velocity of a point of a body (m/s) and the body's angular velocity, in world axes."""
        return velocity(self.linkage, self.kinematics, self.twists, body, at, self.scalars)

    @cached_property
    def down(self) -> Vec:
        """The acceleration of uniform gravity, in world axes, m/s²."""
        g = list(zeros(self.scalars))
        for effect in self.model.effects:
            if effect.uniform:
                g[: self.dimensions] = effect.acceleration(self)
        return (g[0], g[1], g[2])
