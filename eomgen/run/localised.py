"""Detection of what a step may have passed over although its derivative is smooth: a narrow pulse,
a bump in a field, a hard ball that is met for a moment.

An error estimate knows the derivative at a few points of a step. Between them only a localising
function (`program.localising`) can change it much: one whose argument, though smooth, ranges over
many of the function's own widths. Arguments of the state are enclosed along the step as switching
functions are (`branches`), those of time alone by interval arithmetic. Parts of a step are halved
until each function is tame there, or negligible. So narrow parts lie where a function is localised,
and there the derivative is compared with that of the step's own interpolant.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.enclosing import AT, FACTORS, INNER
from eomgen.run.intervals import Interval

NARROW = 1 / 8
"""Fraction of a step below which a part is narrow: methods evaluate wider ones."""
SHORTEST = 2.0**-40
"""Fraction of a step below which parts are not halved."""
MOST_PARTS = 400
"""Most parts of a step that are looked at; a step that needs more is limited in length."""
NOTHING, FAR = -69.0, 19.0
"""Arguments below which exp is negligible, and beyond which tanh is 1 or -1 in doubles."""
NO_ROOT = 1e-24
"""Arguments of roots and divisors below this part of their greatest so far are negligible, and
absolutely those below the square of `NO_ROOT`."""
RATIO = 64.0
"""Roots, logarithms and quotients are tame if arguments have no greater ratio than this."""
PEAK = 0.1
"""A function whose flank ends where a step was cut is looked at again if it goes beyond its values
at both ends of the flank by this part of its range."""
FREE = 10.0
"""A defect matters if its effect is more than this many times the error allowed in a step."""
DEGREE = 8
"""Degree of the polynomial by which an interpolant is differentiated."""
_NODES = (1 - np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)) / 2
_FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * _NODES - 1, DEGREE))

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]


def _by_ratio(low: FloatArray, high: FloatArray) -> Flags:
    return (low > 0) & (high <= RATIO * low) | (high < 0) & (low >= RATIO * high)


TAME: dict[str, Callable[[FloatArray, FloatArray], Flags]] = {
    "exp": lambda low, high: (high - low <= 3) | (high < NOTHING),
    "tanh": lambda low, high: (high - low <= 2) | (low > FAR) | (high < -FAR),
    "atan": lambda low, high: (high - low <= 2) | _by_ratio(low, high),
    "log": _by_ratio,
    "sqrt": _by_ratio,
    "div": _by_ratio,
    "sin": lambda low, high: high - low <= 2,
    "cos": lambda low, high: high - low <= 2,
}
"""Whether polynomials follow a function while its argument is between two bounds."""
VALUES: dict[str, Callable[[FloatArray], FloatArray]] = {
    **{name: getattr(np, name) for name in ("exp", "tanh", "log", "sqrt")},
    "atan": np.arctan,
    "div": lambda x: 1 / x,
}


@dataclass(frozen=True, eq=False)
class Localised:
    """The localising functions of a derivative.

    kinds      (n,), their names; the last ones have arguments that depend on time alone
    arguments  (t (m,), y (m, ny)) -> (m, n)
    timed      number of those that depend on time alone
    over       these as functions of an interval of time
    """

    kinds: tuple[str, ...]
    arguments: Callable[[FloatArray, FloatArray], FloatArray]
    timed: int
    over: Callable[[Interval], Sequence[Interval]]


@dataclass(frozen=True, eq=False)
class Scrutiny:
    """What is checked in a run whose error is estimated, beside what is checked in all runs.

    localised  the localising functions of its derivative; None if it has none
    seed       given to round each step at random, from this seed
    """

    localised: Localised | None = None
    seed: int | None = None


@dataclass(frozen=True)
class Smooth:
    """A step from `start` to `end`, s, and the states (m, ny) at times (m,) within."""

    start: float
    end: float
    states: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Part:
    """A part of a step: start and end as fractions, arguments (5, n), and the functions (n,) that
    were not tame on twice its length.
    """

    a: float
    b: float
    arguments: FloatArray
    blamed: Flags


@dataclass
class Features:
    """What the localising functions of a run do along its steps.

    greatest  (n,), the greatest magnitude of each argument so far
    """

    localised: Localised
    greatest: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.greatest = np.zeros(len(self.localised.kinds))
        kinds = self.localised.kinds
        self._columns = {
            kind: np.array([i for i, other in enumerate(kinds) if other == kind]) for kind in kinds
        }

    def tame(self, values: FloatArray, times: Sequence[tuple[float, float]]) -> Flags:
        """Which functions are tame in parts of a run (m, n), from their arguments (5, m, n) at the
        Chebyshev points of each, and the bounds of each, s.
        """
        sums = np.tensordot(FACTORS, values, 1)
        inner, ends = sums[:-2], np.abs(sums[-2:])
        rest = 2 * (ends[0] + ends[1])
        low, high = inner.min(axis=0) - rest, inner.max(axis=0) + rest
        for k, (start, end) in enumerate(times):
            for i, bound in enumerate(self.localised.over(Interval(start, end))):
                last = i - self.localised.timed
                low[k, last], high[k, last] = bound.low, bound.high
        self.greatest = np.fmax(self.greatest, np.abs(values).max(axis=(0, 1)))
        found: Flags = np.isnan(low) | np.isnan(high)
        for kind, at in self._columns.items():
            found[:, at] |= TAME[kind](low[:, at], high[:, at])
            if kind in ("sqrt", "div"):
                size = np.fmax(np.abs(low[:, at]), np.abs(high[:, at]))
                found[:, at] |= size <= NO_ROOT * np.fmax(self.greatest[at], NO_ROOT)
        return found

    def tame_between(self, t: FloatArray, y: FloatArray, slopes: FloatArray) -> bool:
        """Whether all functions are tame in all steps that end at the times t (m + 1,) after the
        first, from the states and their derivatives (m + 1, ny) there.
        """
        length = np.diff(t)[:, None]
        early, late = length * slopes[:-1], length * slopes[1:]
        states = [_hermite(y[:-1], y[1:], early, late, share) for share in INNER.tolist()]
        times = [t[:-1] + length[:, 0] * share for share in INNER.tolist()]
        at = self.localised.arguments
        ends = at(t, y)
        inner = at(np.concatenate(times), np.concatenate(states))
        count, kinds = len(length), len(self.localised.kinds)
        values = np.concatenate((ends[None, :-1], inner.reshape(3, count, kinds), ends[None, 1:]))
        before, bounds = self.greatest, list(zip(t[:-1].tolist(), t[1:].tolist(), strict=True))
        if self.tame(values, bounds).all():
            return True
        self.greatest = before  # these steps are looked at again
        return False

    def parts(self, step: Smooth) -> list[Part] | None:
        """The parts of a step in order, on each of which all functions are tame or which is as
        short as can be; None if there are too many.
        """
        length, nothing = step.end - step.start, np.zeros(len(self.localised.kinds), dtype=bool)

        def at(shares: FloatArray) -> FloatArray:
            times = step.start + length * shares
            return self.localised.arguments(times, step.states(times))

        waiting, found = [Part(0.0, 1.0, at(AT), nothing)], list[Part]()
        for _ in range(MOST_PARTS):
            if not waiting:
                return found
            part = waiting.pop()
            a, b, values = part.a, part.b, part.arguments
            times = [(step.start + length * a, step.start + length * b)]
            wild = ~self.tame(values[:, None], times)[0]
            if not wild.any() or b - a <= SHORTEST:
                found.append(part)
                continue
            middle = a + (b - a) / 2
            inner = at(np.concatenate((a + (middle - a) * INNER, middle + (b - middle) * INNER)))
            early = np.vstack((values[0], inner[:3], values[2]))
            late = np.vstack((values[2], inner[3:], values[4]))
            waiting += [Part(middle, b, late, wild), Part(a, middle, early, wild)]
        return None

    def places(self, parts: Sequence[Part], cut: tuple[bool, bool]) -> list[tuple[float, float]]:
        """Where a step may have passed over something: fractions of it in order, and of what length
        it may be. `cut` says whether its start and its end were put where something is.
        """
        found, turns = list[tuple[float, float]](), list[tuple[float, float]]()
        for i, kind in enumerate(self.localised.kinds):
            for run in _narrow(parts, i) if kind in VALUES else ():
                a, b = run[0].a, run[-1].b
                seen = (a == 0 and cut[0]) or (b == 1 and cut[1])
                at = np.concatenate([part.a + (part.b - part.a) * AT for part in run])
                values = VALUES[kind](np.concatenate([part.arguments[:, i] for part in run]))
                ends = sorted((values[0], values[-1]))
                beyond = np.fmax(values - ends[1], ends[0] - values)
                k, reach = int(np.argmax(beyond)), float(np.ptp(values))
                if beyond[k] > (PEAK if seen else 0) * reach:
                    found.append((float(at[k]), b - a))
                elif reach > 0 and not seen:
                    k = int(np.argmin(np.abs(values - (ends[0] + ends[1]) / 2)))
                    turns.append((float(at[k]), b - a))
        turns.sort()
        between = [((a + b) / 2, b - a) for (a, _), (b, _) in pairwise(turns) if a < b]
        return sorted({(at, size) for at, size in (*found, *turns, *between) if 0 < at < 1})


def _hermite(
    y: FloatArray, last: FloatArray, early: FloatArray, late: FloatArray, share: float
) -> FloatArray:
    """The cubic between two states at a share of the time between them; `early` and `late` are
    the derivatives there, multiplied by that time.
    """
    s, r = share, 1 - share
    return y + s * s * (3 - 2 * s) * (last - y) + s * r * (r * early - s * late)


def _narrow(parts: Sequence[Part], i: int) -> Iterator[list[Part]]:
    """The runs of narrow parts where function i is localised."""
    run = list[Part]()
    for part in parts:
        if part.b - part.a < NARROW and part.blamed[i]:
            run.append(part)
        elif run:
            yield run
            run = []
    if run:
        yield run


def slope(step: Smooth, at: float) -> FloatArray:
    """The derivative (ny,) of a step's interpolant at a fraction of it, 1/s."""
    length = step.end - step.start
    states = step.states(step.start + length * _NODES)
    fitted = np.polynomial.chebyshev.chebder(_FIT @ states)
    return np.asarray(np.polynomial.chebyshev.chebval(2 * at - 1, fitted) * 2 / length)
