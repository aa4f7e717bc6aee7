"""Gauss collocation with two stages: order 4, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1.
"""

from eomgen.engine.implicit import GAUSS_4
from eomgen.run.integrators.implicit_stages import ImplicitMethod

METHOD = ImplicitMethod(GAUSS_4, order=4)
INTEGRATOR = METHOD.integrator
