"""Passing a change point: a position where the constraints of a mechanism lose rank for a moment.

There several branches of positions cross, as where all bars of a parallelogram are in line. The
branch on which the mechanism arrives is a smooth manifold, and so is its continuation with the same
velocity; restricted to it, the motion is smooth, although the matrix of the constraints is singular
at one point of it. So it is a polynomial over a short time around that point, which is found by
collocation at Gauss's points (Hairer, Wanner, Solving ODEs II, IV.5): these keep away from the
middle, and the derivative is evaluated only where the constraints are independent, at states that
are put on the constraints near the polynomial.

That the motion goes through, and how, is checked and not assumed: the polynomial must meet the
constraints everywhere, also in the middle, where no condition made it do so. It does not where two
branches pass each other at a distance, where the mechanism comes to rest, or where the branch has a
corner.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from eomgen.run.failure import StepFailure
from eomgen.run.margins import rank_margin
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Projection

STAGES = 12
"""Gauss's points; an even number, so that none is in the middle."""
PARTS = 8
"""Most polynomials, one after the other, of which the last one leads through the change point."""
MOST, SETTLED = 40, 1e-14
"""Most iterations, and a change relative to the motion after which they end."""
SMOOTH, MET = 1e-10, 1e-11
"""The largest contribution of the last power to positions, relative to the change of the state; the
largest residual of the polynomial, in sizes."""
SAFE, AWAY = 1e-3, 0.3
"""A margin of the rank from which on steps keep their digits; and the least behind a change point,
in parts of that before it: where it is less, another one may follow."""
ZERO, NARROW = 1e-5, 1e-7
"""A margin of the rank that is 0 at the change point, which is found within this part of a
polynomial."""
LOOK, FALLS, WITHIN = 0.05, 0.5, 65
"""How far ahead the change point is looked for, in times to it; the part of the margin that may be
left at 0.8 of the way; and the number of times at which the polynomial is checked."""
_LENGTHS = np.array([2.0, 3.4, 1.5, 0.6, 0.3])
"""Lengths that are tried, in times to the change point, or to a time beyond it: the points of the
first two keep away from it."""


@dataclass(frozen=True)
class Part:
    """A part of a motion: its end, s, the state there, the state (ny,) at any time in it, and the
    time of a change point that it goes through; None if there is none.
    """

    end: float
    y: FloatArray
    within: Callable[[float], FloatArray]
    at: float | None


@dataclass(frozen=True)
class Crossing:
    """A motion through a change point at about the time `at`, s, in parts."""

    at: float
    parts: Sequence[Part]

    @property
    def end(self) -> float:
        """Its end, s."""
        return self.parts[-1].end

    def within(self, t: float) -> FloatArray:
        """The state (ny,) at a time in it."""
        part = next((part for part in self.parts if t <= part.end), self.parts[-1])
        return part.y if t == part.end else part.within(t)


def distance(held: Projection, t: float, y: FloatArray) -> float:
    """The margin of the rank of the constraints."""
    return rank_margin(held.scaled_jacobian(t, y))


def crossing(
    problem: Problem,
    t: float,
    y: FloatArray,
    until: float | None = None,
    t_end: float = np.inf,
) -> Crossing | None:
    """The motion from a state on the constraints through the change point ahead, or before the time
    `until` if that is given; None if there is none, or if the motion through it is not determined.
    None is looked for beyond `t_end`: where a motion is nearly at rest, it would be far ahead.
    """
    parts: list[Part] = []
    try:
        with np.errstate(all="ignore"):
            while len(parts) < PARTS:
                if not t + _look(problem, t, y) < t_end:
                    return None
                motion = _motion(problem, t, y)
                ahead = _ahead(problem, t, y, motion)
                if ahead is None and until is None:
                    return None
                lengths = _LENGTHS * (until - t if ahead is None else ahead)  # type: ignore[operator]
                tried = (_collocated(problem, t, y, motion, length) for length in lengths.tolist())
                part = next(filter(None, tried), None)
                if part is None:
                    return None
                parts.append(part)
                if part.at is not None:
                    return Crossing(part.at, parts)
                t, y = part.end, part.y
                if until is not None and t >= until:
                    return None
    except (StepFailure, ArithmeticError, ValueError):
        pass
    return None


@dataclass(frozen=True)
class _Motion:
    """A motion to third order, by the derivative of the state (ny,), and its rate."""

    slope: FloatArray
    second: FloatArray

    def states(self, y: FloatArray, nq: int, times: FloatArray) -> FloatArray:
        """(n, ny) at times (n,) from now on."""
        s = times[:, np.newaxis]
        moved = s * (self.slope + s / 2 * self.second)
        if not len(self.slope) < 2 * nq:  # quaternions have no acceleration of their own
            moved[:, :nq] += s**3 / 6 * self.second[nq : 2 * nq]
        return y + moved


