"""The error of a run, relative to the motion's own scale.

States with the same unit form a group (all angles, all angular velocities …). The group's scale is
the greatest range of any of its states during the run: an angle that moves through two radians
gives a scale of 2 rad. The error is the greatest difference of any state relative to the scale of
its group. It depends neither on units nor on the origin.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from eomgen.run.problem import FloatArray

WRONG = 0.1
"""A run with this error says nothing about the motion, even if it reported success."""


def scales(states: Sequence[str], units: Mapping[str, str], y: FloatArray) -> FloatArray:
    """The scale (ny,) of each state of a motion y (n, ny), in the state's unit; positive.

    y may consist of just the least and the greatest value of each state. Samples at equal times are
    not enough: those of an orbit, a period apart, do not differ.

    The scale of a group that does not move is its greatest absolute value, or 1 if that is 0.
    """
    ranges, sizes = np.ptp(y, axis=0), np.max(np.abs(y), axis=0)
    found = np.ones(len(states))
    groups = [units.get(state, "") for state in states]
    for unit in dict.fromkeys(groups):
        members = [i for i, other in enumerate(groups) if other == unit]
        size = float(np.max(sizes[members]))
        moved = float(np.max(ranges[members]))
        found[members] = moved or size or 1.0
    return found


def error(y: FloatArray, true: FloatArray, scale: FloatArray) -> float:
    """The greatest difference relative to the scale, of one state (ny,) or of several (n, ny)."""
    return float(np.max(np.abs(y - true) / scale))
