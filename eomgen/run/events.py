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

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.contact_times import NO_ZERO, UNHELD, closing, opening
from eomgen.engine.contacts import (
    ENDLESS,
    NO_FORCES,
    TOLERANCE,
    Touching,
    begin,
    release,
    settle,
    strike,
    weigh,
)
from eomgen.engine.roots import Search
from eomgen.run.contacts import (
    Holding,
    Rate,
    check_depth,
    in_sizes,
    no_forces,
    nothing_held,
    restrained,
    sizes_of,
)
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Advance, Begin, Resume
from eomgen.run.problem import Contacts, FloatArray, Problem
from eomgen.run.trajectory import Event, Kind

GAP_CHECKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Points of an adaptive step at which the gaps of contacts are checked; for equal steps, the ends.
"""

MOST_EVENTS = 10_000
"""Greatest number of events within 1e-9 of a run's length."""


Flags = NDArray[np.int64]
"""1 for some of the contacts, (nc,)."""


@dataclass(frozen=True)
class Stepper:
    """How a run makes steps.

    begin    begins steps of a problem at any time
    share    gaps are checked at the ends of parts of a step, each this share of its length
    counted  wraps a function so that its calls count as derivatives
    """

    begin: Begin
    share: float
    counted: Callable[[Rate], Rate]


@dataclass
class _Status:
    """The current status of a run: time, state, and what is known of contacts."""

    t: float
    y: FloatArray
    held: Touching


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
    now = _Status(
        t_start, problem.initial, nothing_held(contacts, len(problem.initial), rest_speed)
    )
    closed = np.zeros(len(contacts.names), np.int64)
    begun = (now.t, now.y)
    if resume and "alpha" in resume:
        begun = _resumed(contacts, now.held, resume)
    else:
        begin(contacts, now.held, now.t, now.y, t_end - t_start)
        check_depth(contacts, now.t, now.y)
        closed[contacts.gaps(now.t, now.y) <= TOLERANCE] = 1
    limit = _EventLimit(1e-9 * (t_end - t_start), t_start)
    made = 0
    while True:
        if closed.any():
            limit.count_event(now.t)
            yield from _strike(problem, now, closed)
        closed[:] = 0
        if now.t >= t_end:
            return
        if resume is None:
            begun = (now.t, now.y)
        holding = Holding(contacts, deepcopy(now.held)) if now.held.holds.any() else None
        smooth = restrained(replace(problem, initial=now.y), holding, stepper.counted)
        powers = holding.powers if holding else None
        steps = stepper.begin(smooth, now.t, made, resume, lambda: not now.held.slack.any())
        resume = None
        for advance in steps:
            made += advance.steps
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            step = advance._replace(contact_powers=powers)
            closes, opens = np.inf, np.inf
            opened = np.zeros(len(closed), np.int64)
            within, search = _Within(now.t, now.y, step), Search()
            given = (contacts, within, now.held, search, now.t, step.t - now.t)
            if not advance.checked:
                closes = closing(*given, stepper.share, closed)
            if holding:
                opens = opening(*given, opened)
            _check_times(contacts, now, step, closes, opens)
            if closes <= opens and closed.any():
                now.held.slack[:] = 0.0
                yield from _cut(now, step, now.t + closes, keep=True)
                break
            closed[:] = 0
            if opened.any():
                limit.count_event(now.t + opens)
                yield from _cut(now, step, now.t + opens, keep=False)
                yield _open(contacts, smooth, now, opened)
                break
            now.t, now.y = step.t, step.y
            settle(contacts, now.held, now.t, now.y)
            yield step._replace(resume=_resume(step, now.held, begun))


def _resume(
    step: Advance, held: Touching, begun: tuple[float, FloatArray]
) -> Callable[[], Resume] | None:
    """What a later run needs to continue after a step: that of the method, and the contacts."""
    if step.resume is None:
        return None
    own, alpha, fastest = step.resume, held.alpha, held.fastest
    holds, slack = held.holds.copy(), held.slack.copy()

    def resume() -> Resume:
        return {
            **own(),
            "alpha": np.array(alpha),
            "held": np.flatnonzero(holds).astype(np.float64),
            "slack": slack,
            "fastest": np.array(fastest),
            "begun_t": np.array(begun[0]),
            "begun_y": begun[1],
        }

    return resume


