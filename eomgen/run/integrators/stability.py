"""Whether an explicit method can hold a step: what it makes of the motion's own fast modes.

A step of h multiplies a mode exp(λt) of y' = J y by R(hλ) instead of exp(hλ); where |R| is larger
than that and than 1, what is not there grows from step to step (Hairer, Wanner, Solving ODEs II,
section IV.2). Of a Runge-Kutta method R is a polynomial; of others the factors are found by making
the method's own step on the linear problem.

A Jacobian takes as long as many steps, so it is asked for only where rates jump, as they do at once
where a method cannot hold them, and where the derivatives that the step has evaluated anyway show
a rate that is large beside 1/h (the same, section IV.2, on detecting stiffness).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.run.integrators.interface import Change, Stability, StepFailure
from eomgen.run.problem import FloatArray, Problem

GROWS = 1.25
"""So many times a step, and more than the motion itself: no more than a few steps of it do harm."""

HOLDS = 1.001
"""The same of a step that is said to be short enough."""

LEAST = 1e-9
"""Of a step: what must be shorter than that blows up by itself, and no step can hold it."""

JUMP, NOISE = 0.5, 1e-9
"""A rate that changes from one step to the next by so much of its largest so far is a jump, unless
it is nothing beside the largest of all.
"""

REACH = 0.5
"""Rates of the motion below this share of 1/h are held by every method: Euler's loses at 0.75."""

SHARE = 0.1
"""Of the time of a run that looks into jumps may take: the motion of a large mechanism may jump at
every step. Times are reckoned in derivatives, see `StabilityMonitor`, not taken by a clock: a run
is the same on every machine.
"""

BRIEF = 8000.0
"""Over the number of states: derivatives that take no time worth sparing."""

GREATER = 4.0
"""Rates so many times those at the last look are looked into, whatever it costs: what a step does
not hold grows on and on, what is only wild does not."""


class UnstableStepError(StepFailure):
    """A step that is too long for an explicit method; the text says how long one may be."""


@dataclass
class StabilityMonitor:
    """Looks into steps where rates jump.

    What takes as long as a derivative of n states counts 1: a step its derivatives and 25/n, a look
    n/2 and 60/n, as measured on mechanisms of 2 to 90 states.

    stability  R of the method; None if its step on the linear problem is to tell
    """

    change: Change
    stability: Stability | None
    _seen: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    _last: FloatArray | None = None
    _largest: FloatArray | float = 0.0
    _allowed: FloatArray | float = 0.0
    _worked: float = 0.0
    _spent: float = 0.0
    _level: float = 0.0
    _passed: tuple[float, tuple[float, FloatArray, FloatArray, float] | None] = (0.0, None)

    def seeing(self, problem: Problem) -> Problem:
        """The problem, the derivatives evaluated of which are kept for `see`."""
        derivative, seen = problem.derivative, self._seen

        def kept(t: float, y: FloatArray) -> FloatArray:
            slope = derivative(t, y)
            seen.append((y, slope))
            return slope

        return replace(problem, derivative=kept)

    def see(self, problem: Problem, t: float, y: FloatArray, step: FloatArray, h: float) -> None:
        """Take note of a step of h from `y` at `t` to y + `step`, (ny,) each.

        Raises `UnstableStepError` if it is too long.
        """
        seen = self._seen
        self._worked += len(seen) + 25 / len(y)
        rate, last = step / h, self._last
        self._last = rate
        # Nothing more is done at most steps: the largest rates are brought up to date by a jump.
        if last is not None and (np.abs(rate - last) <= self._allowed).all():
            del seen[:-1]
            return
        seen = seen.copy()
        del self._seen[:-1]
        first = last is None
        earlier = rate if last is None else last
        self._note(earlier)
        jumps = first or not (np.abs(rate - earlier) <= self._allowed).all()
        self._note(rate)
        if not jumps:
            return
        if not np.isfinite(step).all():
            self._look(problem, [(t, y)], h)
        elif first:
            self._look(problem, [(t, y), (t + h, y + step)], h)
        elif self._is_worth_it(problem, rate, seen, h):
            self._look(problem, _reached(problem, t, y, step, h), h)
        else:
            size = float(np.max(np.abs(rate - earlier)))
            if size > self._passed[0]:
                self._passed = size, (t, y, step, h)

    def settle(self, problem: Problem) -> None:
        """At the end of a run, look into the largest of the jumps that were let pass.

        Raises `UnstableStepError` as `see` does.
        """
        _, passed = self._passed
        if passed:
            self._look(problem, _reached(problem, *passed), passed[3])

    def _is_worth_it(
        self,
        problem: Problem,
        rate: FloatArray,
        seen: Sequence[tuple[FloatArray, FloatArray]],
        h: float,
    ) -> bool:
        """Whether a jump is to be looked into: not where that would take much of the run's time."""
        level = float(np.max(np.abs(rate) / np.array(problem.sizes or (1.0,))))
        if self._spent <= SHARE * self._worked + BRIEF / len(rate):
            self._level = max(self._level, level)
            return True
        if level > GREATER * self._level and not h * fastest(problem, seen) < REACH:
            self._level = level
            return True
        return False

    def _note(self, rate: FloatArray) -> None:
        """Take a rate among the largest so far."""
        self._largest = np.maximum(self._largest, np.abs(rate))
        self._allowed = np.maximum(JUMP * self._largest, NOISE * np.max(self._largest))

    def _look(self, problem: Problem, places: Sequence[tuple[float, FloatArray]], h: float) -> None:
        for time, state in places:
            self._spent += len(state) / 2 + 60 / len(state)
            jacobian = _jacobian(problem, time, state)
            if jacobian is not None:
                self._judge(problem, jacobian, h)

    def _judge(self, problem: Problem, jacobian: FloatArray, h: float) -> None:
        grown = growth(self.change, self.stability, problem, jacobian)
        if not grown(h) > math.log(GROWS):
            return
        rates = np.abs(np.linalg.eigvals(jacobian))
        dt = longest(grown, h)
        if dt < LEAST * h:
            return
        raise UnstableStepError(
            f"the step of {h:g} s is too long for an explicit method, which makes what changes at "
            f"a rate of {rates.max():.2g}/s grow without bound",
            f"take --dt {dt:g} or less, or an implicit method (--integrator implicit_midpoint, or "
            "Radau, which chooses its steps)",
        )


