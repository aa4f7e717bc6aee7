"""Planar polygons that close in one way once a branch is chosen: the groups of Assur of two bars.

Vectors of the plane are pairs of scalars, and are multiplied as complex numbers: a bar's direction
times a vector in its axes is this vector in the world. Each function takes what is known of a
closed polygon and returns what is not, with one square root at most. Its `branch`, 1 or -1, is the
side on which the polygon lies. Where the root vanishes both sides meet, in a dead point.
"""

from eomgen.scalars.protocol import Scalar, Scalars

Arrow = tuple[Scalar, Scalar]
"""A vector of the plane."""


def plus(a: Arrow, b: Arrow) -> Arrow:
    """a + b."""
    return a[0] + b[0], a[1] + b[1]


def minus(a: Arrow, b: Arrow) -> Arrow:
    """a - b."""
    return a[0] - b[0], a[1] - b[1]


def opposite(a: Arrow) -> Arrow:
    """-a."""
    return -a[0], -a[1]


def times(k: Scalar, a: Arrow) -> Arrow:
    """k a."""
    return k * a[0], k * a[1]


def along(a: Arrow, b: Arrow) -> Scalar:
    """The scalar product a · b."""
    return a[0] * b[0] + a[1] * b[1]


def across(a: Arrow, b: Arrow) -> Scalar:
    """The component of a × b on the plane."""
    return a[0] * b[1] - a[1] * b[0]


def turned(u: Arrow, a: Arrow) -> Arrow:
    """a turned by the angle of a unit vector u: the complex product."""
    return u[0] * a[0] - u[1] * a[1], u[0] * a[1] + u[1] * a[0]


def turned_back(u: Arrow, a: Arrow) -> Arrow:
    """a turned back by the angle of u."""
    return u[0] * a[0] + u[1] * a[1], u[0] * a[1] - u[1] * a[0]


def between(a: Arrow, b: Arrow, square: Scalar, scalars: Scalars) -> Arrow:
    """The direction that turns a into b, which are of the same length, the root of `square`."""
    if scalars.is_zero(a[1]):
        return b[0] / a[0], b[1] / a[0]
    if scalars.is_zero(a[0]):
        return b[1] / a[1], -(b[0] / a[1])
    found = turned_back(a, b)
    return found[0] / square, found[1] / square


def root(square: Scalar, branch: int, scalars: Scalars) -> Scalar:
    """The square root, with the sign of the branch."""
    found = scalars.call("sqrt", square)
    return found if branch > 0 else -found


def triangle(d: Arrow, first: Scalar, second: Scalar, branch: int, scalars: Scalars) -> Arrow:
    """The first side a of a triangle a + b = d, for the squares of the lengths of a and of b.

    With a = x d + y e, e perpendicular to d: |a|² and |d - a|² give x, and then |a|² gives y.
    """
    half, whole = scalars.number(0.5), along(d, d)
    x = half + half * (first - second) / whole
    y = root(first / whole - x * x, branch, scalars)
    return turned((x, y), d)


def reach(
    d: Arrow, line: Arrow, square: Scalar, branch: int, scalars: Scalars
) -> tuple[Scalar, Arrow]:
    """s and w = d - s `line` of a length, given by its square; `line` is a unit vector."""
    side = across(line, d)
    more = root(square - side * side, branch, scalars)
    return along(line, d) + more, turned((-more, side), line)


def leaning(n: Arrow, h: Scalar, square: Scalar, branch: int, scalars: Scalars) -> Arrow:
    """The vector of a length, given by its square, whose component along the unit vector n is h."""
    return turned((h, root(square - h * h, branch, scalars)), n)


def parts(d: Arrow, first: Arrow, second: Arrow) -> tuple[Scalar, Scalar]:
    """s and r with s `first` + r `second` = d."""
    whole = across(first, second)
    return across(d, second) / whole, across(first, d) / whole