def _resumed(contacts: Contacts, held: Touching, resume: Resume) -> tuple[float, FloatArray]:
    """Take what an earlier run knew of contacts; when and where it began to hold them."""
    held.alpha, held.fastest = float(resume["alpha"]), float(resume["fastest"])
    held.holds[resume["held"].astype(int)] = 1
    held.slack[:] = resume["slack"]
    begun = (float(resume["begun_t"]), resume["begun_y"])
    weigh(contacts, held, *begun)
    return begun


@dataclass(frozen=True)
class _Within:
    """The states of a step that begins at t with y."""

    t: float
    y: FloatArray
    step: Advance

    def state(self, s: float) -> FloatArray:
        """The state s seconds after its start."""
        step = self.step
        return self.y if s <= 0 else step.y if s >= step.t - self.t else step.within(self.t + s)


def _check_times(
    contacts: Contacts, now: _Status, step: Advance, closes: float, opens: float
) -> None:
    """Raise `StepFailure` if times at which contacts close or open are not found."""
    if opens == UNHELD:
        raise no_forces(contacts, now.held, step.t)
    if NO_ZERO in (closes, opens):
        raise StepFailure(
            f"the time of a contact is not found between {now.t:.6g} and {step.t:.6g}",
            "take a smaller step",
        )


def _strike(problem: Problem, now: _Status, closed: Flags) -> Iterator[Advance]:
    """Yield the strikes at time `now.t`, and update `now` with the contacts that are then held."""
    contacts, held, t = problem.contacts, now.held, now.t
    assert contacts is not None
    count = len(contacts.names)
    made: list[tuple[int, FloatArray]] = []

    def impact(t: float, y: FloatArray, contact: int, bounce: float) -> FloatArray:
        made.append((contact, contacts.impact(t, y, contact, bounce)))
        return made[-1][1]

    def instant(y: FloatArray, struck: int | None = None) -> Advance:
        return Advance(t, y, [], problem, lambda _: y, steps=0, struck=struck)

    before, y = held.holds.copy(), now.y.copy()
    speeds, least = np.empty((2, count))
    answer = strike(replace(contacts, impact=impact), held, t, y, closed, speeds, least)
    for contact, after in made:
        now.y = after
        yield instant(after, contact)
    if answer == ENDLESS:
        names = ", ".join(contacts.names[k] for k in sorted({contact for contact, _ in made}))
        raise StepFailure(
            f"the impacts among {names} at t = {t:.6g} do not end", "take less restitution"
        )
    if answer == NO_FORCES:
        raise no_forces(contacts, held, t)

    found = (speeds * sizes_of(contacts)).tolist()
    events: list[Event] = []
    kinds: tuple[tuple[Kind, NDArray[np.bool_]], ...] = (
        ("impact", (speeds > 0) & (speeds >= least)),
        ("rest", held.holds > before),
        ("lift", held.holds < before),
    )
    for kind, which in kinds:
        for k in np.flatnonzero(which).tolist():
            speed = 0.0 if kind == "lift" else found[k]
            events.append(Event(t, contacts.names[k], kind, speed))
    rows = [(t, now.y)] if made else []
    yield instant(now.y)._replace(samples=rows, events=tuple(events))


def _open(contacts: Contacts, problem: Problem, now: _Status, opened: Flags) -> Advance:
    """Release contacts that were held."""
    release(contacts, now.held, now.t, now.y, opened)
    events = tuple(Event(now.t, contacts.names[k], "lift", 0.0) for k in np.flatnonzero(opened))
    y = now.y
    return Advance(now.t, y, [], problem, lambda _: y, steps=0, events=events)


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
    yield step._replace(t=t, y=y, samples=rows, resume=None)
