"""The events of a run with rigid contacts: a step ends where contacts first close or open in it.

Between two events the motion is smooth, and whoever runs it makes the steps.
"""

from eomgen.engine.contact_times import NO_ZERO, UNHELD, Within, closing, opening
from eomgen.engine.contacts import ContactLaw, Place, Touching, release, settle
from eomgen.engine.roots import Search
from eomgen.subset.words import inf

WHOLE, CLOSED, OPENED, NOT_FOUND, NOT_KEPT, ENDLESSLY = 0, 1, 2, 3, 4, 5
"""How a step ends: whole; where contacts close, which then strike; where held ones open, which then
are let go. Or why it fails: the time of a contact is not found, no forces keep contacts from
closing, events do not end."""
MOST_EVENTS = 10_000
"""Greatest number of events within `least` s."""


def taken(
    law: ContactLaw,
    within: Within,
    now: Touching,
    search: Search,
    at: Place,
    end: float,
    share: float,
) -> int:
    """Go to the end of a step that has been made, or to the first event in it. Answers how it ends.

    Gaps are checked at the ends of parts of the step, a `share` of its length each. What closes
    comes before what opens at the same time.
    """
    length = end - at.t
    closes = closing(law, within, now, search, at, length, share)
    opens = opening(law, within, now, search, at, length)
    if opens == UNHELD:
        return NOT_KEPT
    if closes == NO_ZERO or opens == NO_ZERO:
        return NOT_FOUND
    first = min(closes, opens)
    if first == inf:
        at.t = end
        at.y = within.state(length)
        settle(law, now, at.t, at.y)
        return WHOLE
    there = at.t + first
    if there > at.t:
        at.y = within.state(length if there == end else first)
        at.t = there
    if is_endless(at):
        return ENDLESSLY
    if closes <= opens:
        for c in range(len(at.closed)):
            at.opened[c] = 0
            now.slack[c] = 0.0
        return CLOSED
    for c in range(len(at.closed)):
        at.closed[c] = 0
    release(law, now, at.t, at.y, at.opened)
    return OPENED


def is_endless(at: Place) -> bool:
    """Count an event. True if there are too many."""
    at.events += 1
    if at.t - at.since > at.least:
        at.since = at.t
        at.events = 0
    return at.events > MOST_EVENTS
