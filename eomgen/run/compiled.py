"""The interface of compiled steps: many steps of a method at once, with the bits of Python's.

`eomgen.native.runs` implements it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.contacts import ContactLaw, Place, Touching
from eomgen.engine.equal_steps import Course, Kept
from eomgen.engine.structures import copied
from eomgen.engine.sums import Sum

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
MEMORY = {
    "h_abs": "lengths",
    "f": "slopes",
    "lost": "losses",
    "h_last": "last_lengths",
    "error": "errors",
}
"""The engine's records of what determines a method's next step."""


@dataclass(frozen=True, eq=False)
class Constrained:
    """What steps that keep constraints are given of these; see `run.projection`.

    sizes          (nc,), size of each residual
    before, after  (nc,), the largest residuals so far before and after projection, which the steps
                   update
    margins        the ends of the last two steps, s, and the least margins there
    """

    sizes: Array
    before: Array
    after: Array
    margins: tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Margins:
    """The least margins of constraints at the start and the end of a step, which starts at `start`,
    as far as compiled code has checked them; see `run.projection`.
    """

    start: float
    before: float
    here: float


@dataclass(frozen=True, eq=False)
class Stride:
    """Some steps of an adaptive method, in order: m of them, which may be none.

    ends         (m,), their times, s
    states       (m, ny), the states there
    memory       what of the solver determines the next step, by name, for each step
    counts       (m,) each, what the steps have counted so far, by the names of `Advance`
    sampled      (m,), number of rows passed so far
    rows         (r, ny), the states at the times of these rows
    usual        whether the next step may be made so, too
    event        whether rigid contacts close or open at the end of the last one, which is a part
    switched     (m,), the time of the last switch so far, s, and
    values       (m, ns), the switching functions at their ends, if there are some of the state
    within       gives the state at a time in the step of a number; None if that was not asked for
    margins      (m + 1,), the least margins of constraints at the start and at their ends; None if
                 there are none
    """

    ends: Array
    states: Array
    memory: Mapping[str, Array]
    counts: Mapping[str, NDArray[np.int64]]
    sampled: NDArray[np.int64]
    rows: Array
    usual: bool = True
    event: bool = False
    switched: Array = field(default_factory=partial(np.empty, 0))
    values: Array = field(default_factory=partial(np.empty, 0))
    within: Callable[[int, float], Array] | None = None
    margins: Array | None = None


@dataclass(frozen=True, eq=False)
class Watched:
    """What steps from a time on are checked for branches with: see `run.branches`.

    ends      the ends of the last two steps and the switching functions (ns,) there; empty if none
              depends on the state
    switched  the time of the last switch, s
    clear     the time, s, up to which no switching function of time alone changes its sign
    timed     whether those of the state depend on time, too
    angles    indices of the states that are angles
    unseen    the longest step, s, if the functions cannot be followed along it, for steps that are
              made again where they pass over a branch; 0 for such that are not made
    """

    ends: Sequence[tuple[float, Array]]
    switched: float
    clear: float
    timed: bool
    angles: tuple[int, ...]
    unseen: float = 0.0


@dataclass(frozen=True, eq=False)
class Stretch:
    """What steps of an adaptive method are wanted: up to `most` from where a solver is, but none
    beyond `until`, s.

    solver      has the time t, the state y and the memory of the method, which determine the steps
    reaches     whether one of them may be shorter because it ends at `until`; else they end before
                that one
    rtol, atol  tolerances, atol (ny,)
    longest     the longest step, s
    dense       whether states within the steps are wanted
    counts_terms  whether derivatives for them count in steps without rows, as they do where each
                step is looked at within
    times       ascending times of the rows wanted, after t
    watched     given to make no step that may pass over a branch of the derivative
    touched     given for steps that end where rigid contacts close or open
    only_whole  whether no step may end so, but before that
    constrained the constraints to keep, if there are any
    """

    solver: Any
    until: float
    reaches: bool
    rtol: float
    atol: Array
    longest: float
    most: int
    dense: bool
    counts_terms: bool
    times: Array
    watched: Watched | None
    touched: "Touched | None"
    only_whole: bool
    constrained: Constrained | None


Steps = Callable[[Stretch], Stride]
"""Makes steps of an adaptive method."""
Series = Callable[[float, Array, int], Array]
"""The Taylor coefficients (order + 1, ny) of the solution from a state y on: `(t, y, order)`."""


@dataclass(frozen=True, eq=False)
class WholeRun:
    """A run of which only rows are wanted, through all events of rigid contacts and over all
    branches of the derivative.

    stretch  its steps, of which the first row's time is that of the start
    near     a row at most so much before a strike, s, is the state after it
    most     greatest number of steps from one event to the next
    """

    stretch: Stretch
    near: float
    most: int


Through = Callable[[WholeRun], Array | None]
"""Makes a run; its rows, or None if Python must make it."""


CALLS = ("derivatives", "gap_checks", "held")
"""What is counted of steps with rigid contacts."""


@dataclass(frozen=True, eq=False)
class Touched:
    """What steps that end where rigid contacts close or open are given of these, and change.

    law    the contacts, in sizes; `sizes` (nc,) are these, and `names` theirs
    now    what is known of the contacts, after the event if there is one
    at     where the run is, then where the event is, and which contacts close or open
    slack  (nc,), that of the contacts after the last whole step
    calls  (most + 1, 3), those of the derivative, of gaps and their rates, and of
           `ContactLaw.held`, up to the start of each step, or to the end of the last one
    """

    law: ContactLaw
    names: Sequence[str]
    sizes: Array
    now: Touching
    at: Place
    slack: Array
    calls: Whole

    def copy(self, t: float, y: Array, most: int) -> "Touched":
        """The same at a time and a state, for up to `most` steps."""
        now, at = copied(self.now), copied(self.at)
        at.t, at.y = t, y.copy()
        calls = np.zeros((most + 1, len(CALLS)), np.int64)
        return replace(self, now=now, at=at, slack=now.slack.copy(), calls=calls)

    def called(self, n: int) -> dict[str, Any]:
        """The calls in step n."""
        return dict(zip(CALLS, (self.calls[n + 1] - self.calls[n]).tolist(), strict=True))

    def called_by(self, n: int) -> dict[str, Whole]:
        """The calls up to the ends of n steps."""
        return dict(zip(CALLS, self.calls[1 : n + 1].T, strict=True))

    def take(self, made: "Touched") -> None:
        """Take what is known of the contacts after an event."""
        for each in fields(Touching):
            setattr(self.now, each.name, getattr(made.now, each.name))
        self.at.since, self.at.events = made.at.since, made.at.events
        self.at.closed, self.at.opened = made.at.closed, made.at.opened


Strikes = Callable[[Touched], int | None]
"""See `engine.contacts.strike`; None if Python must."""


@dataclass(frozen=True)
class EqualSteps:
    """Steps of equal length, which a place makes by `eomgen.engine.equal_steps`.

    make      makes steps from a sum at t along a course, and keeps them; constraints are kept, and
              rigid contacts end the steps, if they are given. Returns why they end, as the engine
              does
    calls     derivatives in each step, or in each iteration
    iterates  whether the method iterates, with as many Jacobians as derivatives
    """

    make: Callable[[float, Sum, Course, Kept, Constrained | None, Touched | None], int]
    calls: int
    iterates: bool = False


@dataclass(frozen=True, eq=False)
class Compiled:
    """Compiled steps of a problem.

    derivative  the function whose steps they are: they serve no problem with another one
    steps       the steps of a method, by its name and those of further functions that they call;
                None if there are none, or not yet. It is asked again and again during a run, and
                may begin to compile when the run is a long one
    equal       the same for methods with equal steps, without further functions
    strikes     lets rigid contacts strike; None as for steps
    through     the runs of a method through all events and branches; None as for steps
    """

    derivative: Callable[[float, Array], Array]
    steps: Callable[[str, tuple[str, ...]], Steps | None]
    equal: Callable[[str], EqualSteps | None]
    strikes: Callable[[], Strikes | None] = lambda: None
    through: Callable[[str], Through | None] = lambda _: None
