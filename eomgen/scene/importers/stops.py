"""Limits of joints as rigid stops."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any


def stops(
    joints: Iterable[Mapping[str, Any]], following: Collection[str]
) -> Iterator[dict[str, Any]]:
    """A rigid stop without bounce for each joint that has limits, but for the coordinates
    `following` others, or locked.
    """
    for joint in joints:
        if "limits" in joint and joint["coordinate"] not in following:
            low, high = joint["limits"]
            name = joint["name"]
            stop = {"type": "joint_stop", "name": f"{name}_stop", "joint": name}
            yield stop | {"low": low, "high": high, "restitution": 0.0}
