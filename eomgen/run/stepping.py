"""How the steps that a run asks for are begun."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from eomgen.errors import RunError
from eomgen.run.checks import (
    allowed_errors,
    check_no_step,
    check_samples,
    check_steps,
    check_times,
    check_tolerances,
    longest_steps,
    numbers,
)
from eomgen.run.integrators import FixedStep, adaptive, fixed_step
from eomgen.run.integrators.interface import Adaptive, Advance, Begin, Resume
from eomgen.run.integrators.unwarned import Remark
from eomgen.run.problem import Problem

ADAPTIVE_SAMPLES = 1001
ANEW = "anew"
"""Says in a `Resume` that no step was whole: what goes on from it begins like the run that left it.
"""


@dataclass(frozen=True)
class Asked:
    """The steps of a run, as `integrate` describes them; `grid` is where equal ones count from, s.

    Raises `RunError` for what no method can serve.
    """

    integrator: str
    t_start: float
    t_end: float
    grid: float
    dt: float | None
    rtol: float
    atol: float | None
    samples: int | None
    max_step: float | None
    max_steps: int
    resume: Resume | None

    def __post_init__(self) -> None:
        check_times(self.t_start, self.t_end)
        check_tolerances(self.rtol, self.atol)
        check_samples(self.samples)

    @property
    def span(self) -> float:
        """How long the run is, s."""
        return self.t_end - self.t_start


def equal_steps(
    asked: Asked, method: FixedStep, problem: Problem, looked_at: Problem | None
) -> tuple[Begin, Resume]:
    """Equal steps from `asked.grid`, wherever they are begun, and what a run from their end needs.

    looked_at  the problem whose Jacobian tells whether a step is too long, if that is to be asked

    Raises `RunError` for a step that is none.
    """
    if asked.max_step is not None:
        raise RunError(f"max_step: {asked.integrator} takes equal steps; give --dt instead")
    dt, every = check_steps(asked.integrator, asked.span, asked.dt, asked.samples, asked.max_steps)
    change = method.prepare(problem)

    def begin(
        problem: Problem, t: float, made: int, resume: Resume | None = None
    ) -> Iterator[Advance]:
        return fixed_step.advances(
            change,
            problem,
            t,
            t_start=asked.grid,
            t_end=asked.t_end,
            dt=dt,
            every=every,
            checked=problem if looked_at and problem.contacts else looked_at,
            stability=method.stability,
            resume=resume,
        )

    return begin, _remembered(asked, dt)


def adaptive_steps(
    asked: Asked, method: Adaptive, problem: Problem, remark: Remark
) -> tuple[Begin, Resume]:
    """Steps that a method chooses itself, and what a run from their end needs.

    remark  told what the method has to say of its steps

    Raises `RunError` for a step given, or a longest one that is none.
    """
    check_no_step(asked.integrator, asked.dt)
    times = np.linspace(asked.t_start, asked.t_end, asked.samples or ADAPTIVE_SAMPLES)
    longest, unseen = longest_steps(asked.max_step, asked.span)
    if asked.resume is not None and asked.max_step is None:
        longest, unseen = float(asked.resume["longest"]), float(asked.resume["unseen"])
    atol = allowed_errors(problem, asked.integrator, asked.rtol, asked.atol, asked.span)
    bounds = adaptive.Bounds(asked.rtol, atol, longest, unseen, asked.max_steps)

    def begin(
        problem: Problem, t: float, made: int, resume: Resume | None = None
    ) -> Iterator[Advance]:
        return adaptive.advances(
            method,
            problem,
            t,
            asked.t_end,
            bounds=bounds,
            times=times,
            made=made,
            remark=remark,
            resume=resume,
        )

    return begin, {**_remembered(asked, None), **numbers(longest=longest, unseen=unseen)}


def _remembered(asked: Asked, dt: float | None) -> Resume:
    given = {"rtol": asked.rtol, "atol": asked.atol, "max_step": asked.max_step}
    return numbers(grid=asked.grid, dt=dt, **given)


def can_go_on(method: FixedStep | Adaptive) -> bool:
    """Whether a run by a method can go on where another one ended, as if it had not."""
    return isinstance(method, FixedStep) or bool(method.memory)


def begun(asked: Asked, problem: Problem) -> Resume:
    """What a later run needs to go on from the start of this one, where no step has been whole."""
    if asked.resume is not None:
        return asked.resume
    return {"t": np.array(asked.t_start), "y": problem.initial, ANEW: np.array(1.0)}
