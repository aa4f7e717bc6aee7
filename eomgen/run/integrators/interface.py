"""The interface of integrators: methods, the steps that they make, and their failures."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from eomgen.run.compiled import Margins, Touched
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.trajectory import Event

Change = Callable[[Problem, float, FloatArray, float], FloatArray]
"""`change(problem, t, y, h) -> d`: a step of size h leads to y + d; does not modify `y` (ny,)."""

Stability = Callable[[NDArray[np.complex128]], NDArray[np.complex128]]
"""The stability function R(z) of a method at z = hλ (n,): the factors (n,) by which a step
multiplies the solutions of y' = λ y."""

Resume = Mapping[str, FloatArray]
"""What a run continues from, by name: `t` (), `y` (ny,), and the state of its method and contacts.
"""


SMALLEST_RTOL = 2.3e-14
"""SciPy silently raises an rtol below 100 times the machine epsilon; here it is an error."""
SHORTER = "take a smaller --dt, or an implicit or adaptive method (--integrator Radau)"
LOOSER = "try another --integrator, or a looser --rtol and --atol"
"""Remedies for runs that fail."""


Remark = Callable[[str], None]
"""Called with a method's remark on a step, as text."""


def ignored(text: str) -> None:
    """A `Remark` that does nothing."""


@dataclass(frozen=True)
class FixedStep:
    """A method whose step the user chooses.

    prepare    makes the method's `Change` for a problem, once per run; raises `RunError` if the
               method cannot integrate it
    order      global error O(h^order)
    remedy     what to change when a run fails
    explicit   whether a step may be too long for stability
    stability  its stability function, if that is a function of hλ alone
    compiled   name of its compiled steps, "" if there are none
    solves     whether steps with constraints are solved for, so that they are not explicit
    """

    prepare: Callable[[Problem], Change]
    order: int
    remedy: str = SHORTER
    explicit: bool = True
    stability: Stability | None = None
    compiled: str = ""
    solves: bool = False

    def steps_explicitly(self, problem: Problem) -> bool:
        """Whether steps of a problem may be too long for stability."""
        return self.explicit and not (self.solves and problem.projection is not None)


@dataclass(frozen=True)
class Adaptive:
    """A method that chooses its steps to meet rtol and atol.

    maker          makes its `Maker`
    uses_jacobian  whether it is given the problem's Jacobian
    asks_more      whether it takes `timed`, which says whether the derivative depends on time, and
                   `positions`, the number of states that are positions and come first
    one_step       whether a step depends on the state alone, not on earlier steps; then the state
                   may be corrected between steps
    remedy         what to change when a run fails
    smallest_rtol  the smallest relative tolerance that it takes
    compiled       name of its compiled steps, "" if there are none
    memory         attributes of its maker, numbers or arrays, that together with time and state
                   determine the next step; the first is its length. Empty if these do not suffice
    vectors        those of `memory` that have a number for each state
    series         name of the Taylor series that it is given; "" if it needs none
    """

    maker: Callable[..., Any]
    uses_jacobian: bool = False
    asks_more: bool = False
    one_step: bool = True
    remedy: str = LOOSER
    memory: tuple[str, ...] = ()
    vectors: tuple[str, ...] = ("f", "lost")
    compiled: str = ""
    series: str = ""
    smallest_rtol: float = SMALLEST_RTOL


@dataclass(frozen=True)
class Tolerances:
    """What the steps of a run by an adaptive method may be.

    rtol, atol  tolerances for the error of a step
    longest     the longest step, s
    unseen      the longest step, s, if it cannot be checked for branches that it passes over
    most        greatest number of steps
    """

    rtol: float
    atol: float | FloatArray
    longest: float
    unseen: float
    most: int

    def allowed(self, y: FloatArray) -> FloatArray:
        """The error allowed in a step that ends in the state y (ny,), (ny,)."""
        return self.atol + self.rtol * np.abs(y)


class Advance(NamedTuple):
    """A step, or several, from the end of the one before: the state `y` (ny,) at the end, time `t`.

    samples  the rows to keep: times and states in the step
    problem  whose derivative was integrated
    within   gives the state at any time in the step; valid until the next step is made
    steps    number of steps; 0 if no time passes: an impact, or `events` only
    derivatives, jacobians, switches, gap_checks, held
             calls of these, of switching functions, of gaps and their rates, and of
             `Contacts.held`, that are not counted otherwise
    factorisations  LU factorisations in the step, as far as the method counts them
    capped   number of steps that have the greatest length allowed
    cut      number of longer attempts that passed over a branch of the derivative
    struck   number of the contact of an impact
    events   changes of contacts at its end
    contact_powers  (t, y) -> (nc + nd,), powers of the contacts and of the drives during the step,
                    W, if contacts were held
    resume   returns what a later run needs to continue from here exactly as this one does; None if
             this run would not have ended a step here, or if the method cannot continue so
    margins  of its last step, if compiled code has checked all of its steps
    """

    t: float
    y: FloatArray
    samples: Sequence[tuple[float, FloatArray]]
    problem: Problem
    within: Callable[[float], FloatArray]
    steps: int = 1
    derivatives: int = 0
    jacobians: int = 0
    factorisations: int = 0
    switches: int = 0
    gap_checks: int = 0
    held: int = 0
    capped: int = 0
    cut: int = 0
    resume: Callable[[], Resume] | None = None
    margins: Margins | None = None
    struck: int | None = None
    events: tuple[Event, ...] = ()
    contact_powers: Callable[[float, FloatArray], FloatArray] | None = None


class Begin(Protocol):
    """Begin steps of a problem at time t, after `made` earlier ones; `resume` continues a run, and
    `touched` says what is known of rigid contacts.
    """

    def __call__(
        self,
        problem: Problem,
        t: float,
        made: int,
        resume: Resume | None = None,
        touched: Touched | None = None,
    ) -> Iterator[Advance]: ...
