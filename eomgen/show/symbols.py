"""Unit symbols: what springs, motors, contacts and the like look like, once for all pictures.

A symbol is lines in a frame that `marks` places: x and y, and z where it is not flat.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from eomgen.language.formula import Apply, Constant, Formula
from eomgen.language.rewriting import difference, times, total
from eomgen.scene.look import number

Points = tuple[tuple[float | Formula, ...], ...]
Flat = tuple[tuple[float, ...], ...]

COILS = 7
"""Turns of a coil."""
ROUND = 12
"""Points of a turn in space."""
TURNS = 1.75
"""Turns of the spiral of a torsion spring."""
GROUND = 0.08
"""Strength of the inside of what is fixed."""
LEAD = 0.12
"""Straight part at each end of a coil or damper, relative to its length."""


@dataclass(frozen=True)
class Line:
    """A line of a symbol.

    weight  width relative to that of an ordinary line
    ink     strength, from 0 to 1
    fill    strength of its inside, 0 for paper, and of all that is below it if it is open; None: it
            has none
    dashed  whether it shows something that is no thing
    """

    points: Points
    weight: float = 1.0
    ink: float = 0.75
    fill: float | None = None
    dashed: bool = False


Symbol = tuple[Line, ...]


def arc(radius: float = 1.0, start: float = 0.0, stop: float = 2.0, count: int = 48) -> Flat:
    """Points (count + 1) of an arc, between angles in half turns."""
    angles = (math.pi * (start + (stop - start) * i / count) for i in range(count + 1))
    return tuple((_short(radius * math.cos(a)), _short(radius * math.sin(a))) for a in angles)


def numbers_of(point: tuple[float | Formula, ...]) -> tuple[float, ...]:
    """A point of a symbol without names in its formulas."""
    return tuple(x if isinstance(x, float) else number(x) for x in point)


def _short(x: float) -> float:
    """A number of few digits, for pages."""
    return round(x, 4) + 0.0


EDGE: Symbol = (Line(((-1.0, 0.0), (1.0, 0.0)), 1.4),)
SQUARE: Symbol = (Line(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0))),)
"""Of a plane that moves, seen in the plane and in space."""


def ring(radius: float, weight: float = 1.0) -> Symbol:
    """A circle that is filled with paper."""
    return (Line(arc(radius, count=24), weight, fill=0.0),)


# ---- Between two points: x from 0 to 1, y and z in radii ----


def _coil(dimensions: int, side: float = 0.0, high: float = 1.0) -> Flat:
    """A zigzag, in space a helix, at a distance `side` from the middle."""
    turn, flat = (ROUND, (0.0,)) if dimensions == 3 else (2, ())
    count = COILS * turn
    middle = []
    for i in range(count):
        angle = 2 * math.pi * (i + 0.5) / turn
        along = LEAD + (1 - 2 * LEAD) * (i + 0.5) / count
        aside = (side + high * math.sin(angle), high * math.cos(angle))
        middle.append(tuple(map(_short, (along, *aside[: dimensions - 1]))))
    ends = ((0.0, 0.0, *flat), (0.8 * LEAD, 0.0, *flat), (LEAD, side, *flat))
    return (*ends, *middle, *((1 - x, *rest) for x, *rest in reversed(ends)))


def _damper(side: float = 0.0, wide: float = 0.8) -> Symbol:
    """A cylinder, open to the second end, with a piston on a rod."""
    left, right, piston = 0.32, 0.68, 0.52
    inner = 0.8 * wide
    lines: tuple[Points, ...] = (
        ((0.0, 0.0), (LEAD * 0.8, 0.0), (LEAD, side), (left, side)),
        ((right, side + wide), (left, side + wide), (left, side - wide), (right, side - wide)),
        ((piston, side + inner), (piston, side - inner)),
        ((piston, side), (1 - LEAD, side), (1 - LEAD * 0.8, 0.0), (1.0, 0.0)),
    )
    return tuple(Line(points, 1.1) for points in lines)


@cache
def link(kind: str, dimensions: int) -> Symbol:
    """A spring, a damper, both side by side, a rope, or a pull."""
    if kind in ("rope", "pull"):
        along = tuple((i / 24, 0.0) for i in range(25))
        return (Line(along, 1.1) if kind == "rope" else Line(along, 0.6, 0.35, dashed=True),)
    if kind == "spring_damper":
        return (Line(_coil(dimensions, 0.9, 0.6), 1.1), *_damper(-0.9, 0.55))
    return _damper() if kind == "damper" else (Line(_coil(dimensions), 1.1),)


END = ring(0.22)
"""Where a link is held."""
ARROW: Symbol = (
    Line(((0.0, 0.0), (1.0, 0.0)), 0.7, 0.5),
    Line(((0.7, 0.15), (1.0, 0.0), (0.7, -0.15)), 0.7, 0.5),
)
RAIL: Symbol = (Line(((0.0, 0.0), (1.0, 0.0)), 1.6, 0.5),)

# ---- Along an axis, both x and y in radii ----

BASE: Symbol = (
    Line(((0.0, 0.0), (1.0, -0.75), (1.0, 0.75), (0.0, 0.0)), fill=0.0),
    Line(((1.0, -1.3), (1.0, 1.3)), 1.3),
    *(Line(((1.0, -1.1 + 0.4 * i), (1.45, -1.5 + 0.4 * i)), 0.6) for i in range(7)),
)
"""The ground, towards which x points."""
TICK: Symbol = (Line(((0.0, -1.0), (0.0, 1.0)), 2.0, 0.5),)
"""A limit of a slider."""
WIND: Symbol = tuple(
    Line(points, 1.2)
    for aside, ahead in ((-0.7, -0.2), (0.0, 0.2), (0.7, -0.2))
    for points in (
        ((ahead - 1, aside), (ahead + 1, aside)),
        ((ahead + 0.4, aside + 0.3), (ahead + 1, aside), (ahead + 0.4, aside - 0.3)),
    )
)


def at_slider(kind: str, dimensions: int) -> Symbol:
    """What acts along a slider: a spring, pads on both sides, or an arrow beside it."""
    if kind == "torsion":
        points = _coil(dimensions, high=0.4)
        return (Line(tuple((2.4 * x - 1.2, *aside) for x, *aside in points)),)
    if kind == "brake":
        return tuple(Line(((-0.6, side), (0.6, side)), 2.0) for side in (-0.6, 0.6))
    arrow = (
        Line(((-1.2, 1.0), (1.2, 1.0)), 1.3),
        Line(((0.8, 1.3), (1.2, 1.0), (0.8, 0.7)), 1.3),
    )
    return (*arrow, *DOT) if kind == "servo" else arrow


CORD: Symbol = (Line(((0.0, 0.0), (1.0, 0.0)), 1.3),)
"""A rope on its way, or a belt."""

# ---- Around a point, in radii ----


def toothed(teeth: int, ring: bool = False, phase: float = 0.0) -> Flat:
    """The outline of a gear of pitch radius 1, with a tooth at the angle `phase`, rad; of a ring,
    whose teeth are inside, with a gap there.
    """
    high, low, pitch = 1 + 1.7 / teeth, 1 - 2.1 / teeth, 2 * math.pi / teeth
    if ring:
        low, high = 1 - 1.7 / teeth, 1 + 2.1 / teeth
    corners = ((-0.3, low), (-0.11, high), (0.11, high), (0.3, low))
    points = [
        (radius * math.cos(angle), radius * math.sin(angle))
        for k in range(teeth)
        for part, radius in corners
        for angle in [phase + pitch * (k + part)]
    ]
    return tuple((_short(x), _short(y)) for x, y in (*points, points[0]))


def gear(teeth: int, ring: bool, phase: float) -> Symbol:
    """A gear that is no shape of a body; a ring has a rim."""
    rim = (Line(arc(1 + 5 / teeth), 1.0, 0.6),) if ring else ()
    return (*rim, Line(toothed(teeth, ring, phase), 1.0, 0.6))


DOT = ring(0.15)
TORSION: Symbol = (
    Line(
        tuple(
            (r * x, r * y)
            for i, (x, y) in enumerate(arc(1.0, 0.0, 2 * TURNS, 60))
            for r in [0.25 + 0.75 * i / 60]
        )
    ),
)
BRAKE: Symbol = tuple(Line(arc(0.8, side - 0.25, side + 0.25, 12), 2.0) for side in (0.0, 1.0))
_ROUND_ARROW = arc(1.0, 0.35, 1.9, 40)
_x, _y = _ROUND_ARROW[-1]
MOTOR: Symbol = (
    Line(_ROUND_ARROW, 1.3),
    Line(
        tuple(
            (_x + out * _x + back * _y, _y + out * _y - back * _x)
            for out, back in ((-0.3, 0.35), (0.0, 0.0), (0.3, 0.35))
        ),
        1.3,
    ),
)
"""A round arrow."""
CENTRE: Symbol = (
    *ring(0.25, 1.4),
    *(Line(arc(radius, count=120), 0.6, dashed=True) for radius in (0.5, 0.75)),
)
"""A point within rings."""
BALL: Symbol = (Line(arc(), 0.8, 0.45),)
SURFACE: Symbol = (Line(arc(), 0.8, 0.4),)
"""The surface of an obstacle."""
SOLID: Symbol = (Line(arc(), 0.8, 0.4, fill=GROUND),)
"""A fixed ball."""
REACH: Symbol = (Line(arc(count=120), 0.8, 0.3, dashed=True),)
WHEEL: Symbol = (
    *BALL,
    *(
        Line(tuple((sign * x, sign * y) for sign in (-1, 1)), 0.6, 0.45)
        for x, y in arc(1.0, 0.0, 2 / 3, 2)
    ),
)


def at_pin(kind: str) -> Symbol:
    """What acts about a pin."""
    if kind == "servo":
        return (*MOTOR, *DOT)
    return {"torsion": TORSION, "brake": BRAKE}.get(kind, MOTOR)


def stop(limits: Sequence[Formula]) -> Symbol:
    """Ticks at the limits of a pin, and an arc between two of them; angles are from x."""
    rays = tuple(
        Line(tuple(_at(limit, radius) for radius in (1.0, 1.9)), 2.0, 0.5) for limit in limits
    )
    if len(limits) < 2:
        return rays
    low, span = limits[0], difference(limits[1], limits[0])
    angles = (total(low, times(i / 40, span)) for i in range(41))
    return (*rays, Line(tuple(_at(angle, 1.45) for angle in angles), 0.7, 0.5, dashed=True))


def _at(angle: Formula, radius: float) -> tuple[float | Formula, ...]:
    """The point of a circle at an angle."""
    if isinstance(angle, Constant):
        return (radius * math.cos(angle.value), radius * math.sin(angle.value))
    return tuple(times(radius, Apply(function, (angle,))) for function in ("cos", "sin"))
