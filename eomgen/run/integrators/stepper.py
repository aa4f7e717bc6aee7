"""Where a run by an adaptive method is, and where its steps must end, whoever makes them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.run.branches import BranchMonitor, Retry
from eomgen.run.compiled import Steps, Touched
from eomgen.run.integrators.interface import Adaptive, Remark, Resume, Tolerances
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.shaking import Shaken


@dataclass(frozen=True)
class Settings:
    """How the steps of a run by an adaptive method are made.

    t_end   the end, s
    times   those of the rows wanted, ascending, s
    remark  called with what SciPy would warn of
    steps   see `run.compiled.Compiled`; None if there are none
    each    whether each step is yielded, or many at once
    dense   whether compiled steps give the states within them
    alone   whether each step of Python is looked at before the next one is made
    """

    method: Adaptive
    bounds: Tolerances
    t_end: float
    times: FloatArray
    remark: Remark
    steps: Callable[[str, tuple[str, ...]], Steps | None] | None
    each: bool
    dense: bool
    alone: bool


class Stepper:
    """Where a run is: with its `solver`, which is made anew where steps must end earlier than they
    would; `sampled` is the number of rows so far.
    """

    solver: Any

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
        self._cut, self._factorisations = 0, 0
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
        self.solver = self.method.maker(
            self.problem.derivative, t, y.copy(), bound, max_step=self.longest, **options
        )
        self.solver.remark = self.settings.remark
        self.solver.t_bound = until
        self.until = until
        for name in self.method.memory if memory else ():
            if name in memory:
                kind = type(getattr(self.solver, name))
                setattr(self.solver, name, _restored(memory[name], kind))

    def counted(self) -> tuple[int, int]:
        """The attempts that passed over a branch, and the factorisations, since this was asked."""
        made = self._cut, self._factorisations
        self._cut = self._factorisations = 0
        return made

    def capped(self, start: float, ends: Any) -> Any:
        """The number so far of these steps that have the greatest length allowed there."""
        limited = self._unseen and self.solver.reached and not self.ended
        if not limited and self.longest == np.inf:
            return None
        longest = np.diff(ends, prepend=start) >= self.longest * (1 - 1e-9)
        longest[-1] |= limited  # it ends where longer ones cannot be checked
        return np.cumsum(longest)

    def shorten(self, end: float) -> None:
        """Take account of a step that would reach this end, s, if that of the run did not shorten
        it, unless another end does.
        """
        self._whole = self._whole and (end < self.t_end or self.until != self.t_end)

    def repeat(self, retry: Retry, end: float) -> None:
        """Begin again with a step that would end at some time, but must end earlier."""
        solver, memory = self.solver, self.memory
        if memory:  # a step shortened to the end would be retried with another length if rejected
            self.shorten(solver.t + min(solver.h_abs, self.longest))
        # A run with a later end would have checked a longer step.
        self._whole = self._whole and end < self.t_end
        self._unseen = not retry.seen
        self._cut += retry.seen
        self._factorisations += solver.factorisations
        self._start(solver.t, solver.y, retry.until, memory)

    def prepare_next(self, t: float, y: FloatArray, steps: int) -> None:
        """Prepare the solver for the step after some that ended at t in the state y."""
        self._unseen = self._unseen and not self.solver.reached
        if self.solver.reached:  # where a step had to end
            self._start(t, y, self.t_end, self.memory)
        else:
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
        return bool(self.solver.reached and self.until == self.t_end)

    @property
    def memory(self) -> dict[str, Any]:
        """What of the solver determines the next step."""
        return {name: getattr(self.solver, name) for name in self.method.memory}


def continuation(t: float, y: FloatArray, memory: Mapping[str, Any]) -> Resume:
    """What a later run needs to continue from the state `y` at t."""
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _restored(value: Any, kind: type) -> Any:
    """A copy of an array, or a number converted to its type."""
    return np.array(value) if np.ndim(value) else kind(value)
