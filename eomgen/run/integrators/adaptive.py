"""SciPy's adaptive methods and those made like them, one step at a time.

RK45 and DOP853 are explicit (Dormand, Prince), Radau is Radau IIA of order 5, BDF and LSODA are
multistep methods, LSODA switching between stiff and nonstiff by itself (Hindmarsh, Petzold). The
implicit ones are given the problem's exact Jacobian; left without it, as `Radau_differences` and
`BDF_differences` are, they make one of derivatives, which count as such.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from eomgen.run.branches import Again, Lookout, Made
from eomgen.run.integrators.interface import Adaptive, Advance, Resume, StepFailure
from eomgen.run.integrators.stability import UnstableStepError, stiffness
from eomgen.run.integrators.unwarned import BDF, Radau, Remark
from eomgen.run.problem import FloatArray, Problem

_STALLED = 100
_ENOUGH_TO_LOOK, _MANY_MORE = 10_000, 20
"""Steps after which an explicit method that has many times as many before it is asked why."""
_ENOUGH_TO_JUDGE = 100_000
"""Steps after which the pace so far tells whether the end will ever be reached."""


@dataclass(frozen=True)
class Bounds:
    """What bounds the steps of a run.

    rtol, atol  what the error of a step may be
    longest     a step, s
    unseen      the longest step, s, where it cannot be told what it passes over
    most        steps in all
    """

    rtol: float
    atol: float | FloatArray
    longest: float
    unseen: float
    most: int

    def allowed(self, y: FloatArray) -> FloatArray:
        """What a step that ends in the state y (ny,) may be off, (ny,)."""
        return self.atol + self.rtol * np.abs(y)


def advances(
    method: Adaptive,
    problem: Problem,
    t_start: float,
    t_end: float,
    *,
    bounds: Bounds,
    times: FloatArray,
    made: int,
    remark: Remark,
    resume: Resume | None = None,
) -> Iterator[Advance]:
    """Yield the steps of `method`, with a sample at those of `times` (ascending) that each spans.

    Between steps the method's own dense output is used, which is of its accuracy. The sample at
    `t_start` is the caller's. Quaternions are scaled to unit length in every state that is yielded;
    one-step methods go on from there, multistep ones from their own history. `made` steps went
    before, which `bounds.most` counts, too; `remark` is told what SciPy would warn of. A step that
    passed over a branch of the derivative is made again, up to there: see `eomgen.run.branches`.
    Raises `StepFailure` if the method gives up, or after `bounds.most` steps.
    """
    course = _Course(method, problem, t_end, bounds, remark)
    course.begin(t_start, resume)
    sampled, stalled, cut = int(np.searchsorted(times, t_start, side="right")), 0, 0
    left, factored = bounds.most - made, 0
    for here in range(left):
        _check_pace(problem, course, t_start, here, left)
        taken = course.step()
        t, y = taken.end, taken.last
        # LSODA steps on and on where t + h rounds to t; the others notice by themselves. Far from
        # zero its first few steps may do so and still grow.
        stalled = 0 if t > taken.start else stalled + 1
        if stalled == _STALLED:
            raise StepFailure("the steps have shrunk to nothing", method.remedy)
        again = course.passed_over(taken)
        if again:
            cut += again.seen
            continue
        passed = int(np.searchsorted(times, t, side="right"))
        spanned = times[sampled:passed]
        # The step's end is known without what dense output costs.
        within = spanned[spanned < t]
        states = taken.states(within) if within.size else ()
        samples = list(zip(within.tolist(), map(problem.unit, states), strict=True))
        samples += [(t, y)] * (spanned.size - within.size)
        yield Advance(
            t,
            y,
            samples,
            problem,
            partial(_between, problem, taken),
            factorisations=course.factorisations - factored,
            resume=course.stands(),
            capped=course.is_capped(taken),
            cut=cut,
        )
        sampled, cut, factored = passed, 0, course.factorisations
        if course.ended:
            return
        course.go_on(taken)
    raise StepFailure(f"{bounds.most} steps did not suffice", method.remedy)


class _Course:
    """The solver of a run, as it stands."""

    def __init__(
        self, method: Adaptive, problem: Problem, t_end: float, bounds: Bounds, remark: Remark
    ) -> None:
        self.method, self.t_end, self._problem, self._bounds = method, t_end, problem, bounds
        self._remark = remark
        self._longest, self._lookout = bounds.longest, None
        if problem.switching:
            self._lookout = Lookout(
                problem, problem.switching, bounds.allowed, bounds.unseen, method.sees_end
            )
        elif problem.corners:
            self._longest = min(bounds.longest, bounds.unseen)
        self._whole, self._unseen, self.factorisations = True, False, 0

    def begin(self, t: float, resume: Resume | None) -> None:
        """Begin at a time with the problem's initial state, or go on from what `stands` gave."""
        until = self.t_end
        if resume and self._lookout:
            until = min(float(resume["until"]), until)
            self._lookout.restore(resume)
        self._start(t, self._problem.initial, until, resume or {})

    def _start(self, t: float, y: FloatArray, until: float, memory: Mapping[str, Any]) -> None:
        options: dict[str, Any] = {"rtol": self._bounds.rtol, "atol": self._bounds.atol}
        if self.method.uses_jacobian:
            options["jac"] = self._problem.jacobian
        # A copy: LSODA's compiled code works on state arrays in place.
        # What can go on as if it had not ended must not choose its first step by its end.
        bound = np.inf if self.method.memory else until
        self.solver: Any = self.method.solver(
            self._problem.derivative, t, y.copy(), bound, max_step=self._longest, **options
        )
        if isinstance(self.solver, Radau | BDF):
            self.solver.remark = self._remark
        self.solver.t_bound = until
        self._until = until
        for name in self.method.memory if memory else ():
            setattr(self.solver, name, _restored(memory[name], type(getattr(self.solver, name))))

    def step(self) -> Made:
        """Make a step. Raises `StepFailure` if the method gives up."""
        solver = self.solver
        self._before = (float(solver.t), solver.y.copy(), self._memory())
        if self.method.memory and self._until == self.t_end:
            # One that is tried up to the end only is tried again in another length if refused.
            length = min(getattr(solver, self.method.memory[0]), self._longest)
            self._whole = self._whole and solver.t + length < self.t_end
        factored = int(solver.nlu)
        complaint = solver.step()
        self.factorisations += int(solver.nlu) - factored
        if solver.status == "failed":
            cause = (complaint or "the method gave up").rstrip(".")
            raise StepFailure(cause, self.method.remedy)
        if not self.method.sees_end and solver.status == "finished" and not self.ended:
            solver.turn()
        dense = cache(solver.dense_output)
        t, y, _ = self._before
        end = self._problem.unit(solver.y.copy())
        return Made(t, float(solver.t), y, end, lambda times: dense()(times).T)

    def passed_over(self, taken: Made) -> Again | None:
        """How a step has to be made again, which is then begun; None if it is good."""
        if self._lookout is None or not taken.start < taken.end:
            return None
        again = self._lookout.look(taken)
        if again:
            # A longer run would have looked at a longer step.
            self._whole = self._whole and taken.end < self.t_end
            self._unseen = not again.seen
            t, y, memory = self._before
            self._start(t, y, again.until, memory)
        return again

    def go_on(self, taken: Made) -> None:
        """Make ready for the next step."""
        if self.solver.status == "finished":  # up to where one was cut
            self._start(taken.end, taken.last, self.t_end, self._memory())
        elif self.method.one_step:
            # The slope that the next step takes over stays: what it is off is of the size of this
            # step's error, and the next step multiplies that by its length. Measured: evaluating
            # it again changes no error, and costs a derivative a step.
            self.solver.y = taken.last.copy()

    @property
    def ended(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self.solver.status == "finished" and self._until == self.t_end)

    def is_capped(self, taken: Made) -> bool:
        """Whether a step is as long as any may be, there at least."""
        held = self._unseen and self.solver.status == "finished" and not self.ended
        return held or taken.length >= self._longest * (1 - 1e-9)

    def stands(self) -> Callable[[], Resume] | None:
        """What a later run needs to go on from here, if it can: if no step knows of the end, which
        cuts short the last one, and what it would have passed over.
        """
        if not self.method.memory or self.ended or not self._whole:
            return None
        memory = self._memory()
        if self._lookout:
            reached = self.solver.status == "finished"
            memory["until"] = np.inf if reached or self._until == self.t_end else self._until
            memory |= self._lookout.memory
        t, y = float(self.solver.t), self._problem.unit(self.solver.y.copy())
        return partial(_stands, t, y, memory)

    def _memory(self) -> dict[str, Any]:
        return {name: getattr(self.solver, name) for name in self.method.memory}


