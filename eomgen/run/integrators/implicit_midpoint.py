"""The implicit midpoint rule: order 2, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1. It is Gauss collocation with one stage.
"""

from eomgen.run.integrators.implicit_stages import ImplicitMethod

METHOD = ImplicitMethod(
    shares=((1 / 2,),), b=(1.0,), c=(1 / 2,), order=2, compiled="implicit_midpoint"
)
INTEGRATOR = METHOD.integrator
