"""Straight spans of ropes between points and discs, and what ropes take of discs that turn.

A disc that a rope goes round counterclockwise has its centre on the left of the rope. With the
signed radius ρ, positive in this sense, the unit vector u along the rope and n to the left of it,
the tangent point is c - ρ n. From one disc to the next d = c' - c = L u + h n with h = ρ' - ρ, so
the span is L = sqrt(d·d - h²).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from eomgen.language.formula import ZERO, Formula
from eomgen.language.rewriting import times
from eomgen.scalars import exact
from eomgen.scene.effects.base import Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.elements import (
    WORLD_INDEX,
    Attachment,
    Cord,
    Element,
    Layout,
    Link,
    Round,
)
from eomgen.scene.effects.vectors import dot, nearest_square, negative, sub


@dataclass(frozen=True)
class Stop:
    """A point that a rope meets, from the centre of mass in body axes, or a disc about it.

    left   whether the disc is on the left of the rope, which goes round it counterclockwise
    grips  whether the disc takes the rope along
    """

    body: str
    at: tuple[Formula, ...]
    radius: Formula | None = None
    left: bool = True
    grips: bool = False


def drawn(
    effect: str, stops: Sequence[Stop], rest: Formula | None, layout: Layout
) -> Iterator[Element]:
    """What pictures show of a rope over stops, which hangs down if it is longer than its way and
    runs between two points, and of the discs of the world.
    """
    places = [Attachment(layout.bodies[stop.body], stop.at) for stop in stops]
    for stop, place in zip(stops, places, strict=True):
        if stop.radius is not None and place.body == WORLD_INDEX:
            yield Round("ball", effect, place.body, place.at, stop.radius)
    if len(stops) == 2 and not any(stop.radius for stop in stops):
        yield Link("rope", effect, places[0], places[1], rest, layout.symbol)
        return
    radii = (ZERO if s.radius is None else times(1.0 if s.left else -1.0, s.radius) for s in stops)
    yield Cord(effect, tuple(places), tuple(radii))


@dataclass(frozen=True)
class Span:
    """A straight part: its length, m, its unit direction, world axes, and the square of its length
    relative to the distance of the discs' centres; None between points.
    """

    length: Scalar
    direction: Vector
    share: Scalar | None = None


def spans_of(mechanism: Mechanism, stops: Sequence[Stop], *, near: bool = False) -> list[Span]:
    """The spans between stops. Points that may come `near` each other keep a direction there."""
    centres = [mechanism.position(stop.body, _at(mechanism, stop)) for stop in stops]
    radii = [_signed(mechanism, stop) for stop in stops]
    found = []
    for k in range(len(stops) - 1):
        d = mechanism.called("d", *sub(centres[k + 1], centres[k]))
        square = dot(d, d)
        if near:
            square = mechanism.call("max", square, nearest_square(mechanism))
        found.append(_span(mechanism, d, square, radii[k], radii[k + 1]))
    return found


def _at(mechanism: Mechanism, stop: Stop) -> Vector:
    return tuple(map(mechanism.value, stop.at))


def _signed(mechanism: Mechanism, stop: Stop) -> Scalar | None:
    """ρ of a disc; None for a point."""
    if stop.radius is None:
        return None
    radius = mechanism.value(stop.radius)
    return radius if stop.left else -radius


def _span(
    mechanism: Mechanism, d: Vector, square: Scalar, start: Scalar | None, end: Scalar | None
) -> Span:
    """The tangent of two discs whose centres are apart by d, with |d|² = `square`; points are discs
    without a radius.
    """
    if start is None and end is None:
        (length,) = mechanism.called("s", mechanism.call("sqrt", square))
        return Span(length, mechanism.called("u", *(x / length for x in d)))
    nothing = mechanism.zero
    h = (nothing if end is None else end) - (nothing if start is None else start)
    left = square - h * h
    (length,) = mechanism.called("s", mechanism.call("sqrt", left))
    x, y = d
    along = ((length * x + h * y) / square, (length * y - h * x) / square)
    return Span(length, mechanism.called("u", *along), left / square)


def _angle(mechanism: Mechanism, one: Vector, other: Vector) -> Scalar:
    """The angle from one direction to another, in (-π, π], rad."""
    return mechanism.call("atan2", one[0] * other[1] - one[1] * other[0], dot(one, other))


def _arc(mechanism: Mechanism, stop: Stop, before: Span, after: Span) -> Scalar:
    """The arc on a disc between two spans, less than a turn, m."""
    u, w = before.direction, after.direction
    one, other = (u, w) if stop.left else (w, u)
    half = mechanism.number(exact.quarter_turns(2, 0.0))
    assert stop.radius is not None
    turn = half + mechanism.call("atan2", one[1] * other[0] - one[0] * other[1], -dot(one, other))
    return mechanism.value(stop.radius) * turn


def way_of(mechanism: Mechanism, stops: Sequence[Stop], spans: Sequence[Span]) -> Scalar:
    """The length of spans and of the arcs on the discs between them, m."""
    total = spans[0].length
    for stop, before, after in zip(stops[1:-1], spans, spans[1:], strict=False):
        if stop.radius is not None:
            total = total + _arc(mechanism, stop, before, after)
        total = total + after.length
    return total


def margin_of(
    mechanism: Mechanism,
    stops: Sequence[Stop],
    spans: Sequence[Span],
    directions: Sequence[tuple[float, ...]],
) -> Scalar | None:
    """How far the way is from its end, at most 1: the product of what becomes 0 where a span has no
    length, where the rope leaves a disc or has gone round it once, and where it leaves one that
    takes it along against the direction of the start. None between points.
    """
    half, one = mechanism.number(0.5), mechanism.number(1.0)
    parts = [span.share for span in spans if span.share is not None]
    for stop, before, after in zip(stops[1:-1], spans, spans[1:], strict=False):
        if stop.radius is not None:
            parts.append(half * (one - dot(before.direction, after.direction)))
    for k, span in enumerate(spans):
        if any(stop.grips for stop in stops[k : k + 2]):
            along = tuple(map(mechanism.number, directions[k]))
            parts.append(half * (one + dot(along, span.direction)))
    margin: Scalar | None = None
    for part in parts:
        margin = part if margin is None else margin * part
    return margin


def section_of(
    mechanism: Mechanism,
    stops: Sequence[Stop],
    spans: Sequence[Span],
    angles: Mapping[str, Scalar],
    directions: Sequence[tuple[float, ...]],
) -> tuple[Scalar, tuple[Load, ...]]:
    """The length that a section takes, whose first and last stop may take the rope along, m; and
    the loads of a tension of 1.

    A disc at angle θ from which the rope leaves in a direction at φ from that of the start has let
    go ρ (θ - φ) of it since then.
    """
    total = way_of(mechanism, stops, spans)
    torques: list[Vector] = [(), ()]
    for k, (stop, span) in enumerate(((stops[0], spans[0]), (stops[-1], spans[-1]))):
        radius = _signed(mechanism, stop)
        if not stop.grips or radius is None:
            continue
        along = tuple(map(mechanism.number, directions[-k]))
        turned = _angle(mechanism, along, span.direction) - angles[stop.body]
        total = total - radius * turned if k else total + radius * turned
        torques[k] = (-radius,) if k else (radius,)
    loads = []
    for k, span in enumerate(spans):
        ends = zip(
            (stops[k], stops[k + 1]), (span.direction, negative(span.direction)), strict=True
        )
        for n, (stop, pull) in enumerate(ends):
            torque = torques[n] if k == (len(spans) - 1) * n else ()
            loads.append(Load(stop.body, pull, _at(mechanism, stop), "applied", torque))
    return total, tuple(loads)
