"""What a run takes, counted rather than timed, and how far its motion goes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eomgen.run.integrators.interface import Advance, EndedRunError
from eomgen.run.problem import FloatArray, Problem

Follow = Callable[[float, FloatArray], object]
"""Told time, s, and state (ny,) after each step; what it returns ends the run if it is true."""


def _unlimited(tally: "Tally", t: float) -> None:
    """Let every run go on."""


@dataclass
class Tally:
    """Counts of one run; `integrate` keeps it up to date at every step.

    check           told this tally and the time, s, after each step; raises `EndedRunError` to
                    end the run
    follow          told the time and the state after each step; may end the run, too
    steps, derivatives, jacobians  as in `Trajectory.counts`
    factorisations  LU factors made by methods that report them
    rows            rows kept
    held, looks     calls of `Contacts.held`, and of `Contacts.gaps` and `rates`
    switches        calls of `Switching.of_state`
    low, high       (ny,), between which each state was at the ends of steps; None before the first
    """

    check: Callable[["Tally", float], None] = _unlimited
    follow: Follow | None = None
    steps: int = 0
    derivatives: int = 0
    jacobians: int = 0
    factorisations: int = 0
    rows: int = 0
    held: int = 0
    looks: int = 0
    switches: int = 0
    low: FloatArray | None = field(default=None, repr=False)
    high: FloatArray | None = field(default=None, repr=False)

    def begin(self, y: FloatArray) -> None:
        """Take note of the initial state."""
        self.low = self.high = y

    def take(self, advance: Advance, derivatives: int, jacobians: int) -> None:
        """Take note of a step or strike, and of the calls made so far.

        Raises `EndedRunError` where `check` does, or where `follow` says so.
        """
        assert self.low is not None and self.high is not None
        self.steps += advance.is_step
        self.factorisations += advance.factorisations
        self.rows += len(advance.samples)
        self.derivatives, self.jacobians = derivatives, jacobians
        self.low = np.minimum(self.low, advance.y)
        self.high = np.maximum(self.high, advance.y)
        self.check(self, advance.t)
        if self.follow and self.follow(advance.t, advance.y.copy()):
            raise EndedRunError("ended by who follows it")

    def counting(self, problem: Problem) -> Problem:
        """The same problem, calls of its contacts and of its switching functions counted here."""
        contacts, switching = problem.contacts, problem.switching
        if contacts is not None:
            contacts = replace(
                contacts,
                gaps=self._counted("looks", contacts.gaps),
                rates=self._counted("looks", contacts.rates),
                held=self._counted("held", contacts.held),
            )
        if switching is not None and switching.of_state is not None:
            switching = replace(switching, of_state=self._counted("switches", switching.of_state))
        return replace(problem, contacts=contacts, switching=switching)

    def _counted(self, name: str, function: Callable[..., FloatArray]) -> Callable[..., FloatArray]:
        def counted(*given: Any) -> FloatArray:
            setattr(self, name, getattr(self, name) + 1)
            return function(*given)

        return counted
