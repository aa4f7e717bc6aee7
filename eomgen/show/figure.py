"""A motion as one still picture: mechanism, coordinates, energy, and how exact they are."""

import textwrap
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Polygon as Patch
from matplotlib.ticker import LogLocator, NullFormatter

from eomgen.scene.look import Box, Disc, Polygon, Shape
from eomgen.show.motion import Array, Motion, thinned
from eomgen.show.style import (
    ALARM,
    FAINT,
    INK,
    PALETTE,
    colours,
    plain,
    style,
    symbol,
    write_figure,
)

GHOSTS = 8
"""Instants at which the stroboscope flashes."""

KINETIC, POTENTIAL, TOTAL = "#ee6677", "#4477aa", INK
EPSILON = float(np.finfo(float).eps)


def draw_motion(motion: Motion) -> Figure:
    """Draw the mechanism at a few instants, its coordinates, its energy, and two measures of error.

    The figure belongs to no window and no global state. Raises `RunError` if no sample is finite.
    """
    shown = thinned(motion)
    with style():
        figure = Figure(figsize=(12.0, 7.4))
        _draw_heading(figure, motion)
        by_unit = _positions_by_unit(shown)
        rows = len(by_unit) + 1
        heights = [3.2 / rows] * rows + [1.0]
        grid = figure.add_gridspec(rows + 1, 2, width_ratios=(1.25, 1), height_ratios=heights)
        _draw_mechanism(figure.add_subplot(grid[:-1, 0]), shown)
        for row, (unit, indices) in enumerate(by_unit.items()):
            _draw_coordinates(figure.add_subplot(grid[row, 1]), shown, unit, indices)
        _draw_energy(figure.add_subplot(grid[-2, 1]), shown)
        _draw_energy_change(figure.add_subplot(grid[-1, 0]), shown)
        _draw_drift(figure.add_subplot(grid[-1, 1]), shown)
    return figure


def save_figure(motion: Motion, path: Path, force: bool = False) -> None:
    """Draw `motion` and write it to `path`, .png or .svg, the same bytes for the same motion.

    Raises `RunError` as `draw_motion` and `write_figure` do.
    """
    write_figure(draw_motion(motion), path, force=force)


def outline(shape: Shape) -> Array:
    """Corners (k, 2) of a polygon that looks like `shape`, m, body axes."""
    if isinstance(shape, Polygon):
        return np.array(shape.points, dtype=float)
    if isinstance(shape, Box):
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(shape.size) / 2
        return np.array(shape.center) + _turned(corners, shape.angle)
    if isinstance(shape, Disc):
        return np.array(shape.center) + shape.radius * _arc(0.0, 2 * np.pi, 72)
    start, end = np.array(shape.start, dtype=float), np.array(shape.end, dtype=float)
    along = float(np.arctan2(*(end - start)[::-1]))
    cap = shape.width / 2 * _arc(along - np.pi / 2, along + np.pi / 2, 24)
    return np.concatenate([end + cap, start - cap])


