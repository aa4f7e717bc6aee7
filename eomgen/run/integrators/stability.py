"""Whether the step of an explicit method is stable for the fast modes of the motion.

A step of h multiplies a mode exp(λt) of y' = J y by R(hλ) instead of exp(hλ). Where |R| is larger
than |exp(hλ)| and than 1, errors grow from step to step (Hairer, Wanner, Solving ODEs II, section
IV.2). For a Runge-Kutta method R is a polynomial; for other methods the factors are found by making
a step on the linear problem.

That a mode could grow does not say that it does: a contact may close and open again within a few
steps, and friction that saturates bounds it. So a step that looks too long is tried: some steps of
h, and as many pairs of h/2, are made from there. Only if they part does the run stop.

A Jacobian costs as much as many steps. It is evaluated only where the rates y' jump, which they do
soon after a step becomes unstable, and where the derivatives that the step has evaluated anyway
show a rate that is large compared with 1/h (ibid., section IV.2, on the detection of stiffness).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Change, Stability
from eomgen.run.problem import FloatArray, Problem

UNSTABLE = 1.25
"""A step is too long if it multiplies a mode by more than this, relative to the growth of the
motion itself: then a few steps do harm."""

STABLE = 1.001
"""The same factor for the step that a message recommends."""

TRIED, HARM = 40, 0.1
"""A step is too long if after up to this many steps of h and pairs of h/2 any state differs by more
than this, relative to its size: the slowest mode that `UNSTABLE` finds has grown by 7500 then."""

LEAST = 1e-9
"""If a stable step would be shorter than this fraction of the step, the solution itself blows up,
and no message is given."""

JUMP, NOISE = 0.5, 1e-9
"""A rate jumps if it changes from one step to the next by more than `JUMP` of its largest value so
far, and by more than `NOISE` of the largest of all rates."""

FAST = 0.5
"""Every method is stable for rates below this fraction of 1/h: Euler's fails from 0.75 on."""

SHARE = 0.1
"""Largest share of a run's time for checks of jumps: large mechanisms may jump at every step. Times
are counted in derivatives, see `StabilityMonitor`, not by a clock, so that a run is the same on
every machine."""

BRIEF = 8000.0
"""This many derivatives, over the number of states, may be spent on checks in any case."""

GREATER = 4.0
"""A rate that is this many times the largest one checked so far is checked, whatever the cost: in
an unstable run rates keep growing, in a merely irregular motion they do not."""


class UnstableStepError(StepFailure):
    """The step is too long for an explicit method; the remedy says how long it may be."""


