"""Mechanisms with loops: 300 random ones by every route, and other engines; see the parts.

    python tests/campaigns/loops.py [random | pinocchio | peaucellier | symplectic] [--count N]

random       accelerations and wrenches of all joints by every route against the solver in maximal
             coordinates; 1 to 6 loops, all joint types, in the plane and in space by turns
pinocchio    accelerations against Pinocchio's constraint dynamics, of mechanisms in space that
             balls and welds close
peaucellier  how straight the line of Peaucellier's cell is over 1e5 steps
symplectic   constraints and energy of a four-bar that swings, over 1e6 steps of RATTLE
"""

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

import judges
import planar_linkages
from conserved import conserved
from engine import apart, engine
from loop_routes import ROUTES, apart_by_route, model_of, solved
from spatial_loops import random_loops
from test_loop_runs import four_bar
from test_loops import CLOSE, CONDITION, WELL, left_out

from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem


def random(count: int) -> int:
    """How many of the mechanisms are off by more than the bars."""
    failed, worst = 0, {route: [0.0] * 4 for route in ROUTES}
    kinds: Counter[str] = Counter()
    conditions = []
    start = time.process_time()
    for seed in range(count):
        dimensions, loops = 2 + seed % 2, 1 + seed // 2 % 6
        case = random_loops(seed, dimensions, 4 + loops + seed % 3, loops)
        model, (u, motion) = model_of(case), solved(case, seed)
        well = case.condition < CONDITION
        kinds.update(f"{loop.joint.kind}_{dimensions}" for loop in case.tree.loops)
        conditions.append(case.condition)
        for route, off in apart_by_route(case, model, u, motion).items():
            at = 2 * (not well)
            worst[route][at : at + 2] = np.maximum(worst[route][at : at + 2], off)
            if max(off) > (WELL if well else CLOSE) or model.notices:
                failed += 1
                notices = "; ".join(model.notices)
                print(f"{seed}: {route} off by {off[0]:.1e}, wrenches {off[1]:.1e}; condition "
                      f"{case.condition:.0f} {notices}", flush=True)  # fmt: skip
        if (seed + 1) % 50 == 0:
            print(f"to {seed + 1}: {time.process_time() - start:.0f} s", flush=True)
    well = sum(condition < CONDITION for condition in conditions)
    print(f"{count} mechanisms, {well} well-conditioned, largest condition {max(conditions):.1e}")
    print(f"loop joints: {dict(sorted(kinds.items()))}")
    for route, off in worst.items():
        numbers = " ".join(f"{x:.1e}" for x in off)
        print(f"{route:<12} v̇, wrenches; of the others v̇, wrenches: {numbers}")
    return failed


def pinocchio(count: int) -> int:
    """How many mechanisms in space that balls and welds close are not as Pinocchio has them."""
    failed, tried, worst = 0, 0, 0.0
    for seed in range(count):
        loops = 1 + seed % 3
        case = random_loops(seed, 3, 4 + loops + seed % 3, loops, ("ball", "weld"))
        model, (u, motion) = model_of(case), solved(case, seed)
        try:
            other = judges.pinocchio_accelerations(case.tree, case.q, case.v, u)
        except judges.Unsuitable:
            continue
        tried += 1
        off = apart(other, motion.accelerations)
        ours = apart_by_route(case, model, u, replace(motion, accelerations=other))
        off = max(off, *(accelerations for accelerations, _ in ours.values()))
        worst = max(worst, off)
        if off > CLOSE:
            failed += 1
            print(f"{seed}: off by {off:.1e}; condition {case.condition:.0f}", flush=True)
    print(f"{tried} mechanisms; the worst is off by {worst:.1e}")
    return failed


def peaucellier(steps: int) -> int:
    """Whether the line is not straight to 1e-12 of its length."""
    text = planar_linkages.peaucellier_scene()
    module = engine(text, "aba", leave_out=left_out("point_positions")).module
    run = integrate(as_problem(module), "rk4", 1e-3 * steps, dt=1e-3)
    x, y = module.point_positions(0.0, run.y.T)[0]
    off = float(np.abs(x - planar_linkages.LINE).max() / np.ptp(y))
    print(f"{len(run.t) - 1} steps: off by {off:.1e} of its length, {np.ptp(y):.3f} m")
    return int(off > WELL or not run.finished)


def symplectic(steps: int) -> int:
    """Whether constraints open by more than 1e-12 m, or energy leaves its band or has a trend."""
    text = four_bar(initial="q = { theta = 0.3 }", route="embedded")
    start = time.perf_counter()
    found = conserved(text, "leapfrog", 2e-3, steps)
    print(f"{steps} steps in {time.perf_counter() - start:.1f} s: residual {found.residual:.1e} m, "
          f"band of energy {found.band:.3e} J, that of the first tenth {found.early:.3e} J, "
          f"trend {found.trend:.1e} J")  # fmt: skip
    kept = found.band < 1.01 * found.early and abs(found.trend) < 0.01 * found.band
    return int(found.residual > WELL or not kept)


PARTS = {
    "random": (random, 300),
    "pinocchio": (pinocchio, 60),
    "peaucellier": (peaucellier, 100_000),
    "symplectic": (symplectic, 1_000_000),
}


def main() -> None:
    """One of the parts, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("part", nargs="?", choices=PARTS)
    parser.add_argument("--count", type=int, help="mechanisms, or steps")
    given = parser.parse_args()
    failed = 0
    for name, (part, usual) in PARTS.items():
        if given.part in (None, name):
            print(f"{name}:")
            failed += part(given.count or usual)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
