"""Figures for a paper: quantities against time, phase portraits, sections, strobe pictures.

They have the size in which they are printed: a column, two columns, or millimetres.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from eomgen.base.errors import RunError
from eomgen.show.motion import Array, Motion
from eomgen.show.panels import BENEATH, MOST_CURVES, draw_map, widen
from eomgen.show.plane import draw_plane
from eomgen.show.space import draw_space
from eomgen.show.style import INK, PALETTE, plain, style, symbol
from eomgen.study.quantities import Quantity
from eomgen.study.sections import Section

MM = 1 / 25.4
WIDTHS = {"single": 85.0, "double": 174.0}
"""Widths of one column and of two, mm, as most journals print them."""
PANEL, EDGES, KEY, MAP_ROW = 26.0, 11.0, 3.6, 3.4
"""Heights of a panel, of what is below the last, of a line of names, of a row of a map, mm."""
LETTER = 1.35
"""About the width of a letter of a name, mm."""
LONGEST = 16
"""Letters of the name of an axis on one line, with its unit."""
SMALLEST, LARGEST = 20.0, 2000.0
WEAKEST = 0.25
"""The strength of the first pose in a strobe picture; that of the last is 1."""
ENERGY = {"kinetic": PALETTE[1], "potential": PALETTE[0], "total": INK}
DASHES = ("-", (0, (4, 1.5)))


@dataclass(frozen=True)
class Size:
    """The size of a figure, mm; no height: as its content needs it."""

    width: float
    height: float | None = None


def size_of(text: str, argument: str = "size") -> Size:
    """The size that a text gives: single, double, a width such as 120, or 120x80, mm.

    Raises `RunError` for anything else.
    """
    if text in WIDTHS:
        return Size(WIDTHS[text])
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)(?:x([0-9]+(?:\.[0-9]+)?))?", text)
    numbers = [float(x) for x in found.groups() if x] if found else []
    if not numbers or not all(SMALLEST <= x <= LARGEST for x in numbers):
        raise RunError(
            f"{argument}: '{text}' is no size of a figure; give single, double, or millimetres "
            "such as 120 or 120x80"
        )
    return Size(*numbers)


def draw_series(t: Array, found: Sequence[Quantity], size: Size) -> Figure:
    """Draw quantities against time: a panel for those of one kind and unit, one below the other."""
    panels: dict[tuple[str, str], list[Quantity]] = {}
    for quantity in found:
        panels.setdefault((quantity.title, quantity.unit), []).append(quantity)
    groups = list(panels.values())
    heights = [_height(group, size.width) for group in groups]
    with style(paper=True):
        figure = _figure(size, sum(heights) + EDGES)
        for axes, group in zip(
            figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=heights)[
                :, 0
            ],
            groups,
            strict=True,
        ):
            _draw_panel(axes, t, group, size.width)
        axes.set_xlabel("t, s")
        if not any(len(group) > MOST_CURVES for group in groups):  # the names of rows are wide
            figure.align_ylabels()
        _settled(figure)
    return figure


def _height(group: Sequence[Quantity], width: float) -> float:
    """The height that a panel needs, mm."""
    if len(group) > MOST_CURVES:
        return max(PANEL, MAP_ROW * len(group))
    lines = 0 if len(group) == 1 else -(-len(group) // _columns(group, width))
    return PANEL + KEY * lines


def _columns(group: Sequence[Quantity], width: float) -> int:
    """How many names fit into a line above a panel."""
    longest = max(len(quantity.label) for quantity in group)
    return max(1, min(len(group), int((width - 20) / (LETTER * longest + 8))))


def _draw_panel(axes: Axes, t: Array, group: Sequence[Quantity], width: float) -> None:
    values = np.column_stack([quantity.values for quantity in group])
    unit = plain(group[0].unit)
    if len(group) > MOST_CURVES:
        labels = [plain(quantity.label) for quantity in group]
        draw_map(axes, t, np.nan_to_num(values), labels, unit, every=True)
        axes.set_ylabel(plain(group[0].title), labelpad=1)
        return
    for k, quantity in enumerate(group):
        axes.plot(
            t,
            quantity.values,
            linestyle=DASHES[k // len(PALETTE) % len(DASHES)],
            marker="o" if len(t) == 1 else "",
            color=_colour(quantity, k if len(group) > 1 else None),
            label=_named(quantity),
            **(BENEATH if quantity.name == "energy.total" else {}),
        )
    axes.margins(x=0)
    axes.set_ylabel(_beside(group, unit))
    widen(axes, values, max(quantity.size for quantity in group))
    if len(group) > 1:
        axes.legend(
            loc="lower right",  # at the left is the power of ten of the axis
            bbox_to_anchor=(1.0, 1.0),
            ncols=_columns(group, width),
            borderaxespad=0.1,
            borderpad=0.1,
            columnspacing=1.2,
            labelspacing=0.25,
            handletextpad=0.5,
        )


def _beside(group: Sequence[Quantity], unit: str) -> str:
    """The name of the vertical axis of a panel, in lines that fit into its height."""
    first = group[0]
    what = _full(first) if len(group) == 1 else plain(first.title)
    if len(what) + len(unit) <= LONGEST or "$" in what:
        return ", ".join(filter(None, (what, unit)))
    if len(group) == 1 and first.title and first.label in what:
        return f"{plain(first.title)}\n" + ", ".join(filter(None, (plain(first.label), unit)))
    return ",\n".join(filter(None, (what, unit)))


def _colour(quantity: Quantity, k: int | None) -> str:
    """The colour of the k-th curve of a panel; None for one that is alone."""
    if quantity.title == "energy":
        return ENERGY[quantity.label]
    return INK if k is None else PALETTE[k % len(PALETTE)]


def draw_phase(x: Quantity, y: Quantity, size: Size) -> Figure:
    """Draw one quantity against another: a ring at the start, a dot at the end."""
    with style(paper=True):
        figure = _figure(size, 0.75 * size.width)
        axes = figure.subplots()
        axes.plot(x.values, y.values, color=PALETTE[0])
        axes.plot(x.values[0], y.values[0], "o", color=PALETTE[0], mfc="white", ms=4)
        axes.plot(x.values[-1], y.values[-1], "o", color=PALETTE[0], ms=4)
        _label_both(axes, x, y)
        _settled(figure)
    return figure


def draw_section(found: Section, size: Size) -> Figure:
    """Draw a section: of two quantities one against the other; of one its return map, each value
    against the one before.
    """
    x, *rest = map(_wrapped, found.quantities)
    with style(paper=True):
        figure = _figure(size, 0.75 * size.width)
        axes = figure.subplots()
        count = len(found.t)
        dots: dict[str, Any] = {
            "color": PALETTE[0],
            "ms": 3.0 if count < 300 else 1.2,
            "mec": "none",
        }
        if rest:
            axes.plot(x.values, rest[0].values, "o", **dots)
            _label_both(axes, x, rest[0])
        else:
            axes.plot(x.values[:-1], x.values[1:], "o", **dots)
            axes.axline((x.values[0], x.values[0]), slope=1, color="#bbbbbb", linewidth=0.6)
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_xlabel(_axis(x) + "  at a crossing")
            axes.set_ylabel(_axis(x) + "  at the next")
        axes.set_title(f"{plain(found.at)}: {count} crossing{'' if count == 1 else 's'}")
        _settled(figure)
    return figure


def _wrapped(quantity: Quantity) -> Quantity:
    """An angle within half a turn to both sides; anything else as it is."""
    if quantity.unit != "rad":
        return quantity
    return replace(quantity, values=(quantity.values + np.pi) % (2 * np.pi) - np.pi)


def draw_strobe(motion: Motion, rows: Sequence[int], size: Size) -> Figure:
    """Draw the mechanism at some samples in one picture, the later the darker, and the paths."""
    shares = np.linspace(WEAKEST, 1.0, len(rows)) if len(rows) > 1 else np.ones(1)
    poses = list(zip(rows, shares.tolist(), strict=True))
    with style(paper=True):
        figure = _figure(size, 0.75 * size.width)
        axes = figure.subplots()
        axes.set_facecolor(motion.camera.background)
        (draw_plane if motion.dimensions == 2 else draw_space)(axes, motion, poses, rows[-1] + 1)
        # Without a given height the picture is as high as what it shows.
        if size.height is None:
            _fit_height(figure, axes)
        start, end = motion.t[rows[0]], motion.t[rows[-1]]
        times = f"t = {start:.4g} s" + (f" (light) to {end:.4g} s (full)" if len(rows) > 1 else "")
        axes.set_title(f"{len(rows)} pose{'' if len(rows) == 1 else 's'}, {times}")
        _settled(figure)
    return figure


def _fit_height(figure: Figure, axes: Axes) -> None:
    """Make a figure as high as the picture in it is for its width."""
    (x0, y0), (x1, y1) = axes.dataLim.get_points()
    width = figure.get_figwidth()
    share = np.clip((y1 - y0) / (x1 - x0 or 1.0), 0.25, 1.4)
    figure.set_figheight((width - 14 * MM) * share + 16 * MM)


def _figure(size: Size, height: float) -> Figure:
    pad = 0.8 * MM
    engine = ConstrainedLayoutEngine(w_pad=pad, h_pad=pad, hspace=0.02, wspace=0.02)
    return Figure(figsize=(size.width * MM, (size.height or height) * MM), layout=engine)


def _settled(figure: Figure) -> None:
    """Make ticks now, in this style, for figures that are drawn later in another."""
    figure.draw_without_rendering()


def _label_both(axes: Axes, x: Quantity, y: Quantity) -> None:
    axes.set_xlabel(_axis(x))
    axes.set_ylabel(_axis(y))


def _axis(quantity: Quantity) -> str:
    return ", ".join(filter(None, (_full(quantity), plain(quantity.unit))))


def _named(quantity: Quantity) -> str:
    """The name of a curve among others of its kind."""
    return plain(quantity.label) if quantity.title else symbol(quantity.label)


def _full(quantity: Quantity) -> str:
    """The name of a quantity that stands alone."""
    if not quantity.title or quantity.label.replace("_", " ") == quantity.title:
        return symbol(quantity.label) if not quantity.title else plain(quantity.title)
    if quantity.title == "energy":
        return f"{quantity.label} energy"
    return f"{plain(quantity.title)} {plain(quantity.label)}"
