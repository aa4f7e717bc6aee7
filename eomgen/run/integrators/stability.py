"""Whether an explicit method can hold a step: what it makes of the motion's own fast modes.

A step of h multiplies a mode exp(λt) of y' = J y by R(hλ) instead of exp(hλ); where |R| is larger
than that and than 1, what is not there grows from step to step (Hairer, Wanner, Solving ODEs II,
section IV.2). R is found by making the method's own step on the linear problem.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from eomgen.run.integrators.interface import Change, StepFailure
from eomgen.run.problem import Floats, Problem

GROWS = 1.25
"""So many times a step, and more than the motion itself: no more than a few steps of it do harm."""

HOLDS = 1.001
"""The same of a step that is said to be short enough."""

LEAST = 1e-9
"""Of a step: what must be shorter than that blows up by itself, and no step can hold it."""

JUMP, NOISE = 0.5, 1e-9
"""A rate that changes from one step to the next by so much of its largest so far is looked into,
unless it is nothing beside the largest of all.
"""


class UnstableStepError(StepFailure):
    """A step that is too long for an explicit method; the text says how long one may be."""


@dataclass
class Watch:
    """Looks into steps where rates jump, as they do at once where a method cannot hold them."""

    change: Change
    _last: Floats | None = None
    _largest: Floats | float = 0.0
    _allowed: Floats | float = 0.0

    def see(self, problem: Problem, t: float, y: Floats, step: Floats, h: float) -> None:
        """Take note of a step of h from `y` at `t` to y + `step`, (ny,) each.

        Raises `UnstableStepError` if it is too long.
        """
        rate, last = step / h, self._last
        self._last = rate
        # Nothing more is done at most steps: the largest rates are brought up to date by a jump.
        if last is not None and (np.abs(rate - last) <= self._allowed).all():
            return
        first = last is None
        before = rate if last is None else last
        self._note(before)
        jumps = first or not (np.abs(rate - before) <= self._allowed).all()
        self._note(rate)
        if not jumps:
            return
        if not np.isfinite(step).all():
            places = [(t, y)]
        elif first:
            places = [(t, y), (t + h, y + step)]
        else:
            ahead = problem.derivative(t, y)
            reached = (y + h / 2 * ahead, y + h * ahead, y + step)
            places = [(t, y), (t + h / 2, reached[0]), *((t + h, z) for z in reached[1:])]
        for time, state in places:
            jacobian = _jacobian(problem, time, state)
            if jacobian is not None:
                self._judge(problem, jacobian, h)

    def _note(self, rate: Floats) -> None:
        """Take a rate among the largest so far."""
        self._largest = np.maximum(self._largest, np.abs(rate))
        self._allowed = np.maximum(JUMP * self._largest, NOISE * np.max(self._largest))

    def _judge(self, problem: Problem, jacobian: Floats, h: float) -> None:
        if not growth(self.change, problem, jacobian, h) > math.log(GROWS):
            return
        rates = np.abs(np.linalg.eigvals(jacobian))
        dt = longest(self.change, problem, jacobian, h)
        if dt < LEAST * h:
            return
        raise UnstableStepError(
            f"the step of {h:g} s is too long for an explicit method, which makes what changes at "
            f"a rate of {rates.max():.2g}/s grow without bound; take --dt {dt:g} or less, or an "
            "implicit method (--integrator implicit_midpoint, or Radau, which chooses its steps)"
        )


def growth(change: Change, problem: Problem, jacobian: Floats, h: float) -> float:
    """log |R| of the mode that grows most in a step of h, less that of the motion itself.

    `jacobian` (ny, ny) is that of y' = J y.
    """
    linear = replace(
        problem,
        derivative=lambda _, y: jacobian @ y,
        jacobian=lambda _, y: jacobian,
        quaternions=(),
        contacts=None,
    )
    with np.errstate(all="ignore"):
        unit = np.eye(len(jacobian))
        columns = [row + change(linear, 0.0, row, h) for row in unit]
        made = np.array(columns).T
        if not np.isfinite(made).all():
            return math.inf
        largest = float(np.abs(np.linalg.eigvals(made)).max())
        own = float(np.linalg.eigvals(jacobian).real.max())
    return math.log(largest) - h * max(0.0, own) if largest else 0.0


def longest(change: Change, problem: Problem, jacobian: Floats, h: float) -> float:
    """A step below h that is short enough, s, to two digits, by halving."""

    def holds(step: float) -> bool:
        return growth(change, problem, jacobian, step) <= math.log(HOLDS)

    low, high = h / 2, h
    while not holds(low) and low > 1e-30 * h:
        low, high = low / 2, low
    for _ in range(6):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    digits = 1 - math.floor(math.log10(low))
    return math.floor(low * 10.0**digits) / 10.0**digits if abs(digits) < 300 else low


def stiffness(problem: Problem, t: float, y: Floats, h: float) -> str:
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
            f"at {h:.2g} s; take --integrator Radau, or BDF"
        )
    return ""


def _jacobian(problem: Problem, t: float, y: Floats) -> Floats | None:
    """The Jacobian, where there is a finite one."""
    try:
        found = problem.jacobian(t, y)
    except (ArithmeticError, ValueError):
        return None
    return found if np.isfinite(found).all() else None
