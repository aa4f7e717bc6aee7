"""When rigid contacts close or open within a step.

Times within a step are in seconds from its start.
"""

from typing import Annotated, Protocol

from eomgen.engine.contacts import TOLERANCE, ContactLaw, Place, Touching, counted, press
from eomgen.engine.roots import FOUND, WANTED, Search, begun, gone_on
from eomgen.subset.words import Vector, copy, inf, nan, zeros

TOGETHER_CLOSED, TOGETHER_OPENED = 1e-12, 1e-9
"""Contacts that close, or open, within these fractions of a step do so together."""
SHARE = 0.25
"""The part of a step by a method with a tolerance at whose ends gaps are checked; those of equal
length are checked as a whole."""
GAP, RATE, PUSH = 0, 1, 2
"""What is searched for its zero: the gap of a contact with its slack, its rate, how it is pressed.
"""
NO_ZERO, UNHELD = -1.0, -2.0
"""What is answered instead of a time: a zero is not found; no forces keep contacts from closing."""


class Within(Protocol):
    """A step whose states are known."""

    def state(self, s: float, /) -> Annotated[Vector, "STATES"]:
        """The state s seconds after the start of the step."""
        ...


def closing(
    law: ContactLaw,
    within: Within,
    now: Touching,
    search: Search,
    at: Place,
    length: float,
    share: float,
) -> float:
    """The time at which contacts first close in a step, and which; infinity if none do.

    Gaps are checked at the ends of parts of the step, a `share` of its length each.
    """
    n = len(at.closed)
    for c in range(n):
        at.closed[c] = 0
    if counted(n, now.holds) == n:
        return inf
    times = zeros(len(at.closed))
    slack = copy(now.slack)
    y = within.state(0.0)
    gap_a = law.gaps(at.t, y)
    rate_a = law.rates(at.t, y)
    a = 0.0
    part = 1
    while a < length:
        b = share * part * length
        y = within.state(b)
        gap_b = law.gaps(at.t + b, y)
        rate_b = law.rates(at.t + b, y)
        first = inf
        for c in range(n):
            times[c] = inf
            low = gap_b[c] + slack[c] < 0.0
            dips = rate_a[c] < 0.0 and rate_b[c] > 0.0
            if now.holds[c] == 0 and (low or dips):
                at.contact = c
                at.slack = slack[c]
                search.before = a
                search.here = b
                search.at_before = gap_a[c] + slack[c]
                search.at_here = gap_b[c] + slack[c]
                times[c] = first_zero(law, within, now, search, at)
                if times[c] < 0.0:
                    return times[c]
                first = min(first, times[c])
        if first < inf:
            for c in range(n):
                if times[c] <= first + TOGETHER_CLOSED * length:
                    at.closed[c] = 1
            return first
        for c in range(n):
            if gap_b[c] > TOLERANCE:
                slack[c] = 0.0
        gap_a[:] = gap_b
        rate_a[:] = rate_b
        a = b
        part += 1
    return inf


def first_zero(law: ContactLaw, within: Within, now: Touching, search: Search, at: Place) -> float:
    """The first time at which a gap falls to 0, infinity if it does not; its rate changes sign at
    most once between the points `before` and `here` of the search, which has the gap there.
    """
    a = search.before
    b = search.here
    at_a = search.at_before
    at_b = search.at_here
    before = value(law, within, now, at, RATE, a)
    after = value(law, within, now, at, RATE, b)
    # A gap that rises first reaches 0 only after its maximum: at a it may be 0 but for rounding.
    if at_a > 0.0 and at_b < 0.0 and not (before > 0.0 and after < 0.0):
        return zero(law, within, now, search, at, GAP, a, b)
    turns = before * after < 0.0
    middle = b
    if turns:
        middle = zero(law, within, now, search, at, RATE, a, b)
        if middle < 0.0:
            return middle
    if before < 0.0:  # it falls first
        if at_a <= 0.0:
            return a
        if turns and value(law, within, now, at, GAP, middle) < 0.0:
            return zero(law, within, now, search, at, GAP, a, middle)
        return inf
    if at_b >= 0.0 or not turns:  # it rises still
        return a if before == 0.0 and at_b < at_a and at_a <= 0.0 else inf
    if value(law, within, now, at, GAP, middle) > 0.0:
        return zero(law, within, now, search, at, GAP, middle, b)
    return middle


def opening(
    law: ContactLaw, within: Within, now: Touching, search: Search, at: Place, length: float
) -> float:
    """The time at which held contacts first open in a step, and which; infinity if none do.
    A contact opens when its force has fallen to 0 and its gap begins to grow.
    """
    n = len(at.opened)
    for c in range(n):
        at.opened[c] = 0
    if counted(n, now.holds) == 0:
        return inf
    times = zeros(len(at.opened))
    y = within.state(length)
    if not press(law, now, at.t + length, y):
        return UNHELD
    first = inf
    for c in range(n):
        times[c] = inf
        if now.holds[c] == 1 and now.pushes[c] == 0.0 and now.parts[c] > 0.0:
            at.contact = c
            times[c] = 0.0
            if value(law, within, now, at, PUSH, 0.0) > 0.0:
                times[c] = zero(law, within, now, search, at, PUSH, 0.0, length)
                if times[c] < 0.0:
                    return times[c]
            first = min(first, times[c])
    for c in range(n):
        if times[c] < inf and times[c] <= first + TOGETHER_OPENED * length:
            at.opened[c] = 1
    return first


def zero(
    law: ContactLaw,
    within: Within,
    now: Touching,
    search: Search,
    at: Place,
    what: int,
    a: float,
    b: float,
) -> float:
    """The time between a and b at which something of a contact crosses 0; `NO_ZERO` or `UNHELD` if
    it is not found.
    """
    search.xtol = max(1e-14 * (b - a), 1e-300)
    search.rtol = 1e-15
    at_a = value(law, within, now, at, what, a)
    at_b = value(law, within, now, at, what, b)
    answer = begun(search, a, b, at_a, at_b)
    while answer == WANTED:
        answer = gone_on(search, value(law, within, now, at, what, search.here))
    if answer == FOUND:
        return search.here
    return UNHELD if what == PUSH else NO_ZERO


def value(law: ContactLaw, within: Within, now: Touching, at: Place, what: int, s: float) -> float:
    """What is searched for its zero, at a time; not a number if there are no forces."""
    c = at.contact
    y = within.state(s)
    if what == GAP:
        gap = law.gaps(at.t + s, y)
        return gap[c] + at.slack
    if what == RATE:
        rate = law.rates(at.t + s, y)
        return rate[c]
    if not press(law, now, at.t + s, y):
        return nan
    return now.pushes[c] - now.parts[c]
