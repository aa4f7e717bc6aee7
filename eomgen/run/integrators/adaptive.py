"""The steps of SciPy's adaptive methods, and of our own with the same interface.

RK45 and our DOP853 are explicit (Dormand, Prince), our Rodas5P is a Rosenbrock method, Radau is
Radau IIA of order 5, BDF and LSODA are multistep methods; LSODA switches between stiff and nonstiff
methods by itself (Hindmarsh, Petzold).
The implicit ones are given the problem's exact Jacobian, except `Radau_differences` and
`BDF_differences`, which approximate it by differences of derivatives that count as derivatives.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from eomgen.run.branches import BranchMonitor, Retry, Step
from eomgen.run.compiled import Steps, Touched
from eomgen.run.failure import NOT_FINITE, StepFailure
from eomgen.run.integrators.interface import Adaptive, Advance, Remark, Resume
from eomgen.run.integrators.stability import UnstableStepError, stiffness
from eomgen.run.integrators.strides import Before, Strides, continuation
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.rows import Row, all_finite
from eomgen.run.shaking import Shaken

_STALLED = 100
"""A run stops after this many steps in a row that do not advance the time."""
_CHECK_STIFFNESS, _MANY_MORE = 10_000, 20
"""After this many steps, an explicit method that needs `_MANY_MORE` times as many is checked for
stiffness."""
_CHECK_PACE = 100_000
"""After this many steps a run stops if, at its pace, it would exceed the number of steps allowed.
"""


@dataclass(frozen=True)
class Bounds:
    """Bounds on the steps of a run.

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
    steps: Callable[[str, tuple[str, ...]], Steps | None] | None = None,
    touched: Touched | None = None,
    each: bool = True,
    dense: bool = True,
) -> Iterator[Advance]:
    """Yield the steps of `method`, each with samples at those of `times` (ascending) within it.

    Samples within a step come from the method's dense output. There is no sample at `t_start`.
    Quaternions are normalised in every state that is yielded; one-step methods continue from there,
    multistep methods from their own history. A step that passed over a branch of the derivative is
    repeated up to there: see `eomgen.run.branches`.

    made    number of earlier steps, which count towards `bounds.most`
    remark  called with what SciPy would warn of
    steps   see `run.compiled.Compiled`
    touched   what is known of rigid contacts; gaps below 0 end compiled steps
    each    whether each compiled step is yielded, or many at once
    dense   whether compiled steps give the states within them

    Raises `StepFailure` if the method fails, or after `bounds.most` steps.
    """
    stepper = _Stepper(method, problem, t_end, bounds, remark)
    stepper.begin(t_start, resume)
    sampled, stalled, cut = int(np.searchsorted(times, t_start, side="right")), 0, 0
    left, factored, here = bounds.most - made, 0, 0
    compiled = None
    if steps and method.compiled:
        compiled = Strides(method, problem, bounds, times, steps, dense=dense)
    while here < left:
        _check_pace(problem, stepper, t_start, here, left)
        until = min(m for m in (left, _CHECK_STIFFNESS, _CHECK_PACE) if m > here)
        use = None if touched and touched.now.slack.any() else compiled
        most = min(until - here, stepper.shaken.left) if stepper.shaken else until - here
        stride = use.made(stepper, sampled, most) if use else None
        if use and stride:
            before = Before(cut, stepper.factorisations - factored, stepper.is_limited)
            yield from use.portion(stride, sampled, stepper.is_whole, before).advances(each)
            here, sampled = here + len(stride.ends), sampled + int(stride.sampled[-1])
            cut, factored = 0, stepper.factorisations
            if stepper.ended:
                return
            if stepper.solver.status == "finished":
                stepper.prepare_next(float(stride.ends[-1]), stride.states[-1])
            stepper.shake(len(stride.ends))
            continue
        here += 1
        step = stepper.step()
        t, y = step.end, step.last
        # LSODA continues with steps so short that t + h rounds to t; the others stop by themselves.
        # Far from t = 0 its first few steps may be that short before they grow.
        stalled = 0 if t > step.start else stalled + 1
        if stalled == _STALLED:
            raise StepFailure("the steps have shrunk to nothing", method.remedy)
        retry = stepper.retry(step)
        if retry:
            cut += retry.seen
            continue
        passed = int(np.searchsorted(times, t, side="right"))
        samples = _samples(problem, step, times[sampled:passed], method.remedy)
        yield Advance(
            t,
            y,
            samples,
            problem,
            partial(_between, problem, step),
            derivatives=getattr(stepper.solver, "expanded", 0),
            factorisations=stepper.factorisations - factored,
            resume=stepper.continuation(),
            capped=stepper.is_capped(step),
            cut=cut,
        )
        sampled, cut, factored = passed, 0, stepper.factorisations
        if stepper.ended:
            return
        stepper.prepare_next(step.end, step.last)
        stepper.shake(1)
    raise StepFailure(f"{bounds.most} steps did not suffice", method.remedy)


