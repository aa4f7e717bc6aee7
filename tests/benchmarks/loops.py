"""How cost grows with the number of loops: chains of 1 to 100 planar four-bars.

    python tests/benchmarks/loops.py [-o FIGURE] [--most N]

Each four-bar stands on the coupler of the one before it. For each chain: operations of a derivative
by the routes named, and the time to assemble the scene and to generate the program by `embedded`.
Prints a table with the exponents of the growth from one row to the next, and draws a figure.
"""

import argparse
import math
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from matplotlib.figure import Figure
from paired import row

sys.path.append(str(Path(__file__).parent.parent))

from planar_linkages import four_bars

from eomgen.codegen.derive import derive
from eomgen.dynamics.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import generate
from eomgen.program.program import cost
from eomgen.scene.reader import parse_scene
from eomgen.show.style import FAINT, PALETTE, style, write_figure

COUNTS = (1, 2, 5, 10, 20, 50, 100)
ROUTES = ("embedded", "independent", "aba", "ldl")
LONGEST = 10.0
"""A cost that took longer for a chain, s, is not measured for longer ones."""
NAMES = (*(f"operations, {route}" for route in ROUTES), "assembly, s", "generation, s")


def measured(count: int, left: set[str]) -> dict[str, float]:
    """The costs of a chain but those `left` out, by the names in `NAMES`."""
    found = {}
    start = time.perf_counter()
    model = assembled(elaborate(parse_scene(four_bars(count))))
    found["assembly, s"] = time.perf_counter() - start
    for route in ROUTES:
        name = f"operations, {route}"
        if name in left:
            continue
        start = time.perf_counter()
        alone = derive(replace(model, route=route), route).alone
        assert alone is not None
        found[name] = float(cost(alone, "derivative")["total"])
        if time.perf_counter() - start > LONGEST:
            left.add(name)
    if "generation, s" not in left:
        start = time.perf_counter()
        generate(replace(model, route=ROUTES[0]), jacobian=False)
        found["generation, s"] = time.perf_counter() - start
        if found["generation, s"] > LONGEST:
            left.add("generation, s")
    return found


def drawn(found: dict[int, dict[str, float]]) -> Figure:
    """The costs of chains by their four-bars."""
    with style():
        figure = Figure(figsize=(9, 2.8), layout="constrained")
        left_axes, right_axes = figure.subplots(1, 2)
        for k, name in enumerate(NAMES):
            axes = left_axes if name in NAMES[: len(ROUTES)] else right_axes
            shown = {count: values[name] for count, values in found.items() if name in values}
            label = name.removeprefix("operations, ").removesuffix(", s")
            axes.loglog(list(shown), list(shown.values()), "o-", color=PALETTE[k], markersize=3,
                        label=label)  # fmt: skip
        first = found[1][NAMES[0]]
        left_axes.loglog(list(found), [first * n for n in found], ":", color=FAINT,
                         label="linear")  # fmt: skip
        left_axes.set_title("operations of a derivative")
        right_axes.set_title("time, s")
        for axes in (left_axes, right_axes):
            axes.set_xlabel("four-bars")
            axes.legend()
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("-o", type=Path, default=Path("docs/loops_growth.png"), metavar="FIGURE")
    parser.add_argument("--most", type=int, default=COUNTS[-1], help="four-bars")
    given = parser.parse_args()
    left: set[str] = set()
    measured(1, left)  # what is loaded and prepared once does not count
    row("four-bars", *NAMES)
    row(*["---"] * (1 + len(NAMES)))
    found = {}
    for count in (count for count in COUNTS if count <= given.most):
        found[count] = measured(count, left)
        row(count, *(f"{found[count][n]:.4g}" if n in found[count] else "-" for n in NAMES))
    for (a, before), (b, after) in pairwise(found.items()):
        powers = [
            f"exponent {math.log(after[n] / before[n]) / math.log(b / a):.2f}"
            if n in after
            else "-"
            for n in NAMES
        ]
        row(f"{a} to {b}", *powers)
    write_figure(drawn(found), given.o, force=True)
    print(f"wrote {given.o}")


if __name__ == "__main__":
    main()
