"""Steps of equal length, which in every place are those of `eomgen.engine.equal_steps`."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from eomgen.engine.adaptive import EVENT, MADE, UNUSUAL
from eomgen.engine.equal_steps import Course, Kept, equal_steps
from eomgen.engine.explicit import Step
from eomgen.engine.sums import Sum
from eomgen.run.calls import Calls, Count
from eomgen.run.compiled import EqualSteps, Touched
from eomgen.run.contacts import Within, meets
from eomgen.run.failure import NOT_FINITE, StepFailure
from eomgen.run.integrators.interface import Advance, Change, FixedStep, Resume
from eomgen.run.integrators.portions import Portion, Size
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import constrained_by
from eomgen.run.rows import Rows
from eomgen.run.shaking import Shaken

AHEAD = 256
"""Numbers of states that Python computes at once where nothing has to look at each step."""
_NO_QUATERNIONS = np.empty(0, np.int64)


def count_steps(span: float, dt: float) -> float:
    """The number of steps of `dt` that cover `span`, s; the last one may be shorter.

    A remainder below 1e-9 dt is a rounding error of the division and gets no step. The result is a
    whole number, or infinite if the division overflows.
    """
    steps = span / dt
    return max(1, math.ceil(steps - 1e-9)) if math.isfinite(steps) else math.inf


@dataclass(frozen=True)
class Grid:
    """Steps end at t_start + i dt, and at `t_end`; every `every`-th is a row, and the last if it
    `ends` the run. There are steps `before` these.
    """

    t_start: float
    t_end: float
    dt: float
    every: int
    before: int = 0
    ends: bool = True

    @cached_property
    def steps(self) -> int:
        """Their number."""
        return int(count_steps(self.t_end - self.t_start, self.dt))

    def is_row(self, i: int, t: float) -> bool:
        """Whether step i ends at t, and is a row."""
        return self.end(i)[0] == t and self.is_kept(i)

    def is_kept(self, i: int) -> bool:
        """Whether step i is a row."""
        return (self.before + i) % self.every == 0 or (self.ends and i == self.steps)

    def end(self, i: int) -> tuple[float, float | None]:
        """When step i ends, from 1 on, and when it does by the grid; None if it is shorter."""
        # From the start each time: a sum of steps would accumulate rounding errors.
        mark = self.t_start + i * self.dt
        if i < self.steps:
            return min(mark, self.t_end), mark
        return self.t_end, mark if abs(mark - self.t_end) <= 4 * math.ulp(self.t_end) else None


@dataclass(frozen=True)
class Settings:
    """How the steps of a run by a method of equal steps are made.

    change    makes one
    whole     the problem by whose Jacobian the stability of steps is checked, unless there are
              rigid contacts, which may be held; None for no check
    compiled  the steps in compiled code, which it is asked for before each portion of steps; None
              if there are none. They have the same bits. Python makes the first step and the last,
              and those that are not usual
    calls     counts the calls of the problem's functions; given if steps may be made before the
              earlier ones have been looked at
    each      whether each step is yielded, or many at once
    monitor   of stability, if steps after an event continue those before it
    """

    method: FixedStep
    change: Change
    grid: Grid
    whole: Problem | None
    compiled: Callable[[], EqualSteps | None] | None
    calls: Calls | None
    each: bool
    monitor: StabilityMonitor | None


def advances(
    settings: Settings,
    problem: Problem,
    t: float,
    made: int,
    resume: Resume | None = None,
    touched: Touched | None = None,
) -> Iterator[Advance]:
    """Yield the steps from time `t` on; how many were `made` before follows from that.

    If `t` lies between the ends of steps, the first one is shorter. Quaternions are normalised
    after every step. The state within a step is that after a shorter step. Sums are compensated.

    resume    what an `Advance` of an earlier run gave
    touched   what compiled steps are given of rigid contacts; they then end with the part of one up
              to an event, of which `touched` says when the part is yielded

    Raises `StepFailure` where there is no step, or if steps are too long for stability.
    """
    method, change, grid = settings.method, settings.change, settings.grid
    compiled, calls, each = settings.compiled, settings.calls, settings.each
    checked = problem if settings.whole and problem.contacts else settings.whole
    monitor = settings.monitor or StabilityMonitor(change, method.stability)
    own = InPython(change, problem, checked, monitor, calls)
    regular, y, steps = t == grid.t_start or resume is not None, problem.initial, grid.steps
    lost = np.zeros_like(y) if resume is None else resume["lost"]
    seed = problem.scrutiny.seed if problem.scrutiny else None
    shaken = None if seed is None else Shaken(problem.derivative, seed)
    i, size = min(math.floor((t - grid.t_start) / grid.dt + 1e-9), steps - 1), Size()
    goes_on = usual = monitor.begin()
    ahead = max(1, AHEAD // len(y)) if calls and len(y) else 1
    own_most = 1  # it grows: an event may end the steps, and those beyond it are in vain
    while i < steps:
        (end, mark), near = grid.end(i + 1), False
        alone = i + 1 == steps or not regular
        made_here = not compiled or not usual or i + 1 == steps or not (regular or goes_on)
        place = compiled() if compiled and not made_here else None
        most = size.most if place else own_most if usual or not compiled else 1
        most = 1 if alone else min(most, steps - 1 - i, shaken.left if shaken else most)
        length = grid.dt if regular and mark is not None else end - t
        ends = (end, grid.t_end, 0.0) if alone else (grid.t_start, grid.t_end, grid.dt)
        limits, last = own.limits, (np.empty_like(y), np.empty_like(y))
        course = Course(*ends, length, i, most, *limits, *last, 0, _NO_QUATERNIONS)
        kept = _room(most, len(y))
        held = constrained_by(problem.projection) if place else None
        given = t, Sum(y, lost), course, kept
        own.touched = met = touched and touched.copy(t, y, most)
        why = place.make(*given, held, met) if place else own.make(*given, i + 1 == steps)
        n, is_part = kept.made, int(why == EVENT)
        if touched and met:
            touched.now.slack[:] = met.slack
        margins = np.concatenate(([held.margins[1][1]], kept.margins[:n])) if held else None
        if n > is_part and problem.solved_loops:
            whole = slice(n - is_part)
            margins = problem.solved_loops.passed(t, y, kept.ends[whole], kept.states[whole])
            near = margins is None  # perhaps to a singular position, for which each is looked at
            n = 0 if not size.fits(not near) and place else n
        usual = n > 0 and (not place or why == MADE)
        if n:
            if place:
                own.passed(n, place.calls, course)
            is_held = touched is not None and bool(touched.now.holds.any())
            counts = _counts(place, kept, n, met, is_held) if place else own.counts_of(n)
            within = partial(_within, change, problem, (t, y), kept)
            resumes = partial(_continuation, kept, mark) if mark is not None else None
            # The end of a part is a row if that of the whole step would be, and is there.
            is_row = not is_part or grid.is_row(i + n, kept.ends[n - 1])
            rows = _rows(kept, (n, n - (not is_row)), i, grid)
            parted = partial(touched.take, met) if touched and met and is_part else None
            of = kept.ends[:n], kept.states[:n], *rows, counts, within, resumes, margins, parted
            yield from Portion(problem, t, *of).advances(each or near)
            if is_part:
                return
            i, regular, own_most = i + n, True, min(2 * own_most, ahead)
            t, y, lost = float(kept.ends[n - 1]), kept.states[n - 1], kept.losses[n - 1]
            if shaken:
                lost = lost + shaken.error(t, y, length, n)
        if not place and why != MADE:
            own.count_failed()
            raise own.failure or StepFailure(NOT_FINITE, method.remedy)


def _room(most: int, states: int) -> Kept:
    """Room for the records of `most` steps."""
    ends, margins, iterations = np.empty(most), np.empty(most), np.empty(most, np.int64)
    found, losses = np.empty((2, most, states))
    return Kept(0, most, ends, found, losses, iterations, margins)


def _rows(kept: Kept, many: tuple[int, int], made: int, grid: Grid) -> tuple[Any, Any]:
    """The rows in these steps, after `made` earlier ones; and the numbers of rows so far. `many`
    are all of them, and those that may be rows.
    """
    every, (n, last) = grid.every, many
    if made + n == grid.steps:  # the last one, alone
        last *= grid.is_kept(grid.steps)
        return [(grid.t_end, kept.states[0])][:last], [last]
    made += grid.before
    hit = slice(-(made + 1) % every, last, every)
    if n <= AHEAD:
        rows = list(zip(kept.ends[hit].tolist(), kept.states[hit].copy(), strict=True))
        until = [min(k, last) for k in range(1, n + 1)]
        return rows, [(made + k) // every - made // every for k in until]
    # No views, which keep all of the states.
    found = Rows(kept.ends[hit].copy(), kept.states[hit].copy())
    so_far = np.minimum(np.arange(1, n + 1), last)
    return found, (made + so_far) // every - made // every


def _counts(
    place: EqualSteps, kept: Kept, n: int, met: Touched | None, is_held: bool
) -> dict[str, Any]:
    """The derivatives and Jacobians so far in the first n of these steps. While contacts are held
    Jacobians are differences of derivatives.
    """
    if met:
        counts = met.called_by(n)
        solved = place.iterates and not is_held
        return {**counts, "jacobians": counts["derivatives"]} if solved else counts
    if not place.iterates:
        return {"derivatives": place.calls * np.arange(1, n + 1)}
    made = place.calls * np.cumsum(kept.iterations[:n])
    return {"derivatives": made, "jacobians": made}


def _continuation(kept: Kept, mark: float, i: int) -> Resume:
    """What a later run needs to continue after step i of these; the first one ends at `mark`."""
    t = kept.ends[i] if i else mark
    return {"t": np.array(t), "y": kept.states[i], "lost": kept.losses[i]}


def _within(
    change: Change,
    problem: Problem,
    start: tuple[float, FloatArray],
    kept: Kept,
    i: int,
    time: float,
) -> FloatArray:
    """The state at a time in step i of these, by a single step from its start."""
    t, y = (float(kept.ends[i - 1]), kept.states[i - 1]) if i else start
    return problem.projected(time, y + change(problem, t, y, time - t)) if time > t else y


class InPython:
    """Makes steps in Python: what the engine's text is given, which runs as it stands.

    Steps are checked for stability. An error ends the steps, and is then in `failure`. If `calls`
    are given, `counts` has the numbers of those in the last steps, up to the end of each, and
    `calls` is without them: they count as the steps are taken.
    """

    def __init__(
        self,
        change: Change,
        problem: Problem,
        checked: Problem | None,
        monitor: StabilityMonitor,
        calls: Calls | None,
    ) -> None:
        self._change, self._problem = change, problem
        self._checked, self._monitor, self._looked = checked, monitor, False
        self._recorded = monitor.recording(problem) if checked else problem
        ny = len(problem.initial)
        self._no_limits = np.zeros(ny), np.full(ny, np.inf)
        self._counted: dict[str, Count] = vars(calls) if calls else {}
        self.counts: dict[str, list[int]] = {name: [] for name in self._counted}
        self._both = list(zip(self.counts.values(), self._counted.values(), strict=True))
        self._unkept: list[int] = []
        self.touched: Touched | None = None
        self.failure: BaseException | None = None
        self._failed: list[tuple[float, FloatArray] | None] = []

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """The rate of the last step, and the changes from it that are not to be looked at."""
        none, limits = self._no_limits, self._monitor.limits
        return (limits[0] + none[0], limits[1] + none[0]) if self._checked else none

    def make(self, t: float, at: Sum, course: Course, kept: Kept, last: bool) -> int:
        """Steps, as `EqualSteps.make`; `last` if it is the last one of a run."""
        self._course, self._last = course, last
        begun = [count.calls for _, count in self._both]
        failed = [count.failed for _, count in self._both]
        self._unkept.clear()
        for calls, _ in self._both:
            calls.clear()
        try:
            why = equal_steps(self, self, self, t, at, course, Step(), kept)
        except BaseException as failure:  # those before it are kept
            self.failure, why = failure, UNUSUAL
        for (calls, count), before in zip(self._both, begun, strict=True):
            self._unkept.append(count.calls - (calls[-1] if calls else before))
            count.calls = before
            calls[:] = [n - before for n in calls]
        self._failed = [count.failed for _, count in self._both]
        for (_, count), place in zip(self._both, failed, strict=True):
            count.failed = place
        if not self._monitor.is_first:
            self._monitor.rate = course.rate
        return why

    def counts_of(self, n: int) -> dict[str, list[int]]:
        """Those of the first n of the last steps."""
        return {name: calls[:n] for name, calls in self.counts.items()}

    def passed(self, steps: int, calls: int, course: Course) -> None:
        """Take account of compiled steps, of `calls` derivatives each."""
        if self._checked:
            self._monitor.passed(steps, calls, course.rate, course.place, course.slope)

    def count_failed(self) -> None:
        """Count the calls of a step that was not made, and say where they failed."""
        parts = zip(self._both, self._unkept, self._failed, strict=True)
        for (_, count), calls, place in parts:
            count.calls += calls
            count.failed = place

    def changed(self, t: float, y: FloatArray, h: float, step: Step) -> int:
        """A step of the method."""
        change = self._change(self._recorded, t, y, h)
        step.change = step.place = step.slope = change
        self._step = t, y, change, h
        return 1

    def may_jump(self, t: float, y: FloatArray, change: FloatArray) -> bool:
        """Whether a step whose rate jumps may be made: it may, or this raises `StepFailure`."""
        if self._checked:
            if not self._monitor.is_first:
                self._monitor.rate = self._course.rate
            self._monitor.check(self._checked, *self._step)
            self._course.allowed = self._monitor.limits[1]
            self._looked = True
        return True

    def clear(self) -> None:
        """There are no flags: errors are raised."""

    def is_raised(self) -> bool:
        """Whether there was an error."""
        return False

    def projected(self, t: float, y: FloatArray) -> bool:
        """Put the state on the constraints, and normalise its quaternions."""
        y[:] = self._problem.projected(t, y)
        return True

    def event(self, method: Any, t: float, y: FloatArray, end: FloatArray) -> int:
        """Whether a rigid contact ends the step; raises `StepFailure` if that is not found."""
        met = self.touched
        if met is None:
            return MADE
        start, whole = (t, met.at.y), float(end[0])
        within = Within(*start, y.copy(), whole, partial(self._within, start))
        if not meets(met, within, 1.0):
            met.slack[:] = met.now.slack
            return MADE
        y[:], end[0] = met.at.y, met.at.t
        return EVENT

    def _within(self, start: tuple[float, FloatArray], time: float) -> FloatArray:
        t, y = start
        if not time > t:
            return y
        return self._problem.projected(time, y + self._change(self._problem, t, y, time - t))

    def keep_step(self, t: float, y: FloatArray, margin: FloatArray) -> bool:
        """Take account of the step."""
        if self._checked and not self._looked:
            self._monitor.take()
        self._looked = False
        if self._checked and self._last:
            self._monitor.finish(self._checked, *self._step)
        for calls, count in self._both:
            calls.append(count.calls)
        return True
