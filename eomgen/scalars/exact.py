"""Directions and rotations that a scene fixes, computed from its own numbers and rounded once.

A 0 in a fixed rotation is folded away as structure. So whether an entry is 0 must follow from the
scene's numbers and not from rounding: in doubles the cosine of 1e-9 is 1, and its sine is not 0.
Everything here is computed in `BITS` bits. No double is smaller than 2^-1074. A sum that is exactly
0 is smaller than that after rounding, and counts as 0. Everything else is accurate to more than a
hundred bits, however much cancels.
"""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import gmpy2
from gmpy2 import mpfr

BITS = 1280
Real = Any
"""An `mpfr` of `BITS` bits, which has no type for type checkers."""
Matrix = tuple[tuple[Real, Real, Real], tuple[Real, Real, Real], tuple[Real, Real, Real]]
"""A rotation: three rows."""
SMALLEST = mpfr(2) ** -1074
"""The smallest double; smaller numbers count as 0."""
ZERO, ONE = mpfr(0), mpfr(1)
EYE: Matrix = ((ONE, ZERO, ZERO), (ZERO, ONE, ZERO), (ZERO, ZERO, ONE))
AXES = (0, 1, 2)
PARTS = 5
"""The number of doubles, of 53 bits each, whose sum holds 60 digits of a number."""


def exactly() -> AbstractContextManager[Any]:
    """A context in which numbers have `BITS` bits."""
    block: AbstractContextManager[Any] = gmpy2.context(precision=BITS)
    return block


def whole(x: Real) -> Real:
    """A number, or 0 if it is smaller than any double."""
    return x if abs(x) >= SMALLEST else ZERO


def matrix(rows: Sequence[Sequence[Real]]) -> Matrix:
    """Rows as a matrix."""
    a, b, c = rows
    return ((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2]))


@lru_cache(maxsize=4096)
def direction(vector: tuple[float, ...]) -> tuple[Real, ...]:
    """The unit vector along a vector of doubles that is not 0."""
    with exactly():
        parts = [mpfr(x) for x in vector]
        length = gmpy2.sqrt(sum((x * x for x in parts), ZERO))
        return tuple(x / length for x in parts)


