"""A mechanism at a state, over any scalars: what effects may ask of it (effects.base.Mechanism)."""

from functools import cached_property

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
from eomgen.language.formula import names_in
from eomgen.language.rates import with_rates
from eomgen.model.model import Model
from eomgen.model.named import NamedModel, Values
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.constraints.base import Row
from eomgen.scene.effects.base import Vector
from eomgen.scene.joints.base import WORLD


class MechanismState(NamedModel):
    """The kinematics of a model at given values, for effects and recursions.

    Each property is computed once, when it is first used. A `linkage` over the same parameters may
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
        super().__init__(model, scalars)
        self.values = values
        self.axes: Axes = axes or ("world" if model.dimensions == 2 else "own")
        self._linkage = linkage

    # What effects may ask (effects.base.Mechanism).

    def height(self, body: str) -> Scalar:
        """World y of a body's centre of mass in the plane, z in space, m."""
        return self.centre(self.index[body])[self.dimensions - 1]

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body, m."""
        return self._cut(
            at if body == WORLD else self.point_position(self.index[body], self._in_space(at))
        )

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

    @cached_property
    def names(self) -> dict[str, Scalar]:
        """The values of all names that formulas may use."""
        return self.values.by_name(self.model, self.q, self.v)

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
