"""The work-precision diagram: error against time on logarithmic axes, one line per method."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from eomgen.show.style import ALARM, FAINT, INK, colours, plain, style, write_figure
from eomgen.study.accuracy.ladder import Work, order
from eomgen.study.accuracy.measure import WRONG
from eomgen.tables.integrators import INTEGRATORS, Kind

COLOURS = {
    "euler": "#999999",
    "rk4": "#4477aa",
    "semi_implicit_euler": "#b8a000",
    "leapfrog": "#aa3377",
    "leapfrog_4": "#882255",
    "leapfrog_6": "#661166",
    "implicit_midpoint": "#ee6677",
    "gauss_4": "#cc3311",
    "gauss_6": "#7a1f4e",
    "RK45": "#55bbe8",
    "DOP853": "#0055bb",
    "Rodas5P": "#66a61e",
    "Radau": "#228833",
    "Radau_differences": "#228833",
    "BDF": "#ee7733",
    "BDF_differences": "#ee7733",
    "LSODA": "#009988",
    "taylor": "#332288",
}
"""Each method's colour in all figures; one with finite differences has that of its exact twin."""
MARKERS: dict[Kind, str] = {"explicit": "o", "implicit": "s", "symplectic": "D"}
TITLES: dict[Kind, str] = {
    "explicit": "Explicit",
    "implicit": "Implicit",
    "symplectic": "Symplectic",
}
TROUBLES = {
    "wrong": ("x", "reported success,\nbut is wrong"),
    "failed": ("P", "failed"),
    "over": (">", "stopped: took too long"),
}
"""Statuses of runs that are marked, with marker and label."""
AT_MOST, RING = "v", "o"
TOP = 3.0
"""Greater errors, and failed runs, are drawn here."""
BESIDE = 0.85
"""Left side of the legend, relative to the figure's width."""
SMALLEST = 1e-17
MOST = 10.0
"""Smaller and greater drifts are drawn at these."""

Value = Callable[[Work], float]


@dataclass(frozen=True)
class Diagram:
    """The texts of a figure, and what it shows besides its runs.

    name    of the scene
    about   lines below the title
    floor   error below which nothing is resolved
    energy  meaning of the energy drift; "" if it is not known
    joints  whether joints can come apart, so that their gaps have a panel
    taken   by error, the run to take for it, if there is one; it has a ring
    """

    name: str
    about: str
    floor: float
    energy: str
    joints: bool
    taken: Mapping[float, Sequence[Work]] = field(default_factory=dict)


def draw(diagram: Diagram, works: Sequence[Work]) -> Figure:
    """Draw error against time and against derivatives, and drifts, with one line per method.

    Failed and wrong runs are drawn at their time, no higher than the top. The figure uses no window
    and no global state.
    """
    panels: list[Callable[[Axes], None]] = [partial(_draw_evaluations, diagram, works)]
    if diagram.energy:
        panels.append(partial(_draw_drift, works, diagram.energy, lambda w: w.energy_drift))
    if diagram.joints:
        panels.append(partial(_draw_drift, works, "Gap in the joints, m", lambda w: w.joint_gap))
    if any(work.quaternion_defect > 0 for work in works):
        title = "Deviation of quaternions from length 1 before scaling"
        panels.append(partial(_draw_drift, works, title, lambda w: w.quaternion_defect))
    with style():
        figure = Figure(figsize=(13.0, 7.2 if len(panels) < 3 else 8.6))
        write = partial(figure.text, 0.01, va="top", parse_math=False)
        height = figure.get_figheight()
        write(
            1 - 0.1 / height, f"{diagram.name}: what accuracy costs in time", size=15, weight="bold"
        )
        write(1 - 0.42 / height, diagram.about, size=9.5, color=FAINT, linespacing=1.4)
        top = 1 - (0.55 + 0.2 * (1 + diagram.about.count("\n"))) / height
        figure.set_layout_engine(
            ConstrainedLayoutEngine(
                rect=(0.006, 0.006, BESIDE - 0.014, top), wspace=0.03, hspace=0.03
            )
        )
        grid = figure.add_gridspec(len(panels), 2, width_ratios=(1.5, 1))
        main = figure.add_subplot(grid[:, 0])
        _draw_errors(main, diagram, works, lambda work: work.seconds, spread=True)
        main.set_xlabel("time of a run, s: the least, and beside it to the median of repeated runs")
        main.set_title("Error over the whole run, relative to the motion's own scale")
        for row, panel in enumerate(panels):
            panel(figure.add_subplot(grid[row, 1]))
        _draw_legend(figure, diagram, works, top)
    return figure