def sine_between(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """The sine of the angle between two vectors of three doubles."""
    x, y = direction(a), direction(b)
    with exactly():
        parts = (x[i] * y[j] - x[j] * y[i] for i, j in ((0, 1), (0, 2), (1, 2)))
        return float(gmpy2.sqrt(sum((part * part for part in parts), ZERO)))


def in_doubles(x: Real) -> tuple[float, ...]:
    """Doubles whose sum is a number, to 60 digits and more; the largest first."""
    parts: list[float] = []
    with exactly():
        rest = mpfr(x)
        while len(parts) < PARTS:
            parts.append(float(rest))
            rest = rest - mpfr(parts[-1])
            if not float(rest):
                break
    return tuple(parts)


# Angles.


@lru_cache(maxsize=4096)
def radians(degrees: float) -> Real:
    """An angle of degrees in radians."""
    with exactly():
        return mpfr(degrees) * gmpy2.const_pi() / 180


def total(*angles: Real) -> Real:
    """A sum of angles, rad."""
    with exactly():
        return whole(sum(angles, ZERO))


def opposite(angle: Real) -> Real:
    """Minus an angle, rad. A plain minus would round to the precision of the current context."""
    with exactly():
        return -angle


def angle_of(c: Real, s: Real) -> Real:
    """The angle of a cosine and a sine, rad."""
    with exactly():
        return gmpy2.atan2(s, c)


def quarters(angle: Real) -> tuple[int, Real]:
    """The nearest number of quarter turns to an angle, and the rest of the angle, rad."""
    with exactly():
        quarter = gmpy2.const_pi() / 2
        n = int(gmpy2.rint(angle / quarter))
        return n, whole(angle - n * quarter)


def quarter_turns(n: int, angle: Real) -> Real:
    """The angle of n quarter turns plus `angle`, rad."""
    with exactly():
        return whole(n * gmpy2.const_pi() / 2 + angle)


# Rotations.


def rotation_about(k: int, angle: Real) -> Matrix:
    """The rotation by `angle` rad about coordinate axis k."""
    with exactly():
        return rotation_by(k, gmpy2.cos(angle), gmpy2.sin(angle))


def rotation_by(k: int, c: Real, s: Real) -> Matrix:
    """The rotation about coordinate axis k by the angle of cosine c and sine s."""
    i, j = (k + 1) % 3, (k + 2) % 3
    rows = [list(row) for row in EYE]
    with exactly():
        rows[i][i] = rows[j][j] = whole(c)
        rows[i][j], rows[j][i] = whole(-s), whole(s)
    return matrix(rows)


HALF_ABOUT_X, HALF_ABOUT_Z = rotation_by(0, -ONE, ZERO), rotation_by(2, -ONE, ZERO)


@lru_cache(maxsize=4096)
def orientation(degrees: float | tuple[float, float, float]) -> Matrix:
    """The fixed rotation of a joint, Rz Ry Rx of angles about x, y and z; of one, about z."""
    x, y, z = degrees if isinstance(degrees, tuple) else (0.0, 0.0, degrees)
    # Whole turns are removed, which is exact: 1e100 degrees would have too few digits.
    first, second, third = (
        rotation_about(k, radians(math.fmod(a, 360.0))) for k, a in enumerate((x, y, z))
    )
    return product(third, product(second, first))


@lru_cache(maxsize=4096)
def to_axis(axis: tuple[float, float, float]) -> tuple[Matrix, int]:
    """A rotation R and a coordinate axis k with R e_k along `axis`. For an axis in the plane of x
    and y it turns about z.
    """
    for k in AXES:
        if all(axis[i] == 0.0 for i in AXES if i != k):
            back = HALF_ABOUT_Z if k < 2 else HALF_ABOUT_X
            return (EYE if axis[k] > 0.0 else back), k
    x, y, z = direction(axis)
    if axis[2] == 0.0:
        return rotation_by(2, x, y), 0
    # The shortest rotation from z to the axis (Rodrigues), or from -z if that is nearer.
    with exactly():
        if z < 0:
            x, y, z = -x, -y, -z
        k = 1 / (1 + z)
        rows = [[1 - k * x * x, -k * x * y, x], [-k * x * y, 1 - k * y * y, y], [-x, -y, z]]
        shortest = matrix([[whole(entry) for entry in row] for row in rows])
    return (shortest if axis[2] > 0.0 else product(shortest, HALF_ABOUT_X)), 2


def product(a: Matrix, b: Matrix) -> Matrix:
    """a b."""
    if a is EYE or b is EYE:
        return b if a is EYE else a
    with exactly():
        return matrix(
            [[whole(sum((a[i][n] * b[n][j] for n in AXES), ZERO)) for j in AXES] for i in AXES]
        )


def image_of_axis(a: Matrix, k: int, length: Real) -> tuple[Real, ...]:
    """The image under a rotation of a vector of some length along coordinate axis k."""
    with exactly():
        return tuple(whole(row[k] * mpfr(length)) for row in a)


def image(a: Matrix, vector: Sequence[Real]) -> tuple[Real, ...]:
    """The image of a vector under a rotation."""
    with exactly():
        return tuple(
            whole(sum((x * mpfr(y) for x, y in zip(row, vector, strict=True)), ZERO)) for row in a
        )


def inner(a: Sequence[Real], b: Sequence[Real]) -> Real:
    """a · b."""
    with exactly():
        return whole(sum((mpfr(x) * mpfr(y) for x, y in zip(a, b, strict=True)), ZERO))


def perpendiculars(axis: tuple[float, float, float]) -> tuple[tuple[Real, ...], tuple[Real, ...]]:
    """Two unit vectors that are perpendicular to an axis and to each other."""
    rotation, k = to_axis(axis)
    one, other = (image_of_axis(rotation, (k + n) % 3, ONE) for n in (1, 2))
    return one, other


def transposed(a: Matrix) -> Matrix:
    """aᵀ, the rotation back."""
    return matrix([[a[j][i] for j in AXES] for i in AXES])


# Rotations as products of rotations about coordinate axes.


@dataclass(frozen=True)
class AxisRotation:
    """A rotation about coordinate axis k: quarter turns, and another of at most 45 degrees, of
    cosine c and sine s.
    """

    k: int
    quarters: int
    c: Real
    s: Real


@lru_cache(maxsize=4096)
def axis_rotations(rotation: Matrix) -> tuple[AxisRotation, ...] | None:
    """The rotations about coordinate axes whose product a rotation is: none, one, or two, as of
    every rotation with an entry that is 0; None of any other.
    """
    for k in AXES:
        beside = [i for i in AXES if i != k]
        if rotation[k][k] > 0 and not any(rotation[i][k] or rotation[k][i] for i in beside):
            i, j = (k + 1) % 3, (k + 2) % 3
            return _axis_rotation(k, rotation[i][i], rotation[j][i])
    for i in AXES:
        for m in AXES:
            # Column m is in the plane normal to i, and the rest is a rotation about m.
            if i != m and not rotation[i][m]:
                u, v = (i + 1) % 3, (i + 2) % 3
                with exactly():
                    c, s = rotation[u][m], rotation[v][m]
                    c, s = (c, s) if m == u else (s, -c)
                    rest = product(rotation_by(i, c, -s), rotation)
                p, q = (m + 1) % 3, (m + 2) % 3
                return (*_axis_rotation(i, c, s), *_axis_rotation(m, rest[p][p], rest[q][p]))
    return None


def _axis_rotation(k: int, c: Real, s: Real) -> tuple[AxisRotation, ...]:
    """One rotation, or none."""
    with exactly():
        n = 0
        while abs(s) > abs(c) or c < 0:
            c, s, n = s, -c, n + 1
    return (AxisRotation(k, n, c, s),) if n or s else ()


def three_rotations(rotation: Matrix, i: int, k: int) -> tuple[Real, int, Real, Real]:
    """Angles a, b, c, rad, and an axis m with rotation = R_i(a) R_m(b) R_k(c); |a| is at most a
    quarter turn.
    """
    m = (k + 1) % 3 if i == k else 3 - i - k
    # R_i(-a) brings the image of axis k into the plane normal to m.
    image = [row[k] for row in rotation]
    p, q = (i + 1) % 3, (i + 2) % 3
    with exactly():
        a = gmpy2.atan2(-image[p], image[q]) if m == p else gmpy2.atan2(image[q], image[p])
        half = gmpy2.const_pi()
        a = whole(a - gmpy2.copy_sign(half, a)) if 2 * abs(a) > half else a
        rest = product(rotation_about(i, -a), rotation)
        u, v = (m + 1) % 3, (m + 2) % 3
        x, y = rest[u][k], rest[v][k]
        b = gmpy2.atan2(y, x) if k == u else gmpy2.atan2(-x, y)
        last = product(rotation_about(m, -b), rest)
        y, z = (k + 1) % 3, (k + 2) % 3
        return a, m, b, gmpy2.atan2(last[z][y], last[y][y])