def _arc(start: float, stop: float, count: int) -> Array:
    angles = np.linspace(start, stop, count)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _turned(points: Array, angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def _draw_heading(figure: Figure, motion: Motion) -> None:
    """Write title, integrator and, of an unfinished run, its end; lay the panels out below them."""
    write = partial(figure.text, 0.01, va="top", parse_math=False)
    heading = textwrap.shorten(motion.heading, 80, placeholder=" …")
    write(0.988, heading, size=15, weight="bold")
    write(0.943, textwrap.shorten(motion.summary, 150, placeholder=" …"), size=10, color=FAINT)
    top = 0.91
    if motion.stopped:
        alarm = textwrap.shorten(motion.stopped, 140, placeholder=" …")
        write(top, alarm, size=10, weight="bold", color=ALARM)
        top = 0.875
    engine = ConstrainedLayoutEngine(
        rect=(0.006, 0.006, 0.988, top - 0.006), wspace=0.03, hspace=0.03
    )
    figure.set_layout_engine(engine)


def _draw_mechanism(axes: Axes, motion: Motion) -> None:
    paper = motion.camera.background
    axes.set_facecolor(paper)
    axes.grid(color=_mixed(paper, _ink_on(paper), 0.1))
    for body, shapes in enumerate(motion.shapes):
        colour = shapes[0].color if shapes else PALETTE[0]
        axes.plot(*motion.poses[:, body, :2].T, color=colour, linewidth=0.8, alpha=0.5, zorder=2)
    flashes = np.unique(np.linspace(0, len(motion.t) - 1, GHOSTS).round().astype(int))
    for order, row in enumerate(flashes):
        # Mixed with the paper rather than transparent: parts that overlap stay as clear as others.
        strength = 1.0 if row == flashes[-1] else 0.14 + 0.45 * order / GHOSTS
        _draw_pose(axes, motion, motion.poses[row], strength, zorder=3 + order)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    start, end = motion.t[0], motion.t[-1]
    if len(flashes) == 1:
        axes.set_title(f"Pose at t = {start:.4g} s")
    else:
        axes.set_title(f"{len(flashes)} poses, t = {start:.4g} s (light) to {end:.4g} s (full)")


def _draw_pose(axes: Axes, motion: Motion, pose: Array, strength: float, zorder: int) -> None:
    paper = motion.camera.background
    edge = _mixed(paper, _ink_on(paper), strength)
    for (x, y, angle), shapes in zip(pose, motion.shapes, strict=True):
        for shape in shapes:
            axes.add_patch(
                Patch(
                    _turned(outline(shape), angle) + np.array([x, y]),
                    facecolor=_mixed(paper, shape.color, strength),
                    edgecolor=edge,
                    linewidth=0.5,
                    zorder=zorder,
                )
            )
        if not shapes:
            axes.plot(x, y, "o", color=_mixed(paper, PALETTE[0], strength), zorder=zorder)
    for body, *point in motion.anchors:
        place = _turned(np.array(point), pose[body, 2]) + pose[body, :2]
        axes.plot(*place, "o", mfc=paper, mec=edge, mew=1.0, ms=4.5, zorder=zorder)


def _draw_coordinates(axes: Axes, motion: Motion, unit: str, indices: list[int]) -> None:
    by_index = dict(zip(motion.positions, colours(len(motion.positions)), strict=True))
    labels = [symbol(motion.states[k]) for k in indices]
    _draw_curves(axes, motion.t, motion.y[:, indices], labels, [by_index[k] for k in indices])
    axes.set_title({"m": "Lengths", "rad": "Angles"}.get(unit, "Coordinates"))
    axes.set_ylabel(unit, parse_math=False)
    axes.tick_params(labelbottom=False)


def _draw_energy(axes: Axes, motion: Motion) -> None:
    kinetic, potential = motion.kinetic_energy, motion.potential_energy
    values = np.column_stack([kinetic, potential, kinetic + potential])
    _draw_curves(
        axes, motion.t, values, ["kinetic", "potential", "total"], [KINETIC, POTENTIAL, TOTAL]
    )
    axes.set_title("Energy")
    axes.set_ylabel("J")
    axes.set_xlabel("t, s")


def _draw_energy_change(axes: Axes, motion: Motion) -> None:
    kinetic, potential = motion.kinetic_energy, motion.potential_energy
    total = kinetic + potential
    # Where potential energy is zero is a matter of taste, so it must not enter the scale.
    scale = float(kinetic.max() + np.ptp(potential)) or 1.0
    _draw_small(axes, motion.t, np.abs(total - total[:1])[:, None] / scale, [""], [TOTAL])
    axes.set_title(r"Relative change of energy,  $|E-E_0|\,/\,(\max\,T + \mathrm{range}\,V)$")


def _draw_drift(axes: Axes, motion: Motion) -> None:
    labels = [plain(joint) for joint in motion.joints]
    _draw_small(axes, motion.t, motion.joint_drift, labels, colours(len(motion.joints)))
    axes.set_title("Gap in the joints")
    axes.set_ylabel("m")


def _draw_small(
    axes: Axes, t: Array, values: Array, labels: Sequence[str], colours: Sequence[str]
) -> None:
    """Draw errors (n, k) on a logarithmic axis, those below rounding, zeros too, at rounding."""
    axes.set_xlabel("t, s")
    if not values.any():
        note = "exactly 0 at every sample" if values.size else "no joints"
        axes.text(0.5, 0.5, note, ha="center", va="center", color=FAINT, transform=axes.transAxes)
        axes.set_yticks([])
        axes.set_xlim(*(t[[0, -1]] if t[-1] > t[0] else (t[0] - 0.5, t[0] + 0.5)))
        return
    axes.set_yscale("log")
    _draw_curves(axes, t, np.maximum(values, EPSILON), labels, colours)
    low, high = axes.get_ylim()
    if low < 10 * EPSILON:
        low = EPSILON / 3
        axes.axhline(EPSILON, color=FAINT, linewidth=0.8, linestyle=":")
        beside = axes.get_yaxis_transform()
        axes.text(1.006, EPSILON, "ε", transform=beside, va="center", size=8, color=FAINT)
    axes.set_ylim(low, max(high, 1e4 * low))
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_curves(
    axes: Axes, t: Array, values: Array, labels: Sequence[str], colours: Sequence[str]
) -> None:
    marker = "o" if len(t) == 1 else ""
    for curve, label, colour in zip(values.T, labels, colours, strict=True):
        axes.plot(t, curve, marker=marker, label=label, color=colour)
    axes.margins(x=0)
    if any(labels):
        # More than six names do not fit; colours between those named are found by their order.
        handles = axes.get_lines()
        kept = np.linspace(0, len(handles) - 1, min(6, len(handles))).round().astype(int)
        axes.legend(
            handles=[handles[k] for k in kept], loc="center left", bbox_to_anchor=(1.0, 0.5)
        )


def _positions_by_unit(motion: Motion) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for index in motion.positions:
        groups.setdefault(motion.units[index], []).append(index)
    return groups


def _mixed(paper: str, colour: str, share: float) -> str:
    pairs = zip(to_rgb(paper), to_rgb(colour), strict=True)
    red, green, blue = ((1 - share) * below + share * above for below, above in pairs)
    return to_hex((red, green, blue))


def _ink_on(paper: str) -> str:
    return INK if np.dot(to_rgb(paper), (0.2126, 0.7152, 0.0722)) > 0.4 else "#eeeeee"
