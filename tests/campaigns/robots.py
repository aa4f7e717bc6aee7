"""Robot files against other programs: accelerations of the imported scene at random states.

    python tests/campaigns/robots.py urdf [--only TEXT] [--states 20] [--base fixed|floating|both]

prints for each URDF of the package `example-robot-data` its freedoms, the operations of a call, the
time to generate its module, and the largest difference of accelerations from Pinocchio's, relative
to the largest of the state. What is not supported has its message instead.

`tests/robot_peers.py` says how states and torques of both correspond.
"""

import argparse
import sys
import xml.etree.ElementTree as xml
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parent.parent))
from robot_peers import Robot

import eomgen

BOUND = 1e-10


def robots() -> Iterator[Path]:
    """The URDF files of example-robot-data."""
    package = next(p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix")
    yield from sorted((package / "share/example-robot-data/robots").glob("**/*.urdf"))


def urdf(given: argparse.Namespace) -> int:
    """Compare all robots; return how many differ by more than the bound."""
    wrong, worst, count = 0, 0.0, 0
    bases = {"both": (False, True)}.get(given.base, (given.base == "floating",))
    for path in robots():
        for floating in bases if given.only in str(path) else ():
            if floating and xml.parse(path).find("link[@name='world']") is not None:
                continue  # Pinocchio would let the world move
            label = f"{path.stem:32} {'floating' if floating else 'fixed':8}"
            try:
                robot = Robot(path, floating)
            except eomgen.EomgenError as error:
                print(f"{label} {' / '.join(error.lines)}", flush=True)
                continue
            rng = np.random.default_rng(23)
            pin.seed(23)
            found = max(robot.difference(rng) for _ in range(given.states))
            wrong, worst, count = wrong + (not found < BOUND), max(worst, found), count + 1
            total = robot.module.COST["derivative"]["total"]
            label = f"{label} {len(robot.velocities):3} velocities {total:6} operations"
            mark = "" if found < BOUND else " !"
            print(f"{label} {robot.route:11} {robot.seconds:6.1f} s  {found:.1e}{mark}", flush=True)
    print(f"{count} compared, {wrong} beyond {BOUND:g}, worst {worst:.1e}")
    return wrong


def main() -> int:
    """Run one of the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("urdf",))
    parser.add_argument("--only", default="", help="part of a path")
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--base", choices=("fixed", "floating", "both"), default="both")
    given = parser.parse_args()
    return {"urdf": urdf}[given.what](given)


if __name__ == "__main__":
    raise SystemExit(bool(main()))
