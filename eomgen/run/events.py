"""Event location for rigid contacts: when they close, strike, rest and open.

A run is divided where a contact strikes or opens. Between these events the motion is smooth, and
the method makes its own steps. The gaps of open contacts and the forces of held contacts are
checked in every step.

No contact penetrates by more than `contacts.TOLERANCE`, 1e-9 of the mechanism's size, plus the
method's error between the points of a step at which gaps are checked. A contact that closes more
slowly than `rest_speed`, or so slowly that it would not rise by 5e-8 of that size, does not bounce;
so infinitely many bounces in a finite time come to an end. A contact whose gap opens by itself, as
in grazing a curved surface, always bounces.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from eomgen.run.contacts import (
    STILL,
    TOLERANCE,
    Holding,
    Rate,
    accelerations,
    check_depth,
    in_sizes,
    recovery,
    restrained,
    slowest_bounces,
    still,
    strikes,
)
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Advance, Begin, Resume
from eomgen.run.problem import Contacts, FloatArray, Problem
from eomgen.run.roots import root
from eomgen.run.trajectory import Event

GAP_CHECKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Points of an adaptive step at which the gaps of contacts are checked; for equal steps, the ends.
"""

MOST_EVENTS = 10_000
"""Greatest number of events within 1e-9 of a run's length."""

TOGETHER = 1e-9
"""Contacts that open within this fraction of a step open together."""


@dataclass(frozen=True)
class Stepper:
    """How a run makes steps.

    begin    begins steps of a problem at any time
    checked  the points of a step at which gaps are checked, as fractions from 0 to 1
    counted  wraps a function so that its calls count as derivatives
    """

    begin: Begin
    checked: Sequence[float]
    counted: Callable[[Rate], Rate]


@dataclass
class _Status:
    """The current status of a run: time, state, and contacts held.

    slack    added to each gap, (nc,): positive for contacts that have just opened, whose gaps are 0
             but for rounding, until they exceed `TOLERANCE`
    fastest  the greatest rate of any gap at any strike so far, sizes/s
    """

    t: float
    y: FloatArray
    held: tuple[int, ...]
    slack: FloatArray
    fastest: float


@dataclass
class _EventLimit:
    """Counts the events within `least` s, and stops a run with too many."""

    least: float
    since: float
    count: int = 0

    def count_event(self, t: float) -> None:
        """Count an event at `t`. Raises `StepFailure` if there are too many."""
        self.count += 1
        if t - self.since > self.least:
            self.since, self.count = t, 0
        if self.count > MOST_EVENTS:
            raise StepFailure(
                f"contacts struck or opened {MOST_EVENTS} times within {self.least:.2g} s",
                "take a larger rest_speed",
            )


def advances(
    stepper: Stepper,
    problem: Problem,
    t_start: float,
    t_end: float,
    *,
    rest_speed: float | None,
    max_steps: int,
    resume: Resume | None = None,
) -> Iterator[Advance]:
    """Yield the steps of a run with contacts, cut where one strikes or opens, and the strikes.

    `rest_speed`, m/s or rad/s, and `resume`: see `integrate`. Raises `StepFailure` if a contact
    penetrates at the start, if no forces keep contacts from closing, if impacts do not end, and
    after `max_steps`.
    """
    assert problem.contacts is not None
    problem = replace(problem, contacts=in_sizes(problem.contacts))
    contacts = problem.contacts
    assert contacts is not None
    count = len(contacts.names)
    fastest = float(np.abs(contacts.rates(t_start, problem.initial)).max())
    now = _Status(t_start, problem.initial, (), np.zeros(count), fastest)
    closed: list[int] = []
    begun = (now.t, now.y)
    if resume and "alpha" in resume:
        alpha = float(resume["alpha"])
        now.held = tuple(resume["held"].astype(int).tolist())
        now.slack, now.fastest = resume["slack"].copy(), float(resume["fastest"])
        begun = (float(resume["begun_t"]), resume["begun_y"])
    else:
        alpha = recovery(contacts, t_start, now.y, t_end - t_start)
        check_depth(contacts, now.t, now.y)
        closed = np.flatnonzero(contacts.gaps(now.t, now.y) <= TOLERANCE).tolist()
    limit = _EventLimit(1e-9 * (t_end - t_start), t_start)
    made = 0
    while True:
        if closed:
            limit.count_event(now.t)
            yield from _strike(problem, now, closed, rest_speed, alpha)
        closed = []
        if now.t >= t_end:
            return
        if resume is None:
            begun = (now.t, now.y)
        holding = Holding(contacts, now.held, begun, alpha) if now.held else None
        smooth = restrained(replace(problem, initial=now.y), holding, stepper.counted)
        powers = holding.powers if holding else None
        steps = stepper.begin(smooth, now.t, made, resume, lambda: not now.slack.any())
        resume = None
        for advance in steps:
            made += advance.steps
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            step = replace(advance, contact_powers=powers)
            if advance.checked:
                closing, closed = np.inf, list[int]()
            else:
                closing, closed = _closing(contacts, now, step, stepper.checked)
            opening, opened = _opening(holding, now, step)
            if closing <= opening and closed:
                now.slack = np.zeros(len(contacts.names))
                yield from _cut(now, step, closing, keep=True)
                break
            closed = []
            if opened:
                limit.count_event(opening)
                yield from _cut(now, step, opening, keep=False)
                yield _open(contacts, smooth, now, opened)
                break
            now.t, now.y = step.t, step.y
            if now.slack.any():
                now.slack[contacts.gaps(now.t, now.y) > TOLERANCE] = 0.0
            yield replace(step, resume=_resume(step, now, begun, alpha))


