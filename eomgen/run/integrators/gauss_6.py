"""Gauss collocation with three stages: order 6, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant: Hairer, Lubich, Wanner, Geometric Numerical Integration,
theorem IV.2.1. Coefficients: Hairer, Norsett, Wanner, Solving ODEs I, table II.7.4.
"""

from math import sqrt

from eomgen.run.integrators.implicit_stages import ImplicitMethod

_NEXT = 1 / 2 + 3 * sqrt(15) / 20
_LAST = 1 / 2 + 3 * sqrt(15) / 25

METHOD = ImplicitMethod(
    shares=(
        (1 / 2, 1 - _NEXT, 1 - _LAST),
        (_NEXT, 1 / 2, 1 - _NEXT),
        (_LAST, _NEXT, 1 / 2),
    ),
    b=(5 / 18, 4 / 9, 5 / 18),
    c=(1 / 2 - sqrt(15) / 10, 1 / 2, 1 / 2 + sqrt(15) / 10),
    order=6,
    compiled="gauss_6",
)
INTEGRATOR = METHOD.integrator
