"""Quaternions of compiled models as orientations of a scene."""

import math
from collections.abc import Sequence

from eomgen.scene.importers.rotations import Matrix, angles_of, image
from eomgen.scene.importers.vectors import Vector

NEAR = 1e-14
"""An angle this near to a right angle, rad, or a component this near to 0, is rounding."""


def matrix_of(quaternion: Sequence[float]) -> Matrix:
    """The rotation of a quaternion w, x, y, z of any length but 0."""
    length = math.hypot(*quaternion)
    w, x, y, z = (part / length for part in quaternion)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def product(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    """The quaternion of rotation a after b."""
    (p, q, r, s), (w, x, y, z) = a, b
    return (
        p * w - q * x - r * y - s * z,
        p * x + q * w + r * z - s * y,
        p * y - q * z + r * w + s * x,
        p * z + q * y - r * x + s * w,
    )


def inverse(quaternion: Sequence[float]) -> tuple[float, float, float, float]:
    """The quaternion of the inverse rotation."""
    w, x, y, z = quaternion
    return (w, -x, -y, -z)


def about(axis: Sequence[float], angle: float) -> tuple[float, float, float, float]:
    """The quaternion of a rotation about an axis of length 1, by an angle in rad."""
    c, s = math.cos(angle / 2), math.sin(angle / 2)
    return (c, s * axis[0], s * axis[1], s * axis[2])


def angles(quaternion: Sequence[float]) -> Vector:
    """Angles about x, y and z, rad, of the rotation Rz Ry Rx of a quaternion; right angles are
    exact.
    """
    x, y, z = map(_squared, angles_of(matrix_of(quaternion)))
    return (x, y, z)


def cleaned(vector: Sequence[float]) -> list[float]:
    """A vector without components that are rounding errors of 0."""
    return _without(vector, NEAR * max(map(abs, vector), default=0.0))


def line_of(
    at: Sequence[float], quaternion: Sequence[float], half: float
) -> tuple[list[float], list[float]]:
    """Both ends of a line along z of half a length about a point, turned."""
    arm = image(matrix_of(quaternion), (0.0, 0.0, half))
    slight = NEAR * max(map(abs, (*at, *arm)), default=0.0)
    start, end = ([x + sign * d for x, d in zip(at, arm, strict=True)] for sign in (-1, 1))
    return _without(start, slight), _without(end, slight)


def _without(vector: Sequence[float], slight: float) -> list[float]:
    return [x if abs(x) > slight else 0.0 for x in vector]


def _squared(angle: float) -> float:
    right = round(angle / (math.pi / 2)) * (math.pi / 2)
    return right if abs(angle - right) < NEAR else angle
