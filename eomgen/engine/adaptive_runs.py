"""Whole runs by steps whose lengths follow from a tolerance, through the events of rigid contacts.

Only rows are left of them. What is unusual is left to whoever runs it, from the start on.
"""

from typing import Annotated, Protocol

from eomgen.engine.adaptive import AGAIN, EVENT, MADE, Bounds, Progress, first_length
from eomgen.engine.adaptive_steps import Checks, Records, Start, Stepping, adaptive_steps
from eomgen.engine.contacts import STRUCK, ContactLaw, Place, Touching, counted, strike
from eomgen.engine.system import System
from eomgen.subset.words import Vector, copy


class Anew(Stepping, Protocol):
    """A method that begins anew after each event."""

    def anew(self, start: Start) -> None:
        """Begin at a state and with the slope there."""


class ChecksAnew(Checks, Protocol):
    """Checks that begin anew after each event, and say up to when a step is to be made again."""

    def forget(self) -> None:
        """Forget the steps so far."""


def through_events(
    system: System,
    law: ContactLaw,
    by: Anew,
    checks: ChecksAnew,
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
        if not begins_anew(system, by, checks, run, at, start, place.y):
            return False
        if not goes_on(by, checks, run, at, start, kept, most):
            return False


def begins_anew(
    system: System,
    by: Anew,
    checks: ChecksAnew,
    run: Bounds,
    at: Progress,
    start: Start,
    y: Annotated[Vector, "STATES"],
) -> bool:
    """Begin in a state at `at.t`, as if nothing had been before. False if that is unusual."""
    checks.begins()
    checks.forget()
    start.state = copy(y)
    start.slope = system.derivative(at.t, y)
    start.lost = 0.0 * abs(y)
    at.length = first_length(system, run, at.t, y, start.slope, run.longest)
    by.anew(start)
    return checks.is_usual()


def goes_on(
    by: Anew, checks: ChecksAnew, run: Bounds, at: Progress, start: Start, kept: Records, most: int
) -> bool:
    """Go to the next event, or to the end. A step that passes over something is made again up to
    where `checks` say. False if that takes `most` steps, or is unusual.
    """
    end = run.until
    steps = 0
    while steps < most:
        length = at.length
        kept.made = 0
        why = adaptive_steps(by, checks, run, at, start, kept)
        steps += kept.made
        if kept.made > 0:
            start.state = copy(kept.states[kept.made - 1])
            start.lost = copy(kept.losses[kept.made - 1])
            length = kept.lengths[kept.made - 1]
        if why == AGAIN:
            at.length = length
            steps += 1
        elif why == EVENT or (why == MADE and not at.t < end):
            run.until = end
            return True
        elif why != MADE:
            return False
        elif not at.t < run.until:
            run.until = end
    return False
