"""A step of given length of a mechanism with rigid contacts, through all events in it.

Nothing is known of the contacts but time and state: those that touch at its start strike or are
held, as at the start of a run. So a step depends on nothing else.
"""

from typing import Annotated, Protocol

from eomgen.engine.contact_runs import (
    CLOSED,
    ENDLESSLY,
    NOT_KEPT,
    OPENED,
    WHOLE,
    taken,
)
from eomgen.engine.contact_times import Within
from eomgen.engine.contacts import (
    ALPHA,
    ENDLESS,
    STRUCK,
    TOLERANCE,
    ContactLaw,
    Place,
    Touching,
    nothing_held,
    strike,
)
from eomgen.engine.roots import Search
from eomgen.subset.words import Vector

NO_STEP = 6
"""A step whose state is not finite."""


class Way(Within, Protocol):
    """Steps between events, of which the last one's states are known."""

    def go(self, t: float, y: Annotated[Vector, "STATES"], length: float, end: float, /) -> bool:
        """Make a step of a length from t and y to `end`. False if there is none."""
        ...

    def part(self) -> None:
        """Take account of an event in the step that was made, which ends it."""
        ...


def through(
    law: ContactLaw, way: Way, now: Touching, search: Search, at: Place, length: float, end: float
) -> int:
    """Go to `end`, about a length from here. WHOLE, or why that is not possible."""
    now.alpha = ALPHA * nothing_held(law, now, at.t, at.y)
    at.since = at.t
    at.events = 0
    why = met(law, now, at)
    h = length
    while why <= OPENED and at.t < end:
        if not way.go(at.t, at.y, h, end):
            return NO_STEP
        why = ended(law, way, now, search, at, end, 1.0)
        h = end - at.t
    return why if why > OPENED else WHOLE


def met(law: ContactLaw, now: Touching, at: Place) -> int:
    """Let contacts that touch at the start strike, or hold them. WHOLE, or why that is not
    possible.
    """
    touching = 0
    gap = law.gaps(at.t, at.y)
    for c in range(len(at.closed)):
        at.closed[c] = 0
        if gap[c] <= TOLERANCE:
            at.closed[c] = 1
            touching += 1
    if touching == 0:
        return WHOLE
    return struck(law, now, at)


def ended(
    law: ContactLaw, way: Way, now: Touching, search: Search, at: Place, end: float, share: float
) -> int:
    """Go to the end of a step that was made, or to the first event in it, see `taken`, and let
    contacts strike that close. WHOLE or OPENED, or why that is not possible.
    """
    why = taken(law, way, now, search, at, end, share)
    if why != WHOLE:
        way.part()
    return struck(law, now, at) if why == CLOSED else why


def struck(law: ContactLaw, now: Touching, at: Place) -> int:
    """Let contacts strike that have closed. WHOLE, or why that is not possible."""
    answer = strike(law, now, at)
    if answer == STRUCK:
        return WHOLE
    return ENDLESSLY if answer == ENDLESS else NOT_KEPT
