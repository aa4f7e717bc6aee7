"""Linkages whose bars come into line, through their change points for many turns.

    python tests/campaigns/change_points.py [--turns N] [--case NAME] [--method NAME]

parallelogram  one loop
chain          five parallelograms side by side, whose bars come into line together
phases         the same with pins of the cranks 25 degrees apart, so that the change points of one
               loop follow those of another

For each method: energy against the kinetic energy, the largest residual of the loops, how far the
cranks are from parallel, and the number of change points against that of the turns.
"""

import argparse
import sys
import time
from math import pi

import numpy as np

import eomgen

GROUND = (0.7, 0.5, 0.9, 0.6, 0.8)
"""Distances of the pivots of the cranks, m."""
CRANK = 0.4
METHODS = {
    "DOP853": {"rtol": 1e-11},
    "rk4": {"dt": 1e-3},
    "gauss_4": {"dt": 5e-3},
    "leapfrog": {"dt": 2e-3},
}
CASES = {"parallelogram": (1, 0.0), "chain": (5, 0.0), "phases": (5, 25.0)}


def linkage(loops: int, phase: float, speed: float = 10.0) -> str:
    """A scene: `loops` parallelograms side by side; the pins of each are turned by `phase`, in
    degrees, against those of the one before.
    """
    text = 'name = "linkage"\nloops = "projected"\n'
    for k in range(loops + 1):
        text += f'[[bodies]]\nname = "crank_{k}"\nmass = {1 + 0.2 * k}\ninertia_com = 0.02\n'
    for k in range(loops):
        text += f'[[bodies]]\nname = "rod_{k}"\nmass = {0.5 + 0.1 * k}\ninertia_com = 0.01\n'
    for k in range(loops + 1):
        text += f'[[joints]]\nname = "pivot_{k}"\ntype = "revolute"\nparent = "world"\n'
        text += f'child = "crank_{k}"\nr_parent = [{sum(GROUND[:k])}, 0]\n'
        text += f'coordinate = "theta_{k}"\n'
    for k in range(loops):
        pin = CRANK * np.exp(1j * np.radians(phase * k))
        at, half = f"[{float(pin.real)!r}, {float(pin.imag)!r}]", GROUND[k] / 2
        for name, crank, end, more in (
            ("pin", k, -half, f'coordinate = "phi_{k}"'), ("close", k + 1, half, "loop = true"),
        ):  # fmt: skip
            text += (
                f'[[joints]]\nname = "{name}_{k}"\ntype = "revolute"\nparent = "crank_{crank}"\n'
            )
            text += f'child = "rod_{k}"\nr_parent = {at}\nr_child = [{end}, 0]\n{more}\n'
    text += '[[effects]]\ntype = "gravity"\ng = 9.81\n[initial]\n'
    guesses = [f"theta_{k} = 0.5" for k in range(1, loops + 1)]
    guesses += [f"phi_{k} = -0.5" for k in range(loops)]
    text += f"q = {{ theta_0 = 0.5 }}\nv = {{ theta_0_dot = {speed} }}\n"
    return text + f"guess = {{ {', '.join(guesses)} }}\n"


def tried(case: str, method: str, turns: float) -> bool:
    """Whether a linkage keeps its loops, its branch and, by DOP853, its energy."""
    loops, phase = CASES[case]
    speed, start = 10.0, time.process_time()
    text = linkage(loops, phase, speed)
    run = eomgen.simulate(text, t_end=2 * pi * turns / speed, integrator=method, **METHODS[method])
    made = (run["theta_0"][-1] - run["theta_0"][0]) / (2 * pi)
    apart = max(
        float(np.abs(run["theta_0"] - run[f"theta_{k}"]).max()) for k in range(1, loops + 1)
    )
    energy = run.energy - run.energy[0]
    drift = float(energy[-100:].mean() - energy[:100].mean())
    open_ = max(after for _, after in run.trajectory.violations.values())
    print(
        f"{case} {method}: {made:.1f} turns in {time.process_time() - start:.0f} s, energy "
        f"{run.energy[0]:.3g} J within {np.abs(energy).max():.1e}, drift {drift:.1e} J; "
        f"loops {open_:.1e} m; cranks apart {apart:.1e} rad; {run.message or 'no change point'}",
        flush=True,
    )
    good = run.finished and apart < 1e-9 and open_ < 1e-12
    return good and (method != "DOP853" or bool(np.abs(energy).max() < 1e-7 * run.energy[0]))


def main() -> None:
    """All cases by all methods, or one."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--turns", type=float, default=100)
    parser.add_argument("--case", choices=CASES)
    parser.add_argument("--method", choices=METHODS)
    asked = parser.parse_args()
    cases = [asked.case] if asked.case else list(CASES)
    methods = [asked.method] if asked.method else list(METHODS)
    failed = sum(not tried(case, method, asked.turns) for case in cases for method in methods)
    print(f"{failed} failed")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
