"""Lines that show springs, motors, contacts and the like, in the picture's plane.

The same lines are drawn in the plane and in space, where they lie in the plane of the picture; only
rails and stops follow their axes.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Formula
from eomgen.scene.effects.elements import (
    AtJoint,
    Attachment,
    Attraction,
    Element,
    Field,
    Link,
    Pull,
    Round,
    Support,
    Vector,
    Wind,
)
from eomgen.scene.look import number, numbers
from eomgen.show.of_run import world_points
from eomgen.show.picture import DrawnJoint, Picture

Array = NDArray[np.float64]

COILS = 7
LEAD = 0.12
"""Straight part at each end of a coil or damper, relative to its length."""
TAUT = 1e-3
"""A rope is straight if it is shorter than its length at rest by less than this part of it."""
TURNS = 1.75
"""Turns of the spiral of a torsion spring."""


@dataclass(frozen=True, eq=False)
class Stroke:
    """A line through points (k, 2) of the picture, m; the inside is filled with paper if `closed`.

    weight  width relative to that of an ordinary line
    dashed  whether it shows something that is no thing
    layer   behind all bodies, behind them at the last time, or in front of them
    """

    points: Array
    weight: float = 1.0
    closed: bool = False
    dashed: bool = False
    layer: Literal["back", "middle", "front"] = "front"


@dataclass(frozen=True, eq=False)
class Sight:
    """A picture with numbers for formulas, at one pose, seen along the axes of an `eye`."""

    picture: Picture
    pose: Array  # (nb, 3) or (nb, 3, 4)
    eye: Array  # (3, 3); the identity in the plane

    def world(self, body: int, r: Sequence[Formula] | Array) -> Array:
        """The position of a point of a body, m, world axes."""
        at = r if isinstance(r, np.ndarray) else np.array(numbers(r))
        return np.asarray(world_points(self.pose[np.newaxis], body, at)[0])

    def seen(self, points: Array) -> Array:
        """Points (…, d) of the world in the picture (…, 2), m."""
        if points.shape[-1] == 2:
            return points
        return np.asarray((points @ self.eye.T)[..., :2])

    def at(self, attachment: Attachment) -> Array:
        """An attachment in the picture (2,), m."""
        return self.seen(self.world(attachment.body, attachment.at))

    def outward(self, body: int, vector: Array) -> Array:
        """A vector (d,) in a body's axes, in the world's."""
        return self.world(body, vector) - self.world(body, np.zeros_like(vector))


def strokes(sight: Sight) -> Iterator[Stroke]:
    """The lines of all elements that have any."""
    for element in sight.picture.elements:
        yield from _strokes(sight, element)


def _strokes(sight: Sight, element: Element) -> Iterator[Stroke]:
    match element:
        case Link():
            yield from _link(sight, element)
        case AtJoint():
            yield from _at_joint(sight, element)
        case Support():
            yield from _support(sight, element)
        case Round(body=body) if body >= 0:
            yield from _ball(sight, element)
        case Field(center=center) if center is not None:
            yield from _center(sight, sight.seen(np.array(numbers(center))))
        case Field():
            yield from _arrows(sight, element.points, element.forces)
        case Wind(velocity=velocity) if velocity is not None:
            yield from _wind(sight, element.at, velocity)
        case Pull():
            middle = sight.seen(sight.world(element.body, element.at))
            yield Stroke(middle + 0.03 * sight.picture.size * circle(12), closed=True)
        case Attraction():
            yield from _center(sight, sight.seen(np.array(numbers(element.center))))


def circle(count: int = 48, start: float = 0.0, stop: float = 2 * np.pi) -> Array:
    """Points (count + 1, 2) of an arc of radius 1."""
    angles = np.linspace(start, stop, count + 1)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _link(sight: Sight, link: Link) -> Iterator[Stroke]:
    start, end = sight.at(link.start), sight.at(link.end)
    length, radius = float(np.linalg.norm(end - start)), number(link.radius)
    if link.kind == "rope":
        yield Stroke(_rope(sight, link, start, end), 1.1)
        for place in (start, end):
            yield Stroke(place + 0.22 * radius * circle(16), closed=True)
        return
    if length < 1e-9 * radius:
        return
    radius = min(radius, 0.3 * length)
    along = (end - start) / length
    aside = np.array([-along[1], along[0]])

    def placed(x: Array, y: Array) -> Array:
        return start + np.outer(x * length, along) + np.outer(y * radius, aside)

    if link.kind in ("coil", "spring_damper"):
        offset = 0.9 if link.kind == "spring_damper" else 0.0
        yield Stroke(placed(*_coil(offset)), 1.1)
    if link.kind in ("damper", "spring_damper"):
        offset = -0.9 if link.kind == "spring_damper" else 0.0
        for x, y in _damper(offset):
            yield Stroke(placed(x, y), 1.1)
    for place in (start, end):
        yield Stroke(place + 0.22 * radius * circle(16), closed=True)


def _coil(offset: float) -> tuple[Array, Array]:
    """Places along (0 to 1) and aside (in radii) of a zigzag."""
    count = 2 * COILS
    middle = LEAD + (1 - 2 * LEAD) * (np.arange(count) + 0.5) / count
    high = np.where(np.arange(count) % 2, -1.0, 1.0) * (0.6 if offset else 1.0)
    x = np.concatenate([[0, LEAD * 0.8], [LEAD], middle, [1 - LEAD], [1 - LEAD * 0.8, 1]])
    y = np.concatenate([[0, 0], [offset], high + offset, [offset], [0, 0]])
    return x, y


def _damper(offset: float) -> Iterator[tuple[Array, Array]]:
    """A cylinder, open to the second end, with a piston on a rod."""
    wide = 0.55 if offset else 0.8
    left, right, piston = 0.32, 0.68, 0.52
    ends = np.array([0.0, LEAD * 0.8, LEAD, left]), np.array([0.0, 0.0, offset, offset])
    yield ends
    yield (
        np.array([right, left, left, right]),
        np.array([wide, wide, -wide, -wide]) + offset,
    )
    yield np.array([piston, piston]), np.array([wide, -wide]) * 0.8 + offset
    yield (
        np.array([piston, 1 - LEAD, 1 - LEAD * 0.8, 1.0]),
        np.array([offset, offset, 0.0, 0.0]),
    )


def _rope(sight: Sight, link: Link, start: Array, end: Array) -> Array:
    """A straight line, or a sagging one whose length is that of the rope."""
    assert link.rest is not None
    rest = number(link.rest)
    ends = [sight.world(a.body, a.at) for a in (link.start, link.end)]
    slack = rest - float(np.linalg.norm(ends[1] - ends[0]))
    x = np.linspace(0.0, 1.0, 25)[:, np.newaxis]
    line = start + x * (end - start)
    if slack <= TAUT * rest:
        return np.asarray(line)
    # The sag of a flat parabola: length = span + 8/3 sag²/span.
    span = max(rest - slack, 0.15 * rest)
    sag = math.sqrt(3 / 8 * span * slack)
    return np.asarray(line - np.array([0.0, 4 * sag]) * x * (1 - x))


def _at_joint(sight: Sight, element: AtJoint) -> Iterator[Stroke]:
    joint = sight.picture.joints[element.joint]
    center = sight.seen(sight.world(joint.parent, joint.at_parent))
    if joint.type in ("prismatic", "cylindrical", "planar"):
        center = sight.seen(sight.world(joint.child, joint.at_child))
    r = number(element.radius)
    if _slides(element, joint) and element.kind != "stop":
        yield from _at_slider(sight, element, joint, center)
        return
    match element.kind:
        case "torsion":
            angles = np.linspace(0, 2 * np.pi * TURNS, 60)
            radii = r * np.linspace(0.25, 1.0, 60)
            points = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, np.newaxis]
            yield Stroke(center + points)
        case "motor" | "servo" | "drive":
            yield Stroke(center + r * circle(40, 0.35 * np.pi, 1.9 * np.pi), 1.3)
            tip, back = r * circle(1, 1.9 * np.pi, 1.9 * np.pi)[0], 0.45 * r
            head = np.array([[-1.0, 0.1], [0.0, 0.0], [0.1, -1.0]]) * back
            yield Stroke(center + tip + head, 1.3)
            if element.kind == "servo":
                yield Stroke(center + 0.15 * r * circle(16), closed=True)
        case "brake":
            for side in (-1.0, 1.0):
                arc = circle(12, -0.25 * np.pi, 0.25 * np.pi) * side
                yield Stroke(center + 0.8 * r * arc, 2.0)
        case "stop":
            yield from _stop(sight, element, joint)


def _slides(element: AtJoint, joint: DrawnJoint) -> bool:
    """Whether the coordinate of an element is a displacement along the joint's axis."""
    own = joint.type == "prismatic" or (joint.type == "cylindrical" and not element.coordinate)
    return own and joint.axis is not None


