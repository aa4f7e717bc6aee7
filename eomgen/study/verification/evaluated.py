"""A model evaluated at a state in extended precision (see `effects.base.Mechanism`).

Joints are composed of their primitives. Driving formulas are differentiated by central differences.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import gmpy2
from gmpy2 import mpfr

from eomgen.language.formula import Formula, evaluate
from eomgen.model.bodies import JointIndex
from eomgen.model.model import Model
from eomgen.model.named import NamedModel, Values
from eomgen.model.orientation import rows_of
from eomgen.scalars.extended import Bits
from eomgen.scene.effects.base import Vector
from eomgen.scene.joints.base import WORLD, Primitive
from eomgen.study.precision.extended import Array, along, extended, zeros
from eomgen.study.precision.precise import Extended
from eomgen.study.verification.poses import (
    Pose,
    about,
    held,
    orientation,
    rotation_about,
    spun,
    world_pose,
)

_INSTANT, _BITS = mpfr(2) ** -600, 4096
"""Step of the differences, s, and the precision, in bits, in which they are computed."""
_BESIDE = mpfr(2) ** -80
"""Step of the differences of a formula by its names."""
_LEAST = mpfr(2) ** -500
"""A smaller rate counts as 0: it is an error of the differences."""
_JUMP = 1e-30
"""Where one-sided second derivatives differ by more than this, relative to 1 plus their size,
there is a jump."""


class EvaluatedModel(NamedModel):
    """A model at a time and a state y = [q, v, x] of form 'velocity'. Quantities are computed on
    demand, and only within `extended_digits()`.

    y           (ny,), doubles or extended-precision numbers
    inputs      by name; 0 if not given
    parameters  by name; the scene's if not given
    """

    def __init__(
        self,
        model: Model,
        t: Any,
        y: Any,
        inputs: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(model, Bits())
        y, nq = extended(y), len(model.coordinates)
        nothing = dict.fromkeys((i.name for i in model.inputs), 0.0)
        own = (x.name for x in model.extra)
        self.values = Values(
            _all_extended({**model.defaults, **(parameters or {})}),
            _all_extended({**nothing, **(inputs or {})}),
            y[:nq],
            y[nq : nq + self.nv],
            dict(zip(own, y[nq + self.nv :], strict=True)),
            mpfr(t),
        )
        given = [self._prescribed(c.value) for c in model.prescribed]
        for n, c in enumerate(model.prescribed):
            if (degrees := dict(model.locked_deg).get(c.position.name)) is not None:
                given[n] = (mpfr(degrees) * gmpy2.const_pi() / 180, *given[n][1:])
        self.q: list[Extended] = [*self.values.q, *(x for x, _, _ in given)]
        self.v: list[Extended] = [*self.values.v, *(v for _, v, _ in given)]
        self.driven_rates = extended([a for _, _, a in given[: len(model.driven)]])

    # What effects may ask for.

    def mass(self, body: str) -> Extended:
        """Mass of a body, kg."""
        return self.value(self.model.bodies[self.index[body]].mass)

    def height(self, body: str) -> Extended:
        """Height of a body's centre of mass, m: world y in the plane, world z in space."""
        return self.poses[self.index[body]].position[self.dimensions - 1]

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body, m."""
        if body == WORLD:
            return at
        pose = self.poses[self.index[body]]
        return self._cut(pose.position + pose.rotation @ self.in_space(at))

    def velocity(self, body: str, at: Vector) -> Vector:
        """World velocity of a point of a body, m/s."""
        if body == WORLD:
            return self._cut(zeros(3))
        pose = self.poses[self.index[body]]
        arm = self.in_space(at)
        return self._cut(along(self.rates, pose.position_v + pose.rotation_v @ arm))

    def angular_velocity(self, body: str) -> Vector:
        """Angular velocity of a body, world axes, rad/s."""
        w = zeros(3) if body == WORLD else self.spin(self.index[body])
        return tuple(w if self.dimensions == 3 else w[2:])

    def outward(self, body: str, vector: Vector) -> Vector:
        """A vector given in body axes, in world axes."""
        if body == WORLD:
            return vector
        return self._cut(self.poses[self.index[body]].rotation @ self.in_space(vector))

    def slope(self, formula: Formula, names: Mapping[str, Extended], name: str) -> Extended:
        """The derivative of a formula of `names` by one of them, by central differences."""
        ahead, behind = (
            evaluate(formula, {**names, name: names[name] + h}, self.scalars)
            for h in (_BESIDE, -_BESIDE)
        )
        return (ahead - behind) / (2 * _BESIDE)

    @cached_property
    def names(self) -> dict[str, Extended]:
        """The values of all names that formulas may use."""
        return self.values.by_name(self.model, self.q, self.v)

    def _prescribed(self, formula: Formula) -> tuple[Extended, Extended, Extended]:
        """Value, rate and acceleration of a formula of time; the last two are nan at a corner."""
        h = _INSTANT
        with gmpy2.context(precision=_BITS):
            names = dict(self.values.parameters)
            times = (self.values.time + k * h for k in range(-2, 3))
            x = [evaluate(formula, {**names, "t": time}, self.scalars) for time in times]
            rate = (x[3] - x[1]) / (2 * h)
            behind, here, ahead = (
                (a - 2 * b + c) / (h * h) for a, b, c in zip(x, x[1:], x[2:], strict=False)
            )
            smooth = max(abs(ahead - here), abs(behind - here)) <= _JUMP * (1 + abs(here))
            rates = [y if abs(y) > _LEAST else mpfr(0) for y in (rate, here)]
        if not smooth:
            return mpfr(x[2]), mpfr("nan"), mpfr("nan")
        value, rate, acceleration = map(mpfr, (x[2], *rates))  # rounded to the outer precision
        return value, rate, acceleration

    def in_space(self, vector: Sequence[Any]) -> Array:
        """A vector in the plane or in space as one in space, (3,)."""
        return extended([*vector, *(0.0,) * (3 - len(vector))])

    def _cut(self, vector: Array) -> Vector:
        return tuple(vector[: self.dimensions])

    # Poses, joint by joint.

    @cached_property
    def rates(self) -> Array:
        """The velocities of the state, then the driven ones, (m,)."""
        return extended(self.v[: self.moved])

    @cached_property
    def felt(self) -> Array:
        """The same velocities as they enter velocity forces: 0 if these are left out."""
        left_out = "velocity_forces" in self.model.leave_out
        return zeros(self.moved) if left_out else self.rates

    @cached_property
    def poses(self) -> tuple[Pose, ...]:
        """The poses of all bodies."""
        world, found = world_pose(self.moved), list[Pose]()
        for index in self.model.joint_indices:
            parent = index.body.parent
            found.append(self._child(world if parent < 0 else found[parent], index))
        return tuple(found)

    @cached_property
    def carrying(self) -> list[list[int]]:
        """For each body, the indices of the velocities that move it."""
        found: list[list[int]] = []
        for index in self.model.joint_indices:
            base = found[index.body.parent] if index.body.parent >= 0 else []
            found.append([*base, *(i for i in index.v if i < self.moved)])
        return found

    def _child(self, pose: Pose, index: JointIndex) -> Pose:
        joint = index.body.joint
        if joint.holds:
            pose = pose.moved(self.in_space([self.value(r) for r in joint.r_parent]))
            if joint.orientation is None:
                pose = pose.fixed(orientation(joint.orientation_deg))
            else:
                pose = pose.fixed(held(rows_of(joint.orientation), self.value))
        for i, primitive in enumerate(joint.primitives(self.dimensions)):
            pose = self._made(pose, primitive, index, i)
        if joint.holds:
            pose = pose.moved(-self.in_space([self.value(r) for r in joint.r_child]))
        return pose

    def _made(self, pose: Pose, primitive: Primitive, index: JointIndex, i: int) -> Pose:
        """The pose after one primitive of a joint."""
        if primitive.kind == "spherical":
            quaternion = extended([self.q[j] for j in index.quaternion])
            rotation, rotation_v, rotation_b = spun(quaternion, index.spin, self.felt)
            return pose.rotated(rotation, rotation_v, rotation_b, self.felt)
        axis = extended(primitive.axis)
        axis = axis / gmpy2.sqrt(axis @ axis)
        x, column = self.q[index.q[i]], index.v[i] if index.v[i] < self.moved else None
        if primitive.kind == "prismatic":
            return pose.slid(axis, x, column, self.felt)
        if column is None:
            return pose.fixed(about(axis, gmpy2.cos(x), gmpy2.sin(x)))
        return pose.rotated(*rotation_about(axis, x, column, self.felt), self.felt)

    def spin(self, body: int) -> Array:
        """Angular velocity of a body, (3,), world axes, rad/s."""
        return along(self.rates, self.poses[body].spin_v)


def _all_extended(values: Mapping[str, Any]) -> dict[str, Extended]:
    return {name: mpfr(value) for name, value in values.items()}
