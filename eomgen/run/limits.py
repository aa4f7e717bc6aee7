"""Which coordinates of a run left the limits of their joints, and when."""

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
    """What the rows of a trajectory show of each state in `limits` that left them, in their order.

    A form of the state that has no such coordinate shows nothing of it.
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
