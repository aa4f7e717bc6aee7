"""Firmware of scenes: its size, and how far float is from double.

    python tests/campaigns/firmware_sizes.py [SCENE …]

Size: bytes of code and constants of the functions that a model needs, linked alone by the compiler
that the project finds, with -Os: constants, derivative and step; then with the observer of the
example. Accuracy: of the derivative, relative to its largest component, at 100 random states near
the start; and the greatest difference of the coordinates after 1, 2 and 5 s in steps of 1 ms.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

import numpy as np
from firmware import Firmware

from eomgen.exports import Number
from eomgen.native.compiler import find_compiler

STEP = """#include "NAME.h"
volatile NAME_real in, out;
static NAME_real p[1 + NAME_PARAMETERS], k[1 + NAME_CONSTANTS], y[NAME_STATES], u[1 + NAME_INPUTS];
void _start(void) {
    NAME_defaults(p), NAME_constants(p, k);
    for (;;) u[0] = in, NAME_step(0, in, y, k, u), out = y[0];
}
"""
OBSERVER = """#include "NAME.h"
int observer_begin(void);
const NAME_real *observer_update(const NAME_real *u, NAME_real measured);
volatile NAME_real in, out;
static NAME_real u[1 + NAME_INPUTS];
void _start(void) {
    observer_begin();
    for (;;) u[0] = in, out = observer_update(u, in)[0];
}
"""
FLAGS = "-std=c99 -Os -ffunction-sections -fdata-sections -nostartfiles -static -Wl,--gc-sections"


def main() -> None:
    """Measure and print."""
    for scene in sys.argv[1:] or ("pendulum", "cart_pole", "two_body", "puma560", "tumbling_body"):
        made = {number: Firmware(scene, number) for number in ("double", "float")}
        sizes = [
            f"{number}: {size(each, STEP)} B, with observer {size(each, OBSERVER)} B"
            for number, each in made.items()
        ]
        print(f"{scene}: {'; '.join(sizes)}; float: {accuracy(made)}", flush=True)


def size(made: Firmware, main: str) -> int:
    """Bytes of a program of this main, as `size` counts text and data."""
    with tempfile.TemporaryDirectory() as folder:
        sources = {**made.sources, "main.c": main}
        for name, text in sources.items():
            (Path(folder) / name).write_text(filled(text, made), "utf-8")
        used = [name for name in sources if name.endswith(".c")]
        command = [*find_compiler().command, *FLAGS.split(), *used, "-o", "made"]
        subprocess.run([*command, "-lm"], cwd=folder, check=True)
        out = subprocess.run(["size", "made"], cwd=folder, check=True, capture_output=True)
        text, data = out.stdout.decode().splitlines()[1].split()[:2]
        return int(text) + int(data)


def filled(text: str, made: Firmware) -> str:
    """A main program with the scene's names."""
    for part in ("STATES", "INPUTS", "PARAMETERS", "CONSTANTS"):
        text = text.replace(f"NAME_{part}", f"{made.name.upper()}_{part}")
    return text.replace("NAME", made.name)


def state(made: Firmware) -> np.ndarray:
    """The initial state."""
    y = made.array(np.zeros(made.states))
    made.call("initial_state", 0.0, made.array(np.zeros(1)), made.k, made.array(np.zeros(100)), y)
    return y


def accuracy(made: dict[Number, Firmware]) -> str:
    """How far float is from double."""
    rng, worst = np.random.default_rng(1), 0.0
    double, single = made["double"], made["float"]
    start = state(double)
    for _ in range(100):
        y = np.float64(np.float32(start + rng.normal(0, 0.3, len(start))))
        u = rng.normal(0, 1, 100)
        exact = double.derivative(0.0, y, u)
        found = single.derivative(0.0, single.array(y), single.array(u))
        worst = max(worst, float(np.abs(found - exact).max() / np.abs(exact).max()))
    ends = []
    for seconds in (1, 2, 5):
        a, b = (
            each.stepped(start, np.zeros(100), 1e-3, 1000 * seconds) for each in (double, single)
        )
        ends.append(f"{np.abs(a - b)[: len(a) // 2].max():.1e}")
    return f"derivative {worst:.1e}, coordinates after 1, 2, 5 s {', '.join(ends)}"


if __name__ == "__main__":
    main()
