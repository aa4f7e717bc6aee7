"""Gauss collocation with three stages: order 6, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1.
"""

from eomgen.engine.implicit import GAUSS_6
from eomgen.run.integrators.implicit_stages import ImplicitMethod

METHOD = ImplicitMethod(GAUSS_6, order=6)
INTEGRATOR = METHOD.integrator
