"""Semi-implicit (symplectic) Euler: kick the velocities, then drift with the new ones, order 1.

Symplectic, hence without energy drift, where the energy separates into T(v) + V(q). With a
mass matrix that depends on q it is an explicit first-order method and promises nothing more.
"""

from eomgen.run.integrators.interface import FixedStep
from eomgen.run.problem import FloatArray, Problem


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """Return y(t + h) - y(t), shape (ny,). Hairer, Lubich, Wanner, Geometric Numerical Integration,
    section VI.3, written with the derivative alone so that it serves every form of the state:
    the drift is the position part of f at (old positions, new velocities).
    """
    positions = list(problem.positions)
    kick = h * problem.derivative(t, y)
    kick[positions] = 0.0
    kick[positions] = h * problem.derivative(t, y + kick)[positions]
    return kick


INTEGRATOR = FixedStep(lambda _: change, order=1)
