"""The figure of a sweep: a heat map over two parameters, a curve over one, histograms of a sample,
and a fan of trajectories if rows were kept.
"""

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from eomgen.results.ensemble import Ensemble
from eomgen.run.problem import FloatArray
from eomgen.show.style import ALARM, FAINT, PALETTE, plain, style, symbol, write_figure

LINES = 200
"""Greatest number of trajectories in a fan."""
BROKEN = "#d9d9d9"
"""The colour of members that did not finish in a heat map."""
TICKS = 8
"""Greatest number of ticks on an axis whose values are given one by one."""
ABOVE_LEGEND = 20
"""Distance of a title from axes with a legend between them, points."""
EVEN = 1e-6
"""An axis whose steps, or those of its logarithms, differ by less than this share is even."""


def save_sweep_figure(found: Ensemble, of: str, path: Path, *, force: bool = False) -> None:
    """Draw the values of a state or of an output with one number. Raises `RunError` as `of` does,
    or if the file cannot be written.
    """
    with style():
        write_figure(draw_sweep(found, of), path, force=force)


def draw_sweep(found: Ensemble, of: str) -> Figure:
    """The figure; of an output with several numbers the first is drawn."""
    values = np.asarray(found.of(of)).reshape(len(found), -1)[:, 0].astype(float)
    values = np.where(found.finished, values, np.nan)
    fan = found.rows is not None and of in found.states
    figure = Figure((6.4, 6.8 if fan else 4.0), layout="constrained")
    parts = figure.subplots(2 if fan else 1, 1, squeeze=False)[:, 0]
    label = f"{_label(found, of)} at t = {found.times[-1]:g} s"
    axes = found.design.axes
    if len(axes) == 2 and min(map(len, axes)) > 1:
        _heat_map(figure, parts[0], found, values, label)
    elif len(found.design.names) == 1:
        _curve(parts[0], found, values, label)
    else:
        _histogram(parts[0], values, label)
    ended = int(found.finished.sum())
    parts[0].set_title(
        f"{plain(found.scene)}: {ended} of {len(found)} runs finished",
        pad=None if ended == len(found) else ABOVE_LEGEND,
    )
    if fan:
        _fan(parts[1], found, of)
    return figure


def _label(found: Ensemble, name: str) -> str:
    """A quantity with its unit."""
    unit = found.units.get(name, "")
    words = symbol(name) if "_energy" not in name else plain(name.replace("_", " "))
    return f"{words} in {plain(_raised(unit))}" if unit else words


def _raised(unit: str) -> str:
    return unit.replace("^2", "²").replace("^3", "³")


def _heat_map(figure: Figure, to: Axes, found: Ensemble, values: FloatArray, label: str) -> None:
    rows, columns = found.design.axes
    mesh = to.pcolormesh(
        _edges(columns),
        _edges(rows),
        np.ma.masked_invalid(values.reshape(len(rows), len(columns))),
        cmap=_colours(),
        shading="flat",
        rasterized=True,
    )
    to.grid(False)
    names = found.design.names
    to.set(xlabel=_label(found, names[1]), ylabel=_label(found, names[0]))
    for axis, at, scale in ((to.xaxis, columns, to.set_xscale), (to.yaxis, rows, to.set_yscale)):
        if _is_logarithmic(at):
            scale("log")
        elif not _is_even(at):
            marked = np.unique(np.linspace(0, len(at) - 1, TICKS).round().astype(int))
            axis.set_ticks(marked, [f"{value:.3g}" for value in at[marked].tolist()])
    if np.isfinite(values).any():
        figure.colorbar(mesh, ax=to, label=label)
    if not found.finished.all():
        _note_broken(to)


def _colours() -> Colormap:
    return colormaps["viridis"].with_extremes(bad=BROKEN)


def _note_broken(to: Axes) -> None:
    mark = Patch(facecolor=BROKEN, edgecolor=FAINT, linewidth=0.5, label="not finished")
    to.legend(handles=[mark], loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def _is_even(at: FloatArray) -> bool:
    """Whether the distances between values are the same."""
    steps = np.diff(at / np.abs(at).max()) if len(at) > 1 and at.any() else np.zeros(1)
    return bool(steps[0] and np.ptp(steps) <= EVEN * abs(steps[0]))


def _is_logarithmic(at: FloatArray) -> bool:
    """Whether values are even by their logarithms, and not by themselves."""
    return len(at) > 2 and bool((at > 0).all()) and not _is_even(at) and _is_even(np.log(at))


def _edges(at: FloatArray) -> FloatArray:
    """Borders between values; by their logarithms, or by their numbers, if these alone are even."""
    if _is_logarithmic(at):
        return np.exp(_edges(np.log(at)))
    at = at if _is_even(at) else np.arange(len(at), dtype=float)
    half = (at[1] - at[0]) / 2
    return np.concatenate([at - half, at[-1:] + half])


def _curve(to: Axes, found: Ensemble, values: FloatArray, label: str) -> None:
    order = np.argsort(found.design.values[:, 0], kind="stable")
    x, y = found.design.values[order, 0], values[order]
    to.plot(x, y, color=PALETTE[0], marker="." if len(x) < 60 else "")
    broken = x[~np.isfinite(y)]
    if broken.size:
        # On the lower border, whatever the values.
        to.plot(
            *(broken, np.zeros(broken.size)),
            color=ALARM,
            linestyle="",
            marker="x",
            transform=to.get_xaxis_transform(),
            clip_on=False,
            label="not finished",
        )
        to.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    if _is_logarithmic(np.unique(x)):
        to.set_xscale("log")
    to.set_xlabel(_label(found, found.design.names[0]))
    to.set_ylabel(label)


def _histogram(to: Axes, values: FloatArray, label: str) -> None:
    there = values[np.isfinite(values)]
    if there.size:
        bins = min(60, max(5, round(there.size**0.5)))
        to.hist(there, bins=bins, color=PALETTE[0], edgecolor="white", linewidth=0.4)
    to.yaxis.set_major_locator(MaxNLocator(integer=True))
    to.set_xlabel(label)
    to.set_ylabel("runs")


def _fan(to: Axes, found: Ensemble, of: str) -> None:
    assert found.rows is not None
    chosen = np.unique(np.linspace(0, len(found) - 1, LINES).round().astype(int))
    column = np.array([found.rows[i, :, found.states.index(of)] for i in chosen.tolist()])
    clear = min(0.5, max(0.1, 15 / len(chosen)))
    to.plot(found.times, column.T, color=FAINT, linewidth=0.5, alpha=clear)
    low, middle, high = found.quantiles(of)
    to.fill_between(
        *(found.times, low, high),
        color=PALETTE[0],
        alpha=0.25,
        linewidth=0,
        label="5 to 95 % of the runs",
    )
    to.plot(found.times, middle, color=PALETTE[0], linewidth=2, label="median")
    ends = [_last(found.times, line) for line in column]
    stopped = np.array([end for end in ends if end and end[0] < found.times[-1]])
    if stopped.size:
        to.plot(
            *stopped.T, color=ALARM, linestyle="", marker="x", label="last row of a stopped run"
        )
    to.set_xlim(0, found.times[-1])
    to.set_xlabel("t in s")
    to.set_ylabel(_label(found, of))
    to.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)


def _last(times: FloatArray, values: FloatArray) -> tuple[float, float] | None:
    """The last time with a finite value, and that; None if there is none."""
    there = np.flatnonzero(np.isfinite(values))
    return (float(times[there[-1]]), float(values[there[-1]])) if there.size else None
