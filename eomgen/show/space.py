"""The mechanism in space, as drawn in the figure, by an orthographic projection on 2D axes.

Bodies are a raster image, in an SVG as well; floor, paths and marks are lines.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb

from eomgen.scene.look import BARE
from eomgen.show.motion import MOST_MARKS, Array, Motion, instants, paths
from eomgen.show.plane import SURFACE, draw_symbols
from eomgen.show.raster import frame_around, render_solids
from eomgen.show.solid import solids
from eomgen.show.style import FAINT, ink_on, mixed
from eomgen.show.symbols import GROUND
from eomgen.show.view import Cast, Floor, cast_of, eye_axes, floor_under, look, patches

BUDGET = 2500
"""About how many faces all bodies have at one time."""

PIXELS = 1400
"""Longer side of the bodies' image, pixels: about twice what a PNG shows."""

AXIS_COLOURS = ("#cc3311", "#228833", "#3366cc")

EDGE = 0.6
"""Strength of edges, between the body's colour and ink."""


def draw_space(
    axes: Axes,
    motion: Motion,
    rows: Sequence[tuple[int, float]] | None = None,
    until: int | None = None,
) -> None:
    """Draw the bodies at a few times, with increasing strength, and their paths; `rows` and `until`
    are as in `draw_plane`.
    """
    paper, camera = motion.camera.background, motion.camera
    cast = cast_of(solids(motion.shapes, camera.height, BUDGET))
    eye = eye_axes(camera.azimuth_deg, camera.elevation_deg)
    floor = floor_under(motion, cast)
    rows = instants(motion) if rows is None else rows
    _draw_floor(axes, floor, eye, paper)
    _draw_patches(axes, patches(motion, floor), eye, paper)
    if eye[2, 2] > 0:  # seen from below, the floor hides its shadows
        _draw_shadow(
            axes, look(cast, motion.poses[rows[-1][0]], np.eye(3)).faces, floor, eye, paper
        )
    for path, colour in paths(motion):
        seen = path[:until] @ eye.T
        axes.plot(seen[:, 0], seen[:, 1], color=colour, linewidth=0.8, alpha=0.5, zorder=2)
    _draw_bodies(axes, motion, rows, cast, eye)
    for order, (row, strength) in enumerate(rows):
        _draw_points(axes, motion, motion.poses[row], eye, strength, zorder=4 + order)
    draw_symbols(axes, motion, rows[-1][0], eye)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.04)
    axes.autoscale_view()
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    _draw_axes_cross(axes, eye)
    step = f"Grid {floor.step:g} m"
    height = f"{floor.z:.3g} m".replace("-", "−") if floor.z else "0"
    axes.set_xlabel(f"{step}, at z = {height}; seen without perspective", loc="right", color=FAINT)


def _draw_bodies(
    axes: Axes, motion: Motion, rows: Sequence[tuple[int, float]], cast: Cast, eye: Array
) -> None:
    """Draw the bodies at each time over those before, mixed with the paper by their strength."""
    paper = motion.camera.background
    ink, below = np.array(to_rgb(ink_on(paper))), np.array(to_rgb(paper))
    sights = [(look(cast, motion.poses[row], eye), share) for row, share in rows]
    points = np.concatenate([sight.faces.reshape(-1, 3)[:, :2] for sight, _ in sights])
    if not len(points):  # smaller than rounding errors, or that far away
        return
    frame = frame_around(points, PIXELS)
    # Transparent pixels have the paper's colour, because scaling the image mixes it in.
    image = np.empty((frame.height, frame.width, 4))
    image[:] = (*below, 0.0)
    for sight, strength in sights:
        shown, colours = render_solids(sight, frame, ink, EDGE)
        mixed_colours = strength * colours + (1 - strength) * below
        covered = shown >= 0
        image[covered] = np.insert(mixed_colours, 3, 1.0, axis=1)[shown[covered]]
    axes.imshow(image, extent=frame.extent, zorder=3, interpolation_stage="rgba")


def _draw_points(
    axes: Axes, motion: Motion, pose: Array, eye: Array, strength: float, zorder: int
) -> None:
    """Mark bodies without shapes, and joints, in front of everything."""
    paper = motion.camera.background
    edge = mixed(paper, ink_on(paper), strength)
    bare = [k for k, shapes in enumerate(motion.shapes) if not shapes]
    if bare:
        seen = pose[bare, :, 3] @ eye.T
        colour = mixed(paper, BARE, strength)
        axes.plot(seen[:, 0], seen[:, 1], "o", color=colour, ms=5, zorder=zorder)
    if 0 < len(motion.anchors) <= MOST_MARKS:
        body = [anchor[0] for anchor in motion.anchors]
        r = np.array([anchor[1:] for anchor in motion.anchors])
        seen = (np.einsum("kij,kj->ki", pose[body, :, :3], r) + pose[body, :, 3]) @ eye.T
        size = 3.2 if len(body) <= 20 else 1.8
        axes.plot(*seen[:, :2].T, "o", mfc=paper, mec=edge, mew=0.25 * size, ms=size, zorder=zorder)


def _draw_floor(axes: Axes, floor: Floor, eye: Array, paper: str) -> None:
    lines, shares = floor.lines(), np.where(floor.through_origin(), 0.3, 0.12)
    colours = [mixed(paper, ink_on(paper), share) for share in shares]
    flat = (lines @ eye.T)[..., :2]
    axes.add_collection(LineCollection(list(flat), colors=colours, linewidths=0.7, zorder=1))


def _draw_patches(axes: Axes, squares: Array, eye: Array, paper: str) -> None:
    """Draw planes other than the floor; they are transparent."""
    axes.add_collection(
        PolyCollection(
            list((squares @ eye.T)[..., :2]),
            facecolors=(*to_rgb(ink_on(paper)), GROUND / 2),
            edgecolors=mixed(paper, ink_on(paper), SURFACE),
            linewidths=0.8,
            zorder=1.0,
        )
    )


def _draw_shadow(axes: Axes, above: Array, floor: Floor, eye: Array, paper: str) -> None:
    """Draw the bodies' shadow on the floor: their faces `above` (f, 4, 3) that look up, projected
    along z.
    """
    laid = above.reshape(-1, 3).copy()
    laid[:, 2] = floor.z
    points = laid @ eye.T
    colour = mixed(paper, ink_on(paper), 0.1)
    axes.add_collection(
        PolyCollection(
            list(points[:, :2].reshape(-1, 4, 2)),
            facecolors=colour,
            edgecolors=colour,
            linewidths=0.3,
            zorder=0.9,
        )
    )


def _draw_axes_cross(axes: Axes, eye: Array) -> None:
    """Show the directions of x, y and z in a corner."""
    cross = axes.inset_axes((0.0, 0.0, 0.13, 0.13))
    cross.set_axis_off()
    cross.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    for k in np.argsort(eye[2]):  # the nearest axis comes last
        x, y = eye[:2, k]
        cross.plot([0, x], [0, y], color=AXIS_COLOURS[k], linewidth=1.6, solid_capstyle="round")
        cross.text(
            1.3 * x,
            1.3 * y,
            "xyz"[k],
            color=AXIS_COLOURS[k],
            ha="center",
            va="center",
            size=9,
            weight="bold",
        )
