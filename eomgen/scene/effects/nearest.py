"""Contacts of spheres, capsules and boxes with each other: the nearest points of their cores."""

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import product

from eomgen.scene.effects.base import Mechanism, Scalar, Vector
from eomgen.scene.effects.touching import Solid, Touch, on_ball, points_of
from eomgen.scene.effects.vectors import LEAST_SQUARE, add, cross, dot, negative, scale, sub

Arms = tuple[Vector, Vector]
Points = tuple[Vector, Vector, Vector]
"""The arms to a point of each core, from where the two solids are, and the vector from the second
point to the first, world axes, m; () for one that is not computed.
"""

CROSSING = 1e-13
"""Distance below which lines count as crossing, relative to the magnitude of lengths."""
PARALLEL = 1e-14
"""Square of the sine of an angle below which lines count as parallel."""


def between(mechanism: Mechanism, first: Solid, second: Solid) -> Iterator[Touch]:
    """The contacts of two solids whose cores are points, lines or boxes: where these are nearest,
    of a line and a box at both ends of the line, too, and of two boxes at the corners of each.
    """
    if first.edges and not second.edges:
        first, second = second, first
    for *arms, d in _nearest(mechanism, first, second):
        yield on_ball(mechanism, first, second, (arms[0], arms[1]), d)


def _nearest(mechanism: Mechanism, first: Solid, second: Solid) -> Iterator[Points]:
    """The points at which the two may touch."""
    if not second.edges:
        yield _on_lines(mechanism, first, second)
        return
    corners = list[Points]()
    for arm in points_of(mechanism, first):
        corners.append((arm, *_in_box(mechanism, first, arm, second)))
    for arm in points_of(mechanism, second) if first.edges else ():
        inside, d = _in_box(mechanism, second, arm, first)
        corners.append((inside, arm, negative(d)))
    yield from corners
    if first.edges and mechanism.dimensions == 3:
        r = _apart(mechanism, first, second)
        yield _least(mechanism, [*corners, *_crossing(mechanism, r, first, second)])
    elif len(first.arms) > 1:
        arm = _on_line_at_box(mechanism, first, second)
        yield arm, *_in_box(mechanism, first, arm, second)


def _apart(mechanism: Mechanism, first: Solid, second: Solid) -> Vector:
    """The vector from the point `at` of the second to that of the first, world axes, m."""
    place = mechanism.position
    return sub(place(first.body, first.at), place(second.body, second.at))


def _on_lines(mechanism: Mechanism, first: Solid, second: Solid) -> Points:
    """The nearest points of two points or lines. Lines that cross but for rounding, as all may in
    a plane, do cross.
    """
    if len(first.arms) == len(second.arms) == 1:
        return (), (), ()
    r = _apart(mechanism, first, second)
    one, other = _on_both(mechanism, first, second, r)
    d = add(r, one) if one else r
    d = sub(d, other) if other else d
    beyond = dot(d, d) - mechanism.number((CROSSING * mechanism.magnitude) ** 2)
    return one, other, tuple(mechanism.call("select", beyond, x, mechanism.zero) for x in d)


def _on_both(mechanism: Mechanism, first: Solid, second: Solid, r: Vector) -> Arms:
    """The nearest points of two lines, one of which may be a point, with r from the second to the
    first.
    """
    d1, d2 = points_of(mechanism, first)[-1], points_of(mechanism, second)[-1]
    if not d1:
        return (), _part(mechanism, r, d2)
    if not d2:
        return _part(mechanism, negative(r), d1), ()
    return _between_lines(mechanism, r, d1, d2)