def _at_slider(
    sight: Sight, element: AtJoint, joint: DrawnJoint, center: Array
) -> Iterator[Stroke]:
    """A spring along the axis, an arrow beside it, or pads on both sides."""
    assert joint.axis is not None
    axis = np.array(numbers(joint.axis))[: sight.pose.shape[-1] - (sight.pose.ndim == 2)]
    along = sight.seen(sight.outward(joint.parent, axis)[np.newaxis])[0]
    along = along / (np.linalg.norm(along) or 1.0)
    places = np.array([along, [-along[1], along[0]]]) * number(element.radius)
    match element.kind:
        case "torsion":
            x, y = _coil(0.0)
            yield Stroke(center + np.column_stack([2.4 * x - 1.2, 0.4 * y]) @ places)
        case "brake":
            for side in (-0.6, 0.6):
                yield Stroke(center + np.array([[-0.6, side], [0.6, side]]) @ places, 2.0)
        case _:
            arrow = (
                np.array([[-1.2, 1.0], [1.2, 1.0]]),
                np.array([[0.8, 1.3], [1.2, 1.0], [0.8, 0.7]]),
            )
            for points in arrow:
                yield Stroke(center + points @ places, 1.3)
            if element.kind == "servo":
                yield Stroke(center + 0.15 * number(element.radius) * circle(16), closed=True)


