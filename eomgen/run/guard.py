"""A guard against lost digits: the rounding error of the derivative is checked at every step.

A small residual M v̇ + h - F does not imply a small error of v̇: with a heavy body on light ones v̇
loses a digit for each decade of the mass ratio, and the residual does not show it. So the guard
computes the error of the derivative itself, ẏ - f(t, y), with f evaluated in extended precision. It
does so at the end of every step, so that every row is checked. An evaluation in extended precision
costs as much as 8 to 17 in doubles: a guarded run takes 1.5 times as long with DOP853, whose steps
take 12 evaluations, and 3 to 5 times as long with rk4.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Advance, Begin
from eomgen.run.problem import FloatArray, Problem

LOST = 1e-8
"""Relative error of a derivative beyond which digits count as lost, unless the tolerance of the run
is tighter."""
OF_TOLERANCE = 10.0
"""Allowed relative error of the derivative, in relative tolerances of the run."""
LEAST_SCALE = 1e-3
"""Errors are relative to the present rate, but at least to this fraction of its maximum so far."""
REGAINED = 0.1
"""Fraction of the bound below which a repaired run returns to doubles."""
UNIT = 1e-12
"""Allowed deviation of a quaternion from unit length."""
FULL = 16.0
"""Digits of doubles."""


@dataclass(frozen=True, eq=False)
class Guard:
    """The settings of a guard.

    exact    f(t, y) -> (ny,), the derivative in extended precision, nan where it has no value
    groups   groups of states with the same unit; errors are relative to the greatest rate in each
    bound    relative error of the derivative beyond which digits are lost
    repairs  whether to continue with `exact` where digits are lost, instead of stopping
    """

    exact: Callable[[float, FloatArray], FloatArray]
    groups: tuple[tuple[int, ...], ...]
    bound: float = LOST
    repairs: bool = False


@dataclass(eq=False)
class RoundingMonitor:
    """A guard during a run.

    bound      relative error of the derivative that is allowed in this run
    repairing  whether the derivative is now computed in extended precision
    stretches  begin, end (s) and greatest error of each repaired part of the run
    """

    guard: Guard
    problem: Problem
    bound: float
    repairing: bool = False
    stretches: list[tuple[float, float, float]] = field(default_factory=list)
    _sizes: list[float] = field(default_factory=list)

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """f(t, y) for the method: the problem's own, or `exact` while `repairing`."""
        return self.guard.exact(t, y) if self.repairing else self.problem.derivative(t, y)

    def loss(self, t: float, y: FloatArray) -> float:
        """Relative error of the problem's own derivative; infinite if that is not finite.

        Raises `StepFailure` if the derivative is not finite in extended precision either, or if a
        quaternion does not have unit length.
        """
        for indices in self.problem.quaternions:
            defect = math.hypot(*(float(y[i]) for i in indices)) - 1.0
            if abs(defect) > UNIT:
                state = self.problem.states[indices[0]]
                raise StepFailure(
                    f"the length of the quaternion that starts at {state} differs from 1 by "
                    f"{defect:.2g}",
                    "take a smaller step or tighter tolerances",
                )
        true = self.guard.exact(t, y)
        if not np.isfinite(true).all():
            raise StepFailure(
                "the step has left the domain: the equations have no finite value there, in "
                "extended precision either",
                "take a smaller step, or keep away",
            )
        try:
            found = self.problem.derivative(t, y)
        except (ArithmeticError, ValueError):
            return math.inf
        if not np.isfinite(found).all():
            return math.inf
        worst = 0.0
        self._sizes = self._sizes or [0.0] * len(self.guard.groups)
        for k, group in enumerate(map(list, self.guard.groups)):
            size = float(np.max(np.abs(true[group])))
            self._sizes[k] = max(self._sizes[k], size)
            error = float(np.max(np.abs(found[group] - true[group])))
            if error:
                worst = max(worst, error / max(size, LEAST_SCALE * self._sizes[k]))
        return worst

    def failure(self, loss: float) -> StepFailure:
        """The error with which a run stops for lost digits."""
        left = max(0.0, -math.log10(loss)) if loss < 1 else 0.0
        return StepFailure(
            f"digits lost: accelerations there have only {left:.0f} of {FULL:.0f} correct digits "
            f"(relative error {loss:.2g}, allowed {self.bound:.2g})",
            "take --guard repair, or --route orthogonal if the run has another",
        )

    def words(self) -> str:
        """A line that says what was repaired; "" if nothing was."""
        if not self.stretches:
            return ""
        begin, end = self.stretches[0][0], self.stretches[-1][1]
        worst = max(loss for _, _, loss in self.stretches)
        times = f", {len(self.stretches)} times" if len(self.stretches) > 1 else ""
        return (
            f"digits lost between t = {begin:.6g} and {end:.6g} s{times} (relative error up to "
            f"{worst:.2g}) were repaired in extended precision"
        )


def monitored(
    monitor: RoundingMonitor, advances: Iterator[Advance], t: float, y: FloatArray
) -> Iterator[Advance]:
    """The same steps. Raises `StepFailure` before the first whose end has lost digits."""
    _check(monitor, monitor.loss(t, y))
    for advance in advances:
        if np.isfinite(advance.y).all():
            _check(monitor, monitor.loss(advance.t, advance.y))
        yield advance


def repaired(
    monitor: RoundingMonitor, begin: Begin, problem: Problem, t: float, max_steps: int
) -> Iterator[Advance]:
    """The steps of a problem from time t on, in extended precision where doubles lose digits.

    A step whose end has lost digits is repeated in extended precision, and so are the steps after
    it until the error in doubles is below `REGAINED` of the bound.
    """
    y, made = problem.initial, 0
    monitor.repairing = False
    loss = monitor.loss(t, y)
    if loss > monitor.bound:
        _repair(monitor, t, loss)
    again = True
    while again:
        again = False
        for advance in begin(replace(problem, initial=y), t, made):
            if np.isfinite(advance.y).all():
                loss = monitor.loss(advance.t, advance.y)
                if loss > monitor.bound and not monitor.repairing:
                    _repair(monitor, t, loss)
                    again = True
                    break
                if monitor.repairing:
                    since, _, worst = monitor.stretches[-1]
                    monitor.stretches[-1] = since, advance.t, max(worst, loss)
                    monitor.repairing = loss > REGAINED * monitor.bound
            t, y = advance.t, advance.y
            made += advance.steps
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            yield advance


def _check(monitor: RoundingMonitor, loss: float) -> None:
    if loss > monitor.bound:
        raise monitor.failure(loss)


def _repair(monitor: RoundingMonitor, t: float, loss: float) -> None:
    monitor.repairing = True
    monitor.stretches.append((t, t, loss))
