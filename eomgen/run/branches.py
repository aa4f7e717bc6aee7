"""Detection of steps of an adaptive method that pass over a branch of the derivative.

`engine.branches` says what that is. Switching functions of the state are followed along the step
there. Those of time alone are enclosed by interval arithmetic here, and steps end where they change
their sign (`schedule`).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.engine.adaptive import Bounds
from eomgen.engine.branches import (
    PASSED_OVER,
    PASSES_NOTHING,
    TOGETHER,
    Switches,
    passed_over,
)
from eomgen.engine.crossings import (
    MOST_FIRST,
    MOST_PARTS,
    Between,
    Watch,
    divide,
    end_at,
    turned,
)
from eomgen.engine.roots import Search
from eomgen.engine.structures import with_room
from eomgen.run.compiled import Watched
from eomgen.run.integrators.interface import Tolerances
from eomgen.run.localised import FREE, Features, Smooth, slope
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.schedule import Schedule
from eomgen.run.sliding import Returns

MOST_BRACKETS = 32
"""Most zeros in a step that compiled code finds."""
States = Callable[[Any], FloatArray]
"""The states (n, ny) at times (n,) within a step, or the state (ny,) at a single time."""


@dataclass(slots=True)
class Step(Between):
    """A step of a method: also the states between and, if they are known, the derivatives at both
    ends (2, ny).
    """

    states: States
    slopes: FloatArray | None = None

    @property
    def length(self) -> float:
        """Its length, s."""
        return self.end - self.start


@dataclass(frozen=True)
class _Along:
    """What can be known along a step: see `engine.crossings.Along`."""

    step: Step
    problem: Problem
    switching: Switching

    def states_at(self, n: int, times: FloatArray, to: FloatArray) -> None:
        to[:n] = self.step.states(times[:n])

    def switching_at(self, t: float, y: FloatArray, to: FloatArray) -> None:
        assert self.switching.of_state
        to[:] = _found(self.switching.of_state, t, y)

    def slope_at(self, t: float, y: FloatArray, to: FloatArray) -> None:
        to[:] = _found(self.problem.derivative, t, y)


def _found(
    function: Callable[[float, FloatArray], FloatArray], t: float, y: FloatArray
) -> FloatArray | float:
    """What a function returns; not a number if it cannot be evaluated."""
    try:
        return function(float(t), y)
    except (ArithmeticError, ValueError):
        return math.nan


@dataclass(frozen=True)
class Retry:
    """A step must be repeated up to the time `until`, s, only.

    seen  whether it passed over a branch; else the switching functions could not be followed along
          so long a step
    """

    until: float
    seen: bool


def watch(
    many: int,
    states: int,
    angles: Sequence[int] = (),
    timed: bool = False,
    *,
    most: int = MOST_PARTS,
    room: int = MOST_BRACKETS,
) -> Watch:
    """Room for switching functions along steps, for parts of a step and for brackets of zeros."""
    sizes = {"many": many, "most": most, "room": room, "STATES": states}
    which = np.array(angles, np.int64)
    return with_room(Watch, **sizes, timed=timed, turning=len(which), angles=which)


def switches(states: int, room: int = MOST_BRACKETS, **given: Any) -> Switches:
    """Room for the switches in a step; the other numbers are `given`."""
    return with_room(Switches, room=room, STATES=states, **given)


class BranchMonitor:
    """Checks the steps of a run, one after another, with the tolerances `bounds`.

    features   what else steps may pass over, if the run is under scrutiny
    """

    def __init__(self, problem: Problem, switching: Switching, bounds: Tolerances) -> None:
        ny = len(problem.initial)
        self.problem, self.switching = problem, switching
        self.unseen, self.allowed = bounds.unseen, bounds.allowed
        self._bounds = Bounds(np.zeros(ny) + bounds.atol, bounds.rtol, math.inf)
        self._found = self._switches()
        self._of = watch(0, ny)
        self._cut_at = math.nan
        scrutiny = problem.scrutiny
        self._schedule = Schedule(switching.of_time) if switching.of_time else None
        self._returns = Returns(self.unseen) if scrutiny else None
        localised = scrutiny.localised if scrutiny else ()
        self.features = Features(localised) if localised else None

    @property
    def _ends(self) -> list[tuple[float, FloatArray]]:
        """The ends of the last two steps, s, and the switching functions there, if known."""
        of = self._of
        both = [(of.earlier, of.before.copy()), (of.here, of.first.copy())]
        return both if of.earlier < of.here else []

    @property
    def memory(self) -> dict[str, Any]:
        """What the checks of the next steps depend on: numbers and arrays by name."""
        checked = [[t, *values] for t, values in self._ends] or np.empty((0, 0))
        return {"turned": self._found.last, "checked": np.array(checked)}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue from what `memory` gave."""
        self._found.last = float(memory["turned"])
        rows = memory["checked"]
        of = self._of
        of.here = of.earlier = math.nan
        if len(rows):
            of = self._roomy(len(rows[0]) - 1)
            (of.earlier, of.here), (of.before[:], of.first[:]) = rows[:, 0].tolist(), rows[:, 1:]

    def _roomy(self, many: int, marked: int = 0) -> Watch:
        """Room for some functions, and for parts of a step of which so many are given."""
        of, most = self._of, MOST_PARTS + 3 * marked
        if of.many != many or of.most < most:
            own = len(self.problem.initial), self.switching.angles, self.switching.timed
            made = watch(many, *own, most=most, room=most * many)
            if of.many == many:
                made.earlier, made.here = of.earlier, of.here
                made.before, made.first = of.before, of.first
            self._of = made
        return self._of

    def known(self, t: float, end: float) -> tuple[float, float] | None:
        """The first time from t on, but before `end`, at which the derivative changes its branch
        whatever the state is: the last double on this side and the first on the other, s.
        """
        return self._schedule.first(t, math.nextafter(end, t)) if self._schedule else None

    def watched(self, t: float, length: float, most: int, until: float) -> Watched | None:
        """What compiled steps from t on are checked with; None if the next step must be checked
        here. Up to `most` steps of about this length, s, are to be made, none beyond `until`.
        """
        functions, ends = self.switching, self._ends
        if functions.of_state and (not ends or self._of.here != t):
            return None
        clear = self._schedule.clear(t, length, most) if self._schedule else math.inf
        if not min(t + length, until) <= clear:
            return None
        return Watched(ends, self._found.last, clear, functions.timed, functions.angles)

    def check(self, step: Step) -> Retry | None:
        """How a step must be repeated; None if it is accepted.

        Steps must be given in order; a step that must be repeated is forgotten.
        """
        marks: Sequence[float] = ()
        if self.features:
            retry, marks = self._passed_over(self.features, step)
            if retry:
                return retry
        times, follows = list[float](), True
        if self._schedule:
            times, follows = self._schedule.changes(step.start, step.end)
        of = self._watching(step, marks)
        found = self._known(times, of.room)
        along = _Along(step, self.problem, self.switching)
        why = passed_over(of, found, along, self._bounds, Search(), step, follows)
        if why != PASSES_NOTHING:
            return Retry(found.until, seen=why == PASSED_OVER)
        found.last = found.now
        if of.many:
            end_at(of, step.end)
            if self._returns:
                before, here = self._ends
                self._returns.take(before, here, found.many > 0)
        return None

    def _watching(self, step: Step, marks: Sequence[float]) -> Watch:
        """The switching functions along a step, which is smooth between fractions of it, `marks`,
        0 and 1 included; none if all of it is.
        """
        function, of = self.switching.of_state, self._of
        if function and not of.many:
            first = function(step.start, step.first)
            of = self._roomy(len(first))
            of.here, of.first[:] = step.start, first
        of.marked = 0
        if marks and of.many:
            least = turned(of, step)
            if least <= MOST_FIRST:
                divide(of, least)
                shares = sorted({*of.marks[: of.parts + 1].tolist(), *marks})
                of = self._roomy(of.many, len(shares))
                of.marked = len(shares) - 1
                of.marks[: len(shares)] = shares
        return of

    def _known(self, times: Sequence[float], room: int) -> Switches:
        """The switches in a step at these times, and room for more."""
        if self._found.room < len(times) + room:
            self._found = self._switches(self._found.last, len(times) + room)
        self._found.many = len(times)
        self._found.times[: len(times)] = times
        return self._found

    def _switches(self, last: float = -math.inf, room: int = MOST_BRACKETS) -> Switches:
        ny = len(self.problem.initial)
        return switches(ny, room, last=last, unseen=self.unseen)

    def passed(self, ends: FloatArray, values: FloatArray, switched: FloatArray) -> None:
        """Take compiled steps, by their ends (m,), the functions there (m, ns), and the times of
        the last switch (m,), s.

        Raises `StepFailure` for a sliding mode.
        """
        if self._returns and self._ends:
            before = self._ends[-1]
            for t, g, last in zip(ends.tolist(), values, switched.tolist(), strict=True):
                self._returns.take(before, (t, g), last > before[0])
                before = t, g

    def tame(self, t: FloatArray, y: FloatArray, slopes: FloatArray) -> bool:
        """Whether compiled steps that end at times t (m + 1,) after the first, in states y, with
        derivatives `slopes` there (m + 1, ny), pass over nothing but branches.
        """
        return self.features is None or self.features.tame_between(t, y, slopes)

    def _passed_over(self, features: Features, step: Step) -> tuple[Retry | None, Sequence[float]]:
        """How a step that has passed over a localised function must be repeated, or None, and the
        fractions of it between which such functions are tame; none if they are in all of it.
        """
        if step.slopes is not None:
            ends, states = np.array([step.start, step.end]), np.array([step.first, step.last])
            if features.tame_between(ends, states, step.slopes):
                return None, ()
        smooth = Smooth(step.start, step.end, step.states)
        parts = features.parts(smooth)
        if parts is None:
            if step.length > self.unseen * (1 + TOGETHER):
                return Retry(step.start + self.unseen, seen=False), ()
            return None, ()
        cut = (step.start == self._cut_at, step.end == self._cut_at)
        for at, size in features.places(parts, cut):
            t = step.start + at * step.length
            if step.start < t < step.end and self._jumps(smooth, at, size):
                self._cut_at = t
                return Retry(t, seen=True), ()
        return None, [*(part.a for part in parts), 1.0] if len(parts) > 1 else ()

    def _jumps(self, step: Smooth, at: float, size: float) -> bool:
        """Whether the derivative at a fraction of a step differs from that of its interpolant, and
        from the mean of those at the ends of a part of this size around it, by what matters.
        """
        length = step.end - step.start
        shares = np.array([max(at - size, 0.0), at, min(at + size, 1.0)])
        times = step.start + length * shares
        states = step.states(times)
        allowed = FREE * self.allowed(states[1]) / (size * length)
        try:
            here = self.problem.derivative(float(times[1]), states[1])
            if bool((np.abs(here - slope(step, at)) <= allowed).all()):
                return False
            ends = [self.problem.derivative(float(times[i]), states[i]) for i in (0, 2)]
        except (ArithmeticError, ValueError):
            return True
        return not bool((np.abs(here - (ends[0] + ends[1]) / 2) <= allowed).all())