def _stop(sight: Sight, stop: AtJoint, joint: DrawnJoint) -> Iterator[Stroke]:
    """Ticks at the limits: across a rail, or around a pin with an arc between them."""
    r = number(stop.radius)
    limits = [number(x) for x in (stop.low, stop.high) if x is not None]
    middle = sight.world(joint.parent, joint.at_parent)
    if joint.type == "prismatic" and joint.axis is not None:
        axis = np.array(numbers(joint.axis))[: middle.size]
        along = sight.outward(joint.parent, axis)
        flat = sight.seen(along[np.newaxis])[0]
        aside = r * np.array([-flat[1], flat[0]]) / (np.linalg.norm(flat) or 1.0)
        for limit in limits:
            place = sight.seen((middle + limit * along)[np.newaxis])[0]
            yield Stroke(np.array([place - aside, place + aside]), 2.0)
    elif stop.zero is not None:
        zero = np.array(numbers(stop.zero))
        turn = np.array([-zero[1], zero[0]]) if zero.size == 2 else np.zeros(3)
        if zero.size == 3 and joint.axis is not None:
            turn = np.cross(np.array(numbers(joint.axis)), zero)
        zero, turn = (sight.outward(joint.parent, vector) for vector in (zero, turn))
        for limit in limits:
            ray = np.outer([1.0, 1.9], math.cos(limit) * zero + math.sin(limit) * turn)
            yield Stroke(sight.seen(middle + r * ray), 2.0)
        if len(limits) == 2 and limits[1] - limits[0] < 2 * np.pi:
            angles = np.linspace(limits[0], limits[1], 40)
            arc = np.outer(np.cos(angles), zero) + np.outer(np.sin(angles), turn)
            yield Stroke(sight.seen(middle + 1.45 * r * arc), 0.7, dashed=True)


