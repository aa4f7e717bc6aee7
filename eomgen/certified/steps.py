"""One proven step: from a set that holds the state to one that holds it later.

The set is c + A e: an exact centre c, a matrix A, and a box e about 0, which holds what is not
known. If c goes to φ(c), each state of the set goes to φ(c) + S A e with S the derivative of the
flow by its start, over the set (Lohner 1987).
"""

import math
from dataclasses import dataclass

from eomgen.certified.balls import (
    SHORT,
    Ball,
    Balls,
    Matrix,
    about_zero,
    ball,
    column,
    exact_difference,
    exact_sum,
    matrix,
    middle,
    precision,
    size,
    span,
)
from eomgen.certified.recursion import Fixed, Motion, Series

LOWS = (8, 30)
"""Least and greatest order of the enclosure of a whole step and of the derivative by the start."""
TIGHT, SLACK = 1e-6, 1e-4
"""What is left of the derivative beyond this order, relative to it: with less than the first a
lower order serves the next step, with more than the second a higher one.
"""
TRIES = 4
"""Of the enclosure of a step of one length."""
LEAST = 2.0**-30
"""Least step, s."""


@dataclass(frozen=True, eq=False)
class Spread:
    """The set A e: a matrix of exact numbers, (n, n), and a box that holds 0, (n,)."""

    axes: Matrix
    box: Balls

    def __post_init__(self) -> None:
        assert all(x.contains(0) for x in self.box)

    def hull(self) -> Balls:
        """The least box with sides along the axes of the state that holds it."""
        return _entries(self.axes * column(self.box))


@dataclass(frozen=True, eq=False)
class Step:
    """A step from a time, t, over h: coefficients from which states in between can be enclosed.
    Times are exact.

    centre   of the solution from the centre, (n, order)
    rest     ball of the coefficient at `order` over the step, (n,)
    slopes   of the derivative by the start, matrices (n, n)
    last     ball of the next one over the step
    spread   the set at its start
    """

    t: Ball
    h: Ball
    centre: Series
    rest: Balls
    slopes: list[Matrix]
    last: Matrix
    spread: Spread
    bits: int

    @property
    def until(self) -> Ball:
        """The time at its end."""
        return exact_sum(self.t, self.h)

    def box(self, time: float) -> Balls:
        """A box that holds the state at a time of the step."""
        state, slope = self._at(exact_difference(ball(time), self.t))
        with precision(SHORT):
            spread = _entries(slope * self.spread.axes * column(self.spread.box))
        with precision(self.bits):
            return [a + b for a, b in zip(state, spread, strict=True)]

    def end(self) -> tuple[Balls, Spread]:
        """The centre and the spread at the end."""
        state, slope = self._at(self.h)
        with precision(self.bits):
            centre = [middle(x) for x in state]
            rest = [x - c for x, c in zip(state, centre, strict=True)]
        with precision(SHORT):
            return centre, _turned(slope * self.spread.axes, self.spread.box, rest)

    def left(self) -> float:
        """The last term of the derivative by the start at the end, relative to the whole."""
        with precision(SHORT):
            last = max(size(x) for x in _entries(self.last * self.h ** len(self.slopes)))
            return last / max(size(x) for x in _entries(self._at(self.h)[1]))

    def _at(self, tau: Ball) -> tuple[Balls, Matrix]:
        """The state that the centre goes to, and the derivative by the start, after a time."""
        with precision(self.bits):
            state = [
                _polynomial(c, tau) + r * tau ** len(c)
                for c, r in zip(self.centre, self.rest, strict=True)
            ]
        with precision(SHORT):
            slope = self.last
            for each in reversed(self.slopes):
                slope = each + slope * tau
        return state, slope


@dataclass(frozen=True)
class Pace:
    """The length of a step, s, and the order of its enclosure and its derivative by the start."""

    h: float
    low: int = LOWS[0]


@dataclass(frozen=True)
class Plan:
    """How accurately steps are made: sum of all remainders, bits of balls, order of the series."""

    tolerance: float
    bits: int
    order: int


def step_from(
    motion: Motion, fixed: Fixed, place: tuple[Ball, Balls, Spread], pace: Pace, plan: Plan
) -> tuple[Step | None, Pace]:
    """A step of about `pace` from an exact time, a centre and a spread, whose remainder is at most
    the plan's tolerance, and the pace of the next; None if there is none of at least `LEAST`.
    """
    t, centre, spread = place
    h, tolerance, order = pace.h, plan.tolerance, plan.order
    with precision(SHORT):
        start = [c + x for c, x in zip(centre, spread.hull(), strict=True)]
        low, series = motion.series(fixed, t, start, pace.low)
    while h >= LEAST:
        times = span(t, exact_sum(t, ball(h)))
        with precision(SHORT):
            held = _enclosure(motion, fixed, times, low, ball(h))
            if held is None:
                h *= 0.6
                continue
            whole, inside = motion.series(fixed, times, held, order)
            rest = [x[order] for x in whole]
            worst = max(size(x * ball(h) ** order) for x in rest)
        if worst > tolerance:
            fits = 0.9 * (tolerance / worst) ** (1 / order) if worst < math.inf else 0.5
            h *= max(0.4, min(0.9, fits))
            continue
        with precision(SHORT):
            slopes, last = _slopes(motion, fixed, series, inside, ball(h), pace.low)
        with precision(plan.bits):
            first, _ = motion.series(fixed, t, centre, order - 1)
        grown = min(1.5, 0.95 * (tolerance / max(worst, 1e-300)) ** (1 / order))
        step = Step(t, ball(h), first, rest, slopes, last, spread, plan.bits)
        return step, Pace(h * grown, min(_next_low(pace.low, step.left()), order))
    return None, pace


