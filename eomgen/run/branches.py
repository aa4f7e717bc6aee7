"""Detection of steps of an adaptive method that pass over a branch of the derivative.

A method evaluates the derivative at a few points of a step. A contact, a stop or a pulse in time
that begins and ends between them does not show in the error estimate, however long the step. The
derivative is smooth as long as no switching function g(t, y) of the problem crosses 0. Along a step
these are functions of time, known from the method's dense output. On parts of the step they are
interpolated by polynomials, which enclose them (`enclosing`). A part is halved until each function
is monotone or has no zero there. Functions of time alone are enclosed by interval
arithmetic instead.

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
from numpy.typing import NDArray

from eomgen.run.compiled import Watched
from eomgen.run.enclosing import FACTORS, INNER, LAST
from eomgen.run.localised import FREE, Features, Smooth, slope
from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.roots import root
from eomgen.run.schedule import Schedule
from eomgen.run.sliding import Returns

MOST_EVALUATIONS = 200
"""Most evaluations of the switching functions in a step. A step that needs more is limited to the
length for steps that cannot be checked."""
SHORTEST_PART = 2.0**-20
"""Fraction of a step below which parts are not halved."""
LARGEST_ANGLE = 1.0
"""Greatest change of an angle in a part, rad, so that every revolution is resolved."""
FAR = 4.0
"""A function has no zero in a step if it is this many times farther from 0 than it has changed in
the last two steps."""
IRREGULAR = (0.3819660112501051, 0.7548776662466927)
"""Fractions of a step far from simple ratios: a function with the period of the step, or a simple
fraction of it, has other values there than at the ends."""
TOGETHER = 1e-9
"""Fraction of a step within which switches count as one."""
LOCATED = 1e-12
"""Fraction of a step to which a switch is located."""
INSIDE = 1 / 8
"""A step that ends at least this fraction of the time between two switches after the first one has
evaluated the branch between them."""

States = Callable[[Any], FloatArray]
"""The states (n, ny) at times (n,) within a step, or the state (ny,) at a single time."""
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
_Part = tuple[float, float, FloatArray, Indices]
"""A part of a step: start and end as fractions of the step, values (5, n) of functions there, and
the numbers (n,) of these functions."""


@dataclass(frozen=True)
class Step:
    """A step of a method: from `start` to `end`, s, the states there, those between and, if they
    are known, the derivatives at both ends (2, ny).
    """

    start: float
    end: float
    first: FloatArray
    last: FloatArray
    states: States
    slopes: FloatArray | None = None

    @property
    def length(self) -> float:
        """Its length, s."""
        return self.end - self.start


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
    sees_end   whether the method's error estimate depends on the derivative at the end of a step
    switched   the time of the last switch, s
    features   what else it may pass over, if the run is under scrutiny
    """

    problem: Problem
    switching: Switching
    allowed: Callable[[FloatArray], FloatArray]
    unseen: float
    sees_end: bool = True
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
            search = _Search(self.switching, step, self._ends, marks)
        times, whole = self._times(search, step)
        switched = self.switched
        for i, after in enumerate(times):
            if self.sees_end:
                until = self._cut(step, switched, after)
            else:
                until = self._end(step, switched, after, [*times, step.end][i + 1])
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
        cut = (step.start == self._cut_at, step.end == self._cut_at and self.sees_end)
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

    def _times(self, search: "_Search | None", step: Step) -> tuple[list[float], bool]:
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

    def _end(self, step: Step, before: float, change: float, after: float) -> float | None:
        """The time of a switch between two others, if a step must end there; else None."""
        whole = min(change - step.start, step.end - change)
        # The others may be so near that they count as one with it, or bound a short pulse.
        for reach in (whole / 2, min(change - before, after - change, whole) / 2):
            times = (change - reach, change, change + reach)
            if reach > TOGETHER * step.length and self._matters(step, times, reach):
                return change
        return None

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


@dataclass(frozen=True)
class _Bracket:
    """Function number `which` crosses 0 between two times, s."""

    which: int
    start: float
    end: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2


