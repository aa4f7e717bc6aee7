"""The steps of a run, from its arguments."""

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple, cast

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.calls import Calls
from eomgen.run.checks import (
    allowed_errors,
    check_no_step,
    check_rest_speed,
    check_samples,
    check_series,
    check_steps,
    check_times,
    check_tolerances,
    longest_steps,
    numbers,
)
from eomgen.run.compiled import Compiled, Strikes
from eomgen.run.integrators import FixedStep, adaptive, find_integrator, fixed_step
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.integrators.interface import Adaptive, Begin, Remark, Resume, Tolerances
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.integrators.stepper import Settings
from eomgen.run.options import Wanted
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.sampling import Between, sampled

Rows = Callable[[float, float], Sequence[float]]
"""(a, b) -> the times of the rows of a run after a, up to b, s."""
ADAPTIVE_SAMPLES = 1001
ANEW = "anew"
"""The key in a `Resume` of a run that made no whole step: a later run then begins as that one did.
"""


@dataclass(frozen=True)
class Asked(Wanted):
    """These arguments for a run that may continue another one: from its state and its time, and
    without a `resume` of one that made no whole step. `grid`, s, is the time from which equal steps
    are counted.

    Raises `RunError` for arguments that are invalid for every method.
    """

    _: KW_ONLY
    grid: float

    def __post_init__(self) -> None:
        check_times(self.t_start, self.t_end)
        check_tolerances(self.method, self.rtol, self.atol)
        check_samples(self.samples)
        check_rest_speed(self.rest_speed)

    @classmethod
    def of(cls, wanted: Wanted) -> tuple["Asked", Problem]:
        """What is asked, and the problem of the run."""
        given, earlier = vars(wanted), wanted.resume
        grid = t_start = float(wanted.t_start)
        problem = wanted.problem
        if earlier is None and problem.sampling and t_start == 0:
            problem = problem.sampling.begun(problem)
        if earlier is not None:
            t_start = float(earlier["t"])
            grid = float(earlier.get("grid", t_start))
            problem = replace(problem, initial=earlier["y"])
            if ANEW in earlier:
                given = {**given, "resume": None}
        times = {"t_start": t_start, "t_end": float(wanted.t_end), "grid": grid}
        return cls(**{**given, **times}), problem

    @cached_property
    def method(self) -> FixedStep | Adaptive:
        """The integrator."""
        return find_integrator(self.integrator)

    @property
    def span(self) -> float:
        """Length of the run, s."""
        return self.t_end - self.t_start

    @property
    def repairs(self) -> bool:
        """Whether the derivative is repaired where it loses digits."""
        return self.guard is not None and self.guard.repairs


class Steps(NamedTuple):
    """How the steps of a run are begun, the times of its rows, and what a later run compares; and
    what lets its rigid contacts strike in compiled code, if that makes its steps.
    """

    begin: Begin
    rows: Rows
    settings: Resume
    strikes: Callable[[], Strikes | None] = lambda: None


def steps_of(
    asked: Asked, problem: Problem, counted: Problem, calls: Calls, remark: Remark
) -> Steps:
    """The steps of a run; `counted` is the problem with its calls counted, and `remark` is called
    with the remarks of an adaptive method.

    Raises `RunError` for an invalid step, or arguments that the method does not take.
    """
    if isinstance(asked.method, FixedStep):
        return _equal_steps(asked, asked.method, problem, counted, calls)
    return _adaptive_steps(asked, asked.method, problem, remark)


