"""How cost grows with the number of loops: chains of 1 to 100 planar four-bars.

    python tests/benchmarks/loops.py [-o FIGURE] [--most N]

Each four-bar stands on the coupler of the one before it. For each chain: operations of a derivative
by the routes named, and the time to assemble the scene, to generate the program by `embedded` and
for a call of it in C.
Prints a table with the exponents of the growth from one row to the next, and draws a figure.
"""

import argparse
import math
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from paired import paired, row
from peers import compiled_columns, library

sys.path.append(str(Path(__file__).parent.parent))

from planar_linkages import four_bars

from eomgen.codegen.derive import derive
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import generate
from eomgen.program.program import cost
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene
from eomgen.show.style import FAINT, PALETTE, style, write_figure
from eomgen.store import generated_code

COUNTS = (1, 2, 5, 10, 20, 50, 100)
ROUTES = ("embedded", "independent", "aba", "ldl")
LONGEST = 10.0
"""A cost that took longer for a chain, s, is not measured for longer ones."""
FEW = 64
"""States of a call, few so that the shortest calls are not interrupted."""
MOST_GENERATED = 300.0
"""The same for the program by `embedded`."""
TIMES = ("assembly, s", "generation, s", "call in C, µs")
NAMES = (*(f"operations, {route}" for route in ROUTES), *TIMES)


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
        model = replace(model, route=ROUTES[0], outputs=())
        start = time.perf_counter()
        generate(model, jacobian=False)
        found["generation, s"] = time.perf_counter() - start
        found["call in C, µs"] = called(model)
        if found["generation, s"] > MOST_GENERATED:
            left |= {"generation, s", "call in C, µs"}
    return found


def called(model: Model) -> float:
    """The least time of a derivative in C, µs, at states near the start."""
    module = load_module(generated_code(model).module, model.name)
    made, _ = library(model, False)
    start = np.array([*model.initial_q, *model.initial_v])[:, np.newaxis]
    near = np.random.default_rng(1).uniform(-1e-3, 1e-3, (len(start), FEW))
    call, _ = compiled_columns(module, made, start + near)
    return 1e6 * float(np.min(paired(300, call))) / FEW


def drawn(found: dict[int, dict[str, float]]) -> Figure:
    """The costs of chains by their four-bars."""
    titles = ("operations of a derivative", "time, s", "call in C, µs")
    groups = (NAMES[: len(ROUTES)], TIMES[:2], TIMES[2:])
    with style():
        figure = Figure(figsize=(9, 2.8), layout="constrained")
        for axes, title, names in zip(figure.subplots(1, 3), titles, groups, strict=True):
            for k, name in enumerate(names):
                shown = {count: values[name] for count, values in found.items() if name in values}
                label = name.removeprefix("operations, ").removesuffix(", s")
                axes.loglog(list(shown), list(shown.values()), "o-", color=PALETTE[k],
                            markersize=3, label=label)  # fmt: skip
            if names is not groups[1]:
                last = found[max(found)][names[0]] / max(found)
                axes.loglog(list(found), [last * n for n in found], ":", color=FAINT,
                            label="linear")  # fmt: skip
            axes.set_title(title)
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
