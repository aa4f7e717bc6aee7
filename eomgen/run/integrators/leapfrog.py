"""Leapfrog, or Störmer-Verlet: half a drift, kick, half a drift. Order 2, explicit, symplectic.

Hairer, Lubich, Wanner, Geometric Numerical Integration, section I.1.4, variant B. It evaluates one
derivative per step. It requires v' to depend on positions and time only, and q' to be v times a
constant matrix: particles, a single pendulum, a chain of masses and springs, but no mass matrix
that depends on positions and no damping. With constraints the step is that of `rattle`.
"""

from collections.abc import Iterator

import numpy as np

from eomgen.errors import RunError
from eomgen.run.integrators import rattle
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem

_CHECKS = 5
"""Number of states at which the Jacobian is checked."""
_SAME = 1e-6
"""Relative difference of entries that count as equal; a Jacobian by differences is not exact."""


def prepare(problem: Problem) -> Change:
    """Return `change(problem, t, y, h) -> y(t + h) - y(t)`, (ny,), for this problem.

    Raises `RunError` if the Jacobian at the initial state, or at a few seeded random states, shows
    that the problem does not separate into drift and kick.
    """
    if problem.projection is not None:
        return rattle.prepare(problem)
    positions = list(problem.positions)
    others = [i for i in range(len(problem.states)) if i not in problem.positions]
    _check(problem, positions, others)
    rates = rates_of(problem)

    def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        velocities = y[others]
        middle = y.copy()
        middle[positions] += h / 2 * _product(rates, velocities)
        kick = h * problem.derivative(t + h / 2, middle)[others]
        found = np.empty_like(y)
        found[others] = kick
        found[positions] = h * _product(rates, velocities + kick / 2)
        return found

    return change


INTEGRATOR = FixedStep(prepare, order=2, compiled="leapfrog", solves=True)


def rates_of(problem: Problem) -> FloatArray:
    """The constant matrix by which velocities (and all other states that are not positions) are
    multiplied to give the rates of the positions.
    """
    positions = list(problem.positions)
    others = [i for i in range(len(problem.states)) if i not in problem.positions]
    rates = np.empty((len(positions), len(others)))
    start = problem.initial.copy()
    for column, state in enumerate(others):
        start[others] = 0.0
        start[state] = 1.0
        rates[:, column] = problem.derivative(0.0, start)[positions]
    return rates


def _product(matrix: FloatArray, values: FloatArray) -> FloatArray:
    """matrix @ values, of one state or of columns, summed term by term, as in compiled code."""
    if values.ndim == 2:
        matrix = matrix[:, :, None]
    return np.asarray(np.add.accumulate(matrix * values, axis=1)[:, -1])


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
