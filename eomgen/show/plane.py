"""The mechanism in the plane, as the figure shows it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon as Patch

from eomgen.scene.look import Box, Disc, Polygon, Rod, Shape
from eomgen.show.motion import BARE, MOST_MARKS, Array, Motion, instants
from eomgen.show.style import ink_on, mixed


def draw_plane(axes: Axes, motion: Motion) -> None:
    """Draw the bodies at a few instants, each fuller than the one before, and their ways."""
    paper = motion.camera.background
    axes.grid(color=mixed(paper, ink_on(paper), 0.1))
    for body in motion.traced:
        axes.plot(
            *motion.places[:, body].T,
            color=motion.colours[body],
            linewidth=0.8,
            alpha=0.5,
            zorder=2,
        )
    for order, (row, strength) in enumerate(instants(motion)):
        _draw_pose(axes, motion, motion.poses[row], strength, zorder=3 + order)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def outline(shape: Shape) -> Array:
    """Corners (k, 2) of a polygon that looks like a `shape` of the plane, m, body axes."""
    match shape:
        case Polygon():
            return np.array(shape.points, dtype=float)
        case Box():
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(shape.size) / 2
            return _center(shape) + _turned(corners, shape.angle)
        case Disc():
            return _center(shape) + shape.radius * _arc(0.0, 2 * np.pi, 72)
        case Rod():
            start, end = np.array(shape.start, dtype=float), np.array(shape.end, dtype=float)
            along = float(np.arctan2(*(end - start)[::-1]))
            cap = shape.width / 2 * _arc(along - np.pi / 2, along + np.pi / 2, 24)
            return np.concatenate([end + cap, start - cap])
    raise AssertionError(f"{shape.type} is no shape of the plane")


def _center(shape: Box | Disc) -> Array:
    return np.array(shape.center or (0.0, 0.0))


def _arc(start: float, stop: float, count: int) -> Array:
    angles = np.linspace(start, stop, count)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _turned(points: Array, angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _draw_pose(axes: Axes, motion: Motion, pose: Array, strength: float, zorder: int) -> None:
    paper = motion.camera.background
    edge = mixed(paper, ink_on(paper), strength)
    for (x, y, angle), shapes in zip(pose, motion.shapes, strict=True):
        for shape in shapes:
            axes.add_patch(
                Patch(
                    _turned(outline(shape), angle) + np.array([x, y]),
                    facecolor=mixed(paper, shape.color, strength),
                    edgecolor=edge,
                    linewidth=0.5,
                    zorder=zorder,
                )
            )
        if not shapes:
            axes.plot(x, y, "o", color=mixed(paper, BARE, strength), zorder=zorder)
    for body, *point in motion.anchors if len(motion.anchors) <= MOST_MARKS else ():
        place = _turned(np.array(point), pose[body, 2]) + pose[body, :2]
        axes.plot(*place, "o", mfc=paper, mec=edge, mew=1.0, ms=4.5, zorder=zorder)
