"""Where switching functions of the state cross 0 in a step.

Along a step these are functions of time, known from the method's dense output. On parts of the step
they are interpolated by polynomials, which enclose them (`enclosing`). A part is halved until each
function is monotone or has no zero there.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.run.enclosing import FACTORS, INNER, LAST
from eomgen.run.problem import FloatArray, Switching
from eomgen.run.roots import root

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
class Bracket:
    """Function number `which` crosses 0 between two times, s."""

    which: int
    start: float
    end: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2


class Crossings:
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

    def brackets(self) -> tuple[list[Bracket], bool]:
        """Brackets of the zeros in the order of time, and whether the whole step was searched."""
        step, found = self.step, list[Bracket]()
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
                found += [Bracket(int(k), *ends) for k in asked[passing]]
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

    def located(self, bracket: Bracket) -> float:
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
