"""Whether a step of an adaptive method passes over a branch of the derivative, or over a contact.

A method evaluates the derivative at a few points of a step. A contact, a stop or a pulse in time
that begins and ends between them does not show in the error estimate, however long the step. The
derivative is smooth as long as no switching function crosses 0.

A step passes over a branch if two switches lie in it, and the derivative between them differs from
that before and after by more than the tolerance allows. Such a step is repeated up to the middle
between the two, so that the method evaluates the derivative on that branch.
"""

from dataclasses import dataclass
from typing import Annotated

from eomgen.engine.adaptive import Bounds
from eomgen.engine.crossings import (
    MOST_FIRST,
    Along,
    Between,
    Watch,
    are_far,
    begin_at,
    divide,
    evaluate,
    located,
    searched,
    turned,
)
from eomgen.engine.roots import Search
from eomgen.subset.words import Matrix, Vector, all_within, inf

PASSES_NOTHING, PASSED_OVER, UNFOLLOWED = 0, 1, 2
"""What is found of a step: it passes over nothing; it passes over a branch, or is so long that the
switching functions could not be followed along it, and is to be repeated up to some time."""
INSIDE = 1 / 8
"""A step that ends at least this fraction of the time between two switches after the first one has
evaluated the branch between them."""
TOGETHER = 1e-9
"""Fraction of a step within which switches count as one."""


@dataclass(slots=True)
class Switches:
    """The switches of a run.

    last, now   the times of the last one before a step, and in it, s
    unseen      the longest step, s, if the functions cannot be followed
    until       where a step is to end that must be repeated, s
    many, times those in a step, in order
    slopes      the derivatives before, between and after two
    """

    room: int
    times: Annotated[Vector, "room"]
    slopes: Annotated[Matrix, "3", "STATES"]
    last: float
    unseen: float = 0.0
    now: float = 0.0
    until: float = 0.0
    many: int = 0


def passed_over(
    of: Watch,
    found: Switches,
    given: Along,
    run: Bounds,
    search: Search,
    step: Between,
    follows: bool,
) -> int:
    """What a step passes over. Of its switches `found.many` are known, which are all of those of
    time alone if it `follows` them; `found.now` is then the time of the last one.
    """
    follows_all = follows
    if of.many > 0:
        follows_all = followed(of, found, given, search, step) and follows
    found.now = found.last
    for n in range(found.many):
        after = found.times[n]
        found.until = cut(of, found, given, run, step, after)
        if found.until < inf:
            return PASSED_OVER
        found.now = max(found.now, after)
    if not follows_all and step.end - step.start > found.unseen * (1.0 + TOGETHER):
        found.until = step.start + found.unseen
        return UNFOLLOWED
    return PASSES_NOTHING


def followed(of: Watch, found: Switches, given: Along, search: Search, step: Between) -> bool:
    """Add the switches of the state to those that are known, and say whether these are all. A
    single one is not located exactly if that does not matter.
    """
    begin_at(of, given, step.start, step.first)
    evaluate(of, given, step.end, step.last, of.last)
    parts = turned(of, step)
    if parts <= 1.0 and of.marked == 0 and are_far(of, given, step):
        return True
    if parts > MOST_FIRST:
        return False
    of.parts = of.marked
    if of.marked == 0:
        divide(of, parts)
    follows = searched(of, given, step)
    alone = of.found + found.many == 1 and is_seen(found.last, step.start, of.closes[0])
    for k in range(of.found):
        at = (of.opens[k] + of.closes[k]) / 2.0
        if not alone:
            at = located(of, given, search, step, k)
        if at != at:
            follows = False
        else:
            add(found, at)
    return follows


def add(found: Switches, t: float) -> None:
    """Put a time in its place among the others."""
    n = found.many
    while n > 0 and found.times[n - 1] > t:
        later = found.times[n - 1]
        found.times[n] = later
        n -= 1
    found.times[n] = t
    found.many += 1


def is_seen(before: float, between: float, after: float) -> bool:
    """Whether a step that ends `between` two switches has evaluated the branch between them."""
    return before == -inf or between >= before + INSIDE * (after - before)


def cut(
    of: Watch, found: Switches, given: Along, run: Bounds, step: Between, after: float
) -> float:
    """The time at which a step must end because of a switch and the one before it; infinity if it
    need not.
    """
    start = step.start
    end = step.end
    before = found.now
    gap = after - before
    least = TOGETHER * (end - start)
    if not (gap > least and gap < inf):
        return inf
    if before < start and is_seen(before, start, after):
        return inf
    middle = before + gap / 2.0
    if not (middle > start + least and middle < end):
        return inf
    aside = gap / 8.0
    of.moments[0] = max(start, before - aside)
    of.moments[1] = middle
    of.moments[2] = min(end, after + aside)
    return middle if matters(of, found, given, run, gap) else inf


def matters(of: Watch, found: Switches, given: Along, run: Bounds, length: float) -> bool:
    """Whether the derivative at the second of three moments differs from the mean of those at the
    others by more than is allowed in a step of this length, s.
    """
    given.states_at(3, of.moments, of.places)
    for m in range(3):
        given.slope_at(of.moments[m], of.places[m], found.slopes[m])
    mean = (found.slopes[0] + found.slopes[2]) / 2.0
    missed = abs(found.slopes[1] - mean) * length
    allowed = run.atol + run.rtol * abs(of.places[1])
    is_allowed = all_within(missed, allowed)
    return not is_allowed
