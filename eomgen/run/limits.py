"""Coordinates of a run that left the limits of their joints."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from eomgen.run.trajectory import Trajectory


@dataclass(frozen=True)
class Excursion:
    """A coordinate outside its limits `low` and `high`.

    since     time of the first row outside, s
    farthest  the value farthest outside, and
    at        its time, s
    """

    state: str
    low: float
    high: float
    since: float
    farthest: float
    at: float


def excursions(
    trajectory: Trajectory, limits: Mapping[str, tuple[float, float]]
) -> list[Excursion]:
    """The states in `limits`, in their order, of which a row of the trajectory is outside.

    Names in `limits` that are not states of the trajectory are ignored.
    """
    found = []
    for state, (low, high) in limits.items():
        if state not in trajectory.states:
            continue
        values = trajectory.y[:, trajectory.states.index(state)]
        beyond = np.maximum(low - values, values - high)
        if beyond.max() > 0:
            first, worst = int(np.argmax(beyond > 0)), int(np.argmax(beyond))
            since, at = float(trajectory.t[first]), float(trajectory.t[worst])
            found.append(Excursion(state, low, high, since, float(values[worst]), at))
    return found