def _equal_steps(
    asked: Asked, method: FixedStep, whole: Problem, counted: Problem, calls: Calls
) -> Steps:
    """The same for steps of equal length."""
    if asked.max_step is not None:
        raise RunError(f"max_step: {asked.integrator} takes equal steps; give --dt instead")
    dt, every = check_steps(asked.integrator, asked.span, asked.dt, asked.samples, asked.max_steps)
    grid = Grid(asked.grid, asked.t_end, dt, every)
    change = method.prepare(counted)
    # Evaluations to check stability do not count. They need a Jacobian with all digits, which
    # doubles do not give where the derivative is repaired.
    monitor = StabilityMonitor(change, method.stability) if whole.contacts else None
    unchecked = asked.unstable or asked.repairs or not method.steps_explicitly(whole)
    plain = not (asked.guard or asked.powers)
    compiled = compiled_of(whole) if plain and method.compiled else None
    ahead = plain and not whole.projection
    settings = fixed_step.Settings(
        *(method, change, grid, None if unchecked else whole),
        *(partial(compiled.equal, method.compiled) if compiled else None, calls if ahead else None),
        each=bool(asked.tally),
        monitor=monitor,
    )

    def rows(a: float, b: float) -> list[float]:
        first, last = (math.floor((t - asked.grid) / dt) for t in (a, b))
        marks = (asked.grid + i * dt for i in range(first, last + 2) if i % every == 0)
        found = [mark for mark in marks if a < mark <= b and mark < asked.t_end]
        return [*found, b] if b == asked.t_end else found

    strikes = [compiled.strikes] if compiled else []

    def between(start: float, end: float) -> Begin:
        before = round((start - asked.grid) / dt)
        part = Grid(start, end, dt, every, before, end == asked.t_end)
        return partial(fixed_step.advances, replace(settings, grid=part))

    begin = _begin(asked, whole, between, partial(fixed_step.advances, settings))
    return Steps(begin, rows, _settings(asked, dt), *strikes)


def _adaptive_steps(asked: Asked, method: Adaptive, problem: Problem, remark: Remark) -> Steps:
    """The same for steps whose lengths follow from tolerances."""
    check_no_step(asked.integrator, asked.dt)
    if problem.projection and not method.one_step:
        raise RunError(
            f"integrator: {asked.integrator} continues from earlier steps, which leave the "
            "constraints of loops; take DOP853, or Rodas5P if the motion is stiff"
        )
    if method.series:
        check_series(problem, asked.integrator, method.series)
    times, bounds = times_of(asked), tolerances_of(asked, problem)
    compiled = None if asked.guard else compiled_of(problem)
    settings = Settings(
        *(method, bounds, asked.t_end, times, remark, compiled.steps if compiled else None),
        each=bool(asked.tally or asked.powers),
        dense=asked.powers is not None,
        alone=bool(asked.guard or asked.tally or asked.powers),
    )

    def rows(a: float, b: float) -> list[float]:
        first, last = np.searchsorted(times, (a, b), side="right")
        return cast(list[float], times[first:last].tolist())

    limits = numbers(longest=bounds.longest, unseen=bounds.unseen)
    kept = {**_settings(asked, None), **limits}

    def between(start: float, end: float) -> Begin:
        return partial(adaptive.advances, replace(settings, t_end=end))

    begin = _begin(asked, problem, between, partial(adaptive.advances, settings))
    if compiled and not asked.powers and method.compiled:
        return Steps(begin, rows, kept, compiled.strikes)
    return Steps(begin, rows, kept)


def _begin(asked: Asked, problem: Problem, between: Between, whole: Begin) -> Begin:
    """The steps of a run, of which `whole` makes all if nothing samples."""
    if problem.sampling is None:
        return whole
    return sampled(problem.sampling, between, asked.grid, asked.t_end)


def tolerances_of(asked: Asked, problem: Problem) -> Tolerances:
    """What the steps of an adaptive method may be."""
    longest, unseen = longest_steps(asked.max_step, asked.span)
    if asked.resume is not None and asked.max_step is None:
        longest, unseen = float(asked.resume["longest"]), float(asked.resume["unseen"])
    atol = allowed_errors(problem, asked.integrator, asked.rtol, asked.atol, asked.span)
    return Tolerances(asked.rtol, atol, longest, unseen, asked.max_steps)


def times_of(asked: Asked) -> FloatArray:
    """The times of the rows of an adaptive method, with that of the start."""
    return _spaced(asked.t_start, asked.t_end, asked.samples or ADAPTIVE_SAMPLES)


def _spaced(start: float, end: float, count: int) -> FloatArray:
    """`count` equally spaced times, with the arithmetic of NumPy's `linspace`, which asks more."""
    times: FloatArray = np.arange(count, dtype=float) * ((end - start) / (count - 1)) + start
    times[-1] = end
    return times


def _settings(asked: Asked, dt: float | None) -> Resume:
    given = {"rtol": asked.rtol, "atol": asked.atol, "max_step": asked.max_step}
    return numbers(grid=asked.grid, dt=dt, rest_speed=asked.rest_speed, **given)


def compiled_of(problem: Problem) -> Compiled | None:
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
