"""Explicit methods with steps of equal length, which `eomgen.engine.explicit` makes.

Euler's method is for comparison only: it adds energy to every oscillation, at a rate proportional
to the step. The semi-implicit one is symplectic, hence without energy drift, if the energy
separates into T(v) + V(q); if the mass matrix depends on q, it is only an explicit method of order
1.
"""

import numpy as np

from eomgen.engine import explicit
from eomgen.engine.explicit import EULER, RUNGE_KUTTA_4, Step
from eomgen.engine.tableau import ButcherTableau
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem


def runge_kutta(method: ButcherTableau) -> FixedStep:
    """The explicit method of a tableau, which has compiled steps."""

    def prepare(problem: Problem) -> Change:
        step = Step()

        def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
            explicit.runge_kutta(method, problem, t, y, h, step)
            return step.change

        return change

    return FixedStep(prepare, method.order, stability=method.stability, compiled=method.name)


def _semi_implicit_euler(problem: Problem) -> Change:
    step, positions = Step(), np.array(problem.positions, dtype=np.int64)

    def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        explicit.semi_implicit_euler(problem, positions, t, y, h, step)
        return step.change

    return change


EULER_STEPS = runge_kutta(EULER)
RK4 = runge_kutta(RUNGE_KUTTA_4)
SEMI_IMPLICIT_EULER = FixedStep(_semi_implicit_euler, order=1, compiled="semi_implicit_euler")
