"""Contacts of spheres, capsules and boxes with each other: the nearest points of their cores."""

from collections.abc import Iterator

from eomgen.scene.effects.base import Mechanism, Scalar, Vector
from eomgen.scene.effects.touching import Solid, Touch, on_ball, signed_sums
from eomgen.scene.effects.vectors import LEAST_SQUARE, add, dot, negative, scale, sub

PARALLEL = 1e-14
"""Square of the sine of an angle below which lines count as parallel."""


def between(mechanism: Mechanism, first: Solid, second: Solid) -> Iterator[Touch]:
    """The contacts of two solids whose cores are points, lines or boxes.

    Two points, lines, or a point and a box touch at their nearest points. A line and a box touch
    there and at both ends of the line, two boxes at the corners of each; crossing edges do not.
    """
    if second.edges:
        for arm in _corners(mechanism, first):
            yield _at_box(mechanism, first, arm, second)
        if first.edges:
            for arm in _corners(mechanism, second):
                yield _at_box(mechanism, second, arm, first)
        elif len(first.arms) > 1:
            yield _line_at_box(mechanism, first, second)
    elif first.edges:
        yield from between(mechanism, second, first)
    else:
        yield _lines(mechanism, first, second)


def _apart(mechanism: Mechanism, first: Solid, second: Solid) -> Vector:
    """The vector from the point `at` of the second to that of the first, world axes, m."""
    place = mechanism.position
    return sub(place(first.body, first.at), place(second.body, second.at))


def _lines(mechanism: Mechanism, first: Solid, second: Solid) -> Touch:
    """Points or lines. The nearest points of lines p + s d, 0 <= s <= 1: Ericson, "Real-time
    collision detection" (2005), 5.1.9. For parallel ones it begins with s = 1/2.
    """
    if len(first.arms) == len(second.arms) == 1:
        return on_ball(mechanism, first, second)
    r = _apart(mechanism, first, second)
    d1, d2 = _corners(mechanism, first)[-1], _corners(mechanism, second)[-1]
    if not d1:
        return on_ball(mechanism, first, second, ((), _part(mechanism, r, d2)))
    if not d2:
        return on_ball(mechanism, first, second, (_part(mechanism, negative(r), d1), ()))
    a, b, e = _square(mechanism, d1), dot(d1, d2), _square(mechanism, d2)
    c, f = dot(d1, r), dot(d2, r)
    s = _share(mechanism, b * f - c * e, a * e - b * b, a * e)
    t = _within(mechanism, (b * s + f) / e)
    s = _within(mechanism, (b * t - c) / a)
    return on_ball(mechanism, first, second, (scale(s, d1), scale(t, d2)))


def _part(mechanism: Mechanism, r: Vector, line: Vector) -> Vector:
    """The point of a line from 0 that is nearest to r."""
    return scale(_within(mechanism, dot(r, line) / _square(mechanism, line)), line)


def _at_box(mechanism: Mechanism, first: Solid, arm: Vector, box: Solid) -> Touch:
    """A point of a core, and the point of a box that is nearest to it."""
    r = _apart(mechanism, first, box)
    r = add(r, arm) if arm else r
    total, *others = (
        scale(_within(mechanism, dot(r, edge) / square, -1.0), edge)
        for edge, square in zip(*_edges(mechanism, box), strict=True)
    )
    for part in others:
        total = add(total, part)
    return on_ball(mechanism, first, box, (arm, total))


def _line_at_box(mechanism: Mechanism, line: Solid, box: Solid) -> Touch:
    """The nearest points of a line p + t d, 0 <= t <= 1, and a box.

    In the box's axes, with its half sizes as units, the line is x = a + t b. The rate g of half the
    square of the distance along it is a sum of h² b (x - clamp(x)), piecewise linear and rising in
    t. Its 0 is between the last corner of g where it is not positive and the first where it is not
    negative. Where g is 0 on a whole part, but for rounding, t is in the middle of it.
    """
    r, d = _apart(mechanism, line, box), mechanism.outward(line.body, line.arms[-1])
    edges, squares = _edges(mechanism, box)
    zero, one = mechanism.zero, mechanism.number(1.0)
    starts = [dot(r, edge) / square for edge, square in zip(edges, squares, strict=True)]
    rates = [dot(d, edge) / square for edge, square in zip(edges, squares, strict=True)]

    def slope(t: Scalar) -> Scalar:
        total = zero
        for a, b, square in zip(starts, rates, squares, strict=True):
            x = a + t * b
            total = total + square * b * (x - _within(mechanism, x, -1.0))
        return total

    low, high, slight = zero, one, mechanism.number(PARALLEL) * _square(mechanism, d)
    for a, b in zip(starts, rates, strict=True):
        size = mechanism.call("max", b * b, mechanism.number(LEAST_SQUARE))
        for side in (-one, one):
            t = _within(mechanism, (side - a) * b / size)
            g = slope(t)
            low = mechanism.call("max", low, mechanism.call("select", g - slight, zero, t))
            high = mechanism.call("min", high, mechanism.call("select", -g - slight, one, t))
    rise, fall = slope(high), -slope(low)
    share = _share(mechanism, fall, rise + fall, _square(mechanism, d))
    return _at_box(mechanism, line, scale(low + share * (high - low), d), box)


def _share(mechanism: Mechanism, part: Scalar, whole: Scalar, size: Scalar) -> Scalar:
    """part/whole within 0 and 1; 1/2 where the whole is 0 but for rounding of numbers of a size."""
    least = mechanism.number(PARALLEL) * size
    share = _within(mechanism, part / mechanism.call("max", whole, least))
    return mechanism.call("select", whole - least, share, mechanism.number(0.5))


def _corners(mechanism: Mechanism, solid: Solid) -> list[Vector]:
    """The corners of a core from `at`, world axes, m."""
    if solid.edges:
        return signed_sums(_edges(mechanism, solid)[0])
    return [mechanism.outward(solid.body, arm) if arm else () for arm in solid.arms]


def _edges(mechanism: Mechanism, box: Solid) -> tuple[list[Vector], list[Scalar]]:
    """The half edges of a box in world axes, m, and their squares."""
    edges = [mechanism.outward(box.body, edge) for edge in box.edges]
    return edges, [dot(edge, edge) for edge in box.edges]


def _square(mechanism: Mechanism, vector: Vector) -> Scalar:
    return mechanism.call("max", dot(vector, vector), mechanism.number(LEAST_SQUARE))


def _within(mechanism: Mechanism, x: Scalar, low: float = 0.0) -> Scalar:
    """x, or the nearer of `low` and 1."""
    least, one = mechanism.number(low), mechanism.number(1.0)
    return mechanism.call("min", mechanism.call("max", x, least), one)
