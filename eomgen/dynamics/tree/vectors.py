"""Vectors and 3 x 3 matrices over any scalars; they only add, subtract, multiply and divide."""

from collections.abc import Sequence

from eomgen.scalars.exact import Matrix
from eomgen.scalars.protocol import Scalar, Scalars

Vec = tuple[Scalar, Scalar, Scalar]
Mat = tuple[Vec, Vec, Vec]
"""Rows."""
Symmetric = Mat
"""A matrix whose entries (i, j) and (j, i) are the same."""

AXES = (0, 1, 2)
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The entries of a symmetric matrix that are computed: xx, yy, zz, xy, xz, yz."""


def add(a: Vec, b: Vec) -> Vec:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a: Vec, b: Vec) -> Vec:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(k: Scalar, a: Vec) -> Vec:
    """k a."""
    return (k * a[0], k * a[1], k * a[2])


def dot(a: Vec, b: Vec) -> Scalar:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    """a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def times(m: Mat, a: Vec) -> Vec:
    """m a."""
    return (dot(m[0], a), dot(m[1], a), dot(m[2], a))


def transposed(m: Mat) -> Mat:
    """mᵀ."""
    return (
        (m[0][0], m[1][0], m[2][0]),
        (m[0][1], m[1][1], m[2][1]),
        (m[0][2], m[1][2], m[2][2]),
    )


def plus(a: Mat, b: Mat) -> Mat:
    """a + b."""
    return (add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2]))


def product(a: Mat, b: Mat) -> Mat:
    """a b."""
    columns = transposed(b)
    return (
        (dot(a[0], columns[0]), dot(a[0], columns[1]), dot(a[0], columns[2])),
        (dot(a[1], columns[0]), dot(a[1], columns[1]), dot(a[1], columns[2])),
        (dot(a[2], columns[0]), dot(a[2], columns[1]), dot(a[2], columns[2])),
    )


def symmetric(entries: Sequence[Scalar]) -> Symmetric:
    """The matrix of its `ENTRIES`."""
    xx, yy, zz, xy, xz, yz = entries
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def congruent(r: Mat, a: Symmetric) -> Symmetric:
    """r a rᵀ, six entries computed."""
    half = product(r, a)
    return symmetric([dot(half[i], r[j]) for i, j in ENTRIES])


def skew(a: Vec, zero: Scalar) -> Mat:
    """The matrix of a x."""
    x, y, z = a
    return ((zero, -z, y), (z, zero, -x), (-y, x, zero))


def unit(k: int, scalars: Scalars) -> Vec:
    """The k-th coordinate direction."""
    zero, one = scalars.number(0.0), scalars.number(1.0)
    return (one if k == 0 else zero, one if k == 1 else zero, one if k == 2 else zero)


def replaced(a: Vec, k: int, value: Scalar) -> Vec:
    """a with another k-th component."""
    return (value if k == 0 else a[0], value if k == 1 else a[1], value if k == 2 else a[2])


def named(a: Vec, name: str, scalars: Scalars) -> Vec:
    """a, its components known as <name>_x, <name>_y and <name>_z."""
    x, y, z = (scalars.named(part, f"{name}_{axis}") for part, axis in zip(a, "xyz", strict=True))
    return (x, y, z)


def in_space(vector: Sequence[Scalar], scalars: Scalars) -> Vec:
    """A vector of two components or three, z = 0 in the plane."""
    x, y, *z = vector
    return (x, y, z[0] if z else scalars.number(0.0))


def torque_in_space(torque: Sequence[Scalar], scalars: Scalars) -> Vec:
    """A torque of one component, about z, of three, or of none."""
    if len(torque) == 1:
        return (scalars.number(0.0), scalars.number(0.0), torque[0])
    return in_space(torque, scalars) if torque else zeros(scalars)


def zeros(scalars: Scalars) -> Vec:
    """The zero vector."""
    zero = scalars.number(0.0)
    return (zero, zero, zero)


def no_matrix(scalars: Scalars) -> Mat:
    """The zero matrix."""
    row = zeros(scalars)
    return (row, row, row)


def constant(matrix: Matrix, scalars: Scalars) -> Mat:
    """A fixed rotation as scalars."""
    a, b, c = ([scalars.number(x) for x in row] for row in matrix)
    return ((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2]))
