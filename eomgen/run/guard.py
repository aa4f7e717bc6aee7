"""A run guarded against lost digits: what rounding does to its derivative, watched at every step.

A small residual M v̇ + h - F does not mean that v̇ is right: with a heavy body on light ones v̇ loses
a digit for each decade of their masses, and its residual none. So the residual that is watched is
that of the derivative itself, ẏ - f(t, y), with f the same equations in numbers that are long
enough; it is the forward error of v̇ and of all else that goes into the step. It is asked for at
every state that a step ends in, so that no row is kept that was not looked at. One evaluation in
extended numbers takes as long as 8 to 17 of doubles, a step of DOP853 12: a guarded run takes half
as long again by DOP853, and three to five times as long by rk4, whose steps are short.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.run.integrators.interface import Advance, Begin, StepFailure
from eomgen.run.problem import FloatArray, Problem

LOST = 1e-8
"""Relative error of a derivative at which digits count as lost, unless the run is held tighter."""
OF_TOLERANCE = 10.0
"""Times the relative tolerance of a run that its derivative may be off."""
HARDLY = 1e-3
"""Part of the greatest that a rate was in the run, of which less counts as no more."""
REGAINED = 0.1
"""Part of the bound below which doubles are trusted again."""
UNIT = 1e-12
"""What a quaternion may be off unit length."""
FULL = 16.0
"""Digits of doubles."""


@dataclass(frozen=True, eq=False)
class Guard:
    """What watches a run.

    exact    f(t, y) -> (ny,), the derivative in extended precision, nan where it has no value there
    groups   of states that share a unit, whose rates are measured by the greatest of them
    bound    relative error of the derivative beyond which digits are lost
    repairs  go on by `exact` where digits are lost, instead of stopping
    """

    exact: Callable[[float, FloatArray], FloatArray]
    groups: tuple[tuple[int, ...], ...]
    bound: float = LOST
    repairs: bool = False


@dataclass(eq=False)
class RoundingMonitor:
    """A guard at its work on one run, which holds it to `bound`.

    derivative  what the run is to integrate: the problem's own, and `exact` while `repairing`
    stretches   begin, end (s) and worst loss of what was repaired
    """

    guard: Guard
    problem: Problem
    bound: float
    repairing: bool = False
    stretches: list[tuple[float, float, float]] = field(default_factory=list)
    _sizes: list[float] = field(default_factory=list)

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """f(t, y) as the run takes it now."""
        return self.guard.exact(t, y) if self.repairing else self.problem.derivative(t, y)

    def loss(self, t: float, y: FloatArray) -> float:
        """Relative error of the problem's own derivative; infinite where it is not finite.

        Raises `StepFailure` where there is no value in extended precision either, and for a
        quaternion that has left unit length.
        """
        for indices in self.problem.quaternions:
            off = math.hypot(*(float(y[i]) for i in indices)) - 1.0
            if abs(off) > UNIT:
                state = self.problem.states[indices[0]]
                raise StepFailure(
                    f"the quaternion from {state} on is off unit length by {off:.2g}",
                    "take a smaller step or tighter tolerances",
                )
        true = self.guard.exact(t, y)
        if not np.isfinite(true).all():
            raise StepFailure(
                "the step has left the domain: the equations have no finite value there, in long "
                "numbers either",
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
            off = float(np.max(np.abs(found[group] - true[group])))
            if off:
                worst = max(worst, off / max(size, HARDLY * self._sizes[k]))
        return worst

    def lost(self, loss: float) -> StepFailure:
        """What a run stops with where too much is lost."""
        left = max(0.0, -math.log10(loss)) if loss < 1 else 0.0
        return StepFailure(
            f"digits lost: accelerations there are right to {left:.0f} of {FULL:.0f} digits only "
            f"(relative error {loss:.2g}, allowed {self.bound:.2g})",
            "take --route orthogonal, or --guard repair",
        )

    def words(self) -> str:
        """What was repaired, in a line; "" if nothing."""
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
    """Steps of a problem from time t on, in doubles where they hold, in extended precision
    elsewhere.

    A step whose end has lost digits is made again from where it began, in extended precision, and
    so are those after it up to where doubles are good again.
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
            made += advance.is_step
            if made > max_steps:
                raise StepFailure(f"{max_steps} steps did not suffice", "take a shorter --t-end")
            yield advance


def _check(monitor: RoundingMonitor, loss: float) -> None:
    if loss > monitor.bound:
        raise monitor.lost(loss)


def _repair(monitor: RoundingMonitor, t: float, loss: float) -> None:
    monitor.repairing = True
    monitor.stretches.append((t, t, loss))
