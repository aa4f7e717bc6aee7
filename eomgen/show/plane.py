"""The mechanism in the plane, as drawn in the figure."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon as Patch

from eomgen.scene.look import BARE
from eomgen.show.motion import INSTANTS, MOST_MARKS, Array, Motion, instants, paths
from eomgen.show.outlines import outline, turned
from eomgen.show.strokes import Sight, Stroke, strokes
from eomgen.show.style import ink_on, mixed
from eomgen.show.symbols import GROUND

SPREAD = 20
"""Size of planes relative to that of the motion, since a wide view shows more than the motion."""

LAYERS = {"fixed": 1.2, "back": 2.5, "middle": 1.5 + INSTANTS, "front": 3 + INSTANTS}
"""Order in which lines are drawn; the bodies at the last time have 2 + INSTANTS."""

SURFACE = 0.4
"""Strength of the ink of the surface of fixed objects."""


def draw_plane(
    axes: Axes,
    motion: Motion,
    rows: Sequence[tuple[int, float]] | None = None,
    until: int | None = None,
) -> None:
    """Draw the bodies at a few times, with increasing strength, and their paths.

    rows   the samples that are drawn, each with its strength; None: those of `instants`
    until  the paths end before this sample
    """
    paper = motion.camera.background
    axes.grid(color=mixed(paper, ink_on(paper), 0.1))
    for path, colour in paths(motion):
        axes.plot(*path[:until].T, color=colour, linewidth=0.8, alpha=0.5, zorder=2)
    rows = instants(motion) if rows is None else rows
    orders = np.linspace(2 + INSTANTS, 3, len(rows))[::-1].tolist()
    for (row, strength), order in zip(rows, orders, strict=True):
        draw_pose(axes, motion, motion.poses[row], strength, zorder=order)
    draw_symbols(axes, motion, rows[-1][0], np.eye(3))
    _draw_planes(axes, motion)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def draw_symbols(axes: Axes, motion: Motion, row: int, eye: Array) -> None:
    """Draw springs, motors, supports and the like at a sample, seen along the axes `eye`.

    The view is extended to show fixed things that are smaller than the camera's height.
    """
    if motion.drawn is None:
        return
    paper = motion.camera.background
    for stroke in strokes(Sight(motion.drawn, motion.poses[row], eye)):
        line, order = stroke.line, LAYERS[stroke.layer]
        if motion.dimensions == 3 and stroke.layer == "middle":
            order = LAYERS["back"]  # all bodies are one image there
        size = float(np.ptp(stroke.points, axis=0).max())
        small = not line.dashed and size <= motion.camera.height
        seen_whole = stroke.layer != "fixed" or small
        closed = bool(np.allclose(stroke.points[0], stroke.points[-1]))
        face = None if line.fill is None else mixed(paper, ink_on(paper), line.fill)
        if face is not None and not closed:
            _fill_below(axes, stroke, face, SPREAD * max(size, motion.camera.height))
        outline = Patch(
            stroke.points,
            closed=closed,
            fc=face if face is not None and closed else "none",
            ec=mixed(paper, ink_on(paper), line.ink),
            lw=line.weight,
            ls=":" if line.dashed else "-",
            capstyle="round",
            joinstyle="round",
            zorder=order,
        )
        (axes.add_patch if seen_whole else axes.add_artist)(outline)


def _fill_below(axes: Axes, stroke: Stroke, face: str, deep: float) -> None:
    """Fill what is below a line, m, without extending the view."""
    (left, *_), (right, *_), low = stroke.points[0], stroke.points[-1], stroke.points[:, 1].min()
    corners = np.vstack([stroke.points, [(right, low - deep), (left, low - deep)]])
    axes.add_artist(Patch(corners, facecolor=face, edgecolor="none", zorder=0.4))


def _draw_planes(axes: Axes, motion: Motion) -> None:
    """Shade the region behind each plane within the view, without extending the view."""
    paper = motion.camera.background
    ink = ink_on(paper)
    low, high = axes.dataLim.get_points()
    far = SPREAD * max(float(np.linalg.norm(high - low)), motion.camera.height)
    for plane in motion.planes:
        normal = np.array(plane.normal)
        gap = float(normal @ (low + high)) / 2 - plane.offset
        foot = (low + high) / 2 - gap * normal
        along = far * np.array([-normal[1], normal[0]])
        ends, behind = np.array([foot - along, foot + along]), (abs(gap) + far) * normal
        corners = np.concatenate([ends, ends[::-1] - behind])
        colour = mixed(paper, ink, GROUND)
        axes.add_artist(Patch(corners, facecolor=colour, edgecolor="none", zorder=0.4))
        line = Line2D(*ends.T, color=mixed(paper, ink, SURFACE), linewidth=1.0, zorder=1.5)
        axes.add_artist(line)


def draw_pose(axes: Axes, motion: Motion, pose: Array, strength: float, zorder: float) -> None:
    """Draw the bodies at one pose (nb, 3), with a share of ink from 0 to 1."""
    paper = motion.camera.background
    edge = mixed(paper, ink_on(paper), strength)
    for (x, y, angle), shapes in zip(pose, motion.shapes, strict=True):
        for shape in shapes:
            axes.add_patch(
                Patch(
                    turned(outline(shape), angle) + np.array([x, y]),
                    facecolor=mixed(paper, shape.color or BARE, strength),
                    edgecolor=edge,
                    linewidth=0.5,
                    zorder=zorder,
                )
            )
        if not shapes:
            axes.plot(x, y, "o", color=mixed(paper, BARE, strength), zorder=zorder)
    for body, *point in motion.anchors if len(motion.anchors) <= MOST_MARKS else ():
        place = turned(np.array(point), pose[body, 2]) + pose[body, :2]
        axes.plot(*place, "o", mfc=paper, mec=edge, mew=1.0, ms=4.5, zorder=zorder)
