"""Many steps whose lengths follow from a tolerance, one after another, by any method."""

from dataclasses import dataclass
from typing import Annotated, Any, Protocol

import numpy as np

from eomgen.engine.adaptive import AGAIN, AT_END, EVENT, MADE, UNUSUAL, Bounds, Progress
from eomgen.subset.words import (
    Matrix,
    Vector,
    Whole,
    copy,
    inf,
    next_after,
    ordered,
    with_arrays,
    zeros,
)


@dataclass(slots=True)
class Records:
    """Of each step its end, the greatest length of the next one, its own length, of which an event
    may leave a part, and its error, what it has counted and how many rows there are so far, the
    state, slope and lost part at its end, and `wide` terms if wanted. The rows at given times. How
    many rows are passed, and steps made. There is no room for what a method does not need.
    """

    ends: Annotated[Vector, "most"]
    lengths: Annotated[Vector, "most"]
    last_lengths: Annotated[Vector, "most"]
    errors: Annotated[Vector, "most"]
    derivatives: Annotated[Whole, "most"]
    jacobians: Annotated[Whole, "most"]
    factorisations: Annotated[Whole, "most"]
    sampled: Annotated[Whole, "most"]
    states: Annotated[Matrix, "most", "STATES"]
    slopes: Annotated[Matrix, "most", "STATES"]
    losses: Annotated[Matrix, "most", "STATES"]
    terms: Annotated[Matrix, "wide * most", "STATES"]
    times: Annotated[Vector, "count"]
    rows: Annotated[Matrix, "count", "STATES"]
    wide: int
    count: int
    most: int
    passed: int = 0
    made: int = 0


@dataclass(slots=True)
class Start:
    """The state from which steps begin, its slope if that is known, and what rounding took."""

    state: Annotated[Vector, "STATES"]
    slope: Annotated[Vector, "STATES"]
    lost: Annotated[Vector, "STATES"]


class Stepping(Protocol):
    """A method, and the step that it makes."""

    def ready(self, run: Bounds, at: Progress, y: Annotated[Vector, "STATES"]) -> None:
        """A step from y at `at.t` is to be made: compute what does not depend on its length; and
        `at.length`, if that follows from the state.
        """

    def make(
        self,
        run: Bounds,
        at: Progress,
        y: Annotated[Vector, "STATES"],
        lost: Annotated[Vector, "STATES"],
        raw: Annotated[Vector, "STATES"],
    ) -> bool:
        """Make the step, to `raw` at `at.end`; what rounding takes from it is `lost`. False if
        there is none.
        """
        ...

    def between(
        self,
        at: Progress,
        y: Annotated[Vector, "STATES"],
        raw: Annotated[Vector, "STATES"],
        t: float,
        place: Annotated[Vector, "STATES"],
    ) -> None:
        """The state at a time within the step."""

    def record(
        self,
        run: Bounds,
        at: Progress,
        y: Annotated[Vector, "STATES"],
        raw: Annotated[Vector, "STATES"],
        kept: Records,
    ) -> None:
        """Keep what is the method's own of the step, number `kept.made`."""


class Checks(Protocol):
    """What the place where steps are made says of them; false for what it cannot do."""

    def begins(self) -> None:
        """A step begins: forget what one that was not made has left."""

    def is_usual(self) -> bool:
        """Whether nothing in this step so far is unusual, such as an overflow."""
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
    ) -> int:
        """MADE if a step from y to `last` passes over nothing. `raw` is `last` before projection.
        EVENT if a rigid contact closes or opens in it: then `at.end` and `last` become those of the
        event. AGAIN if it must end earlier, at `run.until`. Else why it is not to be made.
        """
        ...

    def keeps(self, i: int, at: Progress, last: Annotated[Vector, "STATES"]) -> bool:
        """Step i, to this state, is kept, or is not."""
        ...


