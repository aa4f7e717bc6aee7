"""The sizes and teeth of wheels that turn each other, for pictures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.scene.effects.elements import Layout, Vector

FEWEST, MOST = 10, 100
"""Teeth of the smaller gear, and most teeth of a gear, in pictures of gears that have a ratio."""


@dataclass(frozen=True)
class Wheel:
    """A wheel about the point `at` of its body: its radius, m, and the direction from its centre to
    where it meets the other one, rad, in the plane from the carrier's x axis.
    """

    body: str
    at: Vector
    radius: float
    meets: float = 0.0
    ring: bool = False


def meshed(
    layout: Layout,
    bodies: tuple[str, str],
    carrier: str,
    ratio: float,
    radius: float | None,
    opposed: bool,
) -> list[Wheel]:
    """Two wheels whose axes a carrier holds. Without the `radius` of the first one, they meet
    between their axes, or the larger one is a ring around the other. None if there is no such size.
    """
    axles = [layout.axle(body, carrier) for body in bodies]
    if axles[0] is None or axles[1] is None:
        return []
    (own, one), (own_2, other) = axles[0], axles[1]
    apart = [layout.value(b) - layout.value(a) for a, b in zip(one, other, strict=True)]
    distance = math.hypot(*apart)
    if radius is None:
        parts = 1 + ratio if opposed else abs(1 - ratio)
        radius = distance / parts if parts else 0.0
    if not (math.isfinite(radius) and radius > 0):
        return []
    along = math.atan2(apart[1], apart[0])
    sizes, rings = (radius, ratio * radius), (not opposed and ratio < 1, not opposed and ratio > 1)
    back = along + math.pi
    meets = (along, back) if opposed else (along, along) if rings[0] else (back, back)
    return [
        Wheel(body, at, size, angle, ring)
        for body, at, size, angle, ring in zip(
            bodies, (own, own_2), sizes, meets, rings, strict=True
        )
    ]


def teeth_of(given: Sequence[float], ratio: float) -> tuple[int, int]:
    """The numbers of teeth as they are given, or numbers of nearly that ratio."""
    if given and max(given) <= MOST and all(x == round(x) >= 3 for x in given):
        return round(given[0]), round(given[1])
    step = max(ratio, 1 / ratio) if 0 < ratio < math.inf else 1.0
    few = range(FEWEST, max(FEWEST + 1, min(3 * FEWEST, int(MOST / step) + 1)))
    least = min(few, key=lambda n: (round(abs(n * step - round(n * step)), 9), n))
    counts = least, min(round(least * step), MOST)
    return counts if ratio >= 1 else counts[::-1]
