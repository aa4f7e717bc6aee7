"""Errors of the accelerations: a figure with a bar for each route, and a table of all states."""

import csv
import io
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from eomgen.base.files import marked, write_whole
from eomgen.run.problem import FloatArray
from eomgen.show.style import FAINT, INK, PALETTE, plain, style, write_figure
from eomgen.study.cost.arithmetic import Arithmetic, Solver

LEAST = 0.05
"""Smaller errors are drawn here: a logarithmic axis has no 0."""
COLOURS = {"float64": PALETTE[0], "float32": PALETTE[1]}


def save_figure(found: Arithmetic, path: Path, *, force: bool = False) -> None:
    """Write the figure: for each route the range over all states, the quartiles, median and worst.

    Raises `RunError` as `write_figure` does.
    """
    solvers = [solver for solver in found.solvers if solver.operations is not None]
    with style():
        engine = ConstrainedLayoutEngine(rect=(0.015, 0.0, 0.985, 1.0))  # for labels of two lines
        figure = Figure(figsize=(10.0, 1.7 + 0.42 * len(solvers)), layout=engine)
        panels = figure.subplots(1, len(found.samples), sharey=True, sharex=True, squeeze=False)[0]
        for k, (axes, sample) in enumerate(zip(panels, found.samples, strict=True)):
            for i, solver in enumerate(solvers):
                _bar(axes, i, solver.errors[k].ulps, COLOURS[solver.precision])
            axes.set_title(f"{len(sample.y)} states, {sample.kind}")
            axes.set_xscale("log")
            axes.set_xlabel("error of v̇, units in the last place of its precision")
            axes.grid(axis="y", visible=False)
        panels[0].set_xlim(LEAST / 1.5, _farthest(solvers))
        panels[0].set_yticks(range(len(solvers)), [_label(solver) for solver in solvers])
        panels[0].set_ylim(len(solvers) - 0.4, -0.6)  # shared: the first solver is on top
        figure.suptitle(
            f"{plain(found.name)}: accuracy and cost of the accelerations",
            x=0.01,
            ha="left",
        )
        write_figure(figure, path, force=force)


def _label(solver: Solver) -> str:
    time = ""
    if solver.seconds is not None:
        us = 1e6 * solver.seconds
        time = f", {us:.1f} µs" if us < 99.95 else f", {us:.0f} µs"
    return f"{solver.name}, {solver.precision}\n{solver.operations} operations{time}"


def _farthest(solvers: list[Solver]) -> float:
    """The right limit of the axis, with room for the numbers beside the bars."""
    all_ulps = np.concatenate([errors.ulps for solver in solvers for errors in solver.errors])
    finite = all_ulps[np.isfinite(all_ulps)]
    most = max(float(np.max(finite, initial=1.0)), 10.0)
    return float(most * (most / LEAST) ** 0.2)


def _bar(axes: Axes, row: int, ulps: FloatArray, colour: str) -> None:
    known = np.maximum(ulps[np.isfinite(ulps)], LEAST)
    if not known.size:
        axes.text(LEAST, row, "no finite number", color=FAINT, va="center", fontsize=8.5)
        return
    least, low, median, high, most = np.quantile(known, (0.0, 0.25, 0.5, 0.75, 1.0))
    axes.plot([least, most], [row, row], color=colour, linewidth=1.2)
    axes.barh(row, high - low, left=low, height=0.5, color=colour, alpha=0.55)
    axes.plot([median, median], [row - 0.25, row + 0.25], color=INK, linewidth=1.6)
    axes.plot(most, row, ".", color=colour, markersize=6)
    axes.annotate(
        f"{most:.3g}",
        (most, row),
        xytext=(5, 0),
        textcoords="offset points",
        va="center",
        fontsize=8.5,
        color=FAINT,
    )


def save_table(found: Arithmetic, path: Path, *, force: bool = False) -> None:
    """Write a row for each state: its kind, time, condition number, the error of the accelerations
    by each route, ulp, and the state itself.

    The states are written exactly, so that the worst can be examined again. Errors in float32 are
    at the same states rounded to float32. Raises `RunError` as `write_whole` does.
    """
    solvers = [solver for solver in found.solvers if solver.operations is not None]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    heads = [f"{solver.name} {solver.precision}" for solver in solvers]
    table.writerow(["state_kind", "t", "condition", *heads, *found.states])
    for k, sample in enumerate(found.samples):
        columns = [solver.errors[k].ulps for solver in solvers]
        for i, (t, y) in enumerate(zip(sample.t.tolist(), sample.y.tolist(), strict=True)):
            errors = [f"{column[i]:.6g}" for column in columns]
            table.writerow([sample.kind, repr(t), f"{sample.condition[i]:.6g}", *errors, *y])
    write_whole(path, marked(text.getvalue()), force=force)
