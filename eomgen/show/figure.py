"""A motion as one still figure: mechanism, coordinates, energy, and their errors."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from eomgen.show.motion import Array, Motion, instants, thinned
from eomgen.show.panels import (
    BENEATH,
    EPSILON,
    MOST_CURVES,
    draw_curves,
    draw_map,
    draw_small,
    widen,
)
from eomgen.show.plane import draw_plane
from eomgen.show.space import draw_space
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

KINETIC, POTENTIAL, TOTAL = "#ee6677", "#4477aa", INK

MOST_KINDS = 4
"""Greatest number of components that are grouped: an orientation has four."""

LONGEST = 2
"""Greatest number of words of a name that is shown as a symbol with subscripts."""
MOST_NAMED = 60
"""Greatest number of rows of a map that are all named."""
PANEL, ROW, BETWEEN, HIGHEST = 1.05, 0.125, 0.36, 16.0
"""Heights of a panel, of a row of a map, of what is between panels, and of all of them, inches."""
WIDE = 4.9
"""About the width of the mechanism beside many coordinates, inches."""
DASHES = ("-", "--", ":")
QUATERNIONS = "Orientations, as unit quaternions"
TITLES = {"m": "Lengths", "rad": "Angles"}


def draw_motion(motion: Motion) -> Figure:
    """Draw the mechanism at a few times, its coordinates, its energy, and measures of error.

    The error of energy is its change if exact motion conserves it, else the change of kinetic
    energy that the works of effects do not explain, if they are known. The figure uses no window
    and no global state. Raises `RunError` if no sample is finite.
    """
    shown = thinned(motion)
    groups = _positions_by_title(shown)
    many = any(len(indices) > MOST_CURVES for indices in groups.values())
    with style():
        return (_draw_many if many else _draw_few)(shown, groups)


def _draw_few(motion: Motion, groups: Mapping[str, list[int]]) -> Figure:
    """Mechanism and balance of energy on the left, all else on the right."""
    figure = Figure(figsize=(12.0, 7.4))
    _draw_heading(figure, motion)
    right: list[Callable[[Axes, Motion], None]] = [
        partial(_draw_coordinates, title=title, indices=indices)
        for title, indices in groups.items()
    ]
    right.append(_draw_energy)
    if motion.works is not None:
        right.append(_draw_works)
    heights = [3.2 / len(right)] * len(right) + [1.0]
    balanced, apart = _is_balanced(motion), _comes_apart(motion)
    if apart:
        right.append(_draw_drift)
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(1.25, 1), height_ratios=heights)
    _draw_mechanism(figure.add_subplot(grid[: -1 if balanced else None, 0]), motion)
    column = grid[:, 1].subgridspec(len(right), 1, height_ratios=heights[: len(right)])
    for row, draw in enumerate(right):
        axes = figure.add_subplot(column[row])
        draw(axes, motion)
        _label_times(axes, row == len(right) - 1)
    if balanced:
        _draw_balance(figure.add_subplot(grid[-1, 0]), motion)
    return figure


def _draw_many(motion: Motion, groups: Mapping[str, list[int]]) -> Figure:
    """Coordinates on the right, with a name at each row of a map, as high as they need; all else
    on the left.
    """
    rows = [len(indices) for indices in groups.values()]
    heights = [max(PANEL, ROW * count) if count > MOST_CURVES else PANEL for count in rows]
    high = min(sum(heights) + BETWEEN * len(heights), HIGHEST)
    figure = Figure(figsize=(12.0, max(7.4, high + 0.9)))
    _draw_heading(figure, motion)
    below: list[Callable[[Axes, Motion], None]] = [_draw_energy]
    if motion.works is not None:
        below.append(_draw_works)
    if _is_balanced(motion):
        below.append(_draw_balance)
    if _comes_apart(motion):
        below.append(_draw_drift)
    sides = figure.add_gridspec(1, 2, width_ratios=(1, 1.05))
    left = sides[0].subgridspec(1 + len(below), 1)
    right = sides[1].subgridspec(len(groups), 1, height_ratios=heights)
    mechanism = figure.add_subplot(left[0])
    _draw_mechanism(mechanism, motion)
    # The picture is as high as it is for its width; what is left is for the panels below it.
    free = figure.get_figheight() - 0.9 - BETWEEN * len(below)
    (x0, y0), (x1, y1) = mechanism.dataLim.get_points()
    high = WIDE * (y1 - y0) / (x1 - x0 or 1.0) if y1 > y0 else WIDE
    high = min(max(high, PANEL), free - PANEL * len(below))
    left.set_height_ratios([high, *[(free - high) / len(below)] * len(below)])
    # The view is extended to the shape of its panel once, so that has to be about right.
    mechanism.set_position(left[0].get_position(figure))
    mechanism.set_in_layout(True)
    for row, draw in enumerate(below, 1):
        axes = figure.add_subplot(left[row])
        draw(axes, motion)
        _label_times(axes, row == len(below))
    for row, (title, indices) in enumerate(groups.items(), 1):
        axes = figure.add_subplot(right[row - 1])
        _draw_coordinates(axes, motion, title, indices, every=True)
        _label_times(axes, row == len(groups))
    return figure


def _label_times(axes: Axes, last: bool) -> None:
    """Label the times of a column's last panel alone."""
    axes.tick_params(labelbottom=last)
    axes.set_xlabel("t, s" if last else "")


