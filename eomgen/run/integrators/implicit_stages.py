"""Implicit Runge-Kutta methods as integrators: see `eomgen.engine.implicit`, and with constraints,
symmetric projection.

Sums are taken term by term in a fixed order, so that compiled code has the same bits: see
`eomgen.native.implicit` and `templates/c/symmetric.c.jinja`, which repeats this arithmetic.
"""

from dataclasses import dataclass
from functools import partial
from math import isfinite

import numpy as np

from eomgen.engine import few
from eomgen.engine.elimination import Factors
from eomgen.engine.implicit import (
    DIVERGES,
    MAX_ITERATIONS,
    SINGULAR,
    UNSOLVED,
    Collocation,
    Stages,
    begin_stages,
    implicit_change,
    improved,
    is_solved,
    largest_update,
)
from eomgen.engine.tableau import ButcherTableau
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.elimination import factored, product
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Projection
from eomgen.run.tangents import tangents

MAX_PROJECTED = 60
"""Most iterations of a step with symmetric projection, which converge linearly."""
REMEDY = "take a smaller --dt or an adaptive method (--integrator Radau)"
WHY = {
    SINGULAR: "Newton's matrix is singular",
    DIVERGES: "Newton's iteration diverges",
    UNSOLVED: f"Newton did not converge in {MAX_ITERATIONS} iterations",
}


@dataclass(frozen=True)
class ImplicitMethod:
    """An implicit Runge-Kutta method. Raises `ValueError` if it does not have the given order."""

    of: Collocation
    order: int

    def __post_init__(self) -> None:
        a = np.array(self.of.shares) * self.of.b
        ButcherTableau(a=tuple(map(tuple, a.tolist())), b=self.of.b, c=self.of.c, order=self.order)

    @property
    def integrator(self) -> FixedStep:
        """The method as an integrator with equal steps."""
        compiled = self.of.name
        return FixedStep(self.prepared, self.order, REMEDY, explicit=False, compiled=compiled)

    def prepared(self, problem: Problem) -> Change:
        """Its steps, with room to work in."""
        return partial(self._change, *self._room(problem))

    def change(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        """Return y(t + h) - y(t), (ny,). Raises `StepFailure` if it is not found."""
        return self.prepared(problem)(problem, t, y, h)

    def _room(self, problem: Problem) -> tuple[Stages, Factors]:
        many, n, positions = len(self.of.b), len(problem.states), problem.leading_positions
        changes, update = np.zeros((2, many, n))
        shapes = (many * n, n), (many, many), (many * n, many * n)
        jacobians, couplings, matrix = map(np.zeros, shapes)
        stages = Stages(many, positions, changes, update, jacobians, couplings, matrix)
        return stages, few.factors_of(many * n, many * positions)

    def _change(
        self,
        stages: Stages,
        factors: Factors,
        problem: Problem,
        t: float,
        y: FloatArray,
        h: float,
    ) -> FloatArray:
        if problem.projection:
            return self._projected(stages, factors, problem, problem.projection, t, y, h)
        change = np.empty(len(y))
        made = implicit_change(problem, self.of, t, h, y, stages, factors, change)
        if made in WHY:
            raise StepFailure(WHY[made], REMEDY)
        return change

    def _projected(
        self,
        stages: Stages,
        factors: Factors,
        problem: Problem,
        projection: Projection,
        t: float,
        y: FloatArray,
        h: float,
    ) -> FloatArray:
        """The change of the state by a step with symmetric projection.

        The step starts from y + N(y) μ and ends at z + N(y') μ = y', z the end of the method's own
        step, with the μ for which y' meets the constraints. N are the constraints' normals. With a
        symmetric method the step is symmetric, and so keeps energy in the long run as the method
        does, which projection at the end alone does not (Hairer, Lubich, Wanner, V.4.1).

        Raises `StepFailure` if the iteration does not converge.
        """
        normals = normals_at(projection, t + h, y)
        beyond, changes = normals, stages.changes
        begin_stages(problem, self.of, h, stages)
        multipliers, previous = np.zeros(normals.shape[1]), 0.0
        sizes = stages.many + 1, len(y)
        for _ in range(MAX_PROJECTED):
            aside = product(normals, multipliers)
            if not improved(problem, self.of, t, h, y + aside, stages, factors):
                raise StepFailure(WHY[SINGULAR], REMEDY)
            step = aside + _last(changes, axis=0)
            end = y + step + product(beyond, multipliers)
            beyond = normals_at(projection, t + h, end)
            ways = (
                _carried(0.5 * h * stages.jacobians[-len(y) :], normals, stages.positions) + beyond
            )
            more = -multipliers_at(projection, t + h, end, ways)
            before, multipliers = multipliers, multipliers + more
            updates = np.vstack((stages.update, product(beyond, more)))
            size = largest_update(*sizes, updates)
            if not isfinite(size):
                raise StepFailure(WHY[DIVERGES], REMEDY)
            scale = np.abs(y) + _last(np.abs(changes), axis=0)
            if size == 0 or (previous and is_solved(*sizes, scale, updates, size, previous)):
                return np.asarray(step + product(normals + beyond, more) + product(beyond, before))
            previous = size
        raise StepFailure(f"Newton did not converge in {MAX_PROJECTED} iterations", REMEDY)


def _carried(half: FloatArray, normals: FloatArray, positions: int) -> FloatArray:
    """Changes (ny, k) of the start at the end of the step, about: by the implicit midpoint rule
    with `half` the step times the Jacobian of the last stage.
    """
    factors = factored(half, 1.0, positions)
    if factors is None:
        raise StepFailure("the matrix of a step is singular", REMEDY)
    begun = product(np.eye(len(normals)) + half, normals)
    return np.array([factors.solve(column) for column in begun.T]).T


def normals_at(projection: Projection, t: float, y: FloatArray) -> FloatArray:
    """Directions (ny, 2 nc) that lead off the constraints: of positions, then of velocities."""
    nq, jacobian = projection.coordinates, projection.scaled_jacobian(t, y)
    nc, nv = jacobian.shape
    found = np.zeros((len(y), 2 * nc))
    found[:nq, :nc] = product(tangents(y[:nq], projection.quaternions), jacobian.T)
    found[nq : nq + nv, nc:] = jacobian.T
    return found


def multipliers_at(projection: Projection, t: float, y: FloatArray, ways: FloatArray) -> FloatArray:
    """How far a state is off the constraints, in directions `ways` (ny, 2 nc), to first order,
    (2 nc,). Raises `StepFailure` if these do not lead off all of them.
    """
    jacobian, nq = projection.scaled_jacobian(t, y), projection.coordinates
    nv, sizes = jacobian.shape[1], projection.sizes
    moved = ways[:nq]
    if projection.quaternions:
        basis = tangents(y[:nq], projection.quaternions)  # its columns are orthogonal
        moved = product(basis.T, moved) / _last(basis**2, axis=0)[:, np.newaxis]
    matrix = np.vstack((product(jacobian, moved), product(jacobian, ways[nq : nq + nv])))
    off = np.concatenate((projection.residuals(t, y) / sizes, projection.rates(t, y) / sizes))
    factors = factored(-matrix, 0.0, 0)
    if factors is None:
        raise StepFailure("the constraints are singular", REMEDY)
    return factors.solve(off)


def _last(terms: FloatArray, axis: int) -> FloatArray:
    """The sum of terms along an axis, one after the other."""
    return np.asarray(np.take(np.add.accumulate(terms, axis=axis), -1, axis=axis))
