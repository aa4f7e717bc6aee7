"""Outlines of shapes in the plane, and points that bound shapes in the plane and in space."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eomgen.scene.look import Box, Disc, Polygon, Rod, Shape, number, numbers
from eomgen.show.solid import mesh

Array = NDArray[np.float64]

ROUND = 1e-300
"""A length of faces with which round shapes have as many sides as they may."""


def extent_points(shapes: Sequence[Shape], dimensions: int) -> Array:
    """Points (k, dimensions) in body axes, m, whose bounds are those of a body's shapes."""
    if not shapes:
        return np.zeros((1, dimensions))
    if dimensions == 2:
        return np.concatenate([outline(shape) for shape in shapes])
    return np.concatenate([mesh(shape, ROUND).vertices for shape in shapes])


def outline(shape: Shape) -> Array:
    """Corners (k, 2) of a polygon that approximates a planar `shape`, m, body axes."""
    match shape:
        case Polygon():
            return np.array([numbers(point) for point in shape.points])
        case Box():
            corners = (
                np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(numbers(shape.size)) / 2
            )
            return _center(shape) + turned(corners, shape.angle)
        case Disc():
            return _center(shape) + number(shape.radius) * _arc(0.0, 2 * np.pi, 72)
        case Rod():
            start, end = np.array(numbers(shape.start)), np.array(numbers(shape.end))
            along = float(np.arctan2(*(end - start)[::-1]))
            cap = number(shape.width) / 2 * _arc(along - np.pi / 2, along + np.pi / 2, 24)
            return np.concatenate([end + cap, start - cap])
    raise AssertionError(f"{shape.type} is not a shape of the plane")


def _center(shape: Box | Disc) -> Array:
    return np.zeros(2) if shape.center is None else np.array(numbers(shape.center))


def _arc(start: float, stop: float, count: int) -> Array:
    angles = np.linspace(start, stop, count)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def turned(points: Array, angle: float) -> Array:
    """Points (…, 2) rotated by an angle, rad."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def hull(points: Array) -> list[int]:
    """The corners of the convex hull of points (n, 2), as indices, counter-clockwise.

    A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", Information
    Processing Letters 9 (1979) 216-219.
    """
    order = sorted(range(len(points)), key=lambda k: tuple(points[k]))
    halves = []
    for way in (order, order[::-1]):
        half: list[int] = []
        for k in way:
            while len(half) > 1 and _turn(points[half[-2]], points[half[-1]], points[k]) <= 0:
                half.pop()
            half.append(k)
        halves += half[:-1]
    return halves


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the area of the triangle a, b, c: > 0 if it is counter-clockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