def save(diagram: Diagram, works: Sequence[Work], path: Path, *, force: bool = False) -> None:
    """Write the figure, .png or .svg. Raises `RunError` as `write_figure` does."""
    write_figure(draw(diagram, works), path, force=force)


def colour(method: str) -> str:
    """A method's colour; a method that is not in the table gets one by its index."""
    if method in COLOURS:
        return COLOURS[method]
    return colours(len(INTEGRATORS))[list(INTEGRATORS).index(method)]


def _line(method: str) -> dict[str, object]:
    """The style of a method's line: dashed for equal steps, hollow for finite differences."""
    hollow = method.endswith("_differences")
    dashes = ":" if hollow else "-" if order(method) is None else "--"
    return {
        "color": colour(method),
        "linestyle": dashes,
        "marker": MARKERS[INTEGRATORS[method].kind],
        "markerfacecolor": "white" if hollow else colour(method),
        "markersize": 5,
        "linewidth": 1.3,
    }


def _by_method(works: Sequence[Work]) -> dict[str, list[Work]]:
    found: dict[str, list[Work]] = {method: [] for method in INTEGRATORS}
    for work in works:
        found[work.setting.integrator].append(work)
    return {method: own for method, own in found.items() if own}


def _draw_errors(
    axes: Axes,
    diagram: Diagram,
    works: Sequence[Work],
    cost: Value,
    *,
    words: bool = True,
    spread: bool = False,
) -> None:
    """Draw one line per method through its "ok" runs, with the spread of their times if `spread`;
    other runs as marks at their errors.
    """
    axes.set_xscale("log")
    axes.set_yscale("log")
    for method, own in _by_method(works).items():
        _draw_method(axes, method, own, cost, spread=spread)
    known = [work.error for work in works if work.status == "ok" and work.error > 0]
    low = min(known, default=1e-3) / 4
    axes.axhspan(WRONG, TOP, color=ALARM, alpha=0.07, linewidth=0)
    beside = partial(axes.text, transform=axes.get_yaxis_transform(), va="center", size=8.5)
    if words:
        text = beside(0.995, math.sqrt(WRONG * TOP), "wrong", ha="right", color=ALARM)
        text.set_in_layout(False)
    if diagram.floor > low:
        axes.axhspan(low, diagram.floor, color=FAINT, alpha=0.16, linewidth=0)
    if diagram.floor > low and words:
        note = "not resolved: below 100 × the reference's error"
        text = beside(0.01, math.sqrt(low * diagram.floor), note, color=FAINT)
        text.set_in_layout(False)
    axes.set_ylim(low, TOP)
    _ticks(axes)
    if spread:
        _mark(axes, diagram, cost)


def _mark(axes: Axes, diagram: Diagram, cost: Value) -> None:
    """Draw a ring about each run to take, with its error beside it."""
    for target, runs in diagram.taken.items():
        for work in runs:
            at = (cost(work), work.error)
            axes.plot(*at, RING, color=INK, markerfacecolor="none", markersize=13, zorder=5)
            axes.annotate(
                f"{target:.0e}",
                at,
                xytext=(-9, -9),
                textcoords="offset points",
                ha="right",
                va="top",
                size=8.5,
                in_layout=False,
            )


