"""The steps of SciPy's adaptive methods, and of our own with the same interface.

RK45 and our DOP853 are explicit (Dormand, Prince), our Rodas5P is a Rosenbrock method, Radau is
Radau IIA of order 5, BDF and LSODA are multistep methods; LSODA switches between stiff and nonstiff
methods by itself (Hindmarsh, Petzold).
The implicit ones are given the problem's exact Jacobian, except `Radau_differences` and
`BDF_differences`, which approximate it by differences of derivatives that count as derivatives.
"""

from collections.abc import Iterator
from typing import Any

from eomgen.run.compiled import Touched
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Advance, Resume
from eomgen.run.integrators.stability import UnstableStepError, stiffness
from eomgen.run.integrators.stepper import Settings, Stepper
from eomgen.run.integrators.strides import Strides
from eomgen.run.problem import Problem

CHECK_STIFFNESS, _MANY_MORE = 10_000, 20
"""After this many steps, an explicit method that needs `_MANY_MORE` times as many is checked for
stiffness."""
_CHECK_PACE = 100_000
"""After this many steps a run stops if, at its pace, it would exceed the number of steps allowed.
"""


def advances(
    settings: Settings,
    problem: Problem,
    t_start: float,
    made: int,
    resume: Resume | None = None,
    touched: Touched | None = None,
) -> Iterator[Advance]:
    """Yield steps, each with samples at those of the times wanted that are within it.

    Samples within a step come from the method's dense output. There is no sample at `t_start`.
    Quaternions are normalised in every state that is yielded; one-step methods continue from there,
    multistep methods from their own history. A step that passed over a branch of the derivative is
    repeated up to there: see `eomgen.run.branches`.

    made     number of earlier steps, which count towards the most that are allowed
    touched  what is known of rigid contacts; the steps end with the part of one up to an event, of
             which `touched` says when the part is yielded

    Raises `StepFailure` if the method fails, or after the most steps allowed.
    """
    method, bounds = settings.method, settings.bounds
    stepper = Stepper(settings, problem, touched)
    stepper.begin(t_start, resume)
    strides = Strides(stepper)
    left, here = bounds.most - made, 0
    while here < left:
        _check_pace(problem, stepper, t_start, here, left)
        most = min(m for m in (left, CHECK_STIFFNESS, _CHECK_PACE) if m > here) - here
        most = min(most, stepper.shaken.left) if stepper.shaken else most
        portion = strides.made(most)
        if portion is None:  # the step must be repeated
            here += 1
            continue
        yield from portion.advances(settings.each)
        n = len(portion.ends)
        here += n
        if stepper.ended or portion.met:
            return
        stepper.prepare_next(float(portion.ends[-1]), portion.states[-1], n)
    raise StepFailure(f"{bounds.most} steps did not suffice", method.remedy)


def _check_pace(problem: Problem, stepper: Stepper, t_start: float, here: int, left: int) -> None:
    """Raise `StepFailure` if, after `here` of `left` steps, the end is too far at this pace."""
    solver, method, t_end = stepper.solver, stepper.method, stepper.t_end
    if here == _CHECK_PACE and (solver.t - t_start) * left < (t_end - t_start) * here:
        raise StepFailure(
            f"{here} steps reached only {solver.t:g} s; at this pace the end takes more than "
            f"{left} steps",
            f"take a shorter --t-end, or {method.remedy}",
        )
    if here == CHECK_STIFFNESS and not method.uses_jacobian and method.one_step:
        _check_stiff(problem, solver, (t_start, t_end), here)


def _check_stiff(problem: Problem, solver: Any, span: tuple[float, float], made: int) -> None:
    """Raise `UnstableStepError` if stiffness is why many more steps are left than were made."""
    t_start, t_end = span
    pace = (float(solver.t) - t_start) / made
    if (t_end - t_start) > _MANY_MORE * made * pace:
        why = stiffness(problem, float(solver.t), solver.y, float(solver.t - solver.t_old))
        if why:
            reason = f"{made} steps reached only {solver.t:g} s: {why}"
            raise UnstableStepError(reason, "take --integrator Rodas5P, or Radau")
