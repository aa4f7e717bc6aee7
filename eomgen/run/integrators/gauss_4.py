"""Gauss collocation with two stages: order 4, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1. Coefficients: Hairer, Norsett, Wanner, Solving ODEs I, table II.7.3.
"""

from math import sqrt

from eomgen.run.integrators.implicit_stages import ImplicitMethod

_LATE = 1 / 2 + sqrt(3) / 3

METHOD = ImplicitMethod(
    shares=(
        (1 / 2, 1 - _LATE),
        (_LATE, 1 / 2),
    ),
    b=(1 / 2, 1 / 2),
    c=(1 / 2 - sqrt(3) / 6, 1 / 2 + sqrt(3) / 6),
    order=4,
    compiled="gauss_4",
)
INTEGRATOR = METHOD.integrator
