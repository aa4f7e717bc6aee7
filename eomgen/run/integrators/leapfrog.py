"""Leapfrog, or Störmer-Verlet, explicit and symplectic, and its compositions to orders 4 and 6.

It evaluates one derivative per step. It requires v' to depend on positions and time only, and q' to
be v times a constant matrix: particles, a single pendulum, a chain of masses and springs, but no
mass matrix that depends on positions and no damping. With constraints the step is that of `rattle`,
and a composition of such is symplectic too (Reich, SIAM J. Numer. Anal. 33 (1996) 475-491).
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from eomgen.base.errors import RunError
from eomgen.engine import explicit, separable
from eomgen.engine.explicit import LEAPFROG_4, LEAPFROG_6, Composition, Split, Step
from eomgen.run.integrators import rattle
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem

_CHECKS = 5
"""Number of states at which rates are looked at."""


def prepare(problem: Problem) -> Change:
    """Return `change(problem, t, y, h) -> y(t + h) - y(t)`, (ny,), for this problem.

    Raises `RunError` as `split_of`.
    """
    if problem.projection is not None:
        return rattle.prepare(problem)
    split, step = split_of(problem), Step()

    def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        explicit.leapfrog(problem, split, t, y, h, step)
        return step.change

    return change


@dataclass(frozen=True)
class _Of:
    """A method's steps of a problem, as compositions take them."""

    change: Change
    problem: Problem

    def changed(self, t: float, y: FloatArray, h: float, step: Step) -> int:
        """A step, without iterations."""
        step.change = self.change(self.problem, t, y, h)
        return 1


def composed(of: Composition) -> FixedStep:
    """A method whose steps are made of leapfrog steps."""

    def prepare_composed(problem: Problem) -> Change:
        one, step = prepare(problem), Step()

        def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
            explicit.composed(of, _Of(one, problem), t, y, h, step)
            return step.change

        return change

    return FixedStep(prepare_composed, order=of.order, compiled=of.name, solves=True)


LEAPFROG = FixedStep(prepare, order=2, compiled="leapfrog", solves=True)
FOUR, SIX = composed(LEAPFROG_4), composed(LEAPFROG_6)


def split_of(problem: Problem) -> Split:
    """The positions of a problem, its other states, and how these move them.

    Raises `RunError` if derivatives at the initial state, or at a few seeded random states, show
    that the problem does not separate into drift and kick.
    """
    positions = np.array(problem.positions, np.int64)
    others = np.setdiff1d(np.arange(len(problem.states)), positions)
    if not len(positions):
        raise _refusal("no state is a position")
    if problem.contacts is not None:
        raise _refusal("those of rigid contacts that are held depend on velocities")
    rates = np.empty((len(positions), len(others)))
    split = Split(positions, others, rates)
    explicit.constant_rates(problem, positions, others, problem.initial, rates)
    seeded = np.random.default_rng(1)
    size = 0.1 * np.maximum(1.0, np.abs(problem.initial))
    for i in range(_CHECKS):
        y = problem.unit(problem.initial + (i > 0) * size * seeded.normal(size=len(size)))
        with suppress(ArithmeticError, ValueError), np.errstate(all="ignore"):
            _check(problem, split, float(i), y)
    return split


def _check(problem: Problem, split: Split, t: float, y: FloatArray) -> None:
    """Raise `RunError` if the problem does not separate into drift and kick at a state."""
    for group in (split.others, split.positions):
        found = separable.coupled(problem, len(group), group, t, y)
        if found != separable.NONE:
            of, by = (problem.states[group[i]] for i in divmod(found, len(group)))
            raise _refusal(f"the rate of {of} depends on {by}")
    if (k := separable.varying(problem, split, t, y)) != separable.NONE:
        of = problem.states[split.positions[k]]
        raise _refusal(f"the rate of {of} is not the velocities times constants")


def _refusal(why: str) -> RunError:
    return RunError(
        f"integrator: leapfrog needs forces that depend on positions alone, and {why}; "
        "take --integrator implicit_midpoint or gauss_4"
    )
