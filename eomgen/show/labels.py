"""Places of labels in a sketch: near where they belong, and not over lines or each other."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from eomgen.show.drawing import Arc, Dot, Drawing, Item, Label, Point
from eomgen.show.layout import size_of

Points = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""Left, low, right, high."""

LETTER, WIDTH, HEIGHT = 8.0, 6.5, 13.0
"""The width of a letter of a word, and of half an M of a formula; the height of a line."""
STEP = 3.0
"""The distance of the points by which strokes are compared with boxes."""
RINGS, DIRECTIONS = (9.0, 18.0, 27.0, 36.0), 12
"""How far from its own place, and in how many directions, a label is tried."""
OUTSIDE, OVER_LABEL, OVER_STROKE, AWAY = 200.0, 25.0, 2.0, 0.15
"""What a place costs: beyond the frame, over a label, for each point of a stroke, for distance."""


def with_clear_labels(drawing: Drawing) -> Drawing:
    """The drawing with labels where they cover least; those of lists stay."""
    strokes = np.array([p for item in drawing.items for p in _points(item)]).reshape(-1, 2)
    placed = [_box(x, x.at) for x in drawing.items if isinstance(x, Label) and x.start]

    def clear(item: Item) -> Item:
        if not isinstance(item, Label) or item.start:
            return item
        at = min(_places(item), key=lambda p: _cost(item, p, strokes, placed, drawing))
        placed.append(_box(item, at))
        return replace(item, at=at)

    return replace(drawing, items=tuple(map(clear, drawing.items)))


def _points(item: Item) -> Iterator[Point]:
    """Points of what is drawn, `STEP` from each other."""
    if isinstance(item, Label):
        return
    if isinstance(item, Dot):
        x, y, r = *item.centre, item.radius
        turns = (2 * math.pi * i / 12 for i in range(12))
        yield from ((x + r * math.cos(a), y + r * math.sin(a)) for a in turns)
        return
    corners = item.points() if isinstance(item, Arc) else item.points
    for (ax, ay), (bx, by) in pairwise(corners):
        n = max(1, math.ceil(math.hypot(bx - ax, by - ay) / STEP))
        yield from ((ax + (bx - ax) * i / n, ay + (by - ay) * i / n) for i in range(n + 1))


def _places(label: Label) -> Iterator[Point]:
    """Its own place, and rings around it: circles, and ellipses by half its width wider."""
    left, _, right, _ = _box(label, label.at)
    x, y = label.at
    yield x, y
    for ring, more in product(RINGS, (0.0, (right - left) / 2)):
        for i in range(DIRECTIONS):
            a = 2 * math.pi * i / DIRECTIONS
            yield x + (ring + more) * math.cos(a), y + ring * math.sin(a)


def _box(label: Label, at: Point) -> Box:
    text = label.text
    wide = LETTER * len(text) if isinstance(text, str) else WIDTH * size_of(text)
    left = at[0] if label.start else at[0] - wide / 2
    return left, at[1] - HEIGHT / 2, left + wide, at[1] + HEIGHT / 2


def _cost(
    label: Label, at: Point, strokes: Points, placed: Sequence[Box], drawing: Drawing
) -> float:
    """How bad a place is."""
    left, low, right, high = _box(label, at)
    cost = AWAY * math.hypot(at[0] - label.at[0], at[1] - label.at[1])
    if left < 0 or low < 0 or right > drawing.width or high > drawing.height:
        cost += OUTSIDE
    x, y = strokes[:, 0], strokes[:, 1]
    cost += OVER_STROKE * int(((x > left) & (x < right) & (y > low) & (y < high)).sum())
    over = (a < right and c > left and b < high and d > low for a, b, c, d in placed)
    return cost + OVER_LABEL * sum(over)
