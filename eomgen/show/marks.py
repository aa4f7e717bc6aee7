"""Marks: where a picture shows which symbol, as formulas of parameters.

A figure places them at a pose (`strokes`), a page at each moment (`stage_elements.js`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from eomgen.language.formula import ZERO, Apply, Constant, Formula
from eomgen.language.rewriting import constant, scaled, sum_of, times
from eomgen.scene.effects.elements import (
    WORLD_INDEX,
    AtJoint,
    Attachment,
    Attraction,
    Cord,
    Element,
    Field,
    GroundLine,
    Heights,
    Link,
    Plane,
    Pull,
    Round,
    Support,
    Vector,
    Wind,
)
from eomgen.scene.look import numbers
from eomgen.show import symbols
from eomgen.show.picture import DrawnJoint, Picture
from eomgen.show.symbols import Symbol

SMALL = 0.02
"""Least radius of a contact's circle relative to the size."""


@dataclass(frozen=True)
class Between:
    """x is from `start` to `end`, y across it in the picture, of `radius`; z is across both.

    With `rest`, m, it hangs down where the points are nearer to each other than that.
    """

    kind: ClassVar[str] = "between"
    start: Attachment
    end: Attachment
    radius: Formula
    rest: Formula | None = None


@dataclass(frozen=True)
class Over:
    """The way of a rope or a belt over points and discs: see `Cord`. Its lines are this way."""

    kind: ClassVar[str] = "over"
    stops: tuple[Attachment, ...]
    radii: tuple[Formula, ...]
    closed: bool


@dataclass(frozen=True)
class Along:
    """x is along an axis of a body, y across it in the picture, z across both; all of `radius`."""

    kind: ClassVar[str] = "along"
    at: Attachment
    body: int
    axis: Vector
    radius: Formula


@dataclass(frozen=True)
class Turned:
    """x and y are unit vectors in a body's axes, of `radius`."""

    kind: ClassVar[str] = "turned"
    at: Attachment
    body: int
    x: Vector
    y: Vector
    radius: Formula


@dataclass(frozen=True)
class Facing:
    """x and y are to the right and up in the picture, of `radius`."""

    kind: ClassVar[str] = "facing"
    at: Attachment
    radius: Formula


@dataclass(frozen=True)
class Arrows:
    """Arrows of `vectors`, whose middles are `points`; the longest is as long as `length`, m."""

    kind: ClassVar[str] = "arrows"
    points: tuple[Vector, ...]
    vectors: tuple[Vector, ...]
    length: Formula


@dataclass(frozen=True)
class Mark:
    """A symbol in a frame.

    layer  behind all bodies, behind them at the last time, in front of them, or with the fixed
           things behind all, which a view need not hold
    """

    frame: Between | Over | Along | Turned | Facing | Arrows
    symbol: Symbol
    layer: Literal["fixed", "back", "middle", "front"] = "front"


def marks_of(picture: Picture) -> Iterator[Mark]:
    """What a picture shows of its elements, with formulas as it has."""
    for element in picture.elements:
        yield from _marks(picture, element)


def _marks(picture: Picture, element: Element) -> Iterator[Mark]:
    size = picture.size
    match element:
        case Link():
            rest = element.rest if element.kind == "rope" else None
            between = Between(element.start, element.end, element.radius, rest)
            yield Mark(between, symbols.link(element.kind, _dimensions(picture)))
            for end in (element.start, element.end) if element.kind != "pull" else ():
                yield Mark(Facing(end, element.radius), symbols.END)
        case Cord():
            yield Mark(Over(element.stops, element.radii, element.closed), symbols.CORD)
            for end, radius in (
                () if element.closed else zip(element.stops, element.radii, strict=True)
            ):
                if end in (element.stops[0], element.stops[-1]) and radius == ZERO:
                    yield Mark(Facing(end, Constant(0.04 * size)), symbols.END)
        case AtJoint():
            yield from _at_joint(picture, element, picture.joints[element.joint])
        case Support(kind="base"):
            down = constant(*[0.0] * (_dimensions(picture) - 1), -1.0)
            at, axis = Attachment(element.body, element.at), element.axis or down
            yield Mark(Along(at, element.body, axis, element.radius), symbols.BASE, "middle")
        case Support(axis=axis, low=low, high=high) if axis and low and high:
            ends = (sum_of(element.at, _times(limit, axis)) for limit in (low, high))
            start, end = (Attachment(element.body, at) for at in ends)
            yield Mark(Between(start, end, element.radius), symbols.RAIL, "back")
        case Round():
            yield from _round(element, size)
        case Heights():
            yield from (_ground(line, _dimensions(picture)) for line in element.lines)
        case Plane(body=body) if body != WORLD_INDEX:
            at = Attachment(body, _times(element.offset, element.normal))
            x, y = _along(element.normal)
            symbol = symbols.SQUARE if len(element.normal) == 3 else symbols.EDGE
            yield Mark(Turned(at, body, x, y, Constant(size)), symbol, "back")
        case Field(center=tuple() as center) | Attraction(center=center):
            at = Attachment(WORLD_INDEX, center)
            yield Mark(Facing(at, Constant(size)), symbols.CENTRE)
        case Field(points=(_, _, *_)):
            places = np.array([numbers(point) for point in element.points])
            apart = float(np.linalg.norm(places[1:] - places[0], axis=1).min())
            arrows = Arrows(element.points, element.forces, Constant(0.8 * apart))
            yield Mark(arrows, symbols.ARROW, "back")
        case Wind(velocity=tuple() as velocity):
            at = Attachment(WORLD_INDEX, element.at)
            along = Along(at, WORLD_INDEX, velocity, Constant(0.3 * size))
            yield Mark(along, symbols.WIND, "back")
        case Pull():
            at = Attachment(element.body, element.at)
            yield Mark(Facing(at, Constant(0.03 * size)), symbols.ring(1.0))


