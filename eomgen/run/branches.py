"""Whether a step of an adaptive method has passed over a branch of the derivative.

A method sees the derivative at a few moments of a step. A contact that is touched and left between
them, a stop, or a pulse in time leaves no trace in its error estimate, however long the step. The
switching functions g(t, y) of a problem tell: the derivative is smooth as long as none of them
passes 0. Along a step they are functions of time, known from the method's dense output. On parts of
the step they are interpolated by polynomials of degree 4, whose Bernstein coefficients enclose
them (Farouki, The Bernstein polynomial basis, Computer Aided Geometric Design 29 (2012), 379). A
part is halved until each function is free of zeros there, or monotone. Those of time alone are
enclosed by interval arithmetic instead.

A step passes over a branch if two changes of branch lie in it, and the derivative between them is
another than before and after by more than the tolerance allows. Such a step is made again, up to
the middle between the two, where the method then sees that branch. A method that does not see what
lies near the ends of a step is made to end its steps at the changes themselves.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from eomgen.run.problem import FloatArray, Problem, Switching
from eomgen.run.schedule import Schedule

MOST_EVALUATIONS = 200
"""Of the switching functions in one step; a step that takes more is held to the longest that may be
taken unseen."""
SHORTEST_PART = 2.0**-20
"""Of a step: parts are not halved further."""
TURN = 1.0
"""Most that an angle may change in a part, rad: what turns fast is seen at every turn."""
FAR = 4.0
"""A function so many times farther from 0 than it has moved in the last two steps does not pass it
within them."""
ODD = (0.3819660112501051, 0.7548776662466927)
"""Shares of a step of which no small multiples are whole numbers."""
TOGETHER = 1e-9
"""Of a step: changes of branch that are no farther apart count as one."""
INSIDE = 1 / 8
"""Of the time between two changes of branch: a step that ends later than that after the first has
seen the branch between them."""

_LAST = 4
"""Degree of the polynomials."""
_AT = (1 - np.cos(np.pi * np.arange(_LAST + 1) / _LAST)) / 2
"""Where in a part the functions are evaluated, 0 to 1: Chebyshev's points, both ends among them."""
_TO_BERNSTEIN = np.linalg.inv(
    np.array([[math.comb(_LAST, i) * x**i * (1 - x) ** (_LAST - i) for i in range(5)] for x in _AT])
)
_TO_CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * _AT - 1, _LAST))

States = Callable[[Any], FloatArray]
"""The states (n, ny) at times (n,) within a step, or that (ny,) at a single one."""
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
_Part = tuple[float, float, FloatArray, Indices]
"""From which share of a step to which; values (5, n) of functions there, and their numbers (n,)."""


@dataclass(frozen=True)
class Made:
    """A step that was made: from `start` to `end`, s, the states there, and those between."""

    start: float
    end: float
    first: FloatArray
    last: FloatArray
    states: States

    @property
    def length(self) -> float:
        """In s."""
        return self.end - self.start


@dataclass(frozen=True)
class Again:
    """A step is to be made again, up to the time `until` only, s.

    seen  whether it is for a branch that was passed over; else the switching functions could not
          be followed along so long a step
    """

    until: float
    seen: bool