class _Search:
    """The switching functions of the state along one step.

    ends  the ends of the last two steps and the functions there; this step starts at the last
    marks fractions of the step, 0 and 1 included, between which it is smooth; none if all of it is
    """

    def __init__(
        self,
        switching: Switching,
        step: Step,
        ends: list[tuple[float, FloatArray]],
        marks: Sequence[float] = (),
    ) -> None:
        assert switching.of_state is not None
        self.step, self._function, self._marks = step, switching.of_state, marks
        self._left = MOST_EVALUATIONS + 2 * LAST * len(marks)
        known = bool(ends) and ends[-1][0] == step.start
        self._earlier = ends[0] if known and len(ends) > 1 else None
        self._timed = switching.timed
        self.start = ends[-1] if known else (step.start, self._value(step.start, step.first))
        self.end = step.end, self._value(step.end, step.last)
        angles = list(switching.angles)
        change = float(np.abs(step.last - step.first)[angles].max(initial=0.0))
        self._least_parts = change / LARGEST_ANGLE if math.isfinite(change) else 1.0

    def is_far(self) -> bool:
        """Whether all functions are so far from 0 that none crosses it in this step."""
        if self._earlier is None or self._least_parts > 1 or self._marks:
            return False
        (before, g), (start, a), (_, b) = self._earlier, self.start, self.end
        moved = np.abs(b - a) + np.abs(a - g) * (self.step.length / (start - before))
        if not (np.minimum(np.abs(a), np.abs(b)) >= FAR * moved).all():
            return False
        return not self._timed or self._is_slow(a)

    def _is_slow(self, a: FloatArray) -> bool:
        """Whether the functions change little within the step, too: a function that is periodic in
        time may have the same value at the ends of all steps.
        """
        step = self.step
        for share in IRREGULAR:
            t, y = step.start + share * step.length, step.first + share * (step.last - step.first)
            if not (np.abs(a) >= FAR * np.abs(self._value(t, y) - a)).all():
                return False
        return True

    def brackets(self) -> tuple[list[_Bracket], bool]:
        """Brackets of the zeros in the order of time, and whether the whole step was searched."""
        step, found = self.step, list[_Bracket]()
        if self._least_parts > MOST_EVALUATIONS / LAST:
            return found, False
        waiting = self._first_parts()
        while waiting:
            a, b, values, asked = waiting.pop()
            passing, unclear = _classified(values)
            ends = step.start + a * step.length, step.start + b * step.length
            if b - a <= SHORTEST_PART:
                passing, unclear = passing | (unclear & _changes(values)), np.zeros_like(unclear)
            if not unclear.any():
                found += [_Bracket(int(k), *ends) for k in asked[passing]]
                continue
            if self._left < 2 * (LAST - 1):
                return found, False
            # A function that crosses 0 is bracketed again in the halves, in order with the others.
            again, middle = unclear | passing, (a + b) / 2
            asked, values = asked[again], values[:, again]
            late = self._part(middle, b, values[2], values[4], asked)
            early = self._part(a, middle, values[0], values[2], asked)
            waiting += [(middle, b, late, asked), (a, middle, early, asked)]
        return found, True

    def _first_parts(self) -> list[_Part]:
        """The parts with which the search begins, the earliest last."""
        count = math.ceil(max(self._least_parts, 1.0))
        marks = np.linspace(0.0, 1.0, count + 1)
        if self._marks:
            marks = np.array(sorted({*marks.tolist(), *self._marks}))
            count = len(marks) - 1
        at_marks = [self.start[1], *self._at(marks[1:-1]), self.end[1]]
        asked = np.arange(len(self.start[1]))
        parts = []
        for i in reversed(range(count)):
            a, b = float(marks[i]), float(marks[i + 1])
            parts.append((a, b, self._part(a, b, at_marks[i], at_marks[i + 1], asked), asked))
        return parts

    def _part(
        self, a: float, b: float, start: FloatArray, end: FloatArray, asked: Indices
    ) -> FloatArray:
        """Values (5, n) of some functions over a part, from those at its ends."""
        within = self._at(a + (b - a) * INNER)
        return np.vstack((start, within[:, asked], end))

    def located(self, bracket: _Bracket) -> float:
        """The time at which a function crosses 0 in a bracket, s."""
        step = self.step

        def value(t: float) -> float:
            return float(self._at(np.array([(t - step.start) / step.length]))[0][bracket.which])

        first, last = value(bracket.start), value(bracket.end)
        if not first * last < 0:  # 0 at an end, or not finite
            return bracket.start if first == 0 else bracket.end
        ends = (first, last)
        return root(value, bracket.start, bracket.end, ends, xtol=LOCATED * step.length)

    def _at(self, shares: FloatArray) -> FloatArray:
        """Values (n, ns) of the functions at fractions (n,) of the step."""
        if not shares.size:
            return np.empty((0, len(self.end[1])))
        times = self.step.start + self.step.length * shares
        pairs = zip(times.tolist(), self.step.states(times), strict=True)
        return np.array([self._value(t, y) for t, y in pairs])

    def _value(self, t: float, y: FloatArray) -> FloatArray:
        """Values (ns,) of the functions at a time; nan if they cannot be evaluated."""
        self._left -= 1
        try:
            return self._function(t, y)
        except (ArithmeticError, ValueError):
            return np.full(len(self.start[1]), np.nan)


def _classified(values: FloatArray) -> tuple[Flags, Flags]:
    """Which functions with `values` (5, n) in a part are monotone there and cross 0, and which may
    be neither monotone nor free of zeros, (n,) each.

    The error of the interpolating polynomial is taken to be less than `rest`, twice the magnitude
    of its last two Chebyshev coefficients.
    """
    sums = FACTORS[:, :1] * values[0]
    for j in range(1, LAST + 1):  # in this order also in compiled steps, for the same bits
        sums += FACTORS[:, j : j + 1] * values[j]
    inner, ends = sums[:-2], np.abs(sums[-2:])
    rest = 2 * (ends[0] + ends[1])
    free = (inner > rest).all(axis=0) | (inner <= -rest).all(axis=0)
    steps = np.diff(inner, axis=0)
    monotone = (steps > rest).all(axis=0) | (steps < -rest).all(axis=0)
    passing = monotone & _changes(values) & ~free
    return passing, ~(free | monotone)


def _changes(values: FloatArray) -> Flags:
    """Whether the signs of functions differ at the ends of a part; 0 counts as negative."""
    return np.asarray((values[0] > 0) != (values[-1] > 0))