def _resume(
    step: Advance, now: _Status, begun: tuple[float, FloatArray], alpha: float
) -> Callable[[], Resume] | None:
    """What a later run needs to continue after a step: that of the method, and the contacts."""
    if step.resume is None:
        return None
    held, slack, fastest, own = now.held, now.slack.copy(), now.fastest, step.resume

    def resume() -> Resume:
        return {
            **own(),
            "alpha": np.array(alpha),
            "held": np.array(held, dtype=np.float64),
            "slack": slack,
            "fastest": np.array(fastest),
            "begun_t": np.array(begun[0]),
            "begun_y": begun[1],
        }

    return resume


def _strike(
    problem: Problem,
    now: _Status,
    closed: Sequence[int],
    rest_speed: float | None,
    alpha: float,
) -> Iterator[Advance]:
    """Yield the strikes at time `now.t`, and update `now` with the contacts that are then held."""
    contacts, t = problem.contacts, now.t
    assert contacts is not None
    near = np.flatnonzero(contacts.gaps(t, now.y) <= TOLERANCE).tolist()
    touching = sorted({*closed, *now.held, *near})
    speeds: dict[int, float] = {}

    def instant(struck: int | None = None) -> Advance:
        y = now.y
        return Advance(t, y, [], problem, lambda _: y, steps=0, struck=struck)

    sizes = np.array(contacts.sizes or np.ones(len(contacts.names)))
    free = accelerations(contacts, t, now.y)
    now.fastest = max(now.fastest, float(np.abs(contacts.rates(t, now.y)).max()))
    nothing = STILL * max(now.fastest, math.sqrt(np.abs(free).max()))
    least = slowest_bounces(free, None if rest_speed is None else rest_speed / sizes)
    for contact, speed, y in strikes(contacts, t, now.y, touching, least, nothing):
        now.y = y
        speeds[contact] = max(speeds.get(contact, 0.0), speed)
        yield instant(contact)
    before, now.held = now.held, tuple(still(contacts, t, now.y, touching, nothing, alpha))
    slow = contacts.rates(t, now.y) <= nothing
    for k in touching:
        opens = slow[k] and k not in now.held
        now.slack[k] = _slack(contacts, t, now.y, k) if opens else 0.0
    events = [
        Event(t, contacts.names[k], "impact", float(speed * sizes[k]))
        for k, speed in sorted(speeds.items())
        if speed >= least[k]
    ]
    rest = [k for k in now.held if k not in before]
    lift = [k for k in before if k not in now.held]
    events += [
        Event(t, contacts.names[k], "rest", float(speeds.get(k, 0.0) * sizes[k])) for k in rest
    ]
    events += [Event(t, contacts.names[k], "lift", 0.0) for k in lift]
    rows = [(t, now.y)] if speeds else []
    yield replace(instant(), samples=rows, events=tuple(events))


def _open(contacts: Contacts, problem: Problem, now: _Status, opened: Sequence[int]) -> Advance:
    """Release contacts that were held."""
    now.held = tuple(k for k in now.held if k not in opened)
    for k in opened:
        now.slack[k] = _slack(contacts, now.t, now.y, k)
    events = tuple(Event(now.t, contacts.names[k], "lift", 0.0) for k in opened)
    y = now.y
    return Advance(now.t, y, [], problem, lambda _: y, steps=0, events=events)


def _slack(contacts: Contacts, t: float, y: FloatArray, contact: int) -> float:
    """The `slack` of a contact that opens: `TOLERANCE`, or a little more than its penetration."""
    return max(TOLERANCE, 0.01 * TOLERANCE - float(contacts.gaps(t, y)[contact]))


