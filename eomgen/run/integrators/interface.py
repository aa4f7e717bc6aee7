"""What every integrator looks like from outside."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolver

from eomgen.errors import RunError
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.trajectory import Event

Change = Callable[[Problem, float, FloatArray, float], FloatArray]
"""`change(problem, t, y, h) -> d`: one step of size h leads to y + d; leaves `y` (ny,) as it is."""

Stability = Callable[[NDArray[np.complex128]], NDArray[np.complex128]]
"""The stability function R of a method: of hλ (n,), what a step multiplies modes exp(λt) by, (n,).
"""

Resume = Mapping[str, FloatArray]
"""Where a run stands, by name: `t` (), `y` (ny,), and what else its method and contacts go on from.
"""


class StepFailure(RunError):
    """A step that cannot be made: the `reason`, and the `remedy`, what to change, or ""."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__("; ".join(filter(None, (reason, remedy))))
        self.reason, self.remedy = reason, remedy

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.reason, self.remedy)


class EndedRunError(StepFailure):
    """Raised by who watches or follows a run, to end it; the text says why."""


@dataclass(frozen=True)
class FixedStep:
    """A method whose steps the user chooses.

    prepare  gives the method's `Change` for a problem, once a run; raises `RunError` if the method
             cannot serve it
    order    global error O(h^order)
    remedy   what to change when a run goes astray
    explicit whether steps may be too long for stability
    stability  its stability function, if that is a function of hλ alone
    """

    prepare: Callable[[Problem], Change]
    order: int
    remedy: str
    explicit: bool = True
    stability: Stability | None = None


@dataclass(frozen=True)
class Adaptive:
    """A method, SciPy's or one like it, that chooses its own steps to meet rtol and atol.

    uses_jacobian  whether it is given the problem's Jacobian
    one_step       whether it steps on from a state alone, which then may be put right between steps
    remedy         what to change when a run goes astray
    memory         attributes of the solver, numbers or arrays, that with time and state are all
                   that the next step goes on from, the first its length; none where there is more
    vectors        those of memory that have a number for each state
    sees_end       whether its error estimate sees the derivative at the end of a step
    """

    solver: "Callable[..., OdeSolver[Any]]"
    uses_jacobian: bool
    one_step: bool
    remedy: str
    memory: tuple[str, ...] = ()
    vectors: tuple[str, ...] = ("f", "slope")
    sees_end: bool = True


@dataclass(frozen=True)
class Advance:
    """One step made, from where the last one ended: the state `y` (ny,) reached at time `t`.

    samples  the rows to keep of it
    problem  whose derivative was integrated
    within   the state at any time within the step; asked for before the next step is made
    is_step  False for what takes no time, an impact or a mere note of `events`
    struck   the number of the contact that struck
    events   what happened at its end
    contact_powers  (t, y) -> (nc + nd,), powers of the contacts, of which some were held during the
                    step, and of the drives, W
    factorisations  LU factors that the step took, as far as its method says
    resume   gives what a later run needs to go on from here as this one does; None where this one
             would not have stopped here, or its method cannot
    capped   whether the step is as long as any may be
    cut      how often it was made again, shorter, for what it would have passed over
    """

    t: float
    y: FloatArray
    samples: Sequence[tuple[float, FloatArray]]
    problem: Problem
    within: Callable[[float], FloatArray]
    is_step: bool = True
    struck: int | None = None
    events: tuple[Event, ...] = ()
    contact_powers: Callable[[float, FloatArray], FloatArray] | None = None
    factorisations: int = 0
    resume: Callable[[], Resume] | None = None
    capped: bool = False
    cut: int = 0


class Begin(Protocol):
    """Steps of a problem from a time on; with how many were made before, what they go on from."""

    def __call__(
        self, problem: Problem, t: float, made: int, resume: Resume | None = None
    ) -> Iterator[Advance]: ...