def _samples(problem: Problem, step: Step, times: FloatArray, remedy: str) -> list[Row]:
    """The rows of a step at times after its start; at its end no dense output is needed."""
    within = times[times < step.end]
    states = map(problem.projected, within.tolist(), step.states(within) if within.size else ())
    samples = list(zip(within.tolist(), states, strict=True))
    if not all(all_finite(y) for _, y in samples):
        raise StepFailure(NOT_FINITE, remedy)
    return samples + [(step.end, step.last)] * (times.size - within.size)


class _Stepper:
    """The solver of a run, restarted where steps must be repeated."""

    def __init__(
        self, method: Adaptive, problem: Problem, t_end: float, bounds: Bounds, remark: Remark
    ) -> None:
        self.method, self.t_end, self._problem, self._bounds = method, t_end, problem, bounds
        self._remark = remark
        self.longest, self.branches = bounds.longest, None
        scrutiny = problem.scrutiny
        if problem.switching or (scrutiny and scrutiny.localised):
            switching = problem.switching or Switching()
            self.branches = BranchMonitor(problem, switching, bounds)
        if problem.corners and not problem.switching:
            self.longest = min(bounds.longest, bounds.unseen)
        self._whole, self._unseen, self.factorisations = True, False, 0
        self.shaken = None
        if scrutiny and scrutiny.seed is not None and "lost" in method.memory:
            self.shaken = Shaken(problem.derivative, scrutiny.seed)

    def begin(self, t: float, resume: Resume | None) -> None:
        """Begin at time t with the problem's initial state; `resume` is from `continuation`."""
        until = self.t_end
        if resume and self.branches:
            cut = float(resume["until"])
            until = min(cut, until) if cut > t else until
            self.branches.restore(resume)
        self._start(t, self._problem.initial, until, resume or {})

    def _start(self, t: float, y: FloatArray, until: float, memory: Mapping[str, Any]) -> None:
        """Start the solver at time t, for steps up to `until` and to the first time at which the
        derivative is known to change its branch. If that is now, start on its other side.
        """
        known = self.branches and self.branches.known(t, self.t_end)
        while self.branches and known and known[0] <= t:
            t, memory = known[1], {name: x for name, x in memory.items() if name == "lost"}
            known = self.branches.known(t, self.t_end)
        until = min(until, known[0]) if known else until
        options: dict[str, Any] = {"rtol": self._bounds.rtol, "atol": self._bounds.atol}
        if self.method.uses_jacobian:
            options["jac"] = self._problem.jacobian
        if self.method.asks_more:
            options |= {"timed": self._problem.timed, "positions": self._problem.leading_positions}
        if self.method.series:
            make = self._problem.series.get(self.method.series)
            options["series"] = make() if make else None
        # y is copied because LSODA's compiled code modifies state arrays in place. If a later run
        # can continue from this one, the choice of the first step must not depend on the end.
        bound = np.inf if self.method.memory else until
        self.solver: Any = self.method.solver(
            self._problem.derivative, t, y.copy(), bound, max_step=self.longest, **options
        )
        if hasattr(self.solver, "remark"):
            self.solver.remark = self._remark
        self.solver.t_bound = until
        self.until = until
        for name in self.method.memory if memory else ():
            if name in memory:
                kind = type(getattr(self.solver, name))
                setattr(self.solver, name, _restored(memory[name], kind))

    def step(self) -> Step:
        """Make a step. Raises `StepFailure` if the method fails."""
        solver = self.solver
        self._before = (float(solver.t), solver.y.copy(), self._memory())
        if self.method.memory:
            # A step shortened to the end would be retried with another length if rejected.
            length = min(getattr(solver, self.method.memory[0]), self.longest)
            if not solver.t + length < self.t_end:
                self.shorten()
        factored = int(solver.nlu)
        message = solver.step()
        self.factorisations += int(solver.nlu) - factored
        if solver.status == "failed":
            reason = (message or "the method failed").rstrip(".")
            raise StepFailure(reason, self.method.remedy)
        dense = cache(solver.dense_output)
        t, y, memory = self._before
        end = self._problem.projected(float(solver.t), solver.y.copy())
        slopes = np.array([memory["f"], solver.f]) if "f" in memory else None
        return Step(t, float(solver.t), y, end, lambda times: dense()(times).T, slopes)

    def shorten(self) -> None:
        """Take account of a step that the end of the run shortens, unless another end does."""
        self._whole = self._whole and self.until != self.t_end

    def retry(self, step: Step) -> Retry | None:
        """Check a step for branches. If it must be repeated, restart the solver for that and say
        how; None if it is accepted.
        """
        if self.branches is None or not step.start < step.end:
            return None
        retry = self.branches.check(step)
        if retry:
            # A run with a later end would have checked a longer step.
            self._whole = self._whole and step.end < self.t_end
            self._unseen = not retry.seen
            t, y, memory = self._before
            self._start(t, y, retry.until, memory)
        return retry

    def prepare_next(self, t: float, y: FloatArray) -> None:
        """Prepare the solver for the step after one that ended at t in the state y."""
        self._unseen = self._unseen and self.solver.status != "finished"
        if self.solver.status == "finished":  # where a step had to end
            self._start(t, y, self.t_end, self._memory())
        elif self.method.one_step:
            # The slope saved for the next step is not evaluated again at the normalised state: its
            # error is of the size of this step's error, and the next step multiplies it by its
            # length. Measured: evaluating it again changes no error and costs a derivative.
            self.solver.y = y.copy()

    def shake(self, steps: int) -> None:
        """Add random rounding errors after some steps, if the run is to have them."""
        if self.shaken:
            solver = self.solver
            length = float(solver.t - solver.t_old)
            solver.lost = solver.lost + self.shaken.error(solver.t, solver.y, length, steps)

    @property
    def is_whole(self) -> bool:
        """Whether no step so far depends on the end of this run."""
        return self._whole and bool(self.method.memory)

    @property
    def ended(self) -> bool:
        """Whether the run has reached its end."""
        return bool(self.solver.status == "finished" and self.until == self.t_end)

    def is_capped(self, step: Step) -> bool:
        """Whether a step has the greatest length allowed there."""
        return self.is_limited or step.length >= self.longest * (1 - 1e-9)

    @property
    def is_limited(self) -> bool:
        """Whether the last step ends where longer ones cannot be checked."""
        return self._unseen and self.solver.status == "finished" and not self.ended

    def continuation(self) -> Callable[[], Resume] | None:
        """A function that gives what a later run needs to continue from here; None if it cannot.

        It can if no step so far depends on the end of this run.
        """
        if self.ended or not self.is_whole:
            return None
        memory = self._memory()
        if self.branches:
            reached = self.solver.status == "finished"
            cut = not reached and self.until != self.t_end
            memory |= {"until": self.until if cut else np.inf, **self.branches.memory}
        t = float(self.solver.t)
        y = self._problem.projected(t, self.solver.y.copy())
        return partial(continuation, t, y, memory)

    def _memory(self) -> dict[str, Any]:
        return {name: getattr(self.solver, name) for name in self.method.memory}


def _check_pace(problem: Problem, stepper: _Stepper, t_start: float, here: int, left: int) -> None:
    """Raise `StepFailure` if, after `here` of `left` steps, the end is too far at this pace."""
    solver, method, t_end = stepper.solver, stepper.method, stepper.t_end
    if here == _CHECK_PACE and (solver.t - t_start) * left < (t_end - t_start) * here:
        raise StepFailure(
            f"{here} steps reached only {solver.t:g} s; at this pace the end takes more than "
            f"{left} steps",
            f"take a shorter --t-end, or {method.remedy}",
        )
    if here == _CHECK_STIFFNESS and not method.uses_jacobian and method.one_step:
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


def _restored(value: Any, kind: type) -> Any:
    """A copy of an array, or a number converted to its type."""
    return np.array(value) if np.ndim(value) else kind(value)


def _between(problem: Problem, step: Step, t: float) -> FloatArray:
    """The state at a time within a step, by dense output, which is computed on first use."""
    return problem.projected(t, step.states(t))
