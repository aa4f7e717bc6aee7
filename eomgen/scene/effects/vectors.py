"""Vectors of effects: two components in the plane, three in space, over any scalars.

`LEAST_SQUARE` and `NEAREST` keep lengths and directions finite where points coincide.
"""

from collections.abc import Iterable

from eomgen.scene.effects.base import Mechanism, Scalar, Vector

LEAST_SQUARE = 1e-300
"""Lower bound of the square of a length under a root."""

NEAREST = 1e-9
"""Distance below which the direction from one point to another is smoothed: see `Spring`.

Relative to `Mechanism.magnitude`, so it is in m for a scene of ordinary size.
"""


def nearest_square(mechanism: Mechanism) -> Scalar:
    """The square of `NEAREST` at the scale of the mechanism, m²."""
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
    """a × b; in the plane its z component."""
    if len(a) == 2:
        return (a[0] * b[1] - a[1] * b[0],)
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(mechanism: Mechanism, vector: Vector) -> Scalar:
    """|a|, with an exact and finite derivative everywhere, which is 0 at a = 0.

    For several components it is sqrt(max(a·a, 1e-300)). The derivative of max is that of the
    greater argument, so the root of 0 is never differentiated. At a = 0 the result is 1e-150, so
    |a| a is exactly 0 there; above 1e-150 it is exact.
    """
    if len(vector) == 1:
        return mechanism.call("abs", vector[0])
    square = mechanism.call("max", dot(vector, vector), mechanism.number(LEAST_SQUARE))
    return mechanism.call("sqrt", square)


def at_least_zero(mechanism: Mechanism, value: Scalar) -> Scalar:
    """max(value, 0)."""
    return mechanism.call("max", value, mechanism.zero)