def _look(problem: Problem, t: float, y: FloatArray) -> float:
    """A small part of the time in which the change point can be reached at the least, s."""
    held = _held(problem)
    fastest = float(np.abs(problem.derivative(t, y)[: held.coordinates]).max())
    return LOOK * distance(held, t, y) / fastest if fastest else np.inf


def _motion(problem: Problem, t: float, y: FloatArray) -> _Motion:
    """The motion from a state on, by a difference over a small part of the way."""
    slope, look = problem.derivative(t, y), _look(problem, t, y)
    after = problem.projected(t + look, y + look * slope)
    return _Motion(slope, (problem.derivative(t + look, after) - slope) / look)


def _held(problem: Problem) -> Projection:
    assert problem.projection is not None
    return problem.projection


def _ahead(problem: Problem, t: float, y: FloatArray, motion: _Motion) -> float | None:
    """The time until the margin of the rank comes to 0; None if it does not fall straight to it."""
    held = _held(problem)

    def margin(at: float) -> float:
        state = motion.states(y, held.coordinates, np.array([at]))[0]
        return distance(held, t + at, problem.projected(t + at, state))

    before = distance(held, t, y)
    at, last = LOOK * before / float(np.abs(motion.slope[: held.coordinates]).max()), 0.0
    for left in (1.0, FALLS, FALLS):
        now = margin(at)
        if not now < left * before:
            return None
        zero = at + now * (at - last) / (before - now)
        at, last, before = at + 0.8 * (zero - at), at, now
    return zero


def _change_point(
    held: Projection, within: Callable[[float], FloatArray], a: float, b: float
) -> float | None:
    """The time of a change point between two times, by golden section; None if there is none."""
    ratio, narrow = (5**0.5 - 1) / 2, NARROW * (b - a)
    while b - a > narrow:
        c, d = b - ratio * (b - a), a + ratio * (b - a)
        at_c, at_d = (distance(held, at, within(at)) for at in (c, d))
        a, b = (a, d) if at_c < at_d else (c, b)
    at = (a + b) / 2
    return at if distance(held, at, within(at)) < ZERO else None


def _collocated(
    problem: Problem, t: float, y: FloatArray, motion: _Motion, length: float
) -> Part | None:
    """The motion over a time `length`; None if it is not smooth, or off the constraints."""
    held, times = _held(problem), (t + length * _NODES).tolist()
    states = motion.states(y, held.coordinates, length * _NODES)
    slopes, change = np.empty_like(states), np.inf
    for _ in range(MOST):
        for i, time in enumerate(times):
            slopes[i] = problem.derivative(time, problem.projected(time, states[i]))
        moved = y + length * _TO_NODES @ slopes
        last, change = change, float(np.abs(moved - states).max())
        states, size = moved, float(np.abs(moved - y).max())
        if not np.isfinite(change):
            return None
        if change <= SETTLED * size or change >= last:
            break
    # Accelerations have lost digits, but across the constraints only, where velocities are put on
    # them: those at the points have not.
    nq, coefficients = held.coordinates, _COEFFICIENTS @ slopes
    if not length * np.abs(coefficients[-1, :nq]).max() <= SMOOTH * size:
        return None
    integrals = legendre.legint(coefficients, lbnd=-1, axis=0) * (length / 2)

    def within(time: float) -> FloatArray:
        x = 2 * (time - t) / length - 1
        state = y + legendre.legval(x, integrals)
        if not held.quaternions:
            state[nq : 2 * nq] = legendre.legval(x, coefficients[:, :nq])
        return np.asarray(state)

    for time in np.linspace(t, t + length, WITHIN).tolist():
        if not np.abs(held.residuals(time, within(time)) / held.sizes).max() <= MET:
            return None
    end = problem.projected(t + length, y + legendre.legval(1.0, integrals))
    margins = [distance(held, *pair) for pair in zip(times, states, strict=True)]
    at = _change_point(held, within, t, t + length)
    least = SAFE if at is None else AWAY * distance(held, t, y)
    if min(margins) < SAFE / 10 or distance(held, t + length, end) < least:
        return None
    return Part(t + length, end, within, at)


_POINTS, _WEIGHTS = legendre.leggauss(STAGES)
_NODES = (_POINTS + 1) / 2
"""Gauss's points as fractions of the time."""
_COEFFICIENTS = (
    (np.arange(STAGES)[:, np.newaxis] + 0.5) * legendre.legvander(_POINTS, STAGES - 1).T * _WEIGHTS
)
"""(n, n): from values at the points, the coefficients of Legendre's polynomials."""
_TO_NODES = legendre.legvander(_POINTS, STAGES) @ (
    legendre.legint(_COEFFICIENTS, lbnd=-1, axis=0) / 2
)
"""(n, n): from slopes at the points, the changes up to each of them in a time of 1."""
