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

from eomgen.engine.contact_runs import (
    CLOSED,
    NOT_FOUND,
    NOT_KEPT,
    OPENED,
    WHOLE,
    Place,
    taken,
)
from eomgen.engine.contacts import ENDLESS, NO_FORCES, TOLERANCE, Touching, begin, strike, weigh
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
    closed, opened = np.zeros((2, len(contacts.names)), np.int64)
    least = 1e-9 * (t_end - t_start)
    now = Place(t_start, problem.initial, closed, opened, least, t_start, 0)
    held = nothing_held(contacts, len(problem.initial), rest_speed)
    begun = (now.t, now.y)
    if resume and "alpha" in resume:
        begun = _resumed(contacts, held, resume)
    else:
        begin(contacts, held, now.t, now.y, t_end - t_start)
        check_depth(contacts, now.t, now.y)
        now.closed[contacts.gaps(now.t, now.y) <= TOLERANCE] = 1
    made = 0
    while True:
        if now.closed.any():
            yield from _strike(problem, now, held)
        if now.t >= t_end:
            return
        if resume is None:
            begun = (now.t, now.y)
        holding = Holding(contacts, deepcopy(held)) if held.holds.any() else None
        smooth = restrained(replace(problem, initial=now.y), holding, stepper.counted)
        powers = holding.powers if holding else None
        steps = stepper.begin(smooth, now.t, made, resume, lambda: not held.slack.any())
        resume = None
        for advance in steps:
            made += advance.steps
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            step = advance._replace(contact_powers=powers)
            start, why = now.t, WHOLE
            if advance.checked:
                now.t, now.y = step.t, step.y
            else:
                within = _Within(now.t, now.y, step)
                why = taken(contacts, within, held, Search(), now, step.t, stepper.share)
            if why not in (WHOLE, CLOSED, OPENED):
                raise _failure(contacts, held, why, (start, step.t), now)
            if why == WHOLE:
                yield step._replace(resume=_resume(step, held, begun))
                continue
            if now.t > start:
                yield _part(step, now, keep=why == CLOSED)
            if why == OPENED:
                yield _opened(contacts, smooth, now)
            break


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


def _failure(
    contacts: Contacts, held: Touching, why: int, times: tuple[float, float], now: Place
) -> StepFailure:
    """Why a step between two times cannot be taken."""
    start, end = times
    if why == NOT_KEPT:
        return no_forces(contacts, held, end)
    if why == NOT_FOUND:
        return StepFailure(
            f"the time of a contact is not found between {start:.6g} and {end:.6g}",
            "take a smaller step",
        )
    return StepFailure(
        f"contacts struck or opened {now.events - 1} times within {now.least:.2g} s",
        "take a larger rest_speed",
    )


def _strike(problem: Problem, now: Place, held: Touching) -> Iterator[Advance]:
    """Yield the strikes of contacts that have closed, and update state and contacts."""
    contacts, t = problem.contacts, now.t
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
    answer = strike(replace(contacts, impact=impact), held, t, y, now.closed, speeds, least)
    now.closed[:] = 0
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


def _opened(contacts: Contacts, problem: Problem, now: Place) -> Advance:
    """That contacts which were held have opened."""
    which = np.flatnonzero(now.opened)
    events = tuple(Event(now.t, contacts.names[k], "lift", 0.0) for k in which)
    y = now.y
    return Advance(now.t, y, [], problem, lambda _: y, steps=0, events=events)


def _part(step: Advance, now: Place, keep: bool) -> Advance:
    """The part of a step up to an event; with `keep` the state there is a sample."""
    t, y = now.t, now.y
    samples = [sample for sample in step.samples if sample[0] < t or (sample[0] == t and not keep)]
    rows = [*samples, (t, y)] if keep else samples
    return step._replace(t=t, y=y, samples=rows, resume=None)
