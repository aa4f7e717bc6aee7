"""The figure of a sweep: a heat map over two parameters, a curve over one, histograms of a sample,
and a fan of trajectories if rows were kept.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eomgen.run.problem import FloatArray
from eomgen.show.style import FAINT, PALETTE, style, symbol, write_figure
from eomgen.sweep.ensemble import Ensemble

LINES = 200
"""Greatest number of trajectories in a fan."""


def save_sweep_figure(found: Ensemble, of: str, path: Path, *, force: bool = False) -> None:
    """Draw the values of a state or of an output with one number. Raises `RunError` as `of` does,
    or if the file cannot be written.
    """
    with style():
        write_figure(draw_sweep(found, of), path, force=force)


def draw_sweep(found: Ensemble, of: str) -> Figure:
    """The figure; of an output with several numbers the first is drawn."""
    values = found.of(of)
    values = values.reshape(len(found), -1)[:, 0].astype(float)
    values = np.where(found.finished, values, np.nan)
    fan = found.rows is not None and of in found.states
    figure = Figure((6.4, 6.4 if fan else 3.8), layout="constrained")
    parts = figure.subplots(2 if fan else 1, 1, squeeze=False)[:, 0]
    label = f"{symbol(of)} at t = {found.times[-1]:g} s"
    axes = found.design.axes
    if len(axes) == 2 and min(map(len, axes)) > 1:
        _heat_map(figure, parts[0], found, values, label)
    elif len(found.design.names) == 1:
        _curve(parts[0], found, values, label)
    else:
        _histogram(parts[0], values, label)
    parts[0].set_title(f"{found.scene}: {int(found.finished.sum())} of {len(found)} finished")
    if fan:
        _fan(parts[1], found, of)
    return figure


def _heat_map(figure: Figure, to: Axes, found: Ensemble, values: FloatArray, label: str) -> None:
    rows, columns = found.design.axes
    mesh = to.pcolormesh(
        columns, rows, values.reshape(len(rows), len(columns)), shading="nearest", rasterized=True
    )
    to.grid(False)
    to.set_xlabel(symbol(found.design.names[1]))
    to.set_ylabel(symbol(found.design.names[0]))
    figure.colorbar(mesh, ax=to, label=label)


def _curve(to: Axes, found: Ensemble, values: FloatArray, label: str) -> None:
    order = np.argsort(found.design.values[:, 0], kind="stable")
    x = found.design.values[order, 0]
    to.plot(x, values[order], color=PALETTE[0], marker="." if len(x) < 60 else "")
    to.set_xlabel(symbol(found.design.names[0]))
    to.set_ylabel(label)


def _histogram(to: Axes, values: FloatArray, label: str) -> None:
    there = values[np.isfinite(values)]
    if there.size:
        to.hist(there, bins=min(60, max(5, round(there.size**0.5))), color=PALETTE[0])
    to.set_xlabel(label)
    to.set_ylabel("members")


def _fan(to: Axes, found: Ensemble, of: str) -> None:
    assert found.rows is not None
    column = found.rows[:, :, found.states.index(of)]
    chosen = np.unique(np.linspace(0, len(found) - 1, LINES).round().astype(int))
    to.plot(found.times, column[chosen].T, color=FAINT, linewidth=0.5, alpha=0.4)
    low, middle, high = found.quantiles(of)
    to.fill_between(found.times, low, high, color=PALETTE[0], alpha=0.25, linewidth=0)
    to.plot(found.times, middle, color=PALETTE[0], label="median, and 5 to 95 %")
    to.set_xlabel("t in s")
    to.set_ylabel(symbol(of))
    to.legend(loc="best")
