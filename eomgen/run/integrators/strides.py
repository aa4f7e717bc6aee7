"""Steps of an adaptive method that compiled code makes, many at once."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from eomgen.run.branches import BranchMonitor
from eomgen.run.compiled import Margins, Steps, Stride, Watched
from eomgen.run.integrators.closed_strides import FEWER, MORE, MOST, kept_closed
from eomgen.run.integrators.interface import Adaptive, Advance, Resume
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import PROJECTS, constrained_by

OF_STATE, OF_CONTACTS = ("switching_functions",), ("gaps", "gap_rates")
"""Functions of a module that steps are checked with."""

_COUNTED = ("derivatives", "jacobians", "factorisations", "switches", "gap_checks")


class Tolerances(Protocol):
    """What `adaptive.Bounds` says of the error of steps."""

    @property
    def rtol(self) -> float: ...
    @property
    def atol(self) -> float | FloatArray: ...


class Stepper(Protocol):
    """A solver, the longest step and the end of its steps, s, and what checks them for branches."""

    solver: Any
    longest: float
    until: float
    t_end: float
    branches: BranchMonitor | None


class Strides:
    """The compiled steps of a run, with rows at `times`, and states at any time if it is `dense`.

    `steps` is asked for them each time.
    """

    def __init__(
        self,
        method: Adaptive,
        problem: Problem,
        bounds: Tolerances,
        times: FloatArray,
        steps: Callable[[str, tuple[str, ...]], Steps | None],
        *,
        dense: bool,
    ) -> None:
        switching, contacts = problem.switching, problem.contacts
        self._steps, self._dense = steps, dense
        self._method, self._problem, self._bounds, self._times = method, problem, bounds, times
        self._atol = np.zeros(problem.initial.shape) + bounds.atol
        self._needed = (
            *(OF_STATE if switching and switching.of_state else ()),
            *(OF_CONTACTS if contacts else ()),
            *(PROJECTS if problem.projection else ()),
        )
        self._sizes = None
        if contacts:
            self._sizes = np.array(contacts.sizes or np.ones(len(contacts.names)))
        self._unusual, self._most = False, MOST

    def made(self, stepper: Stepper, sampled: int, most: int) -> Stride | None:
        """Make at most `most` steps and put the stepper at their end; None if Python must make the
        next, or if there are no compiled ones yet. `sampled` is the number of rows so far.
        """
        steps = self._steps(self._method.compiled, self._needed)
        if steps is None:
            return None
        if stepper.branches and stepper.branches.features and not hasattr(stepper.solver, "f"):
            return None
        if self._unusual:  # the last stride ended before a step that Python must make
            self._unusual = False
            return None
        solver, branches, most = stepper.solver, stepper.branches, min(most, self._most)
        until = stepper.until
        watched = branches.watched(solver.t, solver.h_abs, most, until) if branches else None
        if branches and not watched:
            return None
        stride = steps(
            solver.t,
            solver.y,
            _Memory(solver, self._method.memory),
            t_end=until,
            rtol=self._bounds.rtol,
            atol=self._atol,
            longest=stepper.longest,
            times=self._times[sampled:],
            most=most,
            watched=watched,
            sizes=self._sizes,
            dense=self._dense or self._problem.closed_form is not None,
            constrained=constrained_by(self._problem.projection),
        )
        count = len(stride.ends)
        if not count:
            return None
        if branches and branches.features and not self._passes_nothing(branches, solver, stride):
            return None
        kept, self._most = kept_closed(self._problem, solver.t, solver.y, stride, self._most)
        if kept is None:
            return None
        stride = kept
        self._unusual = not stride.usual
        self._start, self._longest, self._watched = solver.t, stepper.longest, watched
        self._until = until if until < stepper.t_end else np.inf
        solver.t_old = float(stride.ends[-2]) if count > 1 else solver.t
        solver.t, solver.y = float(stride.ends[-1]), stride.states[-1].copy()
        for name, values in stride.memory.items():
            last = values[-1]
            setattr(solver, name, last.copy() if last.ndim else float(last))
        if branches and watched:
            if self._problem.switching and self._problem.switching.of_state:
                branches.passed(stride.ends, stride.values, stride.switched)
            branches.restore(_checks(watched, stride, count - 1))
        if stride.ended:
            solver.status = "finished"
        return stride

    def _passes_nothing(self, branches: BranchMonitor, solver: Any, stride: Stride) -> bool:
        """Whether steps pass over nothing; else Python makes the next one, and then fewer are made
        at once.
        """
        t = np.concatenate(([solver.t], stride.ends))
        y = np.concatenate((solver.y[None], stride.states))
        slopes = np.concatenate((solver.f[None], stride.memory["f"]))
        passes = branches.tame(t, y, slopes)
        self._most = min(MOST, MORE * self._most) if passes else max(1, self._most // FEWER)
        return passes

    def advances(
        self, stride: Stride, sampled: int, resumes: bool, each: bool
    ) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each; with `resumes` a run can continue from
        their ends.
        """
        ends = stride.ends.tolist()
        capped = none = np.zeros_like(stride.derivatives)
        if self._longest < np.inf:
            lengths = np.diff(stride.ends, prepend=self._start)
            capped = np.cumsum(lengths >= self._longest * (1 - 1e-9))
        solved = (none if x is None else x for x in (stride.jacobians, stride.factorisations))
        called = (stride.derivatives, *solved, stride.switches, stride.gap_checks)
        sums = np.column_stack((np.arange(1, len(ends) + 1), stride.sampled, capped, *called))
        kept = slice(None) if each else slice(-1, None)
        made = np.diff(sums[kept], axis=0, prepend=0).tolist()
        whole = len(ends) - stride.ended  # the end shortens the last step
        times, rows = self._times[sampled : sampled + sums[-1, 1]].tolist(), 0
        for i, (steps, passed, shortened, *calls) in zip(range(len(ends))[kept], made, strict=True):
            at = slice(rows, rows + passed)
            yield Advance(
                ends[i],
                stride.states[i],
                list(zip(times[at], stride.rows[at], strict=True)) if passed else [],
                self._problem,
                partial(_within, self._problem, stride.within, i) if stride.within else _unknown,
                steps=steps,
                **dict(zip(_COUNTED, calls, strict=True)),
                checked=True,
                resume=self._resume(stride, min(i, whole - 1)) if resumes and whole else None,
                capped=shortened,
                margins=self._margins(stride, i),
            )
            rows += passed

    def _margins(self, stride: Stride, i: int) -> Margins | None:
        """The margins of step i."""
        if stride.margins is None:
            return None
        start = float(stride.ends[i - 1]) if i else self._start
        return Margins(start, float(stride.margins[i]), float(stride.margins[i + 1]))

    def _resume(self, stride: Stride, i: int) -> Callable[[], Resume]:
        """A function that gives what a later run needs to continue after step i."""
        return partial(_after, stride, self._watched, self._until, i)


