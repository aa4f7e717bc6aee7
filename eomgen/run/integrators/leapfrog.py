"""Leapfrog, or Störmer-Verlet, explicit and symplectic, and its compositions to orders 4 and 6.

It evaluates one derivative per step. It requires v' to depend on positions and time only, and q' to
be v times a constant matrix: particles, a single pendulum, a chain of masses and springs, but no
mass matrix that depends on positions and no damping. With constraints the step is that of `rattle`,
and a composition of such is symplectic too (Reich, SIAM J. Numer. Anal. 33 (1996) 475-491).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from eomgen.base.errors import RunError
from eomgen.engine import explicit
from eomgen.engine.explicit import LEAPFROG_4, LEAPFROG_6, Composition, Split, Step
from eomgen.run.integrators import rattle
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem

_CHECKS = 5
"""Number of states at which the Jacobian is checked."""
_SAME = 1e-6
"""Relative difference of entries that count as equal; a Jacobian by differences is not exact."""


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

    Raises `RunError` if the Jacobian at the initial state, or at a few seeded random states, shows
    that the problem does not separate into drift and kick.
    """
    positions = list(problem.positions)
    others = [i for i in range(len(problem.states)) if i not in problem.positions]
    _check(problem, positions, others)
    rates = np.empty((len(positions), len(others)))
    split = Split(np.array(positions, np.int64), np.array(others, np.int64), rates)
    explicit.constant_rates(problem, split.positions, split.others, problem.initial, rates)
    return split


def _check(problem: Problem, positions: list[int], others: list[int]) -> None:
    """Raise `RunError` if the problem does not separate into drift and kick."""
    if not positions:
        raise _refusal("no state is a position")
    if problem.contacts is not None:
        raise _refusal("those of rigid contacts that are held depend on velocities")
    first: FloatArray | None = None
    for jacobian in _jacobians(problem):
        for group in (others, positions):
            found = np.argwhere(jacobian[np.ix_(group, group)])
            if found.size:
                of, by = (problem.states[group[i]] for i in found[0])
                raise _refusal(f"the rate of {of} depends on {by}")
        rates = jacobian[np.ix_(positions, others)]
        if first is None:
            first = rates
        varies = np.argwhere(np.abs(rates - first) > _SAME * np.max(np.abs(first)))
        if varies.size:
            of = problem.states[positions[varies[0, 0]]]
            raise _refusal(f"the rate of {of} is not the velocities times constants")


def _jacobians(problem: Problem) -> Iterator[FloatArray]:
    """The finite ones among the Jacobians at the initial state and at seeded random states."""
    seeded = np.random.default_rng(1)
    size = 0.1 * np.maximum(1.0, np.abs(problem.initial))
    for i in range(_CHECKS):
        y = problem.unit(problem.initial + (i > 0) * size * seeded.normal(size=len(size)))
        try:
            with np.errstate(all="ignore"):
                jacobian = problem.jacobian(float(i), y)
        except (ArithmeticError, ValueError):
            continue
        if np.isfinite(jacobian).all():
            yield jacobian


def _refusal(why: str) -> RunError:
    return RunError(
        f"integrator: leapfrog needs forces that depend on positions alone, and {why}; "
        "take --integrator implicit_midpoint or gauss_4"
    )