def _check_pace(problem: Problem, course: _Course, t_start: float, here: int, left: int) -> None:
    """Raise `StepFailure` if the end is hopelessly far, after `here` of `left` steps."""
    solver, method, t_end = course.solver, course.method, course.t_end
    if here == _ENOUGH_TO_JUDGE and (solver.t - t_start) * left < (t_end - t_start) * here:
        raise StepFailure(
            f"{here} steps came to {solver.t:g} s only, at which pace the end is more than "
            f"{left} steps away",
            f"take a shorter --t-end, or {method.remedy}",
        )
    if here == _ENOUGH_TO_LOOK and not method.uses_jacobian and method.one_step:
        _check_stiff(problem, solver, (t_start, t_end), here)


def _check_stiff(problem: Problem, solver: Any, span: tuple[float, float], made: int) -> None:
    """Raise `UnstableStepError` if it is stiffness that leaves far more steps than were made."""
    t_start, t_end = span
    pace = (float(solver.t) - t_start) / made
    if (t_end - t_start) > _MANY_MORE * made * pace:
        why = stiffness(problem, float(solver.t), solver.y, float(solver.t - solver.t_old))
        if why:
            reason = f"{made} steps came to {solver.t:g} s only: {why}"
            raise UnstableStepError(reason, "take --integrator Radau, or BDF")


def _stands(t: float, y: FloatArray, memory: dict[str, Any]) -> Resume:
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _restored(value: Any, kind: type) -> Any:
    """An array as one of its own, a number as one of its kind."""
    return np.array(value) if np.ndim(value) else kind(value)


def _between(problem: Problem, taken: Made, t: float) -> FloatArray:
    """The state at a time within a step, by its dense output, which is made when first asked."""
    return problem.unit(taken.states(t))
