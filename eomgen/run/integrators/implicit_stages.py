"""The stages of implicit Runge-Kutta methods, by Newton's method on the exact Jacobian.

Solved down to roundoff: what these methods conserve, they conserve as well as their equations are
solved. Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge-Kutta methods
(BIT 48, 2008) say what else lets rounding drift: coefficients that are rounded, and sums of small
changes to large states. The former is met here, the latter by `fixed_step`.
"""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from scipy.linalg.lapack import dgesv

from eomgen.run.integrators.interface import StepFailure
from eomgen.run.integrators.tableau import ButcherTableau
from eomgen.run.problem import FloatArray, Problem

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


@dataclass(frozen=True)
class ImplicitMethod:
    """A method of s stages whose every weight b (s,) is positive, with nodes c (s,).

    `shares` (s, s) are a_ij / b_j, each correct to the last digit or so. A method conserves
    quadratic invariants, and is symplectic, if share_ij + share_ji = 1 (Hairer, Lubich, Wanner,
    Geometric Numerical Integration, theorem IV.2.2); kept so, this holds exactly in spite of
    rounding: Antonana, Makazaga, Murua, Reducing and monitoring round-off error propagation for
    symplectic implicit Runge-Kutta schemes (Numerical Algorithms 76, 2017).

    Raises `ValueError` if the method is not of its order.
    """

    shares: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int

    def __post_init__(self) -> None:
        shares, b = self._arrays
        a = tuple(map(tuple, (shares * b).tolist()))
        ButcherTableau(a=a, b=self.b, c=self.c, order=self.order)

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.shares, dtype=np.float64), np.array(self.b, dtype=np.float64)

    def change(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        """Return y(t + h) - y(t), shape (ny,): the sum of d_i = h b_i f(t + c_i h, Y_i) with
        Y_i = y + Σ share_ij d_j.

        Newton's method starts at d = 0, which, unlike an explicit predictor, does no harm on stiff
        problems. Raises `StepFailure` if it does not converge.
        """
        shares, b = self._arrays
        stages, states = len(b), len(y)
        times = [t + node * h for node in self.c]
        lengths = h * b
        coupling = -lengths[:, None] * shares
        changes = np.zeros((stages, states))
        slopes = np.empty((stages, states))
        matrix = np.empty((stages, states, stages, states))
        square = matrix.reshape(stages * states, stages * states)
        diagonal = square.ravel()[:: stages * states + 1]
        previous = 0.0
        for _ in range(MAX_ITERATIONS):
            at_stages = y + shares @ changes
            for i, time in enumerate(times):
                slopes[i] = problem.derivative(time, at_stages[i])
                jacobian = problem.jacobian(time, at_stages[i])
                np.multiply(coupling[i][:, None], jacobian[:, None, :], out=matrix[i])
            diagonal += 1.0
            missing = lengths[:, None] * slopes - changes
            *_, solution, singular = dgesv(square, missing.ravel())
            if singular:
                raise StepFailure("Newton's matrix is singular", REMEDY)
            update = solution.reshape(stages, states)
            changes += update
            size = float(np.abs(update).max())
            if not isfinite(size):
                raise StepFailure("Newton's iteration diverges", REMEDY)
            if size == 0 or (previous and _is_solved(y, changes, update, size, previous)):
                return np.asarray(changes.sum(axis=0))
            previous = size
        raise StepFailure(f"Newton did not converge in {MAX_ITERATIONS} iterations", REMEDY)


def _is_solved(
    y: FloatArray, changes: FloatArray, update: FloatArray, size: float, previous: float
) -> bool:
    """Whether another iteration would gain nothing, after updates of these sizes."""
    scale = np.abs(y) + np.abs(changes).sum(axis=0)
    largest = float(scale.max())
    # What is still missing is about the next update: this one times the last contraction.
    # Hairer, Wanner, Solving ODEs II, section IV.8.
    missing = np.abs(update) * (size / previous)
    if (missing <= _ROUNDOFF * np.maximum(scale, _SMALL * largest)).all():
        return True
    return previous <= 2 * size and size <= max(_NOISE * largest, _NOTHING)
