"""Which pairs of a robot's shapes may touch each other: not too many, the nearest at the start."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eomgen.language.formula import Formula, evaluate
from eomgen.scalars.exact import Real
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.base import Vector
from eomgen.scene.effects.contact_shapes import ContactShape
from eomgen.scene.effects.nearest import between

Array = npt.NDArray[np.float64]
Table = dict[str, Any]
Pose = tuple[Array, Array]

MOST_PAIRS = 200
"""Greatest number of pairs of shapes that touch each other."""
ROUNDING = 0.25
"""Radius of a box among them as a part of its smallest half size."""


@dataclass(frozen=True)
class Part:
    """A shape of a body: what of it touches planes, and what touches others, None for nothing."""

    body: str
    kind: str
    shapes: Sequence[Table]
    core: Table | None


def part(body: str, kind: str, shapes: Sequence[Table]) -> Part:
    """A part by its shapes against planes. Boxes are rounded within; of a cylinder that is longer
    than wide it is the capsule within; other shapes do not touch each other.
    """
    first, last = shapes[0], shapes[-1]
    core: Table | None = None
    if "half_sizes" in first:
        radius = ROUNDING * min(first["half_sizes"])
        half = [size - radius for size in first["half_sizes"]]
        core = first | {"half_sizes": half, "radius": first.get("radius", 0.0) + radius}
    elif kind == "cylinder":
        core = _capsule_within(first, last)
    elif not ("semi_axes" in first or "vertices" in first):
        core = first
    return Part(body, kind, shapes, core)


def _capsule_within(first: Table, last: Table) -> Table | None:
    """The capsule within a cylinder of two rims; None if it is shorter than wide."""
    radius, _, thick = first["semi_axes"]
    start, end = np.array(first["at"]), np.array(last["at"])
    length = float(np.linalg.norm(end - start))
    inward = (end - start) / length * (radius - thick)
    if length + 2 * thick <= 2 * radius:
        return None
    ends = {"at": (start + inward).tolist(), "end": (end - inward).tolist()}
    return {**ends, "radius": radius + first.get("radius", 0.0)}


def nearest_pairs(
    cores: Sequence[tuple[str, Table]],
    pairs: Iterable[tuple[int, int]],
    poses: Mapping[str, Pose],
    wanted: Callable[[float], bool],
) -> tuple[list[tuple[int, int]], int, int]:
    """At most `MOST_PAIRS` pairs of shapes of bodies, the nearest in the bodies' poses, of which
    the gap, m, is wanted; how many are not wanted, and how many are left out as too many.
    """
    still: Any = _AtRest(poses)
    balls = [_ball(still, body, table) for body, table in cores]
    solids: Any = [
        ContactShape.model_validate({"body": body, **table}).solid(still) for body, table in cores
    ]

    def apart(pair: tuple[int, int]) -> float:
        (first, a), (second, b) = (balls[i] for i in pair)
        return math.dist(first, second) - a - b

    found, unwanted = list[tuple[int, int]](), 0
    ordered = sorted(pairs, key=apart)
    for i, j in ordered:
        gap = min(float(touch.gap) for touch in between(still, solids[i], solids[j]))
        if not wanted(gap):
            unwanted += 1
        elif len(found) < MOST_PAIRS:
            found.append((i, j))
        else:
            break
    return sorted(found), unwanted, len(ordered) - unwanted - len(found)


def _ball(still: Any, body: str, table: Table) -> tuple[Vector, float]:
    """A ball about a shape: its centre in the world and radius, m."""
    at = np.array(table["at"])
    end = np.array(table.get("end", at))
    half = np.linalg.norm(table.get("half_sizes", 0.0)) + np.linalg.norm(end - at) / 2
    return still.position(body, ((at + end) / 2).tolist()), float(half) + table.get("radius", 0.0)


class _AtRest:
    """What contacts read of a mechanism, of bodies in given poses, over floats."""

    dimensions, zero, magnitude = 3, 0.0, 1.0

    def __init__(self, poses: Mapping[str, Pose]) -> None:
        self._poses = poses

    def position(self, body: str, at: Vector) -> Vector:
        turn, place = self._poses[body]
        return tuple((turn @ np.array(at) + place).tolist())

    def outward(self, body: str, vector: Vector) -> Vector:
        return tuple((self._poses[body][0] @ np.array(vector)).tolist())

    def value(self, formula: Formula) -> float:
        return float(evaluate(formula, {}, FloatScalars()))

    def number(self, value: Real) -> float:
        return float(value)

    def call(self, function: str, *arguments: float) -> float:
        return FloatScalars().call(function, *arguments)

    def called(self, letter: str, *values: float) -> Vector:
        return values