def _draw_method(
    axes: Axes, method: str, own: Sequence[Work], cost: Value, *, spread: bool
) -> None:
    """Draw the line of a method through its "ok" runs, and marks at the others."""
    right = [work for work in own if work.status == "ok"]
    axes.plot(
        [cost(work) for work in right],
        [work.error for work in right],
        label=method,
        **_line(method),  # type: ignore[arg-type]
    )
    if spread:
        axes.hlines(
            [work.error for work in right],
            [cost(work) for work in right],
            [cost(work) + (work.spread if work.spread > 0 else 0.0) for work in right],
            color=colour(method),
            linewidth=0.8,
        )
    bounds = [work for work in right if work.at_most[0]]
    axes.plot(
        [cost(work) for work in bounds],
        [work.error for work in bounds],
        AT_MOST,
        color=colour(method),
        markerfacecolor="white",
        markersize=7,
    )
    for status, (marker, _) in TROUBLES.items():
        marks = [work for work in own if work.status == status and cost(work) > 0]
        axes.plot(
            [cost(work) for work in marks],
            [min(work.error, TOP) if work.error > 0 else TOP for work in marks],
            marker,
            color=colour(method),
            markersize=6,
            clip_on=False,
            in_layout=False,
        )


def _draw_evaluations(diagram: Diagram, works: Sequence[Work], axes: Axes) -> None:
    _draw_errors(axes, diagram, works, lambda work: float(work.derivatives), words=False)
    axes.set_xlabel("derivatives evaluated")
    axes.set_title("The same error against derivatives")


def _draw_drift(works: Sequence[Work], title: str, value: Value, axes: Axes) -> None:
    """Draw a quantity that should stay 0 against time, for all finished runs."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for method, own in _by_method(works).items():
        known = [work for work in own if value(work) >= 0]
        axes.plot(
            [work.seconds for work in known],
            [min(max(value(work), SMALLEST), MOST) for work in known],
            label=method,
            **_line(method) | {"markersize": 3.5, "linewidth": 1.0},  # type: ignore[arg-type]
        )
    low, high = axes.get_ylim()
    axes.set_ylim(low, max(high, 1e4 * low))
    axes.set_xlabel("time of a run, s")
    axes.set_title(title)
    _ticks(axes)


def _ticks(axes: Axes) -> None:
    """Label every few decades, and nothing between."""
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())


def _draw_legend(figure: Figure, diagram: Diagram, works: Sequence[Work], top: float) -> None:
    """Methods by kind, and the meaning of the marks, in their own column."""
    present = _by_method([work for work in works if work.status != "refused"])
    handles: list[Line2D] = []

    def heading(text: str) -> None:
        if handles:
            handles.append(Line2D([], [], linestyle="", label=" "))
        handles.append(Line2D([], [], linestyle="", label=text, gid="heading"))

    for sort, title in TITLES.items():
        own = [method for method in present if INTEGRATORS[method].kind == sort]
        if own:
            heading(title)
            handles += [
                Line2D([], [], label=method, **_line(method))  # type: ignore[arg-type]
                for method in own
            ]
    heading("Lines")
    handles += [
        Line2D([], [], color=INK, linestyle="--", label="equal steps"),
        Line2D([], [], color=INK, linestyle="-", label="adaptive"),
        Line2D([], [], color=INK, linestyle=":", label="by differences"),
    ]
    marks = [
        (marker, words)
        for status, (marker, words) in TROUBLES.items()
        if any(work.status == status for work in works)
    ]
    if any(work.at_most[0] for work in works):
        marks.append((AT_MOST, "at most"))
    if any(diagram.taken.values()):
        marks.append((RING, "the run to take\nfor this error"))
    if marks:
        heading("Marks")
        handles += [
            Line2D([], [], color=INK, linestyle="", marker=marker, label=words, markersize=6,
                   markerfacecolor="white" if marker in (AT_MOST, RING) else INK)
            for marker, words in marks
        ]  # fmt: skip
    legend = figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(BESIDE, top), borderaxespad=0,
        handlelength=2.6, labelspacing=0.3, fontsize=8.4,
    )  # fmt: skip
    for text, handle in zip(legend.get_texts(), handles, strict=True):
        text.set_text(plain(text.get_text()))
        if handle.get_gid() == "heading":
            text.set_fontweight("bold")
    legend.set_in_layout(False)
