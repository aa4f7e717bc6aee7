"""A bill of effects as bars: operations and time, longest first."""

from pathlib import Path

from matplotlib.figure import Figure

from eomgen.show.style import PALETTE, plain, style, write_figure
from eomgen.study.bill import Bill


def save_bill(bill: Bill, path: Path, *, force: bool = False) -> None:
    """Write the figure; raises `RunError` as `write_figure` does."""
    items = sorted(bill.items, key=lambda item: item.operations)
    names = [plain(f"{item.name} ({item.type})") for item in items]
    names.insert(0, "the mechanism itself")
    operations = [bill.bare_operations, *(item.operations for item in items)]
    microseconds = [1e6 * bill.bare_seconds, *(1e6 * item.seconds for item in items)]
    with style():
        figure = Figure(figsize=(9.0, 1.6 + 0.34 * len(names)), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, values, label, unit in (
            (left, operations, "operations of a derivative", "{:.0f}"),
            (right, microseconds, "time of a call, µs", "{:.1f}"),
        ):
            bars = axes.barh(names, values, color=PALETTE[0])
            axes.bar_label(bars, [f" {unit.format(value)}" for value in values], fontsize=8.5)
            axes.margins(x=0.15)
            axes.set_xlabel(label)
            axes.grid(axis="y", visible=False)
        figure.suptitle(f"{plain(bill.name)}: what each effect costs", x=0.01, ha="left")
        write_figure(figure, path, force=force)
