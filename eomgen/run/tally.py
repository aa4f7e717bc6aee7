"""What a run takes, counted rather than timed, and how far its motion goes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.run.integrators.interface import Advance
from eomgen.run.problem import Contacts, Floats


def _unlimited(tally: "Tally", t: float) -> None:
    """Let every run go on."""


@dataclass
class Tally:
    """Counts of one run; `integrate` keeps it up to date at every step.

    check           told this tally and the time, s, after each step; raises `StepFailure` to end
                    the run
    steps, derivatives, jacobians  as in `Trajectory.counts`
    factorisations  LU factors made by methods that report them
    rows            rows kept
    held, looks     calls of `Contacts.held`, and of `Contacts.gaps` and `rates`
    low, high       (ny,), between which each state was at the ends of steps; None before the first
    """

    check: Callable[["Tally", float], None] = _unlimited
    steps: int = 0
    derivatives: int = 0
    jacobians: int = 0
    factorisations: int = 0
    rows: int = 0
    held: int = 0
    looks: int = 0
    low: Floats | None = field(default=None, repr=False)
    high: Floats | None = field(default=None, repr=False)

    def begin(self, y: Floats) -> None:
        """Take note of the initial state."""
        self.low = self.high = y

    def take(self, advance: Advance, derivatives: int, jacobians: int) -> None:
        """Take note of a step or strike, and of the calls made so far.

        Raises `StepFailure` where `check` does.
        """
        assert self.low is not None and self.high is not None
        self.steps += advance.is_step
        self.factorisations += advance.factorisations
        self.rows += len(advance.samples)
        self.derivatives, self.jacobians = derivatives, jacobians
        self.low = np.minimum(self.low, advance.y)
        self.high = np.maximum(self.high, advance.y)
        self.check(self, advance.t)

    def counting(self, contacts: Contacts) -> Contacts:
        """The same contacts, their calls counted here."""

        def gaps(t: float, y: Floats) -> Floats:
            self.looks += 1
            return contacts.gaps(t, y)

        def rates(t: float, y: Floats) -> Floats:
            self.looks += 1
            return contacts.rates(t, y)

        def held(t: float, y: Floats, forces: Floats) -> Floats:
            self.held += 1
            return contacts.held(t, y, forces)

        return replace(contacts, gaps=gaps, rates=rates, held=held)
