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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.contacts import (
    ENDLESS,
    NO_FORCES,
    TOLERANCE,
    Place,
    Touching,
    begin,
    strike,
    weigh,
)
from eomgen.engine.structures import copied
from eomgen.run.compiled import Strikes, Touched
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

_NOTHING = np.empty(0), np.empty(0, np.int64)


@dataclass(frozen=True)
class Stepper:
    """How a run makes steps.

    begin    begins steps of a problem at any time
    strikes  lets contacts strike in compiled code; None if there is none
    counted  wraps a function so that its calls count as derivatives
    """

    begin: Begin
    strikes: Callable[[], Strikes | None]
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
    contacts = in_sizes(problem.contacts)
    problem = replace(problem, contacts=contacts)
    is_begun = resume is not None and "alpha" in resume
    touched = at_start(problem, (t_start, t_end), rest_speed, anew=not is_begun)
    made, held, now = 0, touched.now, touched.at
    begun = (now.t, now.y)
    if resume and is_begun:
        begun = _resumed(contacts, held, resume)
    while True:
        if now.closed.any():
            yield from _strike(problem, touched, stepper.strikes())
        if now.t >= t_end:
            return
        if resume is None:
            begun = (now.t, now.y)
        holding = Holding(contacts, copied(held)) if held.holds.any() else None
        smooth = restrained(replace(problem, initial=now.y), holding, stepper.counted)
        powers = holding.powers if holding else None
        steps = stepper.begin(smooth, now.t, made, resume, touched)
        resume, start = None, now.t
        for advance in steps:
            made += advance.steps
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            step = advance._replace(contact_powers=powers)
            now.t, now.y = step.t, step.y
            closes, opens = now.closed.any(), now.opened.any()
            if not (closes or opens):
                yield step._replace(resume=_resume(step, held, begun))
                start = now.t
                continue
            if now.t > start:
                yield _part(step, keep=bool(closes))
            else:  # for what it counts
                yield step._replace(samples=[], steps=0)
            if opens:
                yield _opened(contacts, smooth, now)
            break


def at_start(
    problem: Problem, span: tuple[float, float], rest_speed: float | None, anew: bool = True
) -> Touched:
    """What steps are given of rigid contacts, in sizes, at the start of a run, and `anew` which of
    them touch. Raises `StepFailure` if one penetrates.
    """
    contacts, (t, end) = problem.contacts, span
    assert contacts is not None
    closed, opened = np.zeros((2, len(contacts.names)), np.int64)
    now = Place(t, problem.initial, closed, opened, 1e-9 * (end - t), t, 0)
    held = nothing_held(contacts, len(problem.initial), rest_speed)
    if anew:
        begin(contacts, held, t, now.y, end - t)
        check_depth(contacts, t, now.y)
        now.closed[contacts.gaps(t, now.y) <= TOLERANCE] = 1
    return Touched(contacts, contacts.names, sizes_of(contacts), held, now, *_NOTHING)


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


def _strike(problem: Problem, touched: Touched, compiled: Strikes | None) -> Iterator[Advance]:
    """Yield the strikes of contacts that have closed, and update state and contacts."""
    contacts, now, held, t = problem.contacts, touched.at, touched.now, touched.at.t
    assert contacts is not None
    made: list[tuple[int | None, FloatArray]] = []

    def impact(t: float, y: FloatArray, contact: int, bounce: float) -> FloatArray:
        made.append((contact, contacts.impact(t, y, contact, bounce)))
        return made[-1][1]

    def instant(y: FloatArray, struck: int | None = None) -> Advance:
        return Advance(t, y, [], problem, lambda _: y, steps=0, struck=struck)

    before, counts = held.holds.copy(), dict[str, Any]()
    met = touched.copy(t, now.y, 1)
    answer = compiled(met) if compiled else None
    if answer is None:
        answer = strike(replace(contacts, impact=impact), held, now)
    else:
        touched.take(met)
        made = [(None, met.at.y)] if held.speeds.any() else []
        counts = met.called(0)
    now.closed[:] = 0
    for contact, after in made:
        now.y = after
        yield instant(after, contact)
    if answer == ENDLESS:
        names = ", ".join(contacts.names[k] for k in np.flatnonzero(held.speeds))
        raise StepFailure(
            f"the impacts among {names} at t = {t:.6g} do not end", "take less restitution"
        )
    if answer == NO_FORCES:
        raise no_forces(contacts.names, held, t)

    found = (held.speeds * sizes_of(contacts)).tolist()
    events: list[Event] = []
    kinds: tuple[tuple[Kind, NDArray[np.bool_]], ...] = (
        ("impact", (held.speeds > 0) & (held.speeds >= held.least)),
        ("rest", held.holds > before),
        ("lift", held.holds < before),
    )
    for kind, which in kinds:
        for k in np.flatnonzero(which).tolist():
            speed = 0.0 if kind == "lift" else found[k]
            events.append(Event(t, contacts.names[k], kind, speed))
    rows = [(t, now.y)] if made else []
    yield instant(now.y)._replace(samples=rows, events=tuple(events), **counts)


def _opened(contacts: Contacts, problem: Problem, now: Place) -> Advance:
    """That contacts which were held have opened."""
    which = np.flatnonzero(now.opened)
    now.opened[:] = 0
    events = tuple(Event(now.t, contacts.names[k], "lift", 0.0) for k in which)
    y = now.y
    return Advance(now.t, y, [], problem, lambda _: y, steps=0, events=events)


def _part(step: Advance, keep: bool) -> Advance:
    """The part of a step up to an event; with `keep` the state there is a sample."""
    if not keep:
        return step
    samples = [sample for sample in step.samples if sample[0] < step.t]
    return step._replace(samples=[*samples, (step.t, step.y)])