def _reached(
    problem: Problem, t: float, y: FloatArray, step: FloatArray, h: float
) -> list[tuple[float, FloatArray]]:
    """Where a step of h from y at t to y + `step` looks, or might: times and states."""
    ahead = problem.derivative(t, y)
    return [(t, y), (t + h / 2, y + h / 2 * ahead), (t + h, y + h * ahead), (t + h, y + step)]


def fastest(problem: Problem, seen: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """About the fastest rate, 1/s, at which states change that lie as far apart as those at which
    derivatives were `seen`: pairs of states and derivatives, (ny,) each.

    Of an oscillation positions and velocities are exchanged: the product of what both change by,
    over that of how far both are apart, is ω². What is damped changes its velocities by themselves.
    """
    sizes = np.array(problem.sizes) if problem.sizes else np.ones(len(problem.states))
    states, slopes = (np.array(part) / sizes for part in zip(*seen, strict=True))
    one, other = np.triu_indices(len(seen), 1)
    apart, change = np.abs(states[one] - states[other]), np.abs(slopes[one] - slopes[other])
    place = np.zeros(len(sizes), dtype=bool)
    place[list(problem.positions)] = True
    far, moved = (
        [part[:, kind].max(axis=1, initial=0.0) for kind in (place, ~place)]
        for part in (apart, change)
    )
    with np.errstate(all="ignore"):
        kinds = [moved[1] / far[1], np.sqrt(moved[0] * moved[1] / (far[0] * far[1]))]
        if place.all():
            kinds = [moved[0] / far[0]]
    rates = np.concatenate(kinds)
    known = rates[np.isfinite(rates)]
    return float(known.max()) if known.size else math.inf


def growth(
    change: Change, stability: Stability | None, problem: Problem, jacobian: FloatArray
) -> Callable[[float], float]:
    """A function of a step h, s: log |R| of the mode that grows most in it, less that of the motion
    itself.

    `jacobian` (ny, ny) is that of y' = J y.
    """
    modes: NDArray[np.complex128] = np.linalg.eigvals(jacobian).astype(complex)
    own = max(0.0, float(modes.real.max()))

    def grown(h: float) -> float:
        with np.errstate(all="ignore"):
            factors = stability(h * modes) if stability else _factors(change, problem, jacobian, h)
        largest = float(np.abs(factors).max())
        if not math.isfinite(largest):
            return math.inf
        return math.log(largest) - h * own if largest else 0.0

    return grown


def _factors(
    change: Change, problem: Problem, jacobian: FloatArray, h: float
) -> NDArray[np.complex128]:
    """What a step of a method multiplies the modes of y' = J y by; nan where it overflows."""
    linear = replace(
        problem,
        derivative=lambda _, y: jacobian @ y,
        jacobian=lambda _, y: jacobian,
        quaternions=(),
        contacts=None,
    )
    made = np.array([row + change(linear, 0.0, row, h) for row in np.eye(len(jacobian))]).T
    if not np.isfinite(made).all():
        return np.array([math.nan], dtype=complex)
    return np.linalg.eigvals(made).astype(complex)


def longest(grown: Callable[[float], float], h: float) -> float:
    """A step below h that is short enough, s, to two digits, by halving; `grown` as of `growth`."""

    def holds(step: float) -> bool:
        return grown(step) <= math.log(HOLDS)

    low, high = h / 2, h
    while not holds(low) and low > 1e-30 * h:
        low, high = low / 2, low
    for _ in range(6):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    digits = 1 - math.floor(math.log10(low))
    return math.floor(low * 10.0**digits) / 10.0**digits if abs(digits) < 300 else low


def stiffness(problem: Problem, t: float, y: FloatArray, h: float) -> str:
    """What keeps steps of an explicit method as short as h, s, in words; "" if not stability.

    It is where the motion damps something faster than the step can show: h|λ| > 1 for a mode that
    damps more than it oscillates.
    """
    jacobian = _jacobian(problem, t, y)
    if jacobian is None:
        return ""
    modes = np.linalg.eigvals(jacobian)
    fastest = modes[np.argmin(modes.real)]
    if -fastest.real * h > 1 and -fastest.real >= abs(fastest.imag):
        return (
            f"the motion is stiff: it damps at {-fastest.real:.2g}/s, which keeps explicit steps "
            f"at {h:.2g} s"
        )
    return ""


def _jacobian(problem: Problem, t: float, y: FloatArray) -> FloatArray | None:
    """The Jacobian, where there is a finite one."""
    try:
        found = problem.jacobian(t, y)
    except (ArithmeticError, ValueError):
        return None
    return found if np.isfinite(found).all() else None