def _is_balanced(motion: Motion) -> bool:
    """Whether the error of energy is known, and is not 0 throughout."""
    return (motion.keeps_energy or motion.works is not None) and bool(_imbalance(motion).any())


def _imbalance(motion: Motion) -> Array:
    """The error of energy against the size of the motion's energies, (n,)."""
    kinetic, potential = motion.kinetic_energy, motion.potential_energy
    off = kinetic + potential
    if not motion.keeps_energy:
        assert motion.works is not None
        off = kinetic - motion.works.sum(axis=1)
    # The zero of potential energy is arbitrary, so it must not affect the scale.
    scale = float(kinetic.max() + np.ptp(potential)) or 1.0
    return np.abs(off - off[:1]) / scale


def _comes_apart(motion: Motion) -> bool:
    """Whether joints have gaps that are more than rounding; by their coordinates they have none."""
    size = float(np.ptp(motion.places, axis=(0, 1)).max(initial=0.0))
    return bool((motion.joint_drift > 10 * EPSILON * size).any())


def save_figure(motion: Motion, path: Path, force: bool = False) -> None:
    """Draw `motion` and write it to `path`, .png or .svg, the same bytes for the same motion.

    Raises `RunError` as `draw_motion` and `write_figure` do.
    """
    write_figure(draw_motion(motion), path, force=force)


def _draw_heading(figure: Figure, motion: Motion) -> None:
    """Write title, integrator and, for an unfinished run, its end; lay out the panels below."""
    write = partial(figure.text, 0.01, va="top", parse_math=False)
    heading = textwrap.shorten(motion.heading, 80, placeholder=" …")
    inch = 1 / figure.get_figheight()
    write(1 - 0.09 * inch, heading, size=15, weight="bold")
    summary = textwrap.shorten(motion.summary, 150, placeholder=" …")
    write(1 - 0.42 * inch, summary, size=10, color=FAINT)
    top = 1 - 0.67 * inch
    if motion.stopped:
        alarm = textwrap.shorten(motion.stopped, 140, placeholder=" …")
        write(top, alarm, size=10, weight="bold", color=ALARM)
        top -= 0.26 * inch
    engine = ConstrainedLayoutEngine(
        rect=(0.006, 0.006, 0.988, top - 0.006), wspace=0.03, hspace=0.03
    )
    figure.set_layout_engine(engine)


def _draw_mechanism(axes: Axes, motion: Motion) -> None:
    axes.set_facecolor(motion.camera.background)
    (draw_plane if motion.dimensions == 2 else draw_space)(axes, motion)
    start, end, count = motion.t[0], motion.t[-1], len(instants(motion))
    if count == 1:
        axes.set_title(f"Pose at t = {start:.4g} s")
    else:
        axes.set_title(f"{count} poses, t = {start:.4g} s (light) to {end:.4g} s (full)")


