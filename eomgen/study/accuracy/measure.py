"""How far a run is from the truth, in parts of the motion's own scale.

States of one unit form a group (all angles, all speeds …), and its scale is the greatest range that
any of its states goes through during the run: a radian of a motion that turns by two is half of
it, whatever else moves. An error is the greatest difference of any state, in parts of the scale of
its group; so it does not change with units, nor with where the origin lies.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from eomgen.run.problem import Floats

WRONG = 0.1
"""A run that is this far off says nothing of the motion any more, whatever it reported."""


def scales(states: Sequence[str], units: Mapping[str, str], y: Floats) -> Floats:
    """The scale of each state (ny,) of a motion y (n, ny), in the state's unit; positive.

    y may hold no more than the least and the greatest value of each state. Rows at equal times are
    not enough: those of an orbit, a period apart, do not move at all.

    A group that does not move at all has the greatest value in it as its scale, and 1 if all its
    values are 0.
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


def error(y: Floats, true: Floats, scale: Floats) -> float:
    """The greatest difference in parts of the scale, of one state (ny,) or of many (n, ny)."""
    return float(np.max(np.abs(y - true) / scale))
