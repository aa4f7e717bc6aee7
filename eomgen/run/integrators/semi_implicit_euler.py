"""Semi-implicit (symplectic) Euler: kick the velocities, then drift with the new ones, order 1.

It is symplectic, hence without energy drift, if the energy separates into T(v) + V(q). If the mass
matrix depends on q, it is only an explicit method of order 1.
"""

from eomgen.run.integrators.interface import FixedStep
from eomgen.run.problem import FloatArray, Problem


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """Return y(t + h) - y(t), (ny,). Hairer, Lubich, Wanner, Geometric Numerical Integration,
    section VI.3. The drift is the position part of f(old positions, new velocities), which holds
    for every form of the state.
    """
    positions = list(problem.positions)
    kick = h * problem.derivative(t, y)
    kick[positions] = 0.0
    kick[positions] = h * problem.derivative(t, y + kick)[positions]
    return kick


INTEGRATOR = FixedStep(lambda _: change, order=1, compiled="semi_implicit_euler")
