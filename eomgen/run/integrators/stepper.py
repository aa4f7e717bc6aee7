"""The solver of a run by an adaptive method: its steps in Python, and what all steps share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from eomgen.engine.contact_times import SHARE
from eomgen.run.branches import BranchMonitor, Retry, Step
from eomgen.run.compiled import Steps, Touched
from eomgen.run.contacts import Within, meets
from eomgen.run.failure import NOT_FINITE, StepFailure
from eomgen.run.integrators.interface import Adaptive, Remark, Resume, Tolerances
from eomgen.run.integrators.portions import Portion
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.rows import Row, all_finite
from eomgen.run.shaking import Shaken

_STALLED = 100
"""A run stops after this many steps in a row that do not advance the time."""
_NONE: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Settings:
    """How the steps of a run by an adaptive method are made.

    t_end   the end, s
    times   those of the rows wanted, ascending, s
    remark  called with what SciPy would warn of
    steps   see `run.compiled.Compiled`; None if there are none
    each    whether each compiled step is yielded, or many at once
    dense   whether compiled steps give the states within them
    """

    method: Adaptive
    bounds: Tolerances
    t_end: float
    times: FloatArray
    remark: Remark
    steps: Callable[[str, tuple[str, ...]], Steps | None] | None
    each: bool
    dense: bool


class Stepper:
    """The solver of a run, restarted where steps must be repeated; `sampled` is the number of rows
    so far.
    """

    def __init__(self, settings: Settings, problem: Problem, touched: Touched | None) -> None:
        self.settings, self.problem, self.sampled = settings, problem, 0
        self.touched = touched
        method, bounds = self.method, self.bounds = settings.method, settings.bounds
        self.t_end, self.times = settings.t_end, settings.times
        self.longest, self.branches = bounds.longest, None
        scrutiny = problem.scrutiny
        if problem.switching or (scrutiny and scrutiny.localised):
            switching = problem.switching or Switching()
            self.branches = BranchMonitor(problem, switching, bounds)
        if problem.corners and not problem.switching:
            self.longest = min(bounds.longest, bounds.unseen)
        self._whole, self._unseen = True, False
        self._cut, self._factorisations, self._stalled = 0, 0, 0
        self.shaken = None
        if scrutiny and scrutiny.seed is not None and "lost" in method.memory:
            self.shaken = Shaken(problem.derivative, scrutiny.seed)

    def begin(self, t: float, resume: Resume | None) -> None:
        """Begin at time t with the problem's initial state; `resume` is from `continuation`."""
        self.sampled = int(np.searchsorted(self.times, t, side="right"))
        until = self.t_end
        if resume and self.branches:
            cut = float(resume["until"])
            until = min(cut, until) if cut > t else until
            self.branches.restore(resume)
        self._start(t, self.problem.initial, until, resume or {})

    def _start(self, t: float, y: FloatArray, until: float, memory: Mapping[str, Any]) -> None:
        """Start the solver at time t, for steps up to `until` and to the first time at which the
        derivative is known to change its branch. If that is now, start on its other side.
        """
        known = self.branches and self.branches.known(t, self.t_end)
        while self.branches and known and known[0] <= t:
            t, memory = known[1], {name: x for name, x in memory.items() if name == "lost"}
            known = self.branches.known(t, self.t_end)
        until = min(until, known[0]) if known else until
        options: dict[str, Any] = {"rtol": self.bounds.rtol, "atol": self.bounds.atol}
        if self.method.uses_jacobian:
            options["jac"] = self.problem.jacobian
        if self.method.asks_more:
            options |= {"timed": self.problem.timed, "positions": self.problem.leading_positions}
        if self.method.series:
            make = self.problem.series.get(self.method.series)
            options["series"] = make() if make else None
        # y is copied because LSODA's compiled code modifies state arrays in place. If a later run
        # can continue from this one, the choice of the first step must not depend on the end.
        bound = np.inf if self.method.memory else until
        self.solver: Any = self.method.solver(
            self.problem.derivative, t, y.copy(), bound, max_step=self.longest, **options
        )
        if hasattr(self.solver, "remark"):
            self.solver.remark = self.settings.remark
        self.solver.t_bound = until
        self.until = until
        for name in self.method.memory if memory else ():
            if name in memory:
                kind = type(getattr(self.solver, name))
                setattr(self.solver, name, _restored(memory[name], kind))

    def made(self) -> Portion | None:
        """Make a step; None if it must be repeated, for which the solver is restarted.

        Raises `StepFailure` if the method fails.
        """
        step = self._step()
        # LSODA continues with steps so short that t + h rounds to t; the others stop by themselves.
        # Far from t = 0 its first few steps may be that short before they grow.
        self._stalled = 0 if step.start < step.end else self._stalled + 1
        if self._stalled == _STALLED:
            raise StepFailure("the steps have shrunk to nothing", self.method.remedy)
        retry = self._retry(step)
        if retry:
            self._cut += retry.seen
            return None
        met, touched = None, self.touched
        if touched and self._meets(touched, step):
            met, step = _nothing, replace(step, end=touched.at.t, last=touched.at.y)
        passed = int(np.searchsorted(self.times, step.end, side="right"))
        rows = self._rows(step, self.times[self.sampled : passed])
        expanded = getattr(self.solver, "expanded", 0)
        capped = self.capped(step.start, [step.end])
        cut, factorisations = self.counted()
        self.sampled = passed
        return Portion(
            *(self.problem, step.start, [step.end], [step.last], rows, (), _NONE),
            *(partial(_between, self.problem, step), self._resume(step), None, met),
            (expanded, 0, factorisations, 0, 0, 0, 0 if capped is None else int(capped[0]), cut),
        )

    def _meets(self, touched: Touched, step: Step) -> bool:
        """Whether a rigid contact closes or opens in a step."""
        touched.at.t, touched.at.y = step.start, step.first
        between = partial(_between, self.problem, step, 0)
        within = Within(step.start, step.first, step.last, step.end, between)
        return meets(touched, within, SHARE)

    def counted(self) -> tuple[int, int]:
        """The attempts that passed over a branch, and the factorisations, since this was asked."""
        made = self._cut, self._factorisations
        self._cut = self._factorisations = 0
        return made

    def capped(self, start: float, ends: Any) -> Any:
        """The number so far of these steps that have the greatest length allowed there."""
        limited = self._unseen and self.solver.status == "finished" and not self.ended
        if not limited and self.longest == np.inf:
            return None
        longest = np.diff(ends, prepend=start) >= self.longest * (1 - 1e-9)
        longest[-1] |= limited  # it ends where longer ones cannot be checked
        return np.cumsum(longest)

    def _step(self) -> Step:
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
        self._factorisations += int(solver.nlu) - factored
        if solver.status == "failed":
            reason = (message or "the method failed").rstrip(".")
            raise StepFailure(reason, self.method.remedy)
        dense = cache(solver.dense_output)
        t, y, memory = self._before
        end = self.problem.projected(float(solver.t), solver.y.copy())
        slopes = np.array([memory["f"], solver.f]) if "f" in memory else None
        return Step(t, float(solver.t), y, end, lambda times: dense()(times).T, slopes)

    def _rows(self, step: Step, times: FloatArray) -> list[Row]:
        """The rows of a step at times after its start; at its end no dense output is needed."""
        within = times[times < step.end]
        states = step.states(within) if within.size else ()
        placed = map(self.problem.projected, within.tolist(), states)
        rows = list(zip(within.tolist(), placed, strict=True))
        if not all(all_finite(y) for _, y in rows):
            raise StepFailure(NOT_FINITE, self.method.remedy)
        return rows + [(step.end, step.last)] * (times.size - within.size)

    def shorten(self) -> None:
        """Take account of a step that the end of the run shortens, unless another end does."""
        self._whole = self._whole and self.until != self.t_end

    def _retry(self, step: Step) -> Retry | None:
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

    def prepare_next(self, t: float, y: FloatArray, steps: int) -> None:
        """Prepare the solver for the step after some that ended at t in the state y."""
        self._unseen = self._unseen and self.solver.status != "finished"
        if self.solver.status == "finished":  # where a step had to end
            self._start(t, y, self.t_end, self._memory())
        elif self.method.one_step:
            # The slope saved for the next step is not evaluated again at the normalised state: its
            # error is of the size of this step's error, and the next step multiplies it by its
            # length. Measured: evaluating it again changes no error and costs a derivative.
            self.solver.y = y.copy()
        if self.shaken:  # add random rounding errors
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

    def _resume(self, step: Step) -> Callable[[int], Resume] | None:
        """Gives what a later run needs to continue from a step; None if it cannot.

        It can if no step so far depends on the end of this run.
        """
        if self.ended or not self.is_whole:
            return None
        memory = self._memory()
        if self.branches:
            reached = self.solver.status == "finished"
            cut = not reached and self.until != self.t_end
            memory |= {"until": self.until if cut else np.inf, **self.branches.memory}
        return lambda _: continuation(step.end, step.last, memory)

    def _memory(self) -> dict[str, Any]:
        return {name: getattr(self.solver, name) for name in self.method.memory}


def continuation(t: float, y: FloatArray, memory: Mapping[str, Any]) -> Resume:
    """What a later run needs to continue from the state `y` at t."""
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _nothing() -> None:
    """What is to be known of an event in a step of Python is known."""


def _restored(value: Any, kind: type) -> Any:
    """A copy of an array, or a number converted to its type."""
    return np.array(value) if np.ndim(value) else kind(value)


def _between(problem: Problem, step: Step, _: int, t: float) -> FloatArray:
    """The state at a time within a step, by dense output, which is computed on first use."""
    return problem.projected(t, step.states(t))