def _draw_coordinates(
    axes: Axes, motion: Motion, title: str, indices: list[int], *, every: bool = False
) -> None:
    many, unit = len(indices) > MOST_CURVES, motion.units[indices[0]]
    if many:
        indices = _alike_together(indices, motion.states)
    values = motion.y[:, indices]
    labels = short_names([motion.states[k] for k in indices])
    if many:
        draw_map(axes, motion.t, values, labels, unit, every=every and len(indices) <= MOST_NAMED)
    else:
        # If there are few coordinates, each has the same colour in the whole figure.
        coloured = motion.positions if len(motion.positions) <= len(PALETTE) else indices
        order = {k: i for i, k in enumerate(coloured)}
        ramp = [PALETTE[order[k] % len(PALETTE)] for k in indices]
        dashes = [DASHES[order[k] // len(PALETTE)] for k in indices]
        if title == QUATERNIONS:  # a colour for each component, a dash pattern for each orientation
            ramp = [PALETTE[k % 4] for k in range(len(indices))]
            dashes = [DASHES[k // 4] for k in range(len(indices))]
            axes.set_ylim(-1.08, 1.08)
        draw_curves(axes, motion.t, values, labels, ramp, dashes)
        if title != QUATERNIONS:
            widen(axes, values)
        axes.set_ylabel(unit, parse_math=False)
    axes.set_title(title)
    axes.tick_params(labelbottom=False)


def _draw_energy(axes: Axes, motion: Motion) -> None:
    kinetic, potential = motion.kinetic_energy, motion.potential_energy
    values = np.column_stack([kinetic, potential, kinetic + potential])
    names, colour = ["kinetic", "potential", "total"], [KINETIC, POTENTIAL, TOTAL]
    draw_curves(axes, motion.t, values, names, colour)
    axes.lines[-1].set(**BENEATH)
    widen(axes, values)
    axes.set_title("Energy")
    axes.set_ylabel("J")
    axes.tick_params(labelbottom=False)


def _draw_works(axes: Axes, motion: Motion) -> None:
    assert motion.works is not None
    labels = [plain(name) for name in motion.effects]
    draw_curves(axes, motion.t, motion.works, labels, colours(len(labels)))
    axes.set_ylabel("J")
    axes.set_title("Work of effects")
    axes.tick_params(labelbottom=False)


def _draw_balance(axes: Axes, motion: Motion) -> None:
    title = r"Relative change of energy,  $|E-E_0|"
    if not motion.keeps_energy:
        title = r"Energy unaccounted for,  $|T-T_0-W|"
    draw_small(axes, motion.t, _imbalance(motion)[:, None], [""], [TOTAL])
    axes.set_title(title + r"\,/\,(\max\,T + \mathrm{range}\,V)$")


def _draw_drift(axes: Axes, motion: Motion) -> None:
    gaps, labels = motion.joint_drift, [plain(joint) for joint in motion.joints]
    if len(labels) > len(PALETTE):
        gaps = np.column_stack([gaps.max(axis=1), np.median(gaps, axis=1)])
        labels = [f"largest of {len(labels)}", "median"]
    draw_small(axes, motion.t, gaps, labels, colours(len(labels)))
    axes.set_title("Gap in the joints")
    axes.set_ylabel("m")


def short_names(names: Sequence[str]) -> list[str]:
    """Names as they are shown: as symbols, or, if they are of many words, as these without those
    that end all of them.
    """
    words = [name.split("_") for name in names]
    if all(len(parts) <= LONGEST for parts in words):
        return [symbol(name) for name in names]
    while len({parts[-1] for parts in words}) == 1 and min(map(len, words)) > 1:
        words = [parts[:-1] for parts in words]
    return [plain(" ".join(parts)) for parts in words]


def _alike_together(indices: list[int], states: Sequence[str]) -> list[int]:
    """States sorted with all x before all y, so that a map shows similar states together."""
    endings = {k: states[k].rpartition("_")[2] for k in indices}
    kinds = list(dict.fromkeys(endings.values()))
    if len(kinds) > MOST_KINDS:  # the names end in numbers, not in components
        return indices
    return sorted(indices, key=lambda k: kinds.index(endings[k]))


def _positions_by_title(motion: Motion) -> dict[str, list[int]]:
    """Indices of the coordinates, grouped by the title of their panel."""
    in_quaternions = {index for four in motion.quaternions for index in four}
    groups: dict[str, list[int]] = {}
    for index in motion.positions:
        unit = motion.units[index]
        title = TITLES.get(unit, f"Coordinates, {plain(unit)}" if unit else "Coordinates")
        groups.setdefault(QUATERNIONS if index in in_quaternions else title, []).append(index)
    return groups
