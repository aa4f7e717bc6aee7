"""Fixed rotations and inertias, in doubles."""

import math
from collections.abc import Sequence

from eomgen.scene.importers.vectors import Vector

NEAR = 1e-10
"""An angle this near to a right angle, rad, is a right angle that was printed with few digits."""
SLIGHT = 1e-15
"""Lengths below this, m, are rounding errors of 0."""
Matrix = tuple[Vector, Vector, Vector]
EYE: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def squared(angle: float) -> float:
    """The angle, rad, or the multiple of π/2 that it is within `NEAR` of."""
    right = round(angle / (math.pi / 2)) * (math.pi / 2)
    return right if abs(angle - right) < NEAR else angle


def is_slight(x: float) -> bool:
    """Whether a length is a rounding error of 0."""
    return 0.0 < abs(x) < SLIGHT


def cleaned(vector: Sequence[float]) -> list[float]:
    """A vector of lengths, with 0 for rounding errors."""
    return [0.0 if is_slight(x) else x for x in vector]


def rotation(angles: Vector) -> Matrix:
    """Rz Ry Rx of angles about x, y and z, rad; right angles are exact."""
    (cx, sx), (cy, sy), (cz, sz) = map(_cosine_and_sine, angles)
    return (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )


def _cosine_and_sine(angle: float) -> tuple[float, float]:
    quarter = round(angle / (math.pi / 2))
    if abs(angle - quarter * (math.pi / 2)) < NEAR:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return math.cos(angle), math.sin(angle)


def image(a: Matrix, vector: Sequence[float]) -> Vector:
    """a v."""
    x, y, z = (math.fsum(p * q for p, q in zip(row, vector, strict=True)) + 0.0 for row in a)
    return (x, y, z)


def times(a: Matrix, b: Matrix) -> Matrix:
    """a b."""
    x, y, z = (image(a, column) for column in zip(*b, strict=True))
    return transposed((x, y, z))


def transposed(a: Matrix) -> Matrix:
    """aᵀ."""
    x, y, z = zip(*a, strict=True)
    return (x, y, z)


def to_axis(axis: Vector) -> Matrix:
    """A rotation whose third column is along `axis`."""
    length = math.hypot(*axis)
    z = (axis[0] / length, axis[1] / length, axis[2] / length)
    if abs(z[0]) + abs(z[1]) == 0.0:
        return EYE if z[2] > 0 else ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    flat = math.hypot(z[0], z[1])
    y = (-z[1] / flat, z[0] / flat, 0.0)
    x = (y[1] * z[2], -y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    return transposed((x, y, z))


def angles_of(a: Matrix) -> Vector:
    """Angles about x, y and z, rad, of a rotation Rz Ry Rx."""
    (a00, a01, _), (a10, a11, _), (a20, a21, a22) = a
    flat = math.hypot(a21, a22)
    if flat < 1e-12:
        return (0.0, math.copysign(math.pi / 2, -a20), math.atan2(-a01, a11))
    return (math.atan2(a21, a22), math.atan2(-a20, flat), math.atan2(a10, a00))


def rotated_inertia(entries: Sequence[float], a: Matrix) -> list[float]:
    """R I Rᵀ of the entries xx, yy, zz, xy, xz, yz; rounding errors of zeros are left out."""
    xx, yy, zz, xy, xz, yz = entries
    if a == EYE:
        return [xx, yy, zz, xy, xz, yz]
    inner = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    b = times(times(a, inner), transposed(a))
    slight = 4e-16 * max(abs(x) for row in b for x in row)
    found = [b[0][0], b[1][1], b[2][2], b[0][1], b[0][2], b[1][2]]
    return [x if abs(x) > slight else 0.0 for x in found]
