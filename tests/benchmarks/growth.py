"""How cost grows with the mechanism: planar chains of 2 to 400 links, in C.

    pip install -e '.[bench]' && python tests/benchmarks/growth.py [-o FIGURE]

For each chain: operations of a derivative, time to generate the program, time to compile it, and
time of a call. Prints a table with the exponents of the growth from one row to the next, and draws
a figure.
"""

import argparse
import math
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from paired import COLUMNS, chain, paired, row
from peers import compiled_columns, library

from eomgen.pipeline import generate
from eomgen.run.module import load_module
from eomgen.show.style import PALETTE, style, write_figure
from eomgen.store import generated_code

LINKS = (2, 5, 10, 20, 50, 100, 200, 400)
NAMES = ("operations", "generation, s", "compilation, s", "call, µs")


def measured(count: int) -> tuple[float, float, float, float]:
    """The four costs of a chain, in the order of `NAMES`."""
    model = chain(count)
    start = time.perf_counter()
    generate(model, jacobian=False)
    generation = time.perf_counter() - start
    module = load_module(generated_code(model).module, model.name)
    made, compilation = library(model, False)
    y = np.random.default_rng(1).uniform(-0.1, 0.1, (len(module.STATES), COLUMNS))
    call, _ = compiled_columns(module, made, y)
    seconds = float(np.median(paired(5, call))) / COLUMNS
    return module.COST["derivative"]["total"], generation, compilation, 1e6 * seconds


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("-o", type=Path, default=Path("docs/growth.png"), metavar="FIGURE")
    path = parser.parse_args().o
    measured(LINKS[0])  # what is loaded and prepared once does not count
    found = {count: measured(count) for count in LINKS}
    row("links", *NAMES)
    row(*["---"] * 5)
    for count, values in found.items():
        row(count, *(f"{value:.3g}" for value in values))
    for (a, before), (b, after) in pairwise(found.items()):
        grown = [math.log(y / x) / math.log(b / a) for x, y in zip(before, after, strict=True)]
        row(f"{a} to {b}", *(f"exponent {power:.2f}" for power in grown))
    with style():
        figure = Figure(figsize=(9, 2.6), layout="constrained")
        for axes, name, values in zip(
            figure.subplots(1, 4), NAMES, zip(*found.values(), strict=True), strict=True
        ):
            axes.loglog(LINKS, values, "o-", color=PALETTE[0], markersize=3)
            axes.loglog(
                LINKS,
                [values[-1] * count / LINKS[-1] for count in LINKS],
                ":",
                color=PALETTE[1],
                label="linear",
            )
            axes.set_title(name)
            axes.set_xlabel("links")
        axes.legend()
    write_figure(figure, path, force=True)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
