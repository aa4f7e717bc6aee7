"""Poses of bodies with their derivatives: each rotation and position with its partial derivatives
along every velocity, and its second time derivative at constant velocities. Extended precision.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import gmpy2
import numpy as np
from gmpy2 import mpfr

from eomgen.language.angles import degrees_of
from eomgen.language.formula import Constant, Formula
from eomgen.study.precision.extended import Array, along, extended, eye, zeros
from eomgen.study.precision.precise import Extended


@dataclass(frozen=True, eq=False)
class Pose:
    """A body's world_R_body and the position of its centre of mass, world axes, with derivatives.

    rotation, position
                     (3, 3), (3,)
    turn_v, place_v  (m, 3, 3), (m, 3): partial derivatives along each of the m velocities
    turn_b, place_b  second time derivatives at constant velocities
    """

    rotation: Array
    position: Array
    rotation_v: Array
    position_v: Array
    rotation_b: Array
    position_b: Array

    def rotated(self, rotation: Array, rotation_v: Array, rotation_b: Array, rate: Array) -> "Pose":
        """The pose with its axes rotated further by a matrix with derivatives. `rate` (m,) are the
        velocities in second derivatives.
        """
        here, more = along(rate, self.rotation_v), along(rate, rotation_v)
        return Pose(
            self.rotation @ rotation,
            self.position,
            self.rotation_v @ rotation + self.rotation @ rotation_v,
            self.position_v,
            self.rotation_b @ rotation + 2 * (here @ more) + self.rotation @ rotation_b,
            self.position_b,
        )

    def fixed(self, rotation: Array) -> "Pose":
        """The pose with its axes rotated by a constant matrix."""
        return Pose(
            self.rotation @ rotation,
            self.position,
            self.rotation_v @ rotation,
            self.position_v,
            self.rotation_b @ rotation,
            self.position_b,
        )

    def moved(self, arm: Array) -> "Pose":
        """The pose moved by a vector that is constant in its axes."""
        return Pose(
            self.rotation,
            self.position + self.rotation @ arm,
            self.rotation_v,
            self.position_v + self.rotation_v @ arm,
            self.rotation_b,
            self.position_b + self.rotation_b @ arm,
        )

    def slid(self, axis: Array, distance: Extended, column: int | None, rate: Array) -> "Pose":
        """The pose moved by `distance`, m, along an axis in its axes; its velocity is `column`."""
        there = self.moved(axis * distance)
        if column is None:
            return there
        position_v = there.position_v.copy()
        position_v[column] = position_v[column] + self.rotation @ axis
        here = along(rate, self.rotation_v)
        position_b = there.position_b + 2 * rate[column] * (here @ axis)
        return Pose(
            there.rotation,
            there.position,
            there.rotation_v,
            position_v,
            there.rotation_b,
            position_b,
        )

    @cached_property
    def spin_v(self) -> Array:
        """J_w (m, 3), world axes: partial angular velocities, from the derivatives of R."""
        return _axial(self.rotation_v @ self.rotation.T)

    @cached_property
    def spin_b(self) -> Array:
        """Angular acceleration at constant velocities, from the skew part of R̈ Rᵀ."""
        return _axial(self.rotation_b @ self.rotation.T)


def _axial(m: Array) -> Array:
    """The vectors w (…, 3) of the skew parts [w]x of matrices (…, 3, 3)."""
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([m[..., i, j] - m[..., j, i] for i, j in pairs], axis=-1) / mpfr(2)


def about(axis: Array, c: Extended, s: Extended) -> Array:
    """Rotation about a unit vector by the angle with cosine c and sine s (Rodrigues' formula)."""
    x, y, z = axis
    cross = extended([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer(axis, axis)
    return (eye() - along) * c + cross * s + along


def orientation(degrees: float | tuple[float, float, float]) -> Array:
    """The fixed rotation of a joint: Rz Ry Rx."""
    angles = degrees if isinstance(degrees, tuple) else (0.0, 0.0, degrees)
    rotation = eye()
    for axis, angle in zip(np.eye(3), angles, strict=True):
        radians = mpfr(angle) * gmpy2.const_pi() / 180
        rotation = about(extended(axis), gmpy2.cos(radians), gmpy2.sin(radians)) @ rotation
    return rotation


def held(rows: Sequence[Sequence[Formula]], value: Callable[[Formula], Extended]) -> Array:
    """The rotation by formulas: of an angle about z, three angles, a quaternion, or a matrix."""
    values = extended([[value(part) for part in row] for row in rows])
    if len(values) == 3:
        return values
    if len(values[0]) == 4:
        square = values[0] @ values[0]
        return _bilinear(values[0], values[0]) / square
    rotation, axes = eye(), eye()[-len(values[0]) :]
    for axis, part, angle in zip(axes, rows[0], values[0], strict=True):
        if isinstance(part, Constant):  # "90 deg" is a right angle, which no double is
            angle = mpfr(degrees_of(part.value)) * gmpy2.const_pi() / 180
        rotation = about(axis, gmpy2.cos(angle), gmpy2.sin(angle)) @ rotation
    return rotation


def composed(quaternion: Array, spin: Array) -> Array:
    """The quaternion product quaternion ∘ (0, spin)."""
    w, axis = quaternion[0], quaternion[1:]
    return np.concatenate([[-(axis @ spin)], w * spin + np.cross(axis, spin)])


def _bilinear(a: Array, b: Array) -> Array:
    """The symmetric bilinear form that gives the rotation of a unit quaternion a = b = (w, x):
    (w² - x·x) 1 + 2 x xᵀ + 2 w [x]x.
    """
    (v, x), (w, y) = (a[0], a[1:]), (b[0], b[1:])
    s = v * y + w * x
    cross = extended([[0.0, -s[2], s[1]], [s[2], 0.0, -s[0]], [-s[1], s[0], 0.0]])
    return eye() * (v * w - x @ y) + np.outer(x, y) + np.outer(y, x) + cross


def spun(quaternion: Array, columns: Sequence[int], rate: Array) -> tuple[Array, Array, Array]:
    """The rotation of a quaternion with derivatives; `columns` are its three velocities."""
    units = [composed(quaternion, axis) / 2 for axis in eye()]
    spin = extended([rate[j] for j in columns])
    change = composed(quaternion, spin) / 2
    second = composed(change, spin) / 2
    rotation_v = zeros(len(rate), 3, 3)
    for j, unit in zip(columns, units, strict=True):
        rotation_v[j] = 2 * _bilinear(quaternion, unit)
    rotation_b = 2 * _bilinear(change, change) + 2 * _bilinear(quaternion, second)
    return _bilinear(quaternion, quaternion), rotation_v, rotation_b


def rotation_about(
    axis: Array, angle: Extended, column: int, rate: Array
) -> tuple[Array, Array, Array]:
    """The rotation about a unit vector by an angle with velocity `column`, with derivatives."""
    c, s, velocity = gmpy2.cos(angle), gmpy2.sin(angle), rate[column]
    # The derivatives of c and s by the angle; the rest of the matrix is constant.
    still = about(axis, mpfr(0), mpfr(0))
    rotation_v = zeros(len(rate), 3, 3)
    rotation_v[column] = about(axis, -s, c) - still
    rotation_b = (about(axis, -c, -s) - still) * (velocity * velocity)
    return about(axis, c, s), rotation_v, rotation_b


def world_pose(m: int) -> Pose:
    """The pose of the world, which none of the m velocities moves."""
    return Pose(eye(), zeros(3), zeros(m, 3, 3), zeros(m, 3), zeros(3, 3), zeros(3))
