"""The costs of effects as bars: operations, time, and how leaving each out changes the motion."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eomgen.show.style import FAINT, PALETTE, plain, style, write_figure
from eomgen.study.cost.bill import Bill, Item, difference
from eomgen.study.cost.omission import Change
from eomgen.study.cost.variants import Kind

MOST_BARS = 40
OWN = FAINT
COLOURS: dict[Kind, str] = {"effect": PALETTE[0], "mechanism": "#bbbbbb", "left out": PALETTE[1]}
"""The colour of the bars of each kind of item."""


def save_bill(bill: Bill, path: Path, *, force: bool = False) -> None:
    """Write the figure, sorted by operations; of more than `MOST_BARS` items the most expensive.

    Raises `RunError` as `write_figure` does.
    """
    known = [item for item in bill.items if not item.needed_by]
    items = sorted(known, key=lambda item: -item.operations)[:MOST_BARS]
    operations, seconds, spread = bill.shared
    labels = ["the mechanism itself", *map(_label, items), "shared by effects"]
    colours = [OWN, *(COLOURS[item.kind] for item in items), OWN]
    counts = [bill.bare_operations, *(item.operations for item in items), operations]
    times = [1e6 * s for s in (bill.bare_seconds, *(item.seconds for item in items), seconds)]
    took = [f"{times[0]:.1f}", *(difference(item.seconds, item.spread) for item in items)]
    took.append(difference(seconds, spread))
    times = [0.0 if text[0] == "<" else time for time, text in zip(times, took, strict=True)]
    changes = [math.nan, *(_percent(item.change) for item in items), math.nan]
    panels: list[tuple[str, Sequence[float], Sequence[str]]] = [
        ("operations of a derivative", counts, [str(count) for count in counts]),
        ("time of a call, µs", times, took),
    ]
    if bill.extent is not None:
        percents = ["" if item.change is None else item.change.percent for item in items]
        panels.append(("without it the motion changes by, %", changes, ["", *percents, ""]))
    with style():
        figure = Figure(figsize=(10.0, 1.5 + 0.32 * len(labels)), layout="constrained")
        for axes, (label, values, texts) in zip(
            figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels, strict=True
        ):
            _bars(axes, [plain(text) for text in labels], values, texts, colours)
            axes.set_xlabel(label)
        axes.invert_yaxis()  # shared: the first label is on top
        figure.suptitle(f"{plain(bill.name)}: what each effect costs", x=0.01, ha="left")
        write_figure(figure, path, force=force)


def _label(item: Item) -> str:
    tails = {"effect": "", "mechanism": ", of the mechanism", "left out": ", left out"}
    return item.label + tails[item.kind]


def _percent(change: Change | None) -> float:
    return math.nan if change is None else 100 * change.relative


def _bars(
    axes: Axes, labels: list[str], values: Sequence[float], texts: Sequence[str], colours: list[str]
) -> None:
    lengths = [value if math.isfinite(value) else 0.0 for value in values]
    bars = axes.barh(range(len(labels)), lengths, color=colours, tick_label=labels)
    axes.bar_label(bars, [f" {text}" for text in texts], fontsize=8.5)
    axes.margins(x=0.2)
    if not any(lengths):
        axes.set_xlim(0, 1)
    axes.grid(axis="y", visible=False)
