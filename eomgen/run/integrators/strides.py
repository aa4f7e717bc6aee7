"""Steps of an adaptive method that compiled code makes, many at once."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from eomgen.run.branches import BranchMonitor
from eomgen.run.compiled import Steps, Stride, Watched
from eomgen.run.integrators.interface import Adaptive, Resume
from eomgen.run.integrators.portions import Portion, Size
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import PROJECTS, constrained_by
from eomgen.run.rows import Rows

OF_STATE, OF_CONTACTS = ("switching_functions",), ("gaps", "gap_rates")
"""Functions of a module that steps are checked with."""


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

    def shorten(self) -> None:
        """Take account of a step that its end shortens."""
        ...


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
        self._unusual, self._size = False, Size()

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
        lengths = self._lengths(stepper, min(most, self._size.most))
        if lengths is None:
            return None
        solver, branches, until = stepper.solver, stepper.branches, stepper.until
        longest, t_end, most = lengths
        watched = branches.watched(solver.t, solver.h_abs, most, until) if branches else None
        if branches and not watched:
            return None
        stride = steps(
            solver.t,
            solver.y,
            _Memory(solver, self._method.memory),
            t_end=t_end,
            rtol=self._bounds.rtol,
            atol=self._atol,
            longest=longest,
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
        if self._problem.closed_form:
            given = solver.t, solver.y, stride.ends, stride.states
            margins = self._problem.closed_form.passed(*given)
            if not self._size.fits(margins is not None):
                return None
            stride = replace(stride, margins=margins)
        if t_end == np.inf:
            stepper.shorten()
        reached = not float(stride.ends[-1]) < until
        stride = replace(stride, ended=reached and until == stepper.t_end)
        self._unusual = not stride.usual
        self._start, self._longest, self._watched = solver.t, stepper.longest, watched
        self._until = np.inf if reached or until == stepper.t_end else until
        solver.t_old = float(stride.ends[-2]) if count > 1 else solver.t
        solver.t, solver.y = float(stride.ends[-1]), stride.states[-1].copy()
        for name, values in stride.memory.items():
            last = values[-1]
            setattr(solver, name, last.copy() if last.ndim else float(last))
        if branches and watched:
            if self._problem.switching and self._problem.switching.of_state:
                branches.passed(stride.ends, stride.values, stride.switched)
            branches.restore(_checks(watched, stride, count - 1))
        if reached:
            solver.status = "finished"
        return stride

    def _lengths(self, stepper: Stepper, most: int) -> tuple[float, float, int] | None:
        """The longest step, s, the end, and the number of steps that are asked for; None if Python
        must make the next one.

        Compiled steps end before one that would reach the end, unless they are series. So that one
        is asked for alone, by its length; but where steps are looked at within, Python counts what
        that takes only if it is done.
        """
        t, until, longest = stepper.solver.t, stepper.until, stepper.longest
        if self._method.series or t + min(stepper.solver.h_abs, longest) < until:
            return longest, until, most
        left, looked = until - t, self._problem.closed_form is not None
        return (left, np.inf, 1) if t + left == until and not looked else None

    def _passes_nothing(self, branches: BranchMonitor, solver: Any, stride: Stride) -> bool:
        """Whether steps pass over nothing; else Python makes the next one, and then fewer are made
        at once.
        """
        t = np.concatenate(([solver.t], stride.ends))
        y = np.concatenate((solver.y[None], stride.states))
        slopes = np.concatenate((solver.f[None], stride.memory["f"]))
        return self._size.fits(branches.tame(t, y, slopes))

    def portion(self, stride: Stride, sampled: int, resumes: bool, before: "Before") -> Portion:
        """These steps, after `sampled` rows; with `resumes` a run can continue from their ends."""
        ends, states, none = stride.ends, stride.states, np.zeros_like(stride.derivatives)
        capped = none
        if before.limited or self._longest < np.inf:
            longest = np.diff(ends, prepend=self._start) >= self._longest * (1 - 1e-9)
            longest[-1] |= before.limited
            capped = np.cumsum(longest)
        solved = none if stride.factorisations is None else stride.factorisations
        counts = {
            "derivatives": stride.derivatives,
            "jacobians": stride.jacobians,
            "factorisations": solved + before.factorisations,
            "switches": stride.switches,
            "gap_checks": stride.gap_checks,
            "capped": capped,
            "cut": none + before.cut,
        }
        times = self._times[sampled : sampled + int(stride.sampled[-1])]
        within = partial(_within, self._problem, stride.within) if stride.within else _unknown
        whole = len(ends) - stride.ended  # the end shortens the last step
        kept = stride, self._watched, self._until, whole - 1
        return Portion(
            *(self._problem, self._start, ends, states, Rows(times, stride.rows), stride.sampled),
            *(counts, within, partial(_after, *kept) if resumes and whole else None),
            *(stride.margins, True),
        )


@dataclass(frozen=True)
class Before:
    """What came before compiled steps: attempts that were too long, which Python made: how many,
    and their factorisations; and whether the steps are limited because longer ones cannot be
    checked.
    """

    cut: int
    factorisations: int
    limited: bool


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


def _after(stride: Stride, watched: Watched | None, until: float, last: int, i: int) -> Resume:
    """What a later run needs to continue after step i, which does not go beyond `until`, or after
    the `last`.
    """
    i = min(i, last)
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


def _unknown(i: int, t: float) -> FloatArray:
    raise AssertionError("states within these compiled steps were not asked for")