@dataclass
class StabilityMonitor:
    """Checks the stability of steps where rates jump.

    Costs are counted in derivatives of n states: a step costs its derivatives and 25/n, a check
    n/2 + 60/n, as measured on mechanisms with 2 to 90 states.

    stability  R of the method; None to find the factors from a step on the linear problem
    rate       (ny,), that of the last step; None before the first one, and the first after an event
    is_first   whether no step was made
    """

    change: Change
    stability: Stability | None
    rate: FloatArray | None = None
    is_first: bool = True
    _evaluated: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    _largest: FloatArray | float = 0.0
    _allowed: FloatArray | float = 0.0
    _steps: int = 0
    _calls: int = 0
    _spent: float = 0.0
    _highest: float = 0.0
    _doubtful: bool = False
    _skipped: tuple[float, tuple[float, FloatArray, FloatArray, float] | None] = (0.0, None)

    def begin(self) -> bool:
        """Begin steps, or go on after an event, at which rates may jump. Returns whether steps were
        made before.
        """
        self.rate = None
        self._evaluated.clear()
        return not self.is_first

    def recording(self, problem: Problem) -> Problem:
        """The same problem, but its derivatives are recorded for `check`."""
        derivative, evaluated = problem.derivative, self._evaluated

        def recorded(t: float, y: FloatArray) -> FloatArray:
            slope = derivative(t, y)
            evaluated.append((y, slope))
            return slope

        return replace(problem, derivative=recorded)

    def check(self, problem: Problem, t: float, y: FloatArray, step: FloatArray, h: float) -> None:
        """Check a step of h from `y` at `t` to y + `step`, (ny,) each, in which rates may jump. The
        largest rates so far are only updated here.

        Raises `UnstableStepError` if it is too long.
        """
        if not y.size:  # all is given by the time
            return
        evaluated, rate, last = self._evaluated.copy(), step / h, self.rate
        self.rate = rate
        self.take()
        first, self.is_first = self.is_first, False
        earlier = rate if last is None else last
        self._update(earlier)
        jumps = first or not (np.abs(rate - earlier) <= self._allowed).all()
        self._update(rate)
        # Rates have doubled here, if they do not jump. A mode that could grow may now do so.
        if not (jumps or self._doubtful):
            return
        if not np.isfinite(step).all():
            self._check_at(problem, [(t, y)], h)
        elif first:
            self._check_at(problem, [(t, y), (t + h, y + step)], h)
        elif self._is_affordable(problem, rate, evaluated, h):
            self._check_at(problem, _states_in(problem, t, y, step, h), h)
        else:
            size = float(np.max(np.abs(rate - earlier)))
            if size > self._skipped[0]:
                self._skipped = size, (t, y, step, h)

    def _count(self, steps: int, calls: int) -> None:
        """Count steps, and the derivatives at hand at their checks: that of the step before too."""
        self._steps += steps
        self._calls += calls

    def take(self) -> None:
        """Take account of a step whose derivatives were recorded."""
        self._count(1, len(self._evaluated))
        del self._evaluated[:-1]

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """The rate of the last step and the changes from it that are not jumps, (ny,) or (1,) each;
        before the first step all are, and after an event none is. A step with such rates needs no
        check: see `take` and `passed`.
        """
        if self.rate is None:
            return np.zeros(1), np.array([-1.0 if self.is_first else np.inf])
        return self.rate, np.asarray(self._allowed)

    def passed(
        self, steps: int, calls: int, rate: FloatArray, place: FloatArray, slope: FloatArray
    ) -> None:
        """Take steps without jumps, of `calls` derivatives each, as `check` would: the rate of the
        last one, the state at which it evaluated its last derivative, and this, (ny,) each.
        """
        self._count(steps, steps * (calls + 1) - 1 + len(self._evaluated))
        self.rate, self._evaluated[:] = rate, [(place, slope)]

    def finish(self, problem: Problem, t: float, y: FloatArray, step: FloatArray, h: float) -> None:
        """At the end of a run, check the step with the largest jump that was not checked and, if
        modes could grow when a step was last checked, its last step, from `y` at `t`.

        Raises `UnstableStepError` if one of them is too long.
        """
        _, skipped = self._skipped
        if skipped:
            self._check_at(problem, _states_in(problem, *skipped), skipped[3])
        if self._doubtful:
            self._check_at(problem, _states_in(problem, t, y, step, h), h)

    def _is_affordable(
        self,
        problem: Problem,
        rate: FloatArray,
        evaluated: Sequence[tuple[FloatArray, FloatArray]],
        h: float,
    ) -> bool:
        """Whether a jump is checked: if time is left for it, or if rates keep growing."""
        size = float(np.max(np.abs(rate) / np.array(problem.sizes or (1.0,))))
        worked = self._calls + 25 * self._steps / len(rate)
        if self._spent <= SHARE * worked + BRIEF / len(rate):
            self._highest = max(self._highest, size)
            return True
        if size > GREATER * self._highest and not h * fastest(problem, evaluated) < FAST:
            self._highest = size
            return True
        return False

    def _update(self, rate: FloatArray) -> None:
        """Update the largest rates so far, and the changes that are not jumps."""
        self._largest = np.maximum(self._largest, np.abs(rate))
        self._allowed = np.maximum(JUMP * self._largest, NOISE * np.max(self._largest))

    def _check_at(
        self, problem: Problem, points: Sequence[tuple[float, FloatArray]], h: float
    ) -> None:
        """Check a step of h from the first of some times and states with the Jacobians at each."""
        for time, state in points:
            self._spent += len(state) / 2 + 60 / len(state)
            jacobian = _jacobian(problem, time, state)
            found = None if jacobian is None else self._too_long(problem, jacobian, h)
            if found and self._parts(problem, *points[0], h):
                raise found
            self._doubtful = found is not None
            if found:
                return

    def _too_long(
        self, problem: Problem, jacobian: FloatArray, h: float
    ) -> UnstableStepError | None:
        """The error that says that modes of y' = J y grow with a step of h; None if they do not."""
        log_growth = growth(self.change, self.stability, problem, jacobian)
        if not log_growth(h) > math.log(UNSTABLE):
            return None
        rates = np.abs(np.linalg.eigvals(jacobian))
        dt = stable_step(log_growth, h)
        if dt < LEAST * h:
            return None
        return UnstableStepError(
            f"the step of {h:g} s is too long for an explicit method: modes at a rate of up to "
            f"{rates.max():.2g}/s grow without bound",
            f"take --dt {dt:g} or less, or an implicit method (--integrator implicit_midpoint, or "
            "Radau, which chooses its steps)",
        )

    def _parts(self, problem: Problem, t: float, y: FloatArray, h: float) -> bool:
        """Whether steps of h and of h/2 from y at t come to different states."""
        sizes = np.array(problem.sizes) if problem.sizes else np.ones(len(y))
        evaluations = 0

        def derivative(t: float, y: FloatArray) -> FloatArray:
            nonlocal evaluations
            evaluations += 1
            return problem.derivative(t, y)

        counted, whole, halved = replace(problem, derivative=derivative), y, y
        try:
            for i in range(TRIED):
                start = t + i * h
                whole = self._stepped(counted, start, whole, h)
                halved = self._stepped(counted, start, halved, h / 2)
                halved = self._stepped(counted, start + h / 2, halved, h / 2)
                sizes = np.maximum(sizes, np.abs(halved))
        except (ArithmeticError, ValueError, StepFailure):
            return True
        finally:
            self._spent += evaluations
        return not (np.abs(whole - halved) <= HARM * sizes).all()

    def _stepped(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        return problem.projected(t + h, y + self.change(problem, t, y, h))


def _states_in(
    problem: Problem, t: float, y: FloatArray, step: FloatArray, h: float
) -> list[tuple[float, FloatArray]]:
    """Times and states that a step of h from y at t to y + `step` evaluates, or might."""
    slope = problem.derivative(t, y)
    return [(t, y), (t + h / 2, y + h / 2 * slope), (t + h, y + h * slope), (t + h, y + step)]


def fastest(problem: Problem, evaluated: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """An estimate of the fastest rate of the problem, 1/s, from differences between pairs of states
    and derivatives, (ny,) each.

    In an oscillation positions change with velocities and velocities with positions: the product of
    the differences of both derivatives, over that of the differences of both states, is ω². In a
    damped motion velocities change with velocities.
    """
    sizes = np.array(problem.sizes) if problem.sizes else np.ones(len(problem.states))
    states, slopes = (np.array(part) / sizes for part in zip(*evaluated, strict=True))
    one, other = np.triu_indices(len(evaluated), 1)
    positions = np.zeros(len(sizes), dtype=bool)
    positions[list(problem.positions)] = True

    def differences(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Greatest differences of each pair, (pairs,), in positions and in the other states."""
        change = np.abs(x[one] - x[other])
        return (
            change[:, positions].max(axis=1, initial=0.0),
            change[:, ~positions].max(axis=1, initial=0.0),
        )

    (q, v), (q_dot, v_dot) = differences(states), differences(slopes)
    with np.errstate(all="ignore"):
        estimates = [v_dot / v, np.sqrt(q_dot * v_dot / (q * v))]
        if positions.all():
            estimates = [q_dot / q]
    rates = np.concatenate(estimates)
    known = rates[np.isfinite(rates)]
    return float(known.max()) if known.size else math.inf


def growth(
    change: Change, stability: Stability | None, problem: Problem, jacobian: FloatArray
) -> Callable[[float], float]:
    """A function of the step h, s: log of the largest |R| of all modes of y' = J y, less the growth
    of the motion itself, h max(0, Re λ). `jacobian` is J, (ny, ny).
    """
    modes: NDArray[np.complex128] = np.linalg.eigvals(jacobian).astype(complex)
    own = max(0.0, float(modes.real.max()))

    def log_growth(h: float) -> float:
        with np.errstate(all="ignore"):
            factors = stability(h * modes) if stability else _factors(change, problem, jacobian, h)
        largest = float(np.abs(factors).max())
        if not math.isfinite(largest):
            return math.inf
        return math.log(largest) - h * own if largest else 0.0

    return log_growth


def _factors(
    change: Change, problem: Problem, jacobian: FloatArray, h: float
) -> NDArray[np.complex128]:
    """The factors by which a step of a method multiplies the modes of y' = J y; nan if it
    overflows.
    """
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


def stable_step(log_growth: Callable[[float], float], h: float) -> float:
    """A stable step below h, s, to two digits, by bisection; `log_growth` as from `growth`."""

    def stable(step: float) -> bool:
        return log_growth(step) <= math.log(STABLE)

    low, high = h / 2, h
    while not stable(low) and low > 1e-30 * h:
        low, high = low / 2, low
    for _ in range(6):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    digits = 1 - math.floor(math.log10(low))
    return math.floor(low * 10.0**digits) / 10.0**digits if abs(digits) < 300 else low


def stiffness(problem: Problem, t: float, y: FloatArray, h: float) -> str:
    """A message if stability keeps the steps of an explicit method as short as h, s; else "".

    It does if h|λ| > 1 for the most strongly damped mode, and that mode decays faster than it
    oscillates.
    """
    jacobian = _jacobian(problem, t, y)
    if jacobian is None:
        return ""
    modes = np.linalg.eigvals(jacobian)
    damped = modes[np.argmin(modes.real)]
    if -damped.real * h > 1 and -damped.real >= abs(damped.imag):
        return (
            f"the motion is stiff: a mode decays at {-damped.real:.2g}/s, which keeps explicit "
            f"steps at {h:.2g} s"
        )
    return ""


def _jacobian(problem: Problem, t: float, y: FloatArray) -> FloatArray | None:
    """The Jacobian; None if it is not finite."""
    try:
        found = problem.jacobian(t, y)
    except (ArithmeticError, ValueError):
        return None
    return found if np.isfinite(found).all() else None
