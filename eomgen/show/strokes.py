"""The marks of a picture at one pose, as lines in the plane of the picture."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Constant, Formula
from eomgen.scene.effects.elements import Attachment
from eomgen.scene.look import number, numbers
from eomgen.show.marks import Along, Arrows, Between, Facing, Over, Turned, marks_of
from eomgen.show.picture import Picture
from eomgen.show.symbols import Line, numbers_of
from eomgen.tables.poses import world_points

Array = NDArray[np.float64]
TAUT = 1e-3
"""A rope is straight if it is shorter than its length at rest by less than this part of it."""
ROUND = 25
"""Points of an arc."""
WIDEST = 0.3
"""Greatest radius of what is between two points relative to their distance."""


@dataclass(frozen=True, eq=False)
class Stroke:
    """A line of a symbol, through points (k, 2) of the picture, m, in the layer of its mark."""

    points: Array
    line: Line
    layer: str


@dataclass(frozen=True, eq=False)
class Sight:
    """A picture with numbers for formulas, at one pose, seen along the axes of an `eye`."""

    picture: Picture
    pose: Array  # (nb, 3) or (nb, 3, 4)
    eye: Array  # (3, 3); the identity in the plane

    def world(self, body: int, r: Sequence[Formula]) -> Array:
        """The position (3,) of a point of a body, m, world axes."""
        return _three(world_points(self.pose[np.newaxis], body, np.array(numbers(r)))[0])

    def vector(self, body: int, r: Sequence[Formula]) -> Array:
        """A vector of a body's axes in the world's, (3,)."""
        return self.world(body, r) - self.world(body, [Constant(0.0)] * len(r))

    def seen(self, points: Array) -> Array:
        """Points (…, 3) of the world in the picture (…, 2), m."""
        return np.asarray((points @ self.eye.T)[..., :2])

    def at(self, attachment: Attachment) -> Array:
        """An attachment in the picture (2,), m."""
        return self.seen(self.world(attachment.body, attachment.at))


def strokes(sight: Sight) -> Iterator[Stroke]:
    """The lines of all marks that are somewhere."""
    for mark in marks_of(sight.picture):
        if isinstance(mark.frame, Over):
            way = _way(sight, mark.frame)
            for line in mark.symbol if np.isfinite(way).all() else ():
                yield Stroke(sight.seen(way), line, mark.layer)
            continue
        with np.errstate(invalid="ignore", divide="ignore"):  # what has no length is left out
            frames = list(_frames(sight, mark.frame))
        for origin, axes, sag in frames:
            if not (np.isfinite(origin).all() and np.isfinite(axes).all()):
                continue
            for line in mark.symbol:
                unit = np.array([numbers_of(point) for point in line.points])
                bend = unit[:, :1] * (1 - unit[:, :1]) * sag
                points = origin + unit @ axes[: unit.shape[1]] + bend
                yield Stroke(sight.seen(points), line, mark.layer)


def _frames(
    sight: Sight, frame: Between | Along | Turned | Facing | Arrows
) -> Iterator[tuple[Array, Array, Array]]:
    """The frames of a mark: origin, x, y and z as rows, and what bends x to a parabola."""
    straight = np.zeros(3)
    if isinstance(frame, Arrows):
        vectors = np.array([_three(np.array(numbers(vector))) for vector in frame.vectors])
        longest = float(np.linalg.norm(vectors, axis=1).max())
        for point, vector in zip(frame.points, vectors, strict=True):
            along = vector * (number(frame.length) / longest if longest else np.nan)
            middle = _three(np.array(numbers(point)))
            yield middle - along / 2, _axes(sight, along, float(np.linalg.norm(along))), straight
        return
    if isinstance(frame, Between):
        start = sight.world(frame.start.body, frame.start.at)
        along = sight.world(frame.end.body, frame.end.at) - start
        length = float(np.linalg.norm(along))
        axes = _axes(sight, along, min(number(frame.radius), WIDEST * length))
        yield start, axes, straight if frame.rest is None else _sag(sight, length, frame.rest)
        return
    radius, origin = number(frame.radius), sight.world(frame.at.body, frame.at.at)
    if isinstance(frame, Along):
        along = sight.vector(frame.body, frame.axis)
        yield origin, _axes(sight, radius * along / np.linalg.norm(along), radius), straight
    elif isinstance(frame, Turned):
        x, y = (sight.vector(frame.body, each) for each in (frame.x, frame.y))
        yield origin, radius * np.array([x, y, straight]), straight
    elif isinstance(frame, Facing):
        yield origin, radius * sight.eye, straight


def _way(sight: Sight, frame: Over) -> Array:
    """The points (k, 3) of a way over discs: tangents between them, and arcs on them."""
    places = [sight.world(stop.body, stop.at) for stop in frame.stops]
    radii = [number(radius) for radius in frame.radii]
    if not any(radii):
        return np.array(places)
    if frame.closed:
        places, radii = [*places, places[0]], [*radii, radii[0]]
    points, before = list[Array](), np.nan
    first = _tangent(places[-2], places[-1], radii[-2], radii[-1]) if frame.closed else np.nan
    for k in range(len(places)):
        after = before
        if k + 1 < len(places):
            after = _tangent(places[k], places[k + 1], radii[k], radii[k + 1])
        came = (first if frame.closed else after) if k == 0 else before
        points.append(_arc(places[k], radii[k], came, after))
        before = after
    return np.concatenate(points)


def _tangent(start: Array, end: Array, radius: float, other: float) -> float:
    """The direction of the tangent from one disc to another, rad; nan if there is none."""
    x, y = (end - start)[:2]
    h, square = other - radius, x * x + y * y
    length = math.sqrt(square - h * h) if square > h * h else math.nan
    return math.atan2(length * y - h * x, length * x + h * y)


def _arc(place: Array, radius: float, came: float, leaves: float) -> Array:
    """Points of a disc from where a rope comes to it to where it leaves it, by its directions."""
    turn = (leaves - came) * np.sign(radius) % (2 * math.pi) if radius else 0.0
    angles = came + np.sign(radius) * np.linspace(0.0, turn, ROUND if turn else 1)
    normal = np.array([-np.sin(angles), np.cos(angles), np.zeros(len(angles))])
    return np.asarray(place - radius * normal.T)


def _axes(sight: Sight, along: Array, radius: float) -> Array:
    """x along, y across it in the picture, z across both; nothing if x has no length."""
    length = float(np.linalg.norm(along))
    aside = np.cross(sight.eye[2], along)
    if np.linalg.norm(aside) <= 1e-9 * length:  # towards the eye
        aside = sight.eye[0] * length
    across = [aside, np.cross(along, aside)]
    return np.array([along, *(radius * each / np.linalg.norm(each) for each in across)])


def _sag(sight: Sight, length: float, rest: Formula) -> Array:
    """What bends a rope that is longer than its way: a flat parabola, whose length is the span and
    8/3 sag²/span.
    """
    long = number(rest)
    slack = long - length
    down = np.eye(3)[sight.pose.ndim - 1] * -1.0
    if slack <= TAUT * long:
        return np.zeros(3)
    return np.asarray(4 * math.sqrt(3 / 8 * max(length, 0.15 * long) * slack) * down)


def _three(point: Array) -> Array:
    """A point with three components."""
    return np.append(point, np.zeros(3 - len(point)))
