"""What every integrator looks like from outside."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.integrate import OdeSolver

from eomgen.errors import RunError
from eomgen.run.problem import Floats, Problem

Step = Callable[[Problem, float, Floats, float], Floats]
"""`step(problem, t, y, h) -> y_new`: one step of size h; leaves `y` (ny,) as it is."""


class StepFailure(RunError):
    """A step that cannot be made; the text says why and what to change."""


@dataclass(frozen=True)
class FixedStep:
    """A method whose steps the user chooses.

    order   global error O(h^order)
    remedy  what to change when a run goes astray
    """

    step: Step
    order: int
    remedy: str


@dataclass(frozen=True)
class Adaptive:
    """A SciPy method that chooses its own steps to meet rtol and atol.

    uses_jacobian  whether it is implicit, and so is given the problem's Jacobian
    one_step       whether it steps on from a state alone, which then may be put right between steps
    remedy         what to change when a run goes astray
    """

    solver: "Callable[..., OdeSolver[Any]]"
    uses_jacobian: bool
    one_step: bool
    remedy: str


@dataclass(frozen=True)
class Advance:
    """One step made: the state `y` (ny,) reached at time `t`, and the samples to keep of it."""

    t: float
    y: Floats
    samples: Sequence[tuple[float, Floats]]