def _cut(now: _Status, step: Advance, t: float, keep: bool) -> Iterator[Advance]:
    """Yield the part of a step up to `t`, if it has any length, and update `now`. With `keep` the
    state at `t` is a sample.
    """
    if t <= now.t:
        return
    y = step.y if t == step.t else step.within(t)
    samples = [sample for sample in step.samples if sample[0] < t or (sample[0] == t and not keep)]
    now.t, now.y = t, y
    rows = [*samples, (t, y)] if keep else samples
    yield replace(step, t=t, y=y, samples=rows, resume=None)


def _closing(
    contacts: Contacts, now: _Status, step: Advance, checked: Sequence[float]
) -> tuple[float, list[int]]:
    """The time at which contacts first close in a step, and which; infinity and none if none do."""
    apart = [k for k in range(len(contacts.names)) if k not in now.held]
    if not apart:
        return np.inf, []
    length, slack = step.t - now.t, now.slack.copy()

    def state(s: float) -> FloatArray:
        return now.y if s <= 0 else step.y if s >= length else step.within(now.t + s)

    def gap(k: int, s: float) -> float:
        return float(contacts.gaps(now.t + s, state(s))[k] + slack[k])

    def rate(k: int, s: float) -> float:
        return float(contacts.rates(now.t + s, state(s))[k])

    def at(s: float) -> tuple[float, FloatArray, FloatArray]:
        y = state(s)
        return s, contacts.gaps(now.t + s, y), contacts.rates(now.t + s, y)

    a, gaps_a, rates_a = at(0.0)
    for fraction in checked[1:]:
        b, gaps_b, rates_b = at(fraction * length)
        found = []
        for k in apart:
            low = gaps_b[k] + slack[k] < 0
            dips = rates_a[k] < 0 < rates_b[k]
            if low or dips:
                ends = (gaps_a[k] + slack[k], gaps_b[k] + slack[k])
                zero = _first_zero(partial(gap, k), partial(rate, k), a, b, ends)
                if zero is not None:
                    found.append((zero, k))
        if found:
            first = min(found)[0]
            return now.t + first, [k for zero, k in found if zero <= first + 1e-12 * length]
        slack[gaps_b > TOLERANCE] = 0.0
        a, gaps_a, rates_a = b, gaps_b, rates_b
    return np.inf, []


def _first_zero(
    gap: Callable[[float], float],
    rate: Callable[[float], float],
    a: float,
    b: float,
    ends: tuple[float, float],
) -> float | None:
    """The first point at which a gap falls to 0, if it does; its rate changes sign at most once
    between `a` and `b`. `ends` are its values there.
    """
    at_a, at_b = ends
    before, after = rate(a), rate(b)
    # A gap that rises first reaches 0 only after its maximum: at `a` it may be 0 but for rounding.
    if at_a > 0 and at_b < 0 and not before > 0 > after:
        return _root(gap, a, b)
    turns = before * after < 0
    middle = _root(rate, a, b) if turns else b
    if before < 0:  # it falls first
        if at_a <= 0:
            return a
        return _root(gap, a, middle) if turns and gap(middle) < 0 else None
    if at_b >= 0 or not turns:  # it rises still
        return a if before == 0 and at_b < at_a <= 0 else None
    return _root(gap, middle, b) if gap(middle) > 0 else middle


def _root(function: Callable[[float], float], a: float, b: float) -> float:
    xtol = max(1e-14 * (b - a), 1e-300)
    return root(function, a, b, (function(a), function(b)), xtol=xtol, rtol=1e-15)


def _opening(holding: Holding | None, now: _Status, step: Advance) -> tuple[float, list[int]]:
    """The time at which held contacts first open in a step, and which; infinity and none if none
    do. A contact opens when its force has fallen to 0 and its gap begins to grow.
    """
    if holding is None:
        return np.inf, []
    _, pushes, parts = holding.solve(step.t, step.y)
    length = step.t - now.t

    def force(i: int, s: float) -> float:
        y = step.y if s >= length else step.within(now.t + s) if s > 0 else now.y
        _, push, part = holding.solve(now.t + s, y)
        return float(push[i] - part[i])

    found = []
    for i in np.flatnonzero((pushes == 0) & (parts > 0)).tolist():
        pressed = partial(force, i)
        at = _root(pressed, 0.0, length) if pressed(0.0) > 0 else 0.0
        found.append((at, holding.held[i]))
    if not found:
        return np.inf, []
    first = min(found)[0]
    return now.t + first, [k for at, k in found if at <= first + TOGETHER * length]
