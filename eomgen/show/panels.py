"""Panels of values against time: as curves, as a map, or as errors on a logarithmic axis."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from eomgen.show.motion import Array
from eomgen.show.style import FAINT

EPSILON = float(np.finfo(float).eps)

MOST_CURVES = 12
"""Greatest number of curves that can be distinguished."""

BENEATH: Mapping[str, Any] = {"linewidth": 2.6, "zorder": 1.9}
"""How a total is drawn, so that it does not cover a part that equals it: below it, and wider."""

FEW_NAMES = 6
"""Number of names that fit into one column beside a panel."""

MAP_TIMES = 600
"""Greatest number of times in a map: a panel has no more pixels."""


USUAL, BEYOND = 98, 3
"""A map's colours end at percentile `USUAL` if the greatest value exceeds `BEYOND` times it."""


ROUNDING = 1e-12
"""Changes smaller than this, relative to the quantities of their kind, are drawn as none."""
LEAST_SPAN = 0.1
"""What an axis spans then, relative to those quantities."""


def widen(axes: Axes, values: Array, size: float = 0.0) -> None:
    """Let the vertical axis span more than rounding errors, which would look like a motion.

    values  what is drawn, (n, k)
    size    the greatest absolute value of quantities of this kind, if not that of `values`
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return
    low, high = float(finite.min()), float(finite.max())
    size = max(size, abs(low), abs(high))
    if high - low < ROUNDING * size:
        middle = (low + high) / 2 if max(abs(low), abs(high)) > ROUNDING * size else 0.0
        half = LEAST_SPAN * (abs(middle) or size) / 2
        axes.set_ylim(middle - half, middle + half)


def draw_curves(
    axes: Axes,
    t: Array,
    values: Array,
    labels: Sequence[str],
    colours: Sequence[str],
    dashes: Sequence[str] = (),
) -> None:
    """Draw curves (n, k) with their names beside the panel; solid unless `dashes` are given."""
    marker = "o" if len(t) == 1 else ""
    kinds = dashes or ["-"] * len(labels)
    for curve, label, colour, kind in zip(values.T, labels, colours, kinds, strict=True):
        axes.plot(t, curve, kind, marker=marker, label=label, color=colour)
    axes.margins(x=0)
    if any(labels):
        many = len(labels) > FEW_NAMES
        axes.legend(
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
            ncols=2 if many else 1,
            **({"fontsize": 8, "columnspacing": 0.8, "handlelength": 1.4} if many else {}),
        )


def draw_map(
    axes: Axes,
    t: Array,
    values: Array,
    labels: Sequence[str],
    unit: str,
    *,
    every: bool = False,
) -> None:
    """Draw many quantities (n, k) of one unit as a map: a row each, time from left to right.

    every  name every row, not only some; there must be room for the names
    """
    # An image needs equally spaced times; those of a trajectory may be anywhere.
    times = np.linspace(t[0], t[-1], min(MAP_TIMES, max(2, len(t))))
    after = np.clip(np.searchsorted(t, times, side="right"), 1, max(1, len(t) - 1))
    before = after - 1
    after = np.minimum(after, len(t) - 1)
    span = np.where(t[after] > t[before], t[after] - t[before], 1.0)
    part = np.clip((times - t[before]) / span, 0.0, 1.0)[:, np.newaxis]
    shown = (1 - part) * values[before] + part * values[after]
    # One row with very large values must not fade the others: its own colours are cut off.
    most, usual = float(np.abs(shown).max()), float(np.percentile(np.abs(shown), USUAL))
    size = (usual if 0 < usual < most / BEYOND else most) or 1.0
    start, end = (t[0], t[-1]) if t[-1] > t[0] else (t[0] - 0.5, t[0] + 0.5)
    count = len(labels)
    image = axes.imshow(
        shown.T,
        aspect="auto",
        interpolation="nearest",
        cmap="RdBu_r",
        vmin=-size,
        vmax=size,
        extent=(start, end, count - 0.5, -0.5),
    )
    named = np.unique(np.linspace(0, count - 1, FEW_NAMES - 1).round().astype(int))
    if every:
        named = np.arange(count)
    letters = 7 if every else matplotlib.rcParams["ytick.labelsize"]
    axes.set_yticks(named, [labels[k] for k in named], fontsize=letters)
    axes.grid(visible=False)
    figure = axes.get_figure()
    assert figure is not None
    beside = axes.inset_axes((1.015, 0.0, 0.022, 1.0))
    bar = figure.colorbar(image, cax=beside, extend="neither" if size >= most else "both")
    bar.set_label(unit, parse_math=False)
    beside.spines["outline"].set_visible(False)


def draw_small(
    axes: Axes, t: Array, values: Array, labels: Sequence[str], colours: Sequence[str]
) -> None:
    """Draw errors (n, k) on a logarithmic axis; those below machine epsilon are drawn there."""
    axes.set_xlabel("t, s")
    axes.set_yscale("log")
    draw_curves(axes, t, np.maximum(values, EPSILON), labels, colours)
    low, high = axes.get_ylim()
    if low < 10 * EPSILON:
        low = EPSILON / 3
        axes.axhline(EPSILON, color=FAINT, linewidth=0.8, linestyle=":")
        beside = axes.get_yaxis_transform()
        axes.text(1.006, EPSILON, "ε", transform=beside, va="center", size=8, color=FAINT)
    axes.set_ylim(low, max(high, 1e4 * low))
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_formatter(NullFormatter())