@dataclass(frozen=True)
class _Memory(Mapping[str, Any]):
    """What determines a solver's next step. It is read when it is used, for it may be computed."""

    solver: Any
    names: tuple[str, ...]

    def __getitem__(self, name: str) -> Any:
        return getattr(self.solver, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def _after(stride: Stride, watched: Watched | None, until: float, i: int) -> Resume:
    """What a later run needs to continue after step i, which does not go beyond `until`."""
    memory: dict[str, Any] = {name: values[i] for name, values in stride.memory.items()}
    if watched:
        memory |= {"until": until, **_checks(watched, stride, i)}
    return continuation(float(stride.ends[i]), stride.states[i], memory)


def _checks(watched: Watched, stride: Stride, i: int) -> dict[str, Any]:
    """What `BranchMonitor.memory` is after step i."""
    checked = np.empty((0, 0))
    if watched.ends:
        before = (stride.ends[i - 1], stride.values[i - 1]) if i else watched.ends[-1]
        pairs = (before, (stride.ends[i], stride.values[i]))
        checked = np.array([[t, *values] for t, values in pairs])
    return {"turned": stride.switched[i], "checked": checked}


def continuation(t: float, y: FloatArray, memory: Mapping[str, Any]) -> Resume:
    """What a later run needs to continue from the state `y` at t."""
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _within(
    problem: Problem, states: Callable[[int, float], FloatArray], i: int, t: float
) -> FloatArray:
    """The state at a time in step i."""
    return problem.projected(t, states(i, t))


def _unknown(t: float) -> FloatArray:
    raise AssertionError("states within these compiled steps were not asked for")
