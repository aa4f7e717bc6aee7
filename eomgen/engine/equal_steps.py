"""Many steps of equal length, one after another."""

from dataclasses import dataclass
from typing import Annotated, Protocol

from eomgen.engine.adaptive import EVENT, MADE, UNUSUAL
from eomgen.engine.explicit import Method, Step
from eomgen.engine.quaternions import normalised
from eomgen.engine.sums import Sum, add_compensated
from eomgen.subset.words import Matrix, Vector, Whole, all_within, ordered


@dataclass(slots=True)
class Course:
    """Where steps lead: step i ends at t_start + i dt, and at t_end at the latest, and is made as
    one of `length`; `before` are made, and at most `most` are to be. Then the rate of the last
    step, and the change from it that is no jump; the last derivative evaluated, `slope` at `place`;
    and the four states of each quaternion.
    """

    t_start: float
    t_end: float
    dt: float
    length: float
    before: int
    most: int
    rate: Annotated[Vector, "STATES"]
    allowed: Annotated[Vector, "STATES"]
    place: Annotated[Vector, "STATES"]
    slope: Annotated[Vector, "STATES"]
    many: int
    quaternions: Annotated[Whole, "4 * many"]


@dataclass(slots=True)
class Kept:
    """Of each step made its end, the state there, what rounding took from it, the number of
    iterations, and the least margin of constraints.
    """

    made: int
    most: int
    ends: Annotated[Vector, "most"]
    states: Annotated[Matrix, "most", "STATES"]
    losses: Annotated[Matrix, "most", "STATES"]
    iterations: Annotated[Whole, "most"]
    margins: Annotated[Vector, "most"]


class Constrained(Protocol):
    """What is held along the way: flags of the processor, the stability of steps, and constraints
    if there are any.
    """

    def clear(self) -> None:
        """Forget what was raised."""
        ...

    def is_raised(self) -> bool:
        """Whether there was an overflow, a division by 0, or a result that is no number."""
        ...

    def may_jump(
        self, t: float, y: Annotated[Vector, "STATES"], change: Annotated[Vector, "STATES"]
    ) -> bool:
        """Whether a step from this state may be made although its rate jumps."""
        ...

    def projected(self, t: float, y: Annotated[Vector, "STATES"]) -> bool:
        """Put the state on the constraints; False if that is not usual."""
        ...

    def keep_step(
        self, t: float, y: Annotated[Vector, "STATES"], margin: Annotated[Vector, "1"]
    ) -> bool:
        """The least margin of the constraints there; False if it is near 0."""
        ...


class Events(Protocol):
    """The rigid contacts, which may end a step; none if there are none."""

    def event(
        self,
        method: Method,
        t: float,
        y: Annotated[Vector, "STATES"],
        end: Annotated[Vector, "1"],
    ) -> int:
        """MADE if no contact closes or opens in a step from t to the state y at `end`. EVENT if one
        does: then state and time become those of the event. UNUSUAL if that is not known.
        """
        ...


def equal_steps(
    held: Constrained,
    method: Method,
    events: Events,
    t: float,
    at: Sum,
    course: Course,
    step: Step,
    kept: Kept,
) -> int:
    """Steps from t on. Ends before a step whose rate may not jump, or one with anything unusual:
    these are made elsewhere; and with one that an event ends.
    """
    start = t
    kept.made = 0
    for n in range(course.most):
        end = min(course.t_end, course.t_start + (course.before + n + 1) * course.dt)
        held.clear()
        iterations = method.changed(start, at.value, course.length, step)
        if iterations == 0:
            return UNUSUAL
        rate = step.change / course.length
        smooth = all_within(abs(rate - course.rate), course.allowed)
        if not smooth and not held.may_jump(start, at.value, step.change):
            return UNUSUAL
        add_compensated(at, step.change)
        zero = ordered((at.value + step.slope) * 0.0)
        if zero != 0.0 or not normalised(course.many, course.quaternions, at.value):
            return UNUSUAL
        if held.is_raised() or not held.projected(end, at.value):
            return UNUSUAL
        kept.ends[n] = end
        why = events.event(method, start, at.value, kept.ends[n:])
        if why == UNUSUAL or not held.keep_step(kept.ends[n], at.value, kept.margins[n:]):
            return UNUSUAL
        start = end
        course.rate = rate
        course.place = step.place
        course.slope = step.slope
        kept.iterations[n] = iterations
        kept.states[n] = at.value
        kept.losses[n] = at.lost
        kept.made = n + 1
        if why == EVENT:
            return EVENT
    return MADE
