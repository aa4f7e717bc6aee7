"""Implicit Runge-Kutta methods as integrators: see `eomgen.engine.implicit`, and with constraints,
symmetric projection: `eomgen.engine.symmetric`.
"""

from dataclasses import dataclass
from functools import partial

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
    implicit_change,
)
from eomgen.engine.symmetric import MOST_PROJECTED, Projected, projected_change
from eomgen.engine.tableau import ButcherTableau
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.integrators.rattle import linkage_of, sizes_of
from eomgen.run.problem import FloatArray, Problem

REMEDY = "take a smaller --dt or an adaptive method (--integrator Radau)"
WHY = {
    SINGULAR: "Newton's matrix is singular",
    DIVERGES: "Newton's iteration diverges",
    UNSOLVED: f"Newton did not converge in {MAX_ITERATIONS} iterations",
}
WHY_PROJECTED = {
    **WHY,
    UNSOLVED: f"Newton did not converge in {MOST_PROJECTED} iterations",
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
        many, n, positions = len(self.of.b), len(problem.states), problem.leading_positions
        factors = few.factors_of(many * n, many * positions)
        room = stages_of(many, n, positions), factors
        if problem.projection is None:
            return partial(self._change, *room)
        rows = sizes_of(problem)[1]
        ends = few.factors_of(n, positions), few.factors_of(2 * rows)
        return partial(self._projected, *room, projected_of(many, problem), *ends)

    def change(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        """Return y(t + h) - y(t), (ny,). Raises `StepFailure` if it is not found."""
        return self.prepared(problem)(problem, t, y, h)

    def _change(
        self,
        stages: Stages,
        factors: Factors,
        problem: Problem,
        t: float,
        y: FloatArray,
        h: float,
    ) -> FloatArray:
        change = np.empty(len(y))
        made = implicit_change(problem, self.of, t, h, y, stages, factors, change)
        if made in WHY:
            raise StepFailure(WHY[made], REMEDY)
        return change

    def _projected(
        self,
        stages: Stages,
        factors: Factors,
        room: Projected,
        at_end: Factors,
        of_rows: Factors,
        problem: Problem,
        t: float,
        y: FloatArray,
        h: float,
    ) -> FloatArray:
        change, linkage = np.empty(len(y)), linkage_of(problem)
        (n, nv, rows), of = (room.n, room.nv, room.rows), self.of
        given = stages, factors, room, at_end, of_rows, change
        made = projected_change(problem, linkage, of, n, nv, rows, t, h, y, *given)
        if made in WHY:
            raise StepFailure(WHY_PROJECTED[made], REMEDY)
        return change


def stages_of(many: int, n: int, positions: int) -> Stages:
    """Room for the stages of a step of n states."""
    changes, update = np.zeros((2, many, n))
    jacobians, couplings = np.zeros((many * n, n)), np.zeros((many, many))
    matrix = np.zeros((many * n, many * n))
    return Stages(many, positions, changes, update, jacobians, couplings, matrix)


def projected_of(many: int, problem: Problem) -> Projected:
    """Room for the symmetric projection of a step with so many stages."""
    (n, rows), states = sizes_of(problem), len(problem.states)
    nv, wide = n - len(problem.quaternions), 2 * rows
    quaternions = np.array(sum(problem.quaternions, ()), np.int64)
    sizes = n, nv, rows, len(problem.quaternions), many + 1, states
    shapes = (
        *((n, nv), (rows, nv)),
        *((wide, states),) * 4,
        *((wide, wide), (states, states), (states, states), (many + 1, states)),
    )
    return Projected(*sizes, quaternions, *map(np.zeros, shapes))