def _next_low(low: int, left: float) -> int:
    """The order with which the next step's derivative by the start is tight."""
    change = 2 * (left > SLACK) - (left < TIGHT)
    return min(max(low + change, LOWS[0]), LOWS[1])


def _enclosure(motion: Motion, fixed: Fixed, times: Ball, low: Series, h: Ball) -> Balls | None:
    """A box that holds the solution from each state of a set over a whole step, by the coefficients
    over the set; None if none was found. If u(τ) + τ^m y_m(B) lies in B for all τ of the step,
    with u the polynomial up to τ^(m-1), then B is one (Nedialkov et al. 1999, section 5).
    """
    low_order = len(low[0]) - 1
    over = span(ball(0.0), h)
    power = over**low_order
    known = [_polynomial(c[:-1], over) for c in low]
    guess = [about_zero(c[-1] * h**low_order * 4 + ball(0.0, 1e-300)) for c in low]
    for _ in range(TRIES):
        box = [a + b for a, b in zip(known, guess, strict=True)]
        reached, _ = motion.series(fixed, times, box, low_order)
        rests = [power * c[-1] for c in reached]
        if not all(x.is_finite() for x in rests):
            return None
        if all(g.contains(x) for g, x in zip(guess, rests, strict=True)):
            return [a + b for a, b in zip(known, rests, strict=True)]
        guess = [about_zero(x * 2) for x in rests]
    return None


def _slopes(
    motion: Motion, fixed: Fixed, series: Series, inside: Series, h: Ball, low: int
) -> tuple[list[Matrix], Matrix]:
    """Coefficients 0 to low - 1 of the derivative S of the flow by its start, over the set, and an
    enclosure of the next over the step: of S' = J S it is Ψ(y(τ)) S(τ), with Ψ the coefficient of a
    solution from I, and |S - I| ≤ exp(|J| h) - 1.
    """
    n = len(motion.names)
    directions = [[ball(float(i == j)) for i in range(n)] for j in range(n)]
    here = [motion.change(fixed, series, d, low - 1) for d in directions]
    there = [motion.change(fixed, inside, d, low) for d in directions]

    def coefficient(k: int, found: list[Series]) -> Matrix:
        return matrix([[found[j][i][k] for j in range(n)] for i in range(n)])

    first = coefficient(1, there)
    rows = (sum(abs(first[i, j]).upper() for j in range(n)) for i in range(n))
    norm = max(size(x) for x in rows)
    grown = about_zero((ball(norm) * h).exp() - 1)
    reached = matrix([[grown + float(i == j) for j in range(n)] for i in range(n)])
    return [coefficient(k, here) for k in range(low)], coefficient(low, there) * reached


def _turned(product: Matrix, box: Balls, rest: Balls) -> Spread:
    """A set Q e that holds {product} box + rest, with Q nearly orthogonal: Lohner's QR against
    wrapping. Columns that matter most come first.
    """
    n = len(box)
    middles = [[float(middle(product[i, j])) for j in range(n)] for i in range(n)]
    lengths = [math.hypot(*(row[j] for row in middles)) * size(box[j]) for j in range(n)]
    order = sorted(range(n), key=lambda j: -lengths[j])
    axes = matrix([[ball(x) for x in row] for row in _orthogonal(middles, order)])
    inverse = axes.inv()
    turned = (inverse * product) * column(box) + inverse * column(rest)
    return Spread(axes, _entries(turned))


def _orthogonal(columns: list[list[float]], order: list[int]) -> list[list[float]]:
    """Directions of the columns in this order, made orthogonal by Gram and Schmidt, twice; nothing
    depends on how well.
    """
    n, found = len(columns), list[list[float]]()
    for j in order:
        vector = [row[j] for row in columns]
        for _ in range(2):
            for other in found:
                along = sum(a * b for a, b in zip(vector, other, strict=True))
                vector = [a - along * b for a, b in zip(vector, other, strict=True)]
            length = math.hypot(*vector)
            vector = [a / length for a in vector]
        found.append(vector)
    return [[found[j][i] for j in range(n)] for i in range(n)]


def _polynomial(coefficients: Balls, x: Ball) -> Ball:
    """Its value by Horner's rule."""
    found = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        found = found * x + c
    return found


def _entries(vector: Matrix) -> Balls:
    return list(vector.entries())
