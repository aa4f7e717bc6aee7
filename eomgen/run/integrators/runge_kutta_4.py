"""The classical Runge-Kutta method: explicit, four stages, order 4."""

from eomgen.run.integrators.interface import FixedStep
from eomgen.run.integrators.tableau import ButcherTableau
from eomgen.run.problem import FloatArray, Problem

# Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2.
TABLEAU = ButcherTableau(
    a=(
        (0, 0, 0, 0),
        (1 / 2, 0, 0, 0),
        (0, 1 / 2, 0, 0),
        (0, 0, 1, 0),
    ),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0, 1 / 2, 1 / 2, 1),
    order=4,
)


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """Return y(t + h) - y(t), shape (ny,)."""
    return TABLEAU.change(problem.derivative, t, y, h)


INTEGRATOR = FixedStep(
    lambda _: change, TABLEAU.order, stability=TABLEAU.stability, compiled="runge_kutta_4"
)
