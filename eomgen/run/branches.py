"""Detection of steps of an adaptive method that pass over a branch of the derivative.

A method evaluates the derivative at a few points of a step. A contact, a stop or a pulse in time
that begins and ends between them does not show in the error estimate, however long the step. The
derivative is smooth as long as no switching function g(t, y) of the problem crosses 0. Those of the
state are followed along the step (`crossings`). Those of time alone are enclosed by interval
arithmetic, and steps end where they change their sign (`schedule`).

A step passes over a branch if two switches lie in it, and the derivative between them differs from
that before and after by more than the tolerance allows. Such a step is repeated up to the middle
between the two, so that the method evaluates the derivative on that branch. If a method's error
estimate does not depend on the derivative near the ends of a step, its steps are made to end at the
switches.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eomgen.run.compiled import Watched
from eomgen.run.crossings import TOGETHER, Crossings, Step
from eomgen.run.localised import FREE, Features, Smooth, slope
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.schedule import Schedule
from eomgen.run.sliding import Returns

INSIDE = 1 / 8
"""A step that ends at least this fraction of the time between two switches after the first one has
evaluated the branch between them."""


@dataclass(frozen=True)
class Retry:
    """A step must be repeated up to the time `until`, s, only.

    seen  whether it passed over a branch; else the switching functions could not be followed along
          so long a step
    """

    until: float
    seen: bool


@dataclass
class BranchMonitor:
    """Checks the steps of a run, one after another.

    allowed    y (ny,) -> (ny,), the error allowed in a step that ends at y
    unseen     the longest step, s, if the functions cannot be followed
    switched   the time of the last switch, s
    features   what else it may pass over, if the run is under scrutiny
    """

    problem: Problem
    switching: Switching
    allowed: Callable[[FloatArray], FloatArray]
    unseen: float
    switched: float = -math.inf
    features: Features | None = None
    _cut_at: float = math.nan
    _ends: list[tuple[float, FloatArray]] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        of_time, scrutiny = self.switching.of_time, self.problem.scrutiny
        self._schedule = Schedule(of_time) if of_time else None
        self._returns = Returns(self.unseen) if scrutiny else None
        if scrutiny and scrutiny.localised:
            self.features = Features(scrutiny.localised)

    @property
    def memory(self) -> dict[str, Any]:
        """What the checks of the next steps depend on: numbers and arrays by name."""
        checked = [[t, *values] for t, values in self._ends] or np.empty((0, 0))
        return {"turned": self.switched, "checked": np.array(checked)}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue from what `memory` gave."""
        self.switched = float(memory["turned"])
        self._ends = [(float(row[0]), np.array(row[1:])) for row in memory["checked"]]

    def known(self, t: float, end: float) -> tuple[float, float] | None:
        """The first time from t on, but before `end`, at which the derivative changes its branch
        whatever the state is: the last double on this side and the first on the other, s.
        """
        return self._schedule.first(t, math.nextafter(end, t)) if self._schedule else None

    def watched(self, t: float, length: float, most: int, until: float) -> Watched | None:
        """What compiled steps from t on are checked with; None if the next step must be checked
        here. Up to `most` steps of about this length, s, are to be made, none beyond `until`.
        """
        functions = self.switching
        if functions.of_state and (len(self._ends) < 2 or self._ends[-1][0] != t):
            return None
        clear = self._schedule.clear(t, length, most) if self._schedule else math.inf
        if not min(t + length, until) <= clear:
            return None
        return Watched(self._ends, self.switched, clear, functions.timed, functions.angles)

    def check(self, step: Step) -> Retry | None:
        """How a step must be repeated; None if it is accepted.

        Steps must be given in order; a step that must be repeated is forgotten.
        """
        marks: Sequence[float] = ()
        if self.features:
            retry, marks = self._passed_over(self.features, step)
            if retry:
                return retry
        search = None
        if self.switching.of_state:
            search = Crossings(self.switching, step, self._ends, marks)
        times, whole = self._times(search, step)
        switched = self.switched
        for after in times:
            until = self._cut(step, switched, after)
            if until is not None:
                return Retry(until, seen=True)
            switched = max(switched, after)
        if not whole and step.length > self.unseen * (1 + TOGETHER):
            return Retry(step.start + self.unseen, seen=False)
        self.switched = switched
        if search:
            self._ends = [search.start, search.end]
            if self._returns:
                self._returns.take(search.start, search.end, bool(times))
        return None

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

    def _times(self, search: Crossings | None, step: Step) -> tuple[list[float], bool]:
        """The times of the switches in a step, in order, and whether these are all. A single one is
        not located exactly if that does not matter.
        """
        times, whole = list[float](), True
        if self._schedule:
            times, whole = self._schedule.changes(step.start, step.end)
        if search is None or search.is_far():
            return times, whole
        brackets, followed = search.brackets()
        if brackets:
            last = max(bracket.end for bracket in brackets)
            alone = len(brackets) + len(times) == 1 and _is_seen(self.switched, step.start, last)
            times = sorted([*times, *(b.middle if alone else search.located(b) for b in brackets)])
        return times, whole and followed

    def _cut(self, step: Step, before: float, after: float) -> float | None:
        """The time at which a step must end because of two consecutive switches; None if it need
        not.
        """
        gap = after - before
        if not TOGETHER * step.length < gap < math.inf:
            return None
        if before < step.start and _is_seen(before, step.start, after):
            return None
        middle = before + gap / 2
        if not step.start + TOGETHER * step.length < middle < step.end:
            return None
        aside = gap / 8
        times = (max(step.start, before - aside), middle, min(step.end, after + aside))
        return middle if self._matters(step, times, gap) else None

    def _matters(self, step: Step, times: tuple[float, float, float], length: float) -> bool:
        """Whether the derivative at the second of three times differs from the mean of those at the
        others by more than is allowed in a step of the given length, s.
        """
        states = step.states(np.array(times))
        try:
            slopes = [self.problem.derivative(t, y) for t, y in zip(times, states, strict=True)]
        except (ArithmeticError, ValueError):
            return True
        missed = np.abs(slopes[1] - (slopes[0] + slopes[2]) / 2) * length
        return not bool((missed <= self.allowed(states[1])).all())


def _is_seen(before: float, between: float, after: float) -> bool:
    """Whether a step that ends `between` two switches has evaluated the branch between them."""
    return before == -math.inf or between >= before + INSIDE * (after - before)
