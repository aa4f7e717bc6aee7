"""What roboticists call, of robot files, against Pinocchio at random states.

    python tests/campaigns/robotics.py [--only TEXT] [--states 20] [--base fixed|floating|both]

prints for each URDF of the package `example-robot-data` its freedoms and the largest difference of
each output from Pinocchio's: Jacobians of frames in its three conventions and their rates times v,
centre of mass, momentum about it, operational space, gravity, the Coriolis matrix, the regressor,
derivatives of dynamics. Friction and damping, which Pinocchio does not apply, are taken out.
Differences are relative to the largest entry. As in `robots.py` 1e-10 is asked, of what has M⁻¹
2⁻⁵² times the condition of M if that is more: such differences are divided by what it is above. For
`operational_inertias`, which are inverted once more, it is the product with the condition of these.
Matrices are scaled to a diagonal of 1.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parent.parent))
from robotics_peers import differences
from robots import BOUND, robots

import eomgen


def main() -> int:
    """Compare all robots."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", default="", help="part of a path")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--base", choices=("fixed", "floating", "both"), default="both")
    given = parser.parse_args()
    bases = {"both": (False, True)}.get(given.base, (given.base == "floating",))
    files, count, wrong, worst = set(), 0, 0, dict[str, float]()
    for path in robots():
        for floating in bases if given.only in str(path) else ():
            label = f"{path.stem:32} {'floating' if floating else 'fixed':8}"
            pin.seed(23)
            try:
                nv, found = differences(path, floating, given.states, np.random.default_rng(23))
            except eomgen.EomgenError as error:
                print(f"{label} {' / '.join(error.lines)}", flush=True)
                continue
            files.add(path)
            bad = [name for name, off in found.items() if not off <= BOUND]
            count, wrong = count + 1, wrong + bool(bad)
            worst = {n: max(worst.get(n, 0.0), found.get(n, 0.0)) for n in {**worst, **found}}
            most = max(found, key=lambda name: found[name])
            shown = ", ".join(f"{name} {found[name]:.1e}" for name in bad or [most])
            print(f"{label} {nv:3} velocities {shown}{' !' * bool(bad)}", flush=True)
    for name, off in worst.items():
        print(f"{name:32} {off:.1e}")
    print(
        f"{len(files)} files, {count} compared at {given.states} states, {wrong} beyond {BOUND:g}"
    )
    return wrong


if __name__ == "__main__":
    raise SystemExit(bool(main()))
