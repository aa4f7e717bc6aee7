"""The implicit midpoint rule: order 2, A-stable, symplectic, time-reversible.

It conserves every quadratic invariant (Hairer, Lubich, Wanner, Geometric Numerical
Integration, theorem IV.2.1), but only as well as its equation is solved: hence Newton's method
on the exact Jacobian, down to roundoff.
"""

import numpy as np

from eomgen.run.integrators.interface import StepFailure
from eomgen.run.problem import Floats, Problem

ORDER = 2
MAX_ITERATIONS = 20
REMEDY = "take a smaller --dt or an adaptive method (--integrator Radau)"

_ROUNDOFF = 4 * np.finfo(np.float64).eps
# Updates that stop shrinking below this fraction of the state are the derivative's own rounding
# noise: nothing is gained by iterating on. Above it, they are a method that does not converge.
_NOISE = 1e-10
# The same where the whole state is as good as zero, as of a body at rest on the ground.
_NOTHING = 1e-13
# A component smaller than this fraction of the largest is solved to its roundoff, not to its own:
# one that should be 0 has no size of its own.
_SMALL = 1e-9


def step(problem: Problem, t: float, y: Floats, h: float) -> Floats:
    """Return y(t + h), shape (ny,), from d = h f(t + h/2, y + d/2), y(t + h) = y + d.

    Newton's method starts at d = 0, which, unlike an explicit predictor, does no harm on stiff
    problems. Raises `StepFailure` if it does not converge.
    """
    middle = t + h / 2
    identity = np.eye(len(y))
    change = np.zeros_like(y)
    previous = 0.0
    for _ in range(MAX_ITERATIONS):
        midpoint = y + change / 2
        residual = change - h * problem.derivative(middle, midpoint)
        matrix = identity - h / 2 * problem.jacobian(middle, midpoint)
        try:
            update = np.linalg.solve(matrix, -residual)
        except np.linalg.LinAlgError:
            raise StepFailure(f"Newton's matrix is singular; {REMEDY}") from None
        change = change + update
        size = np.max(np.abs(update))
        if not np.isfinite(size):
            raise StepFailure(f"Newton left the finite numbers; {REMEDY}")
        scale = np.abs(y) + np.abs(change)
        # What is still missing is about the next update: this one times the last contraction.
        # Hairer, Wanner, Solving ODEs II, section IV.8.
        contraction = size / previous if previous else 1.0
        sizes = np.maximum(scale, _SMALL * np.max(scale))
        converged = np.all(contraction * np.abs(update) <= _ROUNDOFF * sizes)
        stagnant = 0 < previous <= 2 * size and size <= max(_NOISE * np.max(scale), _NOTHING)
        if converged or stagnant:
            return y + change
        previous = size
    raise StepFailure(f"Newton did not converge in {MAX_ITERATIONS} iterations; {REMEDY}")
