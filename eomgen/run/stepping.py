"""The steps of a run, from its arguments."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np

from eomgen.errors import RunError
from eomgen.run.calls import Calls
from eomgen.run.checks import (
    allowed_errors,
    check_no_step,
    check_samples,
    check_series,
    check_steps,
    check_times,
    check_tolerances,
    longest_steps,
    numbers,
)
from eomgen.run.compiled import Compiled
from eomgen.run.integrators import FixedStep, adaptive, find_integrator, fixed_step
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.integrators.interface import Adaptive, Advance, Begin, Remark, Resume, always
from eomgen.run.problem import FloatArray, Problem

Rows = Callable[[float, float], Sequence[float]]
"""(a, b) -> the times of the rows of a run after a, up to b, s."""
ADAPTIVE_SAMPLES = 1001
ANEW = "anew"
"""The key in a `Resume` of a run that made no whole step: a later run then begins as that one did.
"""


@dataclass(frozen=True)
class Asked:
    """The arguments of `integrate` that determine the steps; `grid`, s, is the time from which
    equal steps are counted.

    Raises `RunError` for arguments that are invalid for every method.
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
        check_tolerances(find_integrator(self.integrator), self.rtol, self.atol)
        check_samples(self.samples)

    @property
    def span(self) -> float:
        """Length of the run, s."""
        return self.t_end - self.t_start


def equal_steps(
    asked: Asked,
    method: FixedStep,
    problem: Problem,
    checked: Problem | None,
    *,
    compiled: Compiled | None = None,
    calls: Calls | None = None,
    each: bool = True,
) -> tuple[Begin, Rows, Resume]:
    """A function that begins equal steps, one that gives the times of rows, and the settings that a
    later run compares.

    checked   the problem by whose Jacobian the stability of steps is checked; None for no check
    compiled  compiled steps of the problem, if it has some
    calls     see `fixed_step.advances`
    each      whether each step becomes an `Advance`

    Raises `RunError` for an invalid step.
    """
    if asked.max_step is not None:
        raise RunError(f"max_step: {asked.integrator} takes equal steps; give --dt instead")
    dt, every = check_steps(asked.integrator, asked.span, asked.dt, asked.samples, asked.max_steps)
    grid = Grid(asked.grid, asked.t_end, dt, every)
    change = method.prepare(problem)
    steps = partial(compiled.equal, method.compiled) if compiled and method.compiled else None

    def begin(
        problem: Problem,
        t: float,
        made: int,
        resume: Resume | None = None,
        compiles: Callable[[], bool] = always,
    ) -> Iterator[Advance]:
        return fixed_step.advances(
            method,
            change,
            problem,
            t,
            grid,
            checked=problem if checked and problem.contacts else checked,
            resume=resume,
            compiled=steps,
            calls=calls,
            each=each,
        )

    def rows(a: float, b: float) -> list[float]:
        first, last = (math.floor((t - asked.grid) / dt) for t in (a, b))
        marks = (asked.grid + i * dt for i in range(first, last + 2) if i % every == 0)
        found = [mark for mark in marks if a < mark <= b and mark < asked.t_end]
        return [*found, b] if b == asked.t_end else found

    return begin, rows, _settings(asked, dt)


def adaptive_steps(
    asked: Asked,
    method: Adaptive,
    problem: Problem,
    remark: Remark,
    *,
    compiled: Compiled | None = None,
    each: bool = True,
    dense: bool = True,
) -> tuple[Begin, Rows, Resume]:
    """A function that begins adaptive steps, one that gives the times of rows, and the settings
    that a later run compares.

    remark    called with the method's remarks
    compiled  compiled steps of the problem, if it has some
    each      whether each compiled step becomes an `Advance`
    dense     whether these give the states within steps

    Raises `RunError` if `dt` is given, or `max_step` is invalid.
    """
    check_no_step(asked.integrator, asked.dt)
    if problem.projection and not method.one_step:
        raise RunError(
            f"integrator: {asked.integrator} continues from earlier steps, which leave the "
            "constraints of loops; take DOP853, or Rodas5P if the motion is stiff"
        )
    if method.series:
        check_series(problem, asked.integrator, method.series)
    times = _spaced(asked.t_start, asked.t_end, asked.samples or ADAPTIVE_SAMPLES)
    longest, unseen = longest_steps(asked.max_step, asked.span)
    if asked.resume is not None and asked.max_step is None:
        longest, unseen = float(asked.resume["longest"]), float(asked.resume["unseen"])
    atol = allowed_errors(problem, asked.integrator, asked.rtol, asked.atol, asked.span)
    bounds = adaptive.Bounds(asked.rtol, atol, longest, unseen, asked.max_steps)

    def begin(
        problem: Problem,
        t: float,
        made: int,
        resume: Resume | None = None,
        compiles: Callable[[], bool] = always,
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
            steps=compiled.steps if compiled and problem.compiled else None,
            compiles=compiles,
            each=each,
            dense=dense,
        )

    def rows(a: float, b: float) -> list[float]:
        first, last = np.searchsorted(times, (a, b), side="right")
        return cast(list[float], times[first:last].tolist())

    return begin, rows, {**_settings(asked, None), **numbers(longest=longest, unseen=unseen)}


def _spaced(start: float, end: float, count: int) -> FloatArray:
    """`count` equally spaced times, with the arithmetic of NumPy's `linspace`, which asks more."""
    times: FloatArray = np.arange(count, dtype=float) * ((end - start) / (count - 1)) + start
    times[-1] = end
    return times


def _settings(asked: Asked, dt: float | None) -> Resume:
    given = {"rtol": asked.rtol, "atol": asked.atol, "max_step": asked.max_step}
    return numbers(grid=asked.grid, dt=dt, **given)


def compiled_steps(problem: Problem) -> Compiled | None:
    """The compiled steps of a problem; None if it has none, or another derivative than they."""
    compiled = problem.compiled
    if compiled is None or compiled.derivative is not problem.derivative:
        return None
    return compiled


def can_go_on(method: FixedStep | Adaptive) -> bool:
    """Whether a run by a method can continue another one exactly, as if that had not ended."""
    return isinstance(method, FixedStep) or bool(method.memory)


def begun(asked: Asked, problem: Problem) -> Resume:
    """What a later run needs to continue if this one makes no whole step."""
    if asked.resume is not None:
        return asked.resume
    return {"t": np.array(asked.t_start), "y": problem.initial, ANEW: np.array(1.0)}