@dataclass
class Lookout:
    """Looks at the steps of a run, one after another.

    switching  of the problem
    allowed    of a state (ny,): what a step may be off, (ny,)
    unseen     the longest step, s, that may be taken where the functions cannot be followed
    sees_end   whether the method's error estimate sees the derivative at the end of a step
    turned     when the last change of branch was, s
    """

    problem: Problem
    switching: Switching
    allowed: Callable[[FloatArray], FloatArray]
    unseen: float
    sees_end: bool = True
    turned: float = -math.inf
    _ends: list[tuple[float, FloatArray]] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        of_time = self.switching.of_time
        self._schedule = Schedule(of_time) if of_time else None

    @property
    def memory(self) -> dict[str, Any]:
        """What the looks at the next steps go on from: numbers and arrays by name."""
        checked = [[t, *values] for t, values in self._ends] or np.empty((0, 0))
        return {"turned": self.turned, "checked": np.array(checked)}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        self.turned = float(memory["turned"])
        self._ends = [(float(row[0]), np.array(row[1:])) for row in memory["checked"]]

    def look(self, made: Made) -> Again | None:
        """Whether a step is to be made again; None if it is good.

        Steps are to be given in order; one that is to be made again counts as not given.
        """
        search = _Search(self.switching, made, self._ends) if self.switching.of_state else None
        times, whole = self._times(search, made)
        turned = self.turned
        for i, after in enumerate(times):
            if self.sees_end:
                until = self._cut(made, turned, after)
            else:
                until = self._end(made, turned, after, [*times, made.end][i + 1])
            if until is not None:
                return Again(until, seen=True)
            turned = max(turned, after)
        if not whole and made.length > self.unseen * (1 + TOGETHER):
            return Again(made.start + self.unseen, seen=False)
        self.turned = turned
        if search:
            self._ends = [search.start, search.end]
        return None

    def _times(self, search: "_Search | None", made: Made) -> tuple[list[float], bool]:
        """When branches change in a step, in order, and whether these are all: exactly, if more
        than one has to be known.
        """
        times, whole = list[float](), True
        if self._schedule:
            times, whole = self._schedule.changes(made.start, made.end)
        if search is None or search.is_far():
            return times, whole
        brackets, followed = search.brackets()
        if brackets:
            last = max(bracket.end for bracket in brackets)
            alone = len(brackets) + len(times) == 1 and _is_seen(self.turned, made.start, last)
            times = sorted([*times, *(b.middle if alone else search.root(b) for b in brackets)])
        return times, whole and followed

    def _cut(self, made: Made, before: float, after: float) -> float | None:
        """Where a step is to end that has two changes of branch in a row; None if it may pass."""
        gap = after - before
        if not TOGETHER * made.length < gap < math.inf:
            return None
        if before < made.start and _is_seen(before, made.start, after):
            return None
        middle = before + gap / 2
        if not made.start + TOGETHER * made.length < middle < made.end:
            return None
        aside = gap / 8
        times = (max(made.start, before - aside), middle, min(made.end, after + aside))
        return middle if self._matters(made, times, gap) else None

    def _end(self, made: Made, before: float, change: float, after: float) -> float | None:
        """The time of a change of branch between others, if a step is to end there; None if it
        need not.
        """
        whole = min(change - made.start, made.end - change)
        # Others may lie so near that it is one change, or bound a pulse that is over soon.
        for reach in (whole / 2, min(change - before, after - change, whole) / 2):
            times = (change - reach, change, change + reach)
            if reach > TOGETHER * made.length and self._matters(made, times, reach):
                return change
        return None

    def _matters(self, made: Made, times: tuple[float, float, float], length: float) -> bool:
        """Whether the derivative at the second of three times, times a length, s, is another than
        half way between those at the others by more than is allowed.
        """
        states = made.states(np.array(times))
        try:
            slopes = [self.problem.derivative(t, y) for t, y in zip(times, states, strict=True)]
        except (ArithmeticError, ValueError):
            return True
        missed = np.abs(slopes[1] - (slopes[0] + slopes[2]) / 2) * length
        return not bool((missed <= self.allowed(states[1])).all())


def _is_seen(before: float, between: float, after: float) -> bool:
    """Whether a step that ends `between` two changes of branch has seen what lies there."""
    return before == -math.inf or between >= before + INSIDE * (after - before)


@dataclass(frozen=True)
class _Bracket:
    """Function number `which` passes 0 between two times, s."""

    which: int
    start: float
    end: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2