def _support(sight: Sight, support: Support) -> Iterator[Stroke]:
    r = number(support.radius)
    middle = sight.world(support.body, support.at)
    if support.kind == "base":
        top = sight.seen(middle)
        y = r if support.axis is not None and number(support.axis[-1]) > 0 else -r
        corners = np.array([[0.0, 0.0], [-0.75 * r, y], [0.75 * r, y]])
        yield Stroke(top + corners, closed=True, layer="middle")
        yield Stroke(top + np.array([[-1.3 * r, y], [1.3 * r, y]]), 1.3, layer="middle")
        for x in np.linspace(-1.1, 1.3, 7) * r:
            yield Stroke(top + np.array([[x, y], [x - 0.4 * r, 1.45 * y]]), 0.6, layer="middle")
    elif support.axis is not None and support.low is not None and support.high is not None:
        along = sight.outward(support.body, np.array(numbers(support.axis)))
        ends = np.outer([number(support.low), number(support.high)], along) + middle
        yield Stroke(sight.seen(ends), 1.6, layer="back")


def _ball(sight: Sight, ball: Round) -> Iterator[Stroke]:
    middle, radius = sight.seen(sight.world(ball.body, ball.at)), number(ball.radius)
    if not radius:
        yield Stroke(middle + 0.02 * sight.picture.size * circle(12), closed=True)
        return
    yield Stroke(middle + radius * circle(), 0.8)
    if ball.kind == "wheel" and len(middle) == sight.pose.shape[-1] - 1:
        angle = float(sight.pose[ball.body, 2])
        for spoke in angle + np.arange(3) * np.pi / 3:
            ray = radius * np.array([math.cos(spoke), math.sin(spoke)])
            yield Stroke(np.array([middle - ray, middle + ray]), 0.6)


def _arrows(sight: Sight, points: Sequence[Vector], vectors: Sequence[Vector]) -> Iterator[Stroke]:
    """Vectors at points of a grid; the longest is almost as long as the points are apart."""
    if len(points) < 2:
        return
    places = np.array([numbers(point) for point in points])
    long = np.array([numbers(vector) for vector in vectors])
    apart = np.linalg.norm(places[1:] - places[0], axis=1).min()
    longest = np.linalg.norm(long, axis=1).max()
    if not (np.isfinite(longest) and longest > 0):
        return
    for place, vector in zip(places, long * (0.8 * apart / longest), strict=True):
        start, end = sight.seen(np.array([place - vector / 2, place + vector / 2]))
        yield from arrow(start, end, 0.7)


def _wind(sight: Sight, at: Vector, velocity: Vector) -> Iterator[Stroke]:
    """Parallel arrows beside a point."""
    along = sight.seen(np.array(numbers(velocity)))
    speed = float(np.linalg.norm(along))
    if not (np.isfinite(speed) and speed > 0):
        return
    along = 0.6 * sight.picture.size * along / speed
    middle = sight.seen(np.array(numbers(at)))
    aside = np.array([-along[1], along[0]])
    for part, shift in ((-0.35, -0.1), (0.0, 0.1), (0.35, -0.1)):
        start = middle + part * aside + shift * along - along / 2
        yield from arrow(start, start + along, 1.2)


def arrow(start: Array, end: Array, weight: float) -> Iterator[Stroke]:
    """A line with an open head."""
    along = end - start
    aside = np.array([-along[1], along[0]])
    yield Stroke(np.array([start, end]), weight, layer="back")
    head = [end - 0.3 * along + 0.15 * aside, end, end - 0.3 * along - 0.15 * aside]
    yield Stroke(np.array(head), weight, layer="back")


def _center(sight: Sight, middle: Array) -> Iterator[Stroke]:
    """The centre of a field: a point within rings."""
    size = sight.picture.size
    yield Stroke(middle + 0.25 * size * circle(24), closed=True, weight=1.4)
    for radius in (0.5, 0.75):
        yield Stroke(middle + radius * size * circle(), 0.6, dashed=True)
