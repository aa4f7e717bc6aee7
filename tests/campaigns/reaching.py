"""Inverse kinematics of arms: how many of random reachable poses are found.

    python tests/campaigns/reaching.py [--poses 200] [--starts 50]

prints for `puma560` and for arms of the package `example-robot-data` how many of the poses of a
tool at random coordinates within the limits are reached to 1e-9, at the first start (the middle of
the limits, or 0) and in all, the starts they take, and the processor time of one.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from robots import robots

import eomgen

ARMS = {
    "ur5_robot": "wrist_3_link",
    "ur10_robot": "wrist_3_link",
    "panda": "panda_hand",
    "kinova": "j2s6s200_link_6",
    "z1": "link06",
    "xarm7": "link7",
    "talos_left_arm": "gripper_left_base_link",
}
"""The links that carry the tool."""


def main() -> None:
    """Print a line for each arm."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--poses", type=int, default=200)
    parser.add_argument("--starts", type=int, default=50)
    given = parser.parse_args()
    files = {path.stem: path for path in robots()}
    for name in ("puma560", *ARMS):
        source = name
        if name in ARMS:
            tables = eomgen.import_robot(files[name]).tables
            point = {"name": "tool", "body": ARMS[name], "at": [0.0, 0.0, 0.1]}
            source = {**tables, "points": [point]}
        arm, rng = eomgen.kinematics(source), np.random.default_rng(1)
        (point,), starts = arm.points, []
        begun = time.process_time()
        for _ in range(given.poses):
            wanted = arm.place(point, arm._random(rng))
            found = arm.reach({point: wanted}, starts=given.starts)
            starts.append(found.starts if found.converged else 0)
        each = (time.process_time() - begun) / given.poses * 1e3
        taken = np.array(starts)
        print(
            f"{name:16} {len(arm.names)} coordinates, {(taken > 0).sum()} of {given.poses} found, "
            f"{(taken == 1).sum()} at the first start, {taken[taken > 0].mean():.1f} starts in the "
            f"mean, {taken.max()} at most, {each:.1f} ms",
            flush=True,
        )


if __name__ == "__main__":
    main()
