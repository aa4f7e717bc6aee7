"""Robot files against Pinocchio at random states: places, velocities and accelerations.

    python tests/campaigns/robots.py urdf [--only TEXT] [--states 20] [--base fixed|floating|both]
        [--module]

prints for each URDF of the package `example-robot-data` its freedoms and the largest differences
from Pinocchio: of accelerations, in its order and frames; of places and velocities of links; and of
its q and v, converted to the scene's state and back. The first two are relative to the largest of
the state. What is not supported has its message instead. `--module` compares the generated module
instead of the recursion that it is recorded from, and prints its operations and the time it takes.

The bound is 1e-10, of accelerations at states where the mass matrix loses more digits the rounding
of its entries: 2⁻⁵² times its condition, with a diagonal of 1. These states are counted.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import astuple
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parent.parent))
from robot_peers import Robot

import eomgen

BOUND = 1e-10
EPS = 2.0**-52


def robots() -> Iterator[Path]:
    """The URDF files of example-robot-data."""
    folder = distribution("example-robot-data").locate_file("cmeel.prefix/share")
    yield from sorted(Path(str(folder)).glob("**/*.urdf"))


def urdf(given: argparse.Namespace) -> int:
    """Compare all robots; return how many differ by more than the bound."""
    wrong, lost, worst, count = 0, 0, 0.0, 0
    bases = {"both": (False, True)}.get(given.base, (given.base == "floating",))
    for path in robots():
        for floating in bases if given.only in str(path) else ():
            label = f"{path.stem:32} {'floating' if floating else 'fixed':8}"
            try:
                robot = Robot(path, floating, "auto" * given.module)
            except eomgen.EomgenError as error:
                print(f"{label} {' / '.join(error.lines)}", flush=True)
                continue
            rng = np.random.default_rng(23)
            pin.seed(23)
            apart = [robot.difference(rng) for _ in range(given.states)]
            *off, condition = (max(each) for each in zip(*map(astuple, apart), strict=True))
            beyond = [each for each in apart if not each.accelerations <= BOUND]
            lost += sum(each.accelerations <= EPS * each.condition for each in beyond)
            missed = sum(not each.accelerations <= EPS * each.condition for each in beyond)
            bad = missed or not max(off[1:]) <= BOUND
            wrong, worst, count = wrong + bool(bad), max(worst, *off), count + 1
            mark = f"  condition {condition:.1e}{' !' * bool(bad)}" if beyond or bad else ""
            shown = " ".join(f"{each:.1e}" for each in off)
            print(f"{label} {robot.pin.nv:3} velocities {robot.about} {shown}{mark}", flush=True)
    print(
        f"{count} compared, worst {worst:.1e}; beyond {BOUND:g}: {lost} states by the condition of "
        f"their mass matrix, {wrong} robots otherwise"
    )
    return wrong


def main() -> int:
    """Run one of the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("urdf",))
    parser.add_argument("--only", default="", help="part of a path")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--module", action="store_true")
    parser.add_argument("--base", choices=("fixed", "floating", "both"), default="both")
    given = parser.parse_args()
    return {"urdf": urdf}[given.what](given)


if __name__ == "__main__":
    raise SystemExit(bool(main()))
