"""Places of labels in a sketch: near where they belong, and not over lines or each other."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from eomgen.show.drawing import STYLES, Arc, Dot, Drawing, Item, Label, arrow_head
from eomgen.show.layout import size_of
from eomgen.show.notation import parsed

Array = NDArray[np.float64]

LETTER, WIDTH = 8.0, 6.5
"""The width of a letter of a word, and of half an M of a formula."""
ABOVE, BELOW, INDEX, ASIDE = 7.0, 7.0, 4.0, 2.0
"""How far a text reaches from its middle; how much lower, if it has an index; beside a formula."""
STEP = 3.0
"""The distance of the points by which strokes are compared with boxes."""
RINGS, DIRECTIONS = (6.0, 12.0, 18.0, 27.0, 36.0, 48.0), 16
"""How far from its own place, and in how many directions, a label is tried."""
OUTSIDE, OVER_LABEL, OVER_STROKE, AWAY = 200.0, 25.0, 2.0, 0.15
"""What a place costs: beyond the frame, over a label, for each point of a stroke, for distance."""
PASSES = 4
"""How often each label is put where it costs least among the others."""


def with_clear_labels(drawing: Drawing) -> Drawing:
    """The drawing with labels where they cover least; those of lists stay."""
    strokes = stroke_points(drawing.items)
    labels = {k: item for k, item in enumerate(drawing.items) if isinstance(item, Label)}
    places = {k: _places(label) for k, label in labels.items() if not label.start}
    costs = {k: _costs(labels[k], at, strokes, drawing) for k, at in places.items()}
    placed = {k: _boxes(x, np.array([x.at]))[0] for k, x in labels.items() if x.start}
    chosen: dict[int, int] = {}
    for _ in range(PASSES):
        before = dict(chosen)
        for k, at in places.items():
            boxes = _boxes(labels[k], at)
            others = np.array([box for i, box in placed.items() if i != k]).reshape(-1, 4)
            chosen[k] = int((costs[k] + OVER_LABEL * _overlaps(boxes, others)).argmin())
            placed[k] = boxes[chosen[k]]
        if chosen == before:
            break
    items = list(drawing.items)
    for k, i in chosen.items():
        x, y = places[k][i].tolist()
        items[k] = replace(labels[k], at=(x, y))
    return replace(drawing, items=tuple(items))


def stroke_points(items: Iterable[Item]) -> Array:
    """Points (n, 3) of what is drawn, at most `STEP` from each other: x, y, half the width."""
    return np.array([p for item in items for p in _points(item)]).reshape(-1, 3)


def _points(item: Item) -> Iterator[tuple[float, float, float]]:
    if isinstance(item, Label):
        return
    if isinstance(item, Dot):
        yield (*item.centre, 0.0)
        for ring in np.arange(item.radius, 0.0, -STEP):
            for angle in np.linspace(0.0, 2 * math.pi, 12, endpoint=False):
                x, y = item.centre
                yield x + ring * math.cos(angle), y + ring * math.sin(angle), 0.0
        return
    corners = item.points() if isinstance(item, Arc) else list(item.points)
    half = STYLES[item.style][1] / 2
    for (ax, ay), (bx, by) in pairwise(corners):
        n = max(1, math.ceil(math.hypot(bx - ax, by - ay) / STEP))
        yield from ((ax + (bx - ax) * i / n, ay + (by - ay) * i / n, half) for i in range(n + 1))
    if item.arrow:
        yield from ((x, y, 0.0) for x, y in arrow_head(corners))


def _places(label: Label) -> Array:
    """Its own place, and rings around it: circles, and ellipses by half its width wider; (n, 2)."""
    left, _, right, _ = _boxes(label, np.array([label.at]))[0]
    angles = np.linspace(0.0, 2 * math.pi, DIRECTIONS, endpoint=False)
    offsets = [
        np.column_stack(((ring + more) * np.cos(angles), ring * np.sin(angles)))
        for ring, more in product(RINGS, (0.0, (right - left) / 2))
    ]
    found: Array = np.asarray(label.at) + np.vstack([np.zeros((1, 2)), *offsets])
    return found


def _boxes(label: Label, at: Array) -> Array:
    """What a label covers at places (n, 2): left, low, right, high; (n, 4)."""
    if isinstance(label.text, str):
        wide, below = LETTER * len(label.text), BELOW
    else:
        has_index = any(parsed(symbol.name).below for symbol in label.text.free_symbols)
        wide = WIDTH * size_of(label.text) + 2 * ASIDE
        below = BELOW + INDEX * has_index
    start = 0.0 if label.start else -wide / 2
    found: Array = np.hstack([at, at]) + np.array([start, -below, start + wide, ABOVE])
    return found


def _costs(label: Label, at: Array, strokes: Array, drawing: Drawing) -> Array:
    """How bad places (n, 2) are without other labels; (n,)."""
    boxes = _boxes(label, at)
    left, low, right, high = boxes.T
    cost = AWAY * np.hypot(*(at - label.at).T)
    outside = (left < 0) | (low < 0) | (right > drawing.width) | (high > drawing.height)
    x, y, half = strokes.T
    around = np.column_stack((x - half, y - half, x + half, y + half))
    return np.asarray(cost + OUTSIDE * outside + OVER_STROKE * _overlaps(boxes, around))


def _overlaps(boxes: Array, others: Array) -> Array:
    """With how many of others (m, 4) boxes (n, 4) overlap; (n,)."""
    one, other = boxes[:, None], others[None]
    apart = (one[..., :2] >= other[..., 2:]) | (one[..., 2:] <= other[..., :2])
    return np.asarray((~apart.any(axis=-1)).sum(axis=1))
