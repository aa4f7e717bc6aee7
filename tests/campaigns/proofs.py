"""Proven boxes of built-in scenes: how wide, in what time, and whether they hold a reference.

    python tests/campaigns/proofs.py [--count 5] [--only NAME,…]

For each scene a motion is proven to 1e-9 from its own start, and the time printed; then shorter
ones from random starts near it, at whose end a reference with 40 digits must lie in the box.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from mpmath import mp

sys.path.insert(0, str(Path(__file__).parent.parent))

from extrapolated import moved, rate_of

import eomgen
from eomgen.store import program_of

SCENES = {
    **dict.fromkeys(("pendulum", "double_pendulum", "two_body"), 10.0),
    **dict.fromkeys(("furuta_pendulum", "acrobot", "cart_pole"), 10.0),
    **dict.fromkeys(("spinning_top", "tumbling_body", "four_bar"), 3.0),
}
"""Built-in scenes with smooth equations, and how long a motion is proven, s."""
SHORT, PARTS, WANTED = 0.25, 10, 1e-18
"""Length of a motion from a random start, s; steps of its reference; the wanted radius."""


def main() -> int:
    """Prove all; the exit code is 1 if a box does not hold its reference."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    draw, held, runs = np.random.default_rng(0), 0, 0
    for name in given.only.split(",") if given.only else SCENES:
        eomgen.check(name)
        began = time.process_time()
        found = eomgen.certify(name, t_end=SCENES[name], samples=11)
        spent = time.process_time() - began
        print(
            f"{name}: {found.t[-1]:g} s, radius {found.largest:.1e}, {found.steps} steps, "
            f"order {found.order}, {found.bits} bits, {spent:.1f} s {found.message}",
            flush=True,
        )
        for _ in range(given.count):
            runs, held = runs + 1, held + _holds(name, draw)
    print(f"{held} of {runs} boxes hold their reference")
    return int(held < runs)


def _holds(name: str, draw: np.random.Generator) -> bool:
    """Whether the last box of a motion from a random start holds a reference."""
    module = eomgen.load(eomgen.generate(name))
    y = np.array(module.initial_state())
    free = [i for i in range(y.size) if all(i not in q for q in module.QUATERNIONS)]
    y[free] += draw.uniform(-0.1, 0.1, len(free))
    state = {module.STATES[i]: float(y[i]) for i in free}
    found = eomgen.certify(name, t_end=SHORT, tolerance=WANTED, samples=2, state=state)
    values = {**module.PARAMETERS, **module.INPUTS}
    rate = rate_of(program_of(eomgen.check(name)), module.STATES, values)
    with mp.workdps(60):
        at, t = [mp.mpf(float(x)) for x in found.y[0]], mp.mpf(0)
        h = mp.mpf(SHORT) / PARTS
        for _ in range(PARTS):
            at, t = moved(rate, t, at, h), t + h
        rows = zip(at, found.y[-1], found.low[-1], found.radius[-1], strict=True)
        return found.finished and all(
            abs(mp.mpf(float(a)) + mp.mpf(float(b)) - x) <= radius for x, a, b, radius in rows
        )


if __name__ == "__main__":
    sys.exit(main())
