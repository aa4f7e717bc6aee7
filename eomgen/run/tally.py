"""Counts of what a run evaluates, and the extent of its motion."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eomgen.run.failure import EndedRunError
from eomgen.run.integrators.interface import Advance
from eomgen.run.problem import FloatArray, Problem

Follow = Callable[[float, FloatArray], object]
"""Called with time, s, and state (ny,) after each step; a true result ends the run."""


def _unlimited(tally: "Tally", t: float) -> None:
    """A check that ends no run."""


@dataclass
class Tally:
    """Counts of a run, which `integrate` updates at every step.

    check           called with this tally and the time, s, after each step; raises `EndedRunError`
                    to end the run
    follow          called with the time and the state after each step; may end the run
    steps, derivatives, jacobians  as in `Trajectory.counts`
    factorisations  LU factorisations, by methods that count them
    rows            rows kept
    held, gap_checks
                    calls of `Contacts.held`, and of `Contacts.gaps` and `rates`
    switches        calls of `Switching.of_state`
    low, high       (ny,), least and greatest value of each state at the ends of steps; None before
                    the run
    """

    check: Callable[["Tally", float], None] = _unlimited
    follow: Follow | None = None
    steps: int = 0
    derivatives: int = 0
    jacobians: int = 0
    factorisations: int = 0
    rows: int = 0
    held: int = 0
    gap_checks: int = 0
    switches: int = 0
    low: FloatArray | None = field(default=None, repr=False)
    high: FloatArray | None = field(default=None, repr=False)

    def begin(self, y: FloatArray) -> None:
        """Record the initial state."""
        self.low = self.high = y

    def take(self, advance: Advance, derivatives: int, jacobians: int) -> None:
        """Record a step or an impact, and the numbers of calls so far.

        Raises `EndedRunError` if `check` or `follow` ends the run.
        """
        assert self.low is not None and self.high is not None
        self.steps += advance.steps
        self.factorisations += advance.factorisations
        self.rows += len(advance.samples)
        self.derivatives, self.jacobians = derivatives, jacobians
        self.switches += advance.switches
        self.gap_checks += advance.gap_checks
        self.held += advance.held
        self.low = np.minimum(self.low, advance.y)
        self.high = np.maximum(self.high, advance.y)
        self.check(self, advance.t)
        if self.follow and self.follow(advance.t, advance.y.copy()):
            raise EndedRunError("ended by the function that follows it")

    def counting(self, problem: Problem) -> Problem:
        """The same problem, but calls of its contacts and switching functions are counted."""
        contacts, switching = problem.contacts, problem.switching
        if contacts is not None:
            contacts = replace(
                contacts,
                gaps=self._counted("gap_checks", contacts.gaps),
                rates=self._counted("gap_checks", contacts.rates),
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