def _between_lines(mechanism: Mechanism, r: Vector, d1: Vector, d2: Vector) -> Arms:
    """The nearest points of lines r + s d1 and t d2, 0 <= s, t <= 1, as s d1 and t d2: Ericson,
    "Real-time collision detection" (2005), 5.1.9. For parallel ones it begins with s = 1/2.
    """
    a, b, e = _square(mechanism, d1), dot(d1, d2), _square(mechanism, d2)
    c, f = dot(d1, r), dot(d2, r)
    s = _share(mechanism, b * f - c * e, a * e - b * b, a * e)
    t = _within(mechanism, (b * s + f) / e)
    s = _within(mechanism, (b * t - c) / a)
    return scale(s, d1), scale(t, d2)


def _part(mechanism: Mechanism, r: Vector, line: Vector) -> Vector:
    """The point of a line from 0 that is nearest to r."""
    return scale(_within(mechanism, dot(r, line) / _square(mechanism, line)), line)


def _in_box(mechanism: Mechanism, solid: Solid, arm: Vector, box: Solid) -> Arms:
    """The point of a box that is nearest to a point of another solid, and the vector from there to
    the other, which is 0 in the box without rounding.
    """
    r = _apart(mechanism, solid, box)
    r = add(r, arm) if arm else r
    inside, outside = list[Vector](), list[Vector]()
    for edge, square in zip(*_edges(mechanism, box), strict=True):
        x = dot(r, edge) / square
        within = _within(mechanism, x, -1.0)
        inside.append(scale(within, edge))
        outside.append(scale(x - within, edge))
    return reduce(add, inside), reduce(add, outside)


def _crossing(mechanism: Mechanism, r: Vector, first: Solid, second: Solid) -> Iterator[Points]:
    """Of each direction of edges of two boxes the two edges that may be nearest to each other with
    the nearest points within them: those farthest along the normal n of both directions, which has
    r·n >= 0 with r from the second box to the first.
    """
    own, others = _edges(mechanism, first)[0], _edges(mechanism, second)[0]
    two = mechanism.number(2.0)
    for i, j in product(range(3), repeat=2):
        n = cross(own[i], others[j])
        side = dot(n, r)
        start = _farthest(mechanism, scale(-side, n), own, i)
        end = _farthest(mechanism, scale(side, n), others, j)
        lines = scale(two, own[i]), scale(two, others[j])
        arms = _between_lines(mechanism, add(r, sub(start, end)), *lines)
        ends = add(start, arms[0]), add(end, arms[1])
        yield *ends, add(r, sub(*ends))


def _farthest(mechanism: Mechanism, n: Vector, edges: Sequence[Vector], i: int) -> Vector:
    """One end of the edge along half edge i of a box, that which is farthest along n."""
    corner = negative(edges[i])
    for edge in (*edges[:i], *edges[i + 1 :]):
        along, back = dot(n, edge), negative(edge)
        chosen = (mechanism.call("select", along, x, y) for x, y in zip(edge, back, strict=True))
        corner = add(corner, tuple(chosen))
    return corner


def _least(mechanism: Mechanism, points: Sequence[Points]) -> Points:
    """Those with the least distance."""
    found, least = points[0], _square(mechanism, points[0][-1])
    for other in points[1:]:
        square = _square(mechanism, other[-1])
        nearer = least - square
        first, second, d = (
            tuple(mechanism.call("select", nearer, x, y) for x, y in zip(*pair, strict=True))
            for pair in zip(other, found, strict=True)
        )
        found, least = (first, second, d), mechanism.call("min", least, square)
    return found


def _on_line_at_box(mechanism: Mechanism, line: Solid, box: Solid) -> Vector:
    """The point of a line p + t d, 0 <= t <= 1, that is nearest to a box, from p.

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
    return scale(low + share * (high - low), d)


def _share(mechanism: Mechanism, part: Scalar, whole: Scalar, size: Scalar) -> Scalar:
    """part/whole within 0 and 1; 1/2 where the whole is 0 but for rounding of numbers of a size."""
    least = mechanism.number(PARALLEL) * size
    share = _within(mechanism, part / mechanism.call("max", whole, least))
    return mechanism.call("select", whole - least, share, mechanism.number(0.5))


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
