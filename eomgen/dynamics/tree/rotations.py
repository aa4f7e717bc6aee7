"""Rotations between the axes of a frame and its parent's, in as few operations as possible."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from eomgen.dynamics.tree.vectors import (
    Mat,
    Symmetric,
    Vec,
    congruent,
    constant,
    product,
    times,
    transposed,
)
from eomgen.language.formula import Formula
from eomgen.model.orientation import turns_of
from eomgen.scalars.exact import Matrix, axis_rotations, matrix
from eomgen.scalars.protocol import Scalar, Scalars


class Rotation(Protocol):
    """A rotation R from own axes to the parent's (`out`) and back (`into`)."""

    def out(self, a: Vec) -> Vec:
        """R a: a vector of own axes in the parent's."""

    def into(self, a: Vec) -> Vec:
        """Rᵀ a: a vector of the parent's axes in own axes."""

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """R a Rᵀ for a symmetric matrix of own axes."""

    def out_matrix(self, a: Mat) -> Mat:
        """R a Rᵀ for any matrix of own axes."""

    def after(self, world: Mat) -> Mat:
        """world R: own axes in the world's, given the parent's."""


class IdentityRotation:
    """No rotation."""

    def out(self, a: Vec) -> Vec:
        """The same vector."""
        return a

    def into(self, a: Vec) -> Vec:
        """The same vector."""
        return a

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """The same matrix."""
        return a

    def out_matrix(self, a: Mat) -> Mat:
        """The same matrix."""
        return a

    def after(self, world: Mat) -> Mat:
        """The parent's axes."""
        return world


@dataclass(frozen=True)
class AxisRotation:
    """A rotation about coordinate axis k by an angle of cosine c and sine s."""

    k: int
    c: Scalar
    s: Scalar
    two_c: Scalar

    def out(self, a: Vec) -> Vec:
        """Two components rotate."""
        i, j = (self.k + 1) % 3, (self.k + 2) % 3
        result = list(a)
        result[i], result[j] = self.c * a[i] - self.s * a[j], self.s * a[i] + self.c * a[j]
        return (result[0], result[1], result[2])

    def into(self, a: Vec) -> Vec:
        """Two components rotate back."""
        i, j = (self.k + 1) % 3, (self.k + 2) % 3
        result = list(a)
        result[i], result[j] = self.c * a[i] + self.s * a[j], self.c * a[j] - self.s * a[i]
        return (result[0], result[1], result[2])

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """Nine operations for the block that rotates: with w = s (a - c) + 2 c b,
        [a b; b c] becomes [a - s w, c w - b; c w - b, c + s w].
        """
        i, j, k = (self.k + 1) % 3, (self.k + 2) % 3, self.k
        w = self.s * (a[i][i] - a[j][j]) + self.two_c * a[i][j]
        sw = self.s * w
        edge = self.out(a[k])
        m = [list(row) for row in a]
        m[i][i], m[j][j] = a[i][i] - sw, a[j][j] + sw
        m[i][j] = m[j][i] = self.c * w - a[i][j]
        m[k][i] = m[i][k] = edge[i]
        m[k][j] = m[j][k] = edge[j]
        return matrix(m)

    def out_matrix(self, a: Mat) -> Mat:
        """Like `out_symmetric`; the antisymmetric part of the block stays as it is."""
        i, j, k = (self.k + 1) % 3, (self.k + 2) % 3, self.k
        w = self.s * (a[i][i] - a[j][j]) + self.c * (a[i][j] + a[j][i])
        sw, cw = self.s * w, self.c * w
        row = self.out(a[k])
        column = self.out((a[0][k], a[1][k], a[2][k]))
        m = [list(r) for r in a]
        m[i][i], m[j][j] = a[i][i] - sw, a[j][j] + sw
        m[i][j], m[j][i] = cw - a[j][i], cw - a[i][j]
        m[k][i], m[k][j], m[i][k], m[j][k] = row[i], row[j], column[i], column[j]
        return matrix(m)

    def after(self, world: Mat) -> Mat:
        """Two columns rotate: each row of `world` times R."""
        return (self.into(world[0]), self.into(world[1]), self.into(world[2]))


@dataclass(frozen=True)
class QuarterTurns:
    """Quarter turns about coordinate axis k, 1 to 3: nothing is computed."""

    k: int
    count: int

    def out(self, a: Vec) -> Vec:
        """Two components change places or signs."""
        return self._rotated(a, self.count)

    def into(self, a: Vec) -> Vec:
        """The same, backwards."""
        return self._rotated(a, 4 - self.count)

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """Rows and columns change places, and signs."""
        return self.out_matrix(a)

    def out_matrix(self, a: Mat) -> Mat:
        """First a Rᵀ, by rows, then R times that, by columns."""
        rows = transposed((self.out(a[0]), self.out(a[1]), self.out(a[2])))
        return transposed((self.out(rows[0]), self.out(rows[1]), self.out(rows[2])))

    def after(self, world: Mat) -> Mat:
        """Two columns change places, or signs."""
        return (self.into(world[0]), self.into(world[1]), self.into(world[2]))

    def _rotated(self, a: Vec, count: int) -> Vec:
        i, j = (self.k + 1) % 3, (self.k + 2) % 3
        x, y = _by_quarters(a[i], a[j], count)
        result = list(a)
        result[i], result[j] = x, y
        return (result[0], result[1], result[2])


