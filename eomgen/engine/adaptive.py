"""Steps of explicit Runge-Kutta methods whose lengths follow from a tolerance.

Hairer, Norsett, Wanner, Solving ODEs I: stages and step control in sections II.4 and II.5, dense
output in II.6. What rounding takes from the state is added to its next change: Hairer, Lubich,
Wanner, Geometric Numerical Integration, section VIII.5.

Slopes k (16, STATES) and terms (7, STATES) have the sizes of DOP853.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.engine.sums import round_off
from eomgen.engine.system import System
from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    Whole,
    combined,
    copy,
    inf,
    larger,
    matrix,
    next_after,
    ordered,
    sqrt,
    unrolled,
    zeros,
)

MADE, AT_END, UNUSUAL = 0, 1, 2
"""Why steps ended: all were made; the next one reaches the end; it is not for these steps."""


@dataclass(slots=True)
class Bounds:
    """What steps are made with: tolerances, the longest step, s, the end of the last step, s,
    whether the terms of each step are kept, and whether a step may end there that is shorter
    because of that.
    """

    atol: Annotated[Vector, "STATES"]
    rtol: float
    longest: float
    until: float = 0.0
    dense: bool = False
    reaches: bool = False


@dataclass(slots=True)
class Progress:
    """A step of h s from t to `end`, and the greatest length of the next one, s; the derivatives so
    far; whether the terms are those of this step.
    """

    t: float = 0.0
    h: float = 0.0
    end: float = 0.0
    length: float = 0.0
    derivatives: int = 0
    is_dense: bool = False


@dataclass(slots=True)
class Records:
    """Of each step its end, the greatest length of the next one, its own length and error, the
    least margin of constraints, what it has counted and how many rows there are so far, the state,
    slope and lost part at its end, and its terms if wanted. The rows at given times. The four
    states of each quaternion. How many rows are passed, and steps made. A method leaves out what it
    does not need.
    """

    ends: Annotated[Vector, "most"]
    lengths: Annotated[Vector, "most"]
    last_lengths: Annotated[Vector, "most"]
    errors: Annotated[Vector, "most"]
    margins: Annotated[Vector, "most"]
    derivatives: Annotated[Whole, "most"]
    jacobians: Annotated[Whole, "most"]
    factorisations: Annotated[Whole, "most"]
    sampled: Annotated[Whole, "most"]
    states: Annotated[Matrix, "most", "STATES"]
    slopes: Annotated[Matrix, "most", "STATES"]
    losses: Annotated[Matrix, "most", "STATES"]
    terms: Annotated[Matrix, "7 * most", "STATES"]
    times: Annotated[Vector, "count"]
    rows: Annotated[Matrix, "count", "STATES"]
    quaternions: Annotated[Whole, "4 * many"]
    many: int
    count: int
    most: int
    passed: int = 0
    made: int = 0


def keep(
    kept: Records,
    end: float,
    length: float,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
) -> None:
    """Keep a step, whose last state is also that of rows at its end."""
    while kept.passed < kept.count and kept.times[kept.passed] <= end:
        kept.rows[kept.passed] = y
        kept.passed += 1
    i = kept.made
    kept.ends[i] = end
    kept.lengths[i] = length
    kept.sampled[i] = kept.passed
    kept.states[i] = y
    kept.losses[i] = lost
    kept.made += 1


@dataclass(slots=True)
class Start:
    """The state from which steps begin, its slope if that is known, and what rounding took."""

    state: Annotated[Vector, "STATES"]
    slope: Annotated[Vector, "STATES"]
    lost: Annotated[Vector, "STATES"]


class Checks(Protocol):
    """What the place where steps are made says of them; false for what it cannot do."""

    def begins(self) -> None:
        """A step begins: forget what one that was not made has left."""

    def are_usual(self, k: Annotated[Matrix, "16", "STATES"], first: int, past: int) -> bool:
        """Whether these slopes are finite, and no flag was raised in this step."""
        ...

    def placed(self, t: float, y: Annotated[Vector, "STATES"]) -> bool:
        """Put a state on the constraints, and normalise its quaternions."""
        ...

    def seen(
        self,
        at: Progress,
        y: Annotated[Vector, "STATES"],
        raw: Annotated[Vector, "STATES"],
        last: Annotated[Vector, "STATES"],
        k: Annotated[Matrix, "16", "STATES"],
        terms: Annotated[Matrix, "7", "STATES"],
    ) -> int:
        """MADE if a step from y to `last` passes over nothing. `raw` is `last` before projection.
        The terms may be computed.
        """
        ...

    def keeps(self, i: int, at: Progress, last: Annotated[Vector, "STATES"]) -> bool:
        """Step i, to this state, is kept, or is not."""
        ...


def eighth_root(x: float) -> float:
    """x^(1/8), with the same bits wherever there is a square root."""
    return sqrt(sqrt(sqrt(x)))


def first_length(
    system: System,
    run: Bounds,
    t: float,
    y: Annotated[Vector, "STATES"],
    slope: Annotated[Vector, "STATES"],
    longest: float,
) -> float:
    """The length of the first step from y, s: section II.4, (a) to (f)."""
    if len(y) == 0:
        return longest
    scale = run.atol + abs(y) * run.rtol
    a = y / scale
    b = slope / scale
    first = ordered(a * a)
    second = ordered(b * b)
    size = sqrt(first / len(y))
    speed = sqrt(second / len(y))
    trial = 1e-6
    if size >= 1e-5 and speed >= 1e-5 and speed < inf:
        trial = 0.01 * size / speed
    trial = min(trial, longest)
    place = y + trial * slope
    ahead = system.derivative(t + trial, place)
    c = (ahead - slope) / scale
    third = ordered(c * c)
    bend = sqrt(third / len(y)) / trial
    length = max(1e-6, trial * 1e-3)
    if speed > 1e-15 or bend > 1e-15:
        length = eighth_root(0.01 / max(speed, bend))
    return min(min(100.0 * trial, length), longest)


def attempted(
    method: Known,
    system: System,
    t: float,
    h: float,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    atol: Annotated[Vector, "STATES"],
    rtol: float,
    k: Annotated[Matrix, "16", "STATES"],
    change: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
) -> float:
    """A step of h s from y, with the slope k[0], to `raw`. Returns its error, relative to the one
    that is allowed.
    """
    for i in unrolled(range(1, method.last)):  # (II.4.1)
        place = y + h * combined(method.stages[i], k)
        k[i] = system.derivative(t + method.nodes[i] * h, place)
    change[:] = h * combined(method.end, k) + lost
    raw[:] = y + change
    before = abs(y)
    after = abs(raw)
    scale = atol + larger(before, after) * rtol  # (II.4.10)
    a = combined(method.long_error, k) / scale
    b = combined(method.short_error, k) / scale
    fifth = ordered(a * a)
    third = ordered(b * b)
    size = sqrt((fifth + method.short_weight * third) * len(y))
    if size == 0.0:
        return 0.0
    return h * fifth / size  # (II.5.17)


def made(
    method: Known,
    system: System,
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    change: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
) -> bool:
    """Make a step from y at `at.t`, with the slope k[0], to `raw` at `at.end`; `change` is the
    difference before rounding. False if it would have to be too short.
    """
    at.is_dense = False
    shortest = 10.0 * abs(next_after(at.t) - at.t)
    length = max(min(at.length, run.longest), shortest)
    factor = method.greatest
    while True:
        if not length >= shortest:
            return False
        at.end = min(at.t + length, run.until)
        h = at.end - at.t
        error = attempted(method, system, at.t, h, y, lost, run.atol, run.rtol, k, change, raw)
        at.derivatives += method.last - 1
        if error < 1.0:
            break
        length = h * max(method.smallest, method.safety / eighth_root(error))
        factor = 1.0
    if error != 0.0:
        factor = min(factor, method.safety / eighth_root(error))
    at.h = h
    at.length = h * factor
    return True


def interpolate(
    method: Known,
    system: System,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    terms: Annotated[Matrix, "7", "STATES"],
) -> None:
    """The terms of the polynomial of a step from y to `raw`, with slopes up to the one at its end:
    section II.6. Nothing is done if they are known.
    """
    if at.is_dense:
        return
    h = at.h
    for i in unrolled(range(method.last + 1, len(method.nodes))):
        place = y + h * combined(method.stages[i], k)
        k[i] = system.derivative(at.t + method.nodes[i] * h, place)
        at.derivatives += 1
    terms[0] = raw - y
    terms[1] = h * k[0] - terms[0]
    terms[2] = 2.0 * terms[0] - h * (k[method.last] + k[0])
    for i in unrolled(range(len(method.dense))):
        terms[3 + i] = h * combined(method.dense[i], k)
    at.is_dense = True


def within(
    at: Progress,
    y: Annotated[Vector, "STATES"],
    terms: Annotated[Matrix, "7", "STATES"],
    t: float,
    place: Annotated[Vector, "STATES"],
) -> None:
    """The state at a time within a step whose terms are known."""
    x = (t - at.t) / at.h
    rest = 1.0 - x
    found = zeros(len(y))
    for i in unrolled(range(6, -1, -1)):
        found = (found + terms[i]) * (rest if i % 2 else x)
    place[:] = found + y


def made_many(
    method: Known,
    system: System,
    checks: Checks,
    run: Bounds,
    at: Progress,
    start: Start,
    kept: Records,
) -> int:
    """Up to `kept.most` steps from `at.t` on. They end at the end, or before one that reaches it if
    none may, or that anything is unusual in. Returns why.
    """
    y = copy(start.state)
    lost = copy(start.lost)
    change = zeros(len(y))
    raw = zeros(len(y))
    place = zeros(len(y))
    k = matrix(16, len(y))
    terms = matrix(7, len(y))
    k[0] = start.slope
    while kept.made < kept.most and at.t < run.until:
        length = min(at.length, run.longest)
        if not length >= 10.0 * abs(next_after(at.t) - at.t):
            return UNUSUAL
        if not run.reaches and not at.t + length < run.until:
            return AT_END
        checks.begins()
        if not made(method, system, run, at, y, lost, k, change, raw):
            return UNUSUAL
        k[method.last] = system.derivative(at.end, raw)
        at.derivatives += 1
        last = copy(raw)
        if not checks.are_usual(k, 0, method.last + 1) or not checks.placed(at.end, last):
            return UNUSUAL
        why = checks.seen(at, y, raw, last, k, terms)
        if why != MADE:
            return why
        has_rows = kept.passed < kept.count and kept.times[kept.passed] < at.end
        if has_rows or run.dense:
            interpolate(method, system, at, y, raw, k, terms)
        while kept.passed < kept.count and kept.times[kept.passed] < at.end:
            now = kept.times[kept.passed]
            within(at, y, terms, now, place)
            if not checks.placed(now, place):
                return UNUSUAL
            kept.rows[kept.passed] = place
            kept.passed += 1
        past = method.last + 1
        if at.is_dense:
            past = len(method.nodes)
        if not checks.are_usual(k, method.last + 1, past) or not checks.keeps(kept.made, at, last):
            return UNUSUAL
        round_off(y, raw, change, lost)
        y = copy(last)
        k[0] = k[method.last]
        at.t = at.end
        i = kept.made
        keep(kept, at.t, at.length, y, lost)
        kept.derivatives[i] = at.derivatives
        kept.slopes[i] = k[0]
        if run.dense:
            for term in range(7):
                kept.terms[7 * i + term] = terms[term]
    return MADE
