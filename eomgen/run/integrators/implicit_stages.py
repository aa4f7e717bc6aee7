"""Implicit Runge-Kutta methods as integrators: see `eomgen.engine.implicit`, and with constraints,
symmetric projection: `eomgen.engine.symmetric`.

Those of Gauss are A-stable, symplectic and time-reversible, and conserve every quadratic invariant:
Hairer, Lubich, Wanner, Geometric Numerical Integration, theorem IV.2.1.
"""

from dataclasses import dataclass

import numpy as np

from eomgen.engine import few
from eomgen.engine.implicit import (
    DIVERGES,
    GAUSS_4,
    GAUSS_6,
    IMPLICIT_MIDPOINT,
    MAX_ITERATIONS,
    SINGULAR,
    UNSOLVED,
    Collocation,
    Stages,
    implicit_change,
)
from eomgen.engine.structures import with_room
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
        stages, room, most = stages_of(many, problem), None, MAX_ITERATIONS
        stages.newton = few.factors_of(many * n, many * positions)
        if problem.projection:
            room, most = projected_of(many, problem), MOST_PROJECTED
            room.first, room.second = few.factors_of(n, positions), few.factors_of(2 * room.rows)
        why = {**WHY, UNSOLVED: f"Newton did not converge in {most} iterations"}

        def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
            stages.change = np.empty(len(y))
            if room is None:
                made = implicit_change(problem, self.of, t, h, y, stages)
            else:
                linkage = linkage_of(problem)
                made = projected_change(problem, linkage, self.of, t, h, y, stages, room)
            if made in why:
                raise StepFailure(why[made], REMEDY)
            return stages.change

        return change

    def change(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        """Return y(t + h) - y(t), (ny,). Raises `StepFailure` if it is not found."""
        return self.prepared(problem)(problem, t, y, h)


def stages_of(many: int, problem: Problem) -> Stages:
    """Room for the stages of a step."""
    return with_room(
        Stages, many=many, positions=problem.leading_positions, STATES=len(problem.states)
    )


def projected_of(many: int, problem: Problem) -> Projected:
    """Room for the symmetric projection of a step with so many stages."""
    (n, rows), quaternions = sizes_of(problem), problem.quaternions
    sizes = {"n": n, "nv": n - len(quaternions), "rows": rows, "many": len(quaternions)}
    given = {**sizes, "quaternions": np.array(sum(quaternions, ()), np.int64)}
    return with_room(Projected, stages=many + 1, states=len(problem.states), **given)


METHODS = {
    of.name: ImplicitMethod(of, order)
    for of, order in ((IMPLICIT_MIDPOINT, 2), (GAUSS_4, 4), (GAUSS_6, 6))
}
"""The methods of Gauss, by their names."""
MIDPOINT, FOUR, SIX = (method.integrator for method in METHODS.values())