class _Search:
    """The switching functions of the state along one step.

    ends  the last steps' ends and the functions there, the one that this step starts at the last
    """

    def __init__(
        self, switching: Switching, made: Made, ends: list[tuple[float, FloatArray]]
    ) -> None:
        assert switching.of_state is not None
        self.made, self._function, self._left = made, switching.of_state, MOST_EVALUATIONS
        known = bool(ends) and ends[-1][0] == made.start
        self._earlier = ends[0] if known and len(ends) > 1 else None
        self._timed = switching.timed
        self.start = ends[-1] if known else (made.start, self._value(made.start, made.first))
        self.end = made.end, self._value(made.end, made.last)
        angles = list(switching.angles)
        turned = float(np.abs(made.last - made.first)[angles].max(initial=0.0))
        self._turns = turned / TURN if math.isfinite(turned) else 1.0

    def is_far(self) -> bool:
        """Whether all functions are that far from 0, so that none passes it in this step."""
        if self._earlier is None or self._turns > 1:
            return False
        (before, g), (start, a), (_, b) = self._earlier, self.start, self.end
        moved = np.abs(b - a) + np.abs(a - g) * (self.made.length / (start - before))
        if not (np.minimum(np.abs(a), np.abs(b)) >= FAR * moved).all():
            return False
        return not self._timed or self._is_quiet(a)

    def _is_quiet(self, a: FloatArray) -> bool:
        """Whether time alone does not move the functions much within the step: what is periodic
        may be the same at all ends of steps.
        """
        made = self.made
        for share in ODD:
            t, y = made.start + share * made.length, made.first + share * (made.last - made.first)
            if not (np.abs(a) >= FAR * np.abs(self._value(t, y) - a)).all():
                return False
        return True

    def brackets(self) -> tuple[list[_Bracket], bool]:
        """Where functions pass 0, from early to late, and whether the whole step was looked at."""
        made, found = self.made, list[_Bracket]()
        if self._turns > MOST_EVALUATIONS / _LAST:
            return found, False
        waiting = self._first_parts()
        while waiting:
            a, b, values, asked = waiting.pop()
            passing, unclear = _judged(values)
            ends = made.start + a * made.length, made.start + b * made.length
            if b - a <= SHORTEST_PART:
                passing, unclear = passing | (unclear & _changes(values)), np.zeros_like(unclear)
            if not unclear.any():
                found += [_Bracket(int(k), *ends) for k in asked[passing]]
                continue
            if self._left < 2 * (_LAST - 1):
                return found, False
            # A function that passes 0 is asked for again in the halves, to be in order with others.
            again, middle = unclear | passing, (a + b) / 2
            asked, values = asked[again], values[:, again]
            late = self._part(middle, b, values[2], values[4], asked)
            early = self._part(a, middle, values[0], values[2], asked)
            waiting += [(middle, b, late, asked), (a, middle, early, asked)]
        return found, True

    def _first_parts(self) -> list[_Part]:
        """The parts that a step is looked at in first, the earliest last."""
        count = math.ceil(max(self._turns, 1.0))
        marks = np.linspace(0.0, 1.0, count + 1)
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
        within = self._at(a + (b - a) * _AT[1:-1])
        return np.vstack((start, within[:, asked], end))

    def root(self, bracket: _Bracket) -> float:
        """When a function passes 0 in a bracket, s."""
        made = self.made

        def value(t: float) -> float:
            return float(self._at(np.array([(t - made.start) / made.length]))[0][bracket.which])

        first, last = value(bracket.start), value(bracket.end)
        if not first * last < 0:  # 0 at an end, or not finite
            return bracket.start if first == 0 else bracket.end
        return float(brentq(value, bracket.start, bracket.end, xtol=1e-12 * made.length))

    def _at(self, shares: FloatArray) -> FloatArray:
        """Values (n, ns) at shares (n,) of the step."""
        if not shares.size:
            return np.empty((0, len(self.end[1])))
        times = self.made.start + self.made.length * shares
        pairs = zip(times.tolist(), self.made.states(times), strict=True)
        return np.array([self._value(t, y) for t, y in pairs])

    def _value(self, t: float, y: FloatArray) -> FloatArray:
        """Values (ns,) at a time; nan where they have none."""
        self._left -= 1
        try:
            return self._function(t, y)
        except (ArithmeticError, ValueError):
            return np.full(len(self.start[1]), np.nan)


def _judged(values: FloatArray) -> tuple[Flags, Flags]:
    """Of functions with `values` (5, n) in a part: those (n,) that are monotone there and pass 0,
    and those that are neither monotone nor free of zeros, as far as can be told.

    What the polynomial through the values may be off is taken to be less than `rest`, twice the
    size of its last two coefficients.
    """
    inner = _TO_BERNSTEIN @ values
    rest = 2 * np.abs((_TO_CHEBYSHEV @ values)[-2:]).sum(axis=0)
    free = (inner > rest).all(axis=0) | (inner <= -rest).all(axis=0)
    steps = np.diff(inner, axis=0)
    monotone = (steps > rest).all(axis=0) | (steps < -rest).all(axis=0)
    passing = monotone & _changes(values) & ~free
    return passing, ~(free | monotone)


def _changes(values: FloatArray) -> Flags:
    """Whether functions have another sign at the end of a part; 0 counts as negative."""
    return np.asarray((values[0] > 0) != (values[-1] > 0))
