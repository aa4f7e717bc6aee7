"""Whole runs by steps whose lengths follow from a tolerance, through the events of rigid contacts.

Only rows are left of them. What is unusual is left to whoever runs it, from the start on.
"""

from typing import Protocol

from eomgen.engine.adaptive import EVENT, MADE, Bounds, Progress, first_length
from eomgen.engine.adaptive_steps import Checks, Records, Start, Stepping, adaptive_steps
from eomgen.engine.contacts import STRUCK, ContactLaw, Place, Touching, counted, strike
from eomgen.engine.system import System
from eomgen.subset.words import copy


class Anew(Stepping, Protocol):
    """A method that begins anew after each event."""

    def anew(self, start: Start) -> None:
        """Begin at a state and with the slope there."""


def through_events(
    system: System,
    law: ContactLaw,
    by: Anew,
    checks: Checks,
    now: Touching,
    place: Place,
    run: Bounds,
    at: Progress,
    start: Start,
    kept: Records,
    near: float,
    most: int,
) -> bool:
    """Go from a place to `run.until`. A row at most `near` s before a strike is the state after it.
    False if anything is unusual, also `most` steps from one event to the next.
    """
    while True:
        if counted(len(place.closed), place.closed) > 0:
            checks.begins()
            if strike(law, now, place) != STRUCK or not checks.is_usual():
                return False
            if kept.passed > 0 and place.t <= kept.times[kept.passed - 1] + near:
                kept.rows[kept.passed - 1] = place.y
        for c in range(len(place.closed)):
            place.closed[c] = 0
            place.opened[c] = 0
        at.t = place.t
        if not at.t < run.until:
            return True
        checks.begins()
        start.state = copy(place.y)
        start.slope = system.derivative(at.t, place.y)
        start.lost = 0.0 * abs(place.y)
        at.length = first_length(system, run, at.t, place.y, start.slope, run.longest)
        if not checks.is_usual():
            return False
        by.anew(start)
        if not goes_on(by, checks, run, at, start, kept, most):
            return False


def goes_on(
    by: Anew, checks: Checks, run: Bounds, at: Progress, start: Start, kept: Records, most: int
) -> bool:
    """Go to the next event, or to the end. False if that takes `most` steps, or is unusual."""
    steps = 0
    while steps < most:
        kept.made = 0
        why = adaptive_steps(by, checks, run, at, start, kept)
        if why == EVENT or (why == MADE and not at.t < run.until):
            return True
        if why != MADE:
            return False
        start.state = copy(kept.states[kept.made - 1])
        start.lost = copy(kept.losses[kept.made - 1])
        steps += kept.made
    return False
