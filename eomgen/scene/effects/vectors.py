"""Vectors of effects: two components in the plane, three in space, over any scalars.

`LEAST_SQUARE` and `NEAREST` are what keeps lengths and directions finite where points meet.
"""

from collections.abc import Iterable

from eomgen.scene.effects.base import Mechanism, Scalar, Vector

LEAST_SQUARE = 1e-300
"""Of a length under a root: less counts as this."""

NEAREST = 1e-9
"""Distance, m, within which the line between two points has no sure direction: see `Spring`. So it
is in a scene of ordinary size; in one of molecules or planets it is as small beside them.
"""


def nearest_square(mechanism: Mechanism) -> Scalar:
    """The square of that distance, m²."""
    return mechanism.number((NEAREST * mechanism.magnitude) ** 2)


def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def sub(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def scale(k: Scalar, a: Iterable[Scalar]) -> Vector:
    """k a."""
    return tuple(k * x for x in a)


def negative(a: Iterable[Scalar]) -> Vector:
    """-a."""
    return tuple(-x for x in a)


def dot(a: Vector, b: Vector) -> Scalar:
    """a · b."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def cross(a: Vector, b: Vector) -> Vector:
    """a × b; in the plane its one component, along z."""
    if len(a) == 2:
        return (a[0] * b[1] - a[1] * b[0],)
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(mechanism: Mechanism, vector: Vector) -> Scalar:
    """|a|, with a Jacobian that is finite and exact everywhere, 0 at a = 0.

    Of several components it is sqrt(max(a·a, 1e-300)): the greater of two has the slope of the one
    it takes, so that no root of 0 is ever differentiated. It is 1e-150 at a = 0, and right to
    the last bit from there upwards; |a| a is exactly 0 at a = 0.
    """
    if len(vector) == 1:
        return mechanism.call("abs", vector[0])
    square = mechanism.call("max", dot(vector, vector), mechanism.number(LEAST_SQUARE))
    return mechanism.call("sqrt", square)
