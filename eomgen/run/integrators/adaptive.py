"""SciPy's adaptive methods and those made like them, one step at a time.

RK45 and DOP853 are explicit (Dormand, Prince), Radau is Radau IIA of order 5, BDF and LSODA are
multistep methods, LSODA switching between stiff and nonstiff by itself (Hindmarsh, Petzold). The
implicit ones are given the problem's exact Jacobian; left without it, as `Radau_differences` and
`BDF_differences` are, they make one of derivatives, which count as such.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from eomgen.run.integrators.interface import Adaptive, Advance, Resume, StepFailure
from eomgen.run.integrators.stability import UnstableStepError, stiffness
from eomgen.run.problem import Floats, Problem

_STALLED = 100
_ENOUGH_TO_LOOK, _MANY_MORE = 10_000, 20
"""Steps after which an explicit method that has many times as many before it is asked why."""
_ENOUGH_TO_JUDGE = 100_000
"""Steps after which the pace so far tells whether the end will ever be reached."""


def advances(
    method: Adaptive,
    problem: Problem,
    t_start: float,
    t_end: float,
    *,
    rtol: float,
    atol: float | Floats,
    max_step: float,
    times: Floats,
    made: int,
    max_steps: int,
    resume: Resume | None = None,
) -> Iterator[Advance]:
    """Yield the steps of `method`, with a sample at those of `times` (ascending) that each spans.

    Between steps the method's own dense output is used, which is of its accuracy. The sample at
    `t_start` is the caller's. Quaternions are scaled to unit length in every state that is yielded;
    one-step methods go on from there, multistep ones from their own history. `made` steps went
    before, which `max_steps` counts, too.
    Raises `StepFailure` if the method gives up, or after `max_steps`.
    """
    options: dict[str, Any] = {"rtol": rtol, "atol": atol, "max_step": max_step}
    if method.uses_jacobian:
        options["jac"] = problem.jacobian
    # A copy: LSODA's compiled code works on state arrays in place.
    start = problem.initial.copy()
    solver = method.solver(problem.derivative, t_start, start, t_end, **options)
    if resume is not None:
        for name in method.memory:
            kind = type(getattr(solver, name))
            setattr(solver, name, _restored(resume[name], kind))
    sampled, stalled = int(np.searchsorted(times, t_start, side="right")), 0
    left = max_steps - made
    for here in range(left):
        if here == _ENOUGH_TO_JUDGE and (solver.t - t_start) * left < (t_end - t_start) * here:
            raise StepFailure(
                f"{here} steps came to {solver.t:g} s only, at which pace the end is more than "
                f"{left} steps away; take a shorter --t-end, or {method.remedy}"
            )
        if here == _ENOUGH_TO_LOOK and not method.uses_jacobian and method.one_step:
            _check_stiff(problem, solver, (t_start, t_end), here)
        factored = solver.nlu
        complaint = solver.step()
        if solver.status == "failed":
            cause = (complaint or "the method gave up").rstrip(".")
            raise StepFailure(f"{cause}; {method.remedy}")
        t, y = float(solver.t), problem.unit(solver.y.copy())
        # LSODA steps on and on where t + h rounds to t; the others notice by themselves. Far from
        # zero its first few steps may do so and still grow.
        stalled = 0 if t > solver.t_old else stalled + 1
        if stalled == _STALLED:
            raise StepFailure(f"the steps have shrunk to nothing; {method.remedy}")
        passed = int(np.searchsorted(times, t, side="right"))
        dense = cache(solver.dense_output)
        spanned = times[sampled:passed]
        # The step's end is known without what dense output costs.
        within = spanned[spanned < t]
        states = dense()(within).T if within.size else ()
        samples = list(zip(within.tolist(), map(problem.unit, states), strict=True))
        samples += [(t, y)] * (spanned.size - within.size)
        finished = solver.status == "finished"
        # The last step is cut short by the end, but no step before it knows of that.
        stands = None
        if method.memory and not finished:
            stands = partial(_stands, t, y, {name: getattr(solver, name) for name in method.memory})
        yield Advance(
            t,
            y,
            samples,
            problem,
            partial(_between, problem, dense),
            factorisations=int(solver.nlu - factored),
            resume=stands,
        )
        sampled = passed
        if finished:
            return
        if method.one_step:
            # The slope that the next step takes over stays: what it is off is of the size of this
            # step's error, and the next step multiplies that by its length. Measured: evaluating
            # it again changes no error, and costs a derivative a step.
            solver.y = y.copy()
    raise StepFailure(f"{max_steps} steps did not suffice; {method.remedy}")


def _check_stiff(problem: Problem, solver: Any, span: tuple[float, float], made: int) -> None:
    """Raise `UnstableStepError` if it is stiffness that leaves far more steps than were made."""
    t_start, t_end = span
    pace = (float(solver.t) - t_start) / made
    if (t_end - t_start) > _MANY_MORE * made * pace:
        why = stiffness(problem, float(solver.t), solver.y, float(solver.t - solver.t_old))
        if why:
            raise UnstableStepError(f"{made} steps came to {solver.t:g} s only: {why}")


def _stands(t: float, y: Floats, memory: dict[str, Any]) -> Resume:
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _restored(value: Floats, kind: type) -> Any:
    """An array as one of its own, a number as of its kind."""
    return value.copy() if value.ndim else kind(value)


def _between(problem: Problem, dense: Callable[[], Any], t: float) -> Floats:
    """The state at a time within a step, by its dense output, which is made when first asked."""
    return problem.unit(dense()(t))
