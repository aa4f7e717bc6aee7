"""Detection of sliding modes: forces on either side of a switch drive the motion back to it.

A motion in a sliding mode stays where a switching function is 0 (Filippov, Differential Equations
with Discontinuous Righthand Sides, section 4). A method that makes steps on either side crosses it
again and again, and the tighter its tolerance, the shorter its steps.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eomgen.run.failure import StepFailure

FloatArray = NDArray[np.float64]

MOST = 50
"""A run ends when a function has gone back to 0 so often in succession after it had crossed it, on
average within `Returns.soon`."""
SLIDES = "forces switch back and forth"
"""How the reason begins why a run ended in a sliding mode."""
REMEDY = "make the switch gradual: tanh(s/width) in place of a jump of s"


@dataclass
class Returns:
    """Counts how often switching functions go back to 0.

    soon     the time, s, within which a function is back soon
    count    (ns,), how often in succession each was back after it had crossed 0
    since    (ns,), when it crossed 0 first
    """

    soon: float
    count: FloatArray = field(default_factory=lambda: np.zeros(0))
    since: FloatArray = field(default_factory=lambda: np.zeros(0))
    _crossed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def take(
        self, start: tuple[float, FloatArray], end: tuple[float, FloatArray], switched: bool
    ) -> None:
        """Take a step, by the times of its ends and the functions (ns,) there, and whether any of
        them has crossed 0 in it. Steps are given in order, without gaps.

        Raises `StepFailure` for a sliding mode.
        """
        (_, first), (t, last) = start, end
        if len(self.count) != len(first):
            self.count, self.since = np.zeros(len(first)), np.full(len(first), t)
            self._crossed = np.zeros(len(first), dtype=bool)
        if not (switched or self._crossed.any()):
            return
        away = self._crossed & ~((last - first) * first < 0)
        self.count = np.where(away, 0.0, self.count + self._crossed)
        near = np.minimum(np.abs(first), np.abs(last)) <= np.abs(last - first)
        self._crossed = switched & ((first * last < 0) | near)
        self.since = np.where(self.count > 0, self.since, t)
        sliding = (self.count >= MOST) & (t - self.since <= MOST * self.soon)
        if sliding.any():
            within = t - float(self.since[sliding][0])
            raise StepFailure(
                f"{SLIDES} {MOST} times within {within:.2g} s, each driving the motion back "
                "(a sliding mode)",
                REMEDY,
            )
