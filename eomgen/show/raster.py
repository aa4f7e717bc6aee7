"""Hidden-surface removal with a depth buffer: solids may touch and intersect."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.show.motion import Array
from eomgen.show.view import Sight

EDGE_WIDTH = 2.2
"""Width of an edge, pixels."""

THICK = 6.0
"""Solids thinner than this, pixels, have edges of their own colour: dark ones would hide them."""

BEFORE = 1.5
"""Edges are drawn this much nearer than their faces, pixels."""

SLACK = 1e-7
"""Pixels up to this far outside a face belong to it, so that neighbours leave no gap."""


@dataclass(frozen=True)
class Frame:
    """A part of the picture: `width` by `height` pixels from its upper left corner, m."""

    left: float
    top: float
    pixels_per_metre: float
    width: int
    height: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, m, as Matplotlib takes them."""
        right = self.left + self.width / self.pixels_per_metre
        return self.left, right, self.top - self.height / self.pixels_per_metre, self.top

    def pixels(self, points: Array) -> Array:
        """Points (right, up, near), m, as pixels (right, down, near)."""
        moved = points - np.array([self.left, self.top, 0.0])
        return np.asarray(moved * np.array([1.0, -1.0, 1.0]) * self.pixels_per_metre)


def frame_around(points: Array, most: int) -> Frame:
    """The frame around `points` (n, 2), with `most` pixels on its longer side."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max()) or 1.0
    margin = 0.01 * size
    scale = most / (size + 2 * margin)
    width, height = np.ceil((high - low + 2 * margin) * scale).astype(int)
    return Frame(
        left=float(low[0]) - margin,
        top=float(high[1]) + margin,
        pixels_per_metre=scale,
        width=int(width),
        height=int(height),
    )


def render_solids(
    sight: Sight, frame: Frame, ink: Array, share: float
) -> tuple[NDArray[np.int32], Array]:
    """Draw faces and edges: for each pixel (height, width) an index into colours (k, 3), or -1.

    An edge's colour is a mixture of `share` parts `ink` (3,) and the solid's own colour.
    """
    canvas = _Canvas(frame)
    faces = frame.pixels(sight.faces)
    diagonals = faces[:, 2:] - faces[:, :2]
    normals = np.cross(diagonals[:, 0], diagonals[:, 1])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slopes = np.nan_to_num(-normals[:, :2] / normals[:, 2:])
    for face, slope in zip(faces, slopes, strict=True):
        canvas.fill(face, slope)

    edges = frame.pixels(sight.edges)
    along = edges[:, 1] - edges[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    shares = share * (sight.edge_thickness * frame.pixels_per_metre > THICK)[:, np.newaxis]
    colours = shares * ink + (1 - shares) * sight.edge_colours
    long = np.flatnonzero(length > SLACK)
    for k in long:
        ahead = along[k, :2] / length[k] * EDGE_WIDTH / 2
        aside = np.array([-ahead[1], ahead[0]])
        start, end = edges[k, 0, :2] - ahead / 2, edges[k, 1, :2] + ahead / 2
        flat = np.array([start - aside, end - aside, end + aside, start + aside])
        nearness = edges[k, [0, 1, 1, 0], 2:] + BEFORE
        slope = along[k, :2] * along[k, 2] / length[k] ** 2
        canvas.fill(np.hstack([flat, nearness])[::-1], slope)
    return canvas.shown, np.concatenate([sight.colours, colours[long]])


class _Canvas:
    """The index of the face shown at each pixel, counted in the order of drawing; -1 for none."""

    def __init__(self, frame: Frame) -> None:
        self.shown = np.full((frame.height, frame.width), -1, dtype=np.int32)
        self._nearness = np.full((frame.height, frame.width), -np.inf)
        self._face = -1

    def fill(self, corners: Array, slope: Array) -> None:
        """Draw the next face where it is nearest; it is convex and flat, corners (4, 3), clockwise.

        `slope` is the change of nearness per pixel to the right and per pixel down.
        """
        self._face += 1
        height, width = self.shown.shape
        low, high = corners.min(axis=0), corners.max(axis=0)
        left, top = (max(0, int(np.ceil(value - 0.5))) for value in low[:2].tolist())
        right = min(width, int(np.floor(high[0] + 0.5)))
        bottom = min(height, int(np.floor(high[1] + 0.5)))
        if left >= right or top >= bottom:
            return
        x = np.arange(left, right) + 0.5
        y = (np.arange(top, bottom) + 0.5)[:, np.newaxis]
        (xa, ya, za), *_ = rows = corners.tolist()
        near = (za + slope[0] * (x - xa)) + slope[1] * (y - ya)
        np.clip(near, low[2], high[2], out=near)  # a face seen edge-on has huge slopes
        spot = slice(top, bottom), slice(left, right)
        inside = near > self._nearness[spot]
        for (x0, y0, _), (x1, y1, _) in zip(rows, [*rows[1:], rows[0]], strict=True):
            inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) <= SLACK
        np.copyto(self._nearness[spot], near, where=inside)
        np.copyto(self.shown[spot], self._face, where=inside)
