"""Where switching functions of the state cross 0 in a step.

Along a step these are functions of time. On parts of the step they are interpolated by polynomials,
which enclose them (`enclosing`). A part is halved until each function is monotone or has no zero
there.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.engine.enclosing import ENCLOSING, INNER
from eomgen.engine.roots import FOUND, RTOL, WANTED, Search, begun, gone_on
from eomgen.subset.words import (
    Matrix,
    Vector,
    Whole,
    all_within,
    combined,
    copy,
    inf,
    isfinite,
    larger,
    nan,
    unrolled,
)

MOST_EVALUATIONS = 200
"""Most evaluations of the switching functions in a step. A step that needs more is limited to the
length for steps that cannot be checked."""
MOST_PARTS = MOST_EVALUATIONS // 4 + 3
"""Parts of a step that wait at one time, at most: each first one takes four evaluations, or three
of one alone, and each more six."""
MOST_FIRST = MOST_EVALUATIONS / 4
"""Most parts with which a search begins."""
SHORTEST_PART = 2.0**-20
"""Fraction of a step below which parts are not halved."""
LARGEST_ANGLE = 1.0
"""Greatest change of an angle in a part, rad, so that every revolution is resolved."""
FAR = 4.0
"""A function has no zero in a step if it is this many times farther from 0 than it has changed in
the last two steps."""
IRREGULAR = (0.3819660112501051, 0.7548776662466927)
"""Fractions of a step far from simple ratios: a function with the period of the step, or a simple
fraction of it, has other values there than at the ends."""
LOCATED = 1e-12
"""Fraction of a step to which a zero is located."""
SHARES = tuple(enumerate(INNER.tolist()))
"""The inner points of a part, as fractions of it, with their numbers."""
FREE, PASSING, UNCLEAR = 0, 1, 2
"""A function has no zero in a part; it is monotone and crosses 0; it may be neither."""


@dataclass(slots=True)
class Watch:
    """Switching functions along the steps of a run, of which one is from `here` on.

    many, timed   their number; whether they depend on time beside the state
    turning, angles
                  how many states are angles, and which
    earlier, before
                  the start of the step before, s, and the functions there; infinite if not known,
                  for a comparison with what is not a number would count as unusual
    here, first, last
                  when the step starts, s, and the functions there and at its end
    left          evaluations that are left in the step
    parts, marks  the number of parts with which a search begins, and the fractions of the step
                  between which they lie; they are given if `marked` is their number, else 0
    starts, ends, values, asked
                  of each part that waits: where it lies, as fractions of the step, the functions at
                  its five points, and for which it is searched
    found, opens, closes, which
                  brackets of zeros, in order: times between which function number `which` crosses 0
    moments, places
                  times within the step, and states there
    """

    many: int
    timed: bool
    turning: int
    angles: Annotated[Whole, "turning"]
    most: int
    room: int
    before: Annotated[Vector, "many"]
    first: Annotated[Vector, "many"]
    last: Annotated[Vector, "many"]
    marks: Annotated[Vector, "most"]
    starts: Annotated[Vector, "most"]
    ends: Annotated[Vector, "most"]
    values: Annotated[Matrix, "5 * most", "many"]
    asked: Annotated[Whole, "most", "many"]
    opens: Annotated[Vector, "room"]
    closes: Annotated[Vector, "room"]
    which: Annotated[Whole, "room"]
    moments: Annotated[Vector, "3"]
    places: Annotated[Matrix, "3", "STATES"]
    earlier: float = inf
    here: float = nan
    left: int = 0
    parts: int = 0
    marked: int = 0
    found: int = 0


@dataclass(slots=True)
class Between:
    """A step: when it starts and ends, s, and the states there."""

    start: float
    end: float
    first: Annotated[Vector, "STATES"]
    last: Annotated[Vector, "STATES"]


class Along(Protocol):
    """A step, and what can be known along it. What cannot be evaluated is not a number."""

    def states_at(
        self, n: int, times: Annotated[Vector, "n"], to: Annotated[Matrix, "n", "STATES"]
    ) -> None:
        """The states at times within the step."""

    def switching_at(
        self, t: float, y: Annotated[Vector, "STATES"], to: Annotated[Vector, "many"]
    ) -> None:
        """The switching functions."""

    def slope_at(
        self, t: float, y: Annotated[Vector, "STATES"], to: Annotated[Vector, "STATES"]
    ) -> None:
        """The derivative of the state."""


def begin_at(of: Watch, given: Along, t: float, y: Annotated[Vector, "STATES"]) -> None:
    """A step begins at t in the state y."""
    of.left = MOST_EVALUATIONS + 8 * of.marked
    of.found = 0
    if of.here != t:
        of.earlier = inf
        of.here = t
        evaluate(of, given, t, y, of.first)


def end_at(of: Watch, t: float) -> None:
    """The step is made: the next one begins where it ends, at t."""
    of.before[:] = of.first
    of.first[:] = of.last
    of.earlier = of.here
    of.here = t


def evaluate(
    of: Watch,
    given: Along,
    t: float,
    y: Annotated[Vector, "STATES"],
    to: Annotated[Vector, "of.many"],
) -> None:
    """The functions at a time."""
    of.left -= 1
    given.switching_at(t, y, to)


def evaluate_within(
    of: Watch, given: Along, step: Between, share: float, to: Annotated[Vector, "of.many"]
) -> None:
    """The functions at a fraction of the step."""
    of.moments[0] = step.start + (step.end - step.start) * share
    given.states_at(1, of.moments, of.places)
    evaluate(of, given, of.moments[0], of.places[0], to)


def turned(of: Watch, step: Between) -> float:
    """The greatest change of an angle in a step, in parts of which each is resolved."""
    change = 0.0
    for i in range(of.turning):
        change = max(change, abs(step.last[of.angles[i]] - step.first[of.angles[i]]))
    return change / LARGEST_ANGLE if isfinite(change) else 1.0


def are_far(of: Watch, given: Along, step: Between) -> bool:
    """Whether all functions are so far from 0 that none crosses it in a step."""
    if not of.earlier < step.start:
        return False
    length = step.end - step.start
    ratio = length / (step.start - of.earlier)
    moved = abs(of.last - of.first) + abs(of.first - of.before) * ratio
    is_start = all_within(FAR * moved, abs(of.first))
    is_end = all_within(FAR * moved, abs(of.last))
    if not is_start or not is_end:
        return False
    # A function that is periodic in time may have the same value at the ends of all steps.
    if of.timed:
        for share in unrolled(IRREGULAR):
            of.places[0] = step.first + share * (step.last - step.first)
            evaluate(of, given, step.start + share * length, of.places[0], of.values[0])
            is_slow = all_within(FAR * abs(of.values[0] - of.first), abs(of.first))
            if not is_slow:
                return False
    return True


def divide(of: Watch, least: float) -> None:
    """Begin the search with at least so many equal parts."""
    of.parts = 1
    while of.parts < least:
        of.parts += 1
    each = 1.0 / of.parts
    for i in range(of.parts):
        of.marks[i] = i * each
    of.marks[of.parts] = 1.0


def searched(of: Watch, given: Along, step: Between) -> bool:
    """Bracket the zeros in the step, and say whether all of it was searched."""
    length = step.end - step.start
    waiting = first_parts(of, given, step)
    while waiting > 0:
        p = waiting - 1
        a = of.starts[p]
        b = of.ends[p]
        row = 5 * p
        is_short = b - a <= SHORTEST_PART
        if classified(of.many, of.values[row : row + 5], is_short, of.asked[p]):
            waiting -= 1
            for i in range(of.many):
                if of.asked[p, i] == PASSING:
                    if of.found == of.room:
                        return False
                    of.opens[of.found] = step.start + a * length
                    of.closes[of.found] = step.start + b * length
                    of.which[of.found] = i
                    of.found += 1
        else:
            if of.left < 6:
                return False
            halve(of, p)
            fill_part(of, given, step, p)
            fill_part(of, given, step, waiting)
            waiting += 1
    return True


def first_parts(of: Watch, given: Along, step: Between) -> int:
    """The parts with which the search begins, the earliest last; returns their number."""
    end = copy(of.last)
    for p in range(of.parts):
        i = of.parts - 1 - p
        row = 5 * p
        of.starts[p] = of.marks[i]
        of.ends[p] = of.marks[i + 1]
        of.values[row + 4] = end
        if i > 0:
            evaluate_within(of, given, step, of.starts[p], of.values[row])
        else:
            of.values[row] = of.first
        end = copy(of.values[row])
        for j in range(of.many):
            of.asked[p, j] = UNCLEAR
        fill_part(of, given, step, p)
    return of.parts


def halve(of: Watch, p: int) -> None:
    """Put the later half of a part in its place, and the earlier one after it. A function that
    crosses 0 is bracketed again in the halves, in order with the others.
    """
    row = 5 * p
    middle = (of.starts[p] + of.ends[p]) / 2.0
    of.starts[p + 1] = of.starts[p]
    of.ends[p + 1] = middle
    of.starts[p] = middle
    start = copy(of.values[row])
    half = copy(of.values[row + 2])
    of.values[row + 5] = start
    of.values[row + 9] = half
    of.values[row] = half
    for j in range(of.many):
        of.asked[p + 1, j] = of.asked[p, j]


def fill_part(of: Watch, given: Along, step: Between, p: int) -> None:
    """Evaluate the functions at the inner points of a part."""
    a = of.starts[p]
    size = of.ends[p] - a
    length = step.end - step.start
    row = 5 * p + 1
    for m, share in unrolled(SHARES):
        of.moments[m] = step.start + length * (a + size * share)
    given.states_at(3, of.moments, of.places)
    for m in range(3):
        evaluate(of, given, of.moments[m], of.places[m], of.values[row + m])


def classified(
    many: int,
    values: Annotated[Matrix, "5", "many"],
    is_short: bool,
    asked: Annotated[Whole, "many"],
) -> bool:
    """What the functions that are asked for do in a part; returns whether none is unclear. Those in
    short parts never are.

    The error of the interpolating polynomial is taken to be less than twice the magnitude of its
    last two Chebyshev coefficients.
    """
    before = combined(ENCLOSING[0], values)
    highest = copy(before)
    lowest = -before
    for i in unrolled(range(1, 5)):
        here = combined(ENCLOSING[i], values)
        up = here - before
        down = before - here
        if i == 1:
            rise = copy(up)
            fall = copy(down)
        else:
            rise = larger(rise, up)
            fall = larger(fall, down)
        highest = larger(highest, here)
        lowest = larger(lowest, -here)
        before = copy(here)
    third = combined(ENCLOSING[5], values)
    fourth = combined(ENCLOSING[6], values)
    least = -2.0 * (abs(third) + abs(fourth))
    is_clear = True
    for i in range(many):
        if asked[i] != FREE:
            asked[i] = FREE
            if not (lowest[i] < least[i] or highest[i] <= least[i]):
                if not (rise[i] < least[i] or fall[i] < least[i] or is_short):
                    asked[i] = UNCLEAR
                    is_clear = False
                elif (values[0, i] > 0.0) != (values[4, i] > 0.0):
                    asked[i] = PASSING
    return is_clear


def located(of: Watch, given: Along, search: Search, step: Between, k: int) -> float:
    """The time at which the function of bracket k crosses 0, not a number if it is not found."""
    i = of.which[k]
    a = of.opens[k]
    b = of.closes[k]
    start = step.start
    length = step.end - start
    evaluate_within(of, given, step, (a - start) / length, of.values[0])
    at_a = of.values[0, i]
    evaluate_within(of, given, step, (b - start) / length, of.values[0])
    at_b = of.values[0, i]
    if not at_a * at_b < 0.0:  # 0 at an end
        return a if at_a == 0.0 else b
    search.xtol = LOCATED * length
    search.rtol = RTOL
    answer = begun(search, a, b, at_a, at_b)
    while answer == WANTED:
        evaluate_within(of, given, step, (search.here - start) / length, of.values[0])
        answer = gone_on(search, of.values[0, i])
    return search.here if answer == FOUND else nan
