"""Mechanisms with loops: 300 random ones by every route, and other engines; see the parts.

    python tests/campaigns/loops.py [random | pinocchio | masses | peaucellier | energy] [--count N]

random       accelerations and wrenches of all joints by every route against the solver in maximal
             coordinates; 1 to 6 loops, all joint types, in the plane and in space by turns
pinocchio    accelerations against Pinocchio's constraint dynamics, of mechanisms that balls and
             welds close, and of a planar four-bar
masses       digits that each route keeps where the masses of a mechanism with loops are 12 decades
             apart, against 60 digits
peaucellier  how straight the line of Peaucellier's cell is over 1e5 steps
energy       energy and constraints of a conservative four-bar over 1e6 steps
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

from loop_routes import ROUTES, apart_by_route, model_of, solved
from spatial_loops import random_loops
from test_loops import CLOSE, CONDITION, WELL

MOST = (6, 8, 10)


def random(count: int) -> int:
    """How many of the mechanisms are off by more than the bars."""
    failed, worst = 0, {route: [0.0] * 4 for route in ROUTES}
    kinds: Counter[str] = Counter()
    conditions = []
    start = time.process_time()
    for seed in range(count):
        dimensions, loops = 2 + seed % 2, 1 + seed // 2 % 6
        case = random_loops(seed, dimensions, MOST[seed // 12 % 3], loops)
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


PARTS = {"random": random}


def main() -> None:
    """One of the parts, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("part", nargs="?", choices=PARTS)
    parser.add_argument("--count", type=int, default=300)
    given = parser.parse_args()
    failed = 0
    for name, part in PARTS.items():
        if given.part in (None, name):
            print(f"{name}:")
            failed += part(given.count)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
