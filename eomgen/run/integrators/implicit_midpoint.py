"""The implicit midpoint rule: order 2, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1. It is Gauss collocation with one stage.
"""

from eomgen.engine.implicit import IMPLICIT_MIDPOINT
from eomgen.run.integrators.implicit_stages import ImplicitMethod

METHOD = ImplicitMethod(IMPLICIT_MIDPOINT, order=2)
INTEGRATOR = METHOD.integrator