def _ground(line: GroundLine, dimensions: int) -> Mark:
    """A line of the ground: x along it, y up. In the plane all that is below is ground."""
    at = [0.0] * dimensions
    if dimensions == 3:
        at[1 - line.axis] = line.across
    along, up = (constant(*np.eye(dimensions)[k]) for k in (line.axis, dimensions - 1))
    origin = Attachment(WORLD_INDEX, constant(*at))
    frame = Turned(origin, WORLD_INDEX, along, up, Constant(1.0))
    fill = symbols.GROUND if dimensions == 2 else None
    return Mark(frame, (symbols.Line(line.points, ink=0.4, fill=fill),), "fixed")


def _at_joint(picture: Picture, element: AtJoint, joint: DrawnJoint) -> Iterator[Mark]:
    """At the pin of a joint, or along its axis."""
    pin, parent = Attachment(joint.parent, joint.at_parent), joint.parent
    carriage, axis = Attachment(joint.child, joint.at_child), None
    if joint.axis is not None and _slides(element, joint):
        axis = joint.axis[: _dimensions(picture)]
    elif element.kind != "stop":
        axis = _straight(element, joint, _dimensions(picture))
    limits = tuple(limit for limit in (element.low, element.high) if limit is not None)
    if element.kind == "stop":
        if axis is not None:
            for limit in limits:
                at = Attachment(parent, sum_of(joint.at_parent, _times(limit, axis)))
                yield Mark(Along(at, parent, axis, element.radius), symbols.TICK)
        elif joint.across is not None:
            yield Mark(Turned(pin, parent, *joint.across, element.radius), symbols.stop(limits))
    elif axis is not None:
        symbol = symbols.at_slider(element.kind, _dimensions(picture))
        yield Mark(Along(carriage, parent, axis, element.radius), symbol)
    elif joint.across is not None:
        frame = Turned(pin, parent, *joint.across, element.radius)
        yield Mark(frame, symbols.at_pin(element.kind))
    else:
        at = carriage if joint.type in ("prismatic", "cylindrical", "planar") else pin
        yield Mark(Facing(at, element.radius), symbols.at_pin(element.kind))


def _slides(element: AtJoint, joint: DrawnJoint) -> bool:
    """Whether the coordinate of an element is a displacement along the joint's axis."""
    return joint.type == "prismatic" or (joint.type == "cylindrical" and not element.coordinate)


def _straight(element: AtJoint, joint: DrawnJoint, dimensions: int) -> Vector | None:
    """The axis of the parent along which a coordinate of a particle, or of a planar joint in the
    plane, is a displacement; None if it is none.
    """
    planar = joint.type == "planar" and dimensions == 2
    count = dimensions if joint.type == "particle" else 2 if planar else 0
    k = element.coordinate
    return constant(*np.eye(dimensions)[k]) if k < count else None


def _round(ball: Round, size: float) -> Iterator[Mark]:
    """A circle; of a wheel with spokes, about its axis."""
    at, least = Attachment(ball.body, ball.at), Constant(SMALL * size)
    radius: Formula = Apply("max", (ball.radius, least))
    if isinstance(ball.radius, Constant):
        radius = Constant(max(ball.radius.value, least.value))
    if ball.kind == "gear":
        x, y = constant(1.0, 0.0), constant(0.0, 1.0)
        symbol = symbols.gear(ball.teeth, ball.ring, ball.phase)
        yield Mark(Turned(at, ball.body, x, y, ball.radius), symbol, "back")
        return
    if ball.kind == "wheel":
        x, y = _across(ball.axis) if ball.axis else (constant(1.0, 0.0), constant(0.0, 1.0))
        yield Mark(Turned(at, ball.body, x, y, radius), symbols.WHEEL)
        return
    if ball.body >= 0:
        yield Mark(Facing(at, radius), symbols.BALL)
        return
    surface = symbols.SOLID if ball.reach is None else symbols.SURFACE
    yield Mark(Facing(at, radius), surface, "fixed")
    if ball.reach is not None:
        reach = Facing(at, sum_of((ball.radius,), (ball.reach,))[0])
        yield Mark(reach, symbols.REACH, "fixed")


def _along(normal: Vector) -> tuple[Vector, Vector]:
    """Unit vectors along a plane; in the plane the second is its normal."""
    if len(normal) == 2:
        x, y = normal
        return (y, times(-1.0, x)), normal
    return _across(normal)


def _across(axis: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors across an axis and each other."""
    along = np.array(numbers(axis))
    aside = np.cross(np.eye(3)[np.argmin(np.abs(along))], along)
    aside = aside / np.linalg.norm(aside)
    return constant(*aside), constant(*np.cross(along, aside))


def _times(factor: Formula, vector: Vector) -> Vector:
    """A vector times a quantity."""
    if isinstance(factor, Constant):
        return scaled(factor.value, vector)
    return tuple(Apply("*", (factor, part)) for part in vector)


def _dimensions(picture: Picture) -> int:
    return len(picture.joints[0].at_parent)