def adaptive_steps(
    by: Stepping, checks: Checks, run: Bounds, at: Progress, start: Start, kept: Records
) -> int:
    """Up to `kept.most` steps from `at.t` on. They end at the end, or before one that reaches it if
    none may, or that anything is unusual in; and with one that an event ends. Returns why.
    """
    y = copy(start.state)
    lost = copy(start.lost)
    raw = zeros(len(y))
    by.ready(run, at, y)
    while kept.made < kept.most and at.t < run.until:
        length = min(at.length, run.longest)
        if not length >= 10.0 * abs(next_after(at.t) - at.t):
            return UNUSUAL
        if not run.reaches and not at.t + length < run.until:
            return AT_END
        checks.begins()
        if not by.make(run, at, y, lost, raw):
            return UNUSUAL
        last = copy(raw)
        wrong = ordered(raw * 0.0)
        if not checks.is_usual() or wrong != 0.0 or not checks.placed(at.end, last):
            return UNUSUAL
        why = checks.seen(at, y, raw, last)
        if why != MADE and why != EVENT:
            return why
        if not has_rows(by, checks, at, y, raw, kept):
            return UNUSUAL
        by.record(run, at, y, raw, kept)
        if not checks.is_usual() or not checks.keeps(kept.made, at, last):
            return UNUSUAL
        y = copy(last)
        at.t = at.end
        keep(kept, at, y, lost)
        if why == EVENT:
            return EVENT
        if at.t < run.until:
            by.ready(run, at, y)
            kept.lengths[kept.made - 1] = at.length
    return MADE


def step_on(
    by: Stepping,
    checks: Checks,
    run: Bounds,
    at: Progress,
    start: Start,
    kept: Records,
    until: float,
) -> int:
    """A step from `at.t` on, not beyond `until`, or where the last one had to end that was made
    again. It is made again up to where `checks` say, until it passes over nothing. Then what is
    kept of it is the start of the next one. Returns why it ended.
    """
    if at.t >= run.until:
        run.until = inf
    run.until = min(run.until, until)
    length = at.length
    why = AGAIN
    while why == AGAIN:
        at.length = length
        kept.made = 0
        why = adaptive_steps(by, checks, run, at, start, kept)
    if kept.made == 1:
        start.state[:] = kept.states[0]
        start.lost[:] = kept.losses[0]
    return why


def _has_rows(
    by: Stepping, checks: Checks, at: Progress, y: Vector, raw: Vector, kept: Records
) -> bool:
    """As `has_rows`."""
    first = kept.passed
    last = first + int(np.searchsorted(kept.times[first : kept.count], at.end))
    if last == first:
        return True
    times: Any = kept.times[first:last]
    places = np.empty((last - first, len(y)))
    by.between(at, y, raw, times[:, None], places)
    if not np.isfinite(places).all():
        return False
    kept.passed = last
    kept.rows[first:last] = places
    return all(map(checks.placed, times.tolist(), kept.rows[first:last]))


@with_arrays(_has_rows)
def has_rows(
    by: Stepping,
    checks: Checks,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
    kept: Records,
) -> bool:
    """Keep the rows before the end of a step. False if that is not usual."""
    place = zeros(len(y))
    while kept.passed < kept.count and kept.times[kept.passed] < at.end:
        now = kept.times[kept.passed]
        by.between(at, y, raw, now, place)
        wrong = ordered(place * 0.0)
        if wrong != 0.0 or not checks.placed(now, place):
            return False
        kept.rows[kept.passed] = place
        kept.passed += 1
    return True


def keep(
    kept: Records,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
) -> None:
    """Keep a step, whose last state is also that of rows at its end."""
    while kept.passed < kept.count and kept.times[kept.passed] <= at.end:
        kept.rows[kept.passed] = y
        kept.passed += 1
    i = kept.made
    kept.ends[i] = at.end
    kept.lengths[i] = at.length
    kept.last_lengths[i] = at.h
    kept.derivatives[i] = at.derivatives
    kept.sampled[i] = kept.passed
    kept.states[i] = y
    kept.losses[i] = lost
    kept.made += 1