@dataclass(frozen=True)
class MatrixRotation:
    """Any rotation, by its matrix; the columns are its own axes."""

    matrix: Mat

    def out(self, a: Vec) -> Vec:
        """R a."""
        return times(self.matrix, a)

    def into(self, a: Vec) -> Vec:
        """Rᵀ a."""
        return times(transposed(self.matrix), a)

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """R a Rᵀ."""
        return congruent(self.matrix, a)

    def out_matrix(self, a: Mat) -> Mat:
        """R a Rᵀ."""
        return product(product(self.matrix, a), transposed(self.matrix))

    def after(self, world: Mat) -> Mat:
        """world R."""
        return product(world, self.matrix)


@dataclass(frozen=True)
class ComposedRotation:
    """A product of two rotations, R = outer inner: a fixed one, and the joint's."""

    outer: Rotation
    inner: Rotation

    def out(self, a: Vec) -> Vec:
        """Inner first."""
        return self.outer.out(self.inner.out(a))

    def into(self, a: Vec) -> Vec:
        """Outer first."""
        return self.inner.into(self.outer.into(a))

    def out_symmetric(self, a: Symmetric) -> Symmetric:
        """Inner first."""
        return self.outer.out_symmetric(self.inner.out_symmetric(a))

    def out_matrix(self, a: Mat) -> Mat:
        """Inner first."""
        return self.outer.out_matrix(self.inner.out_matrix(a))

    def after(self, world: Mat) -> Mat:
        """world outer inner."""
        return self.inner.after(self.outer.after(world))


def axis_rotation(k: int, angle: Scalar, quarters: int, scalars: Scalars) -> AxisRotation:
    """A rotation about coordinate axis k by quarter turns and an angle."""
    c, s = cosine_and_sine(angle, quarters, scalars)
    return AxisRotation(k, c, s, scalars.number(2.0) * c)


def cosine_and_sine(angle: Scalar, quarters: int, scalars: Scalars) -> tuple[Scalar, Scalar]:
    """Cosine and sine of an angle (rad) plus quarter turns, which no double is exactly."""
    return _by_quarters(scalars.call("cos", angle), scalars.call("sin", angle), quarters)


def fixed_rotation(rotation: Matrix, scalars: Scalars) -> Rotation:
    """A rotation that a scene fixes, by rotations about coordinate axes where it is one or two."""
    parts = axis_rotations(rotation)
    if parts is None:
        return MatrixRotation(constant(rotation, scalars))
    found: Rotation = IdentityRotation()
    for part in parts:
        if part.quarters:
            found = both(found, QuarterTurns(part.k, part.quarters))
        if part.s:
            c, s = scalars.number(part.c), scalars.number(part.s)
            found = both(found, AxisRotation(part.k, c, s, scalars.number(2.0) * c))
    return found


def held_rotation(
    rows: Sequence[Sequence[Formula]], value: Callable[[Formula], Scalar], scalars: Scalars
) -> Rotation:
    """The rotation by formulas of parameters (see `model.orientation`): Rz Ry Rx of three angles,
    of one about z; of a quaternion; or a matrix, by its rows.
    """
    if len(rows) == 3:
        a, b, c = ([value(part) for part in row] for row in rows)
        return MatrixRotation(matrix([a, b, c]))
    if len(rows[0]) == 4:
        return from_quaternion([value(part) for part in rows[0]], scalars)
    found: Rotation = IdentityRotation()
    for k, turn in turns_of(rows[0]):
        if isinstance(turn, tuple):
            found = both(found, fixed_rotation(turn, scalars))
        else:
            found = both(found, axis_rotation(k, value(turn), 0, scalars))
    return found


def both(outer: Rotation, inner: Rotation) -> Rotation:
    """The product outer inner."""
    return inner if isinstance(outer, IdentityRotation) else ComposedRotation(outer, inner)


def _by_quarters(x: Scalar, y: Scalar, count: int) -> tuple[Scalar, Scalar]:
    """Components x and y after quarter turns from x to y."""
    return ((x, y), (-y, x), (-x, -y), (y, -x))[count % 4]


def from_quaternion(q: Sequence[Scalar], scalars: Scalars) -> MatrixRotation:
    """The rotation of w, x, y, z, whatever the quaternion's length.

    R = 1 + (2/|q|²) (w [v]x + [v]x²), which is a rotation for any length.
    """
    w, x, y, z = q
    one = scalars.number(1.0)
    k = scalars.number(2.0) / (w * w + x * x + y * y + z * z)
    kx, ky, kz = k * x, k * y, k * z
    wx, wy, wz = kx * w, ky * w, kz * w
    xx, yy, zz = kx * x, ky * y, kz * z
    xy, xz, yz = kx * y, kx * z, ky * z
    return MatrixRotation(
        (
            (one - (yy + zz), xy - wz, xz + wy),
            (xy + wz, one - (xx + zz), yz - wx),
            (xz - wy, yz + wx, one - (xx + yy)),
        )
    )
