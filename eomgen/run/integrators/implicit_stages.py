"""Implicit Runge-Kutta methods, whose stages are solved by Newton's method with the exact Jacobian.

The stages are solved to roundoff, because the methods conserve invariants only as well as their
equations are solved. Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit
Runge-Kutta methods (BIT 48, 2008) give two more causes of drift by rounding: rounded coefficients,
which `ImplicitMethod.shares` avoids, and sums of small changes to large states, which `fixed_step`
compensates.

Sums are taken term by term in a fixed order, so that compiled code has the same bits: see
`eomgen.native.implicit` and `templates/c/implicit.c.jinja`, which repeats this arithmetic.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from eomgen.run.failure import StepFailure
from eomgen.run.integrators.elimination import factored
from eomgen.run.integrators.interface import FixedStep
from eomgen.run.integrators.tableau import ButcherTableau
from eomgen.run.problem import FloatArray, Problem

MAX_ITERATIONS = 20
REMEDY = "take a smaller --dt or an adaptive method (--integrator Radau)"

ROUNDOFF = 4 * float(np.finfo(np.float64).eps)
# If updates stop shrinking below this fraction of the state, they are rounding errors of the
# derivative, and the iteration ends. Above it, the iteration has not converged.
NOISE = 1e-10
# The same bound, absolute, for a state that is almost zero, as of a body at rest on the ground.
NOTHING = 1e-13
# A component below this fraction of the largest one is solved to roundoff of that fraction, not of
# itself: it may be 0 in exact arithmetic.
SMALL = 1e-9


@dataclass(frozen=True)
class ImplicitMethod:
    """An implicit Runge-Kutta method of s stages with positive weights b (s,) and nodes c (s,).

    `shares` (s, s) are the a_ij / b_j. A method conserves quadratic invariants, and is symplectic,
    if share_ij + share_ji = 1 (Hairer, Lubich, Wanner, Geometric Numerical Integration, theorem
    IV.2.2). In this form the condition holds exactly in floating point: Antonana, Makazaga, Murua,
    Reducing and monitoring round-off error propagation for symplectic implicit Runge-Kutta schemes
    (Numerical Algorithms 76, 2017).

    `compiled` is the name of its compiled steps. Raises `ValueError` if the method does not have
    the given order.
    """

    shares: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int
    compiled: str = ""

    def __post_init__(self) -> None:
        shares, b = self._arrays
        a = tuple(map(tuple, (shares * b).tolist()))
        ButcherTableau(a=a, b=self.b, c=self.c, order=self.order)

    @property
    def integrator(self) -> FixedStep:
        """The method as an integrator with equal steps."""
        return FixedStep(
            lambda _: self.change, self.order, REMEDY, explicit=False, compiled=self.compiled
        )

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.shares, dtype=np.float64), np.array(self.b, dtype=np.float64)

    def change(self, problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        """Return y(t + h) - y(t), (ny,): the sum of d_i = h b_i f(t + c_i h, Y_i) with
        Y_i = y + Σ share_ij d_j.

        Newton's method starts at d = 0; an explicit predictor would be far off on stiff problems.
        Raises `StepFailure` if the iteration does not converge.
        """
        shares, b = self._arrays
        stages, states = len(b), len(y)
        times = [t + node * h for node in self.c]
        lengths = h * b
        coupling = lengths[:, None] * shares
        changes = np.zeros((stages, states))
        slopes = np.empty((stages, states))
        matrix = np.empty((stages, states, stages, states))
        square = matrix.reshape(stages * states, stages * states)
        positions = problem.leading_positions
        order = _positions_first(stages, states, positions)
        across, update = order[:, None], np.empty_like(changes)
        previous = 0.0
        for _ in range(MAX_ITERATIONS):
            at_stages = y + _last(shares[:, :, None] * changes, axis=1)
            for i, time in enumerate(times):
                slopes[i] = problem.derivative(time, at_stages[i])
                jacobian = problem.jacobian(time, at_stages[i])
                np.multiply(coupling[i][:, None], jacobian[:, None, :], out=matrix[i])
            missing = lengths[:, None] * slopes - changes
            factors = factored(square[across, order], 1.0, stages * positions)
            if factors is None:
                raise StepFailure("Newton's matrix is singular", REMEDY)
            update.ravel()[order] = factors.solve(missing.ravel()[order])
            changes += update
            size = float(np.abs(update).max())
            if not isfinite(size):
                raise StepFailure("Newton's iteration diverges", REMEDY)
            if size == 0 or (previous and _is_solved(y, changes, update, size, previous)):
                return _last(changes, axis=0)
            previous = size
        raise StepFailure(f"Newton did not converge in {MAX_ITERATIONS} iterations", REMEDY)


def _is_solved(
    y: FloatArray, changes: FloatArray, update: FloatArray, size: float, previous: float
) -> bool:
    """Whether the iteration has converged to roundoff, by the sizes of the last two updates."""
    scale = np.abs(y) + _last(np.abs(changes), axis=0)
    largest = float(scale.max())
    # The remaining error is about the next update: this one times the last contraction factor.
    # Hairer, Wanner, Solving ODEs II, section IV.8.
    missing = np.abs(update) * (size / previous)
    if (missing <= ROUNDOFF * np.maximum(scale, SMALL * largest)).all():
        return True
    return previous <= 2 * size and size <= max(NOISE * largest, NOTHING)


def _last(terms: FloatArray, axis: int) -> FloatArray:
    """The sum of terms along an axis, one after the other."""
    return np.asarray(np.take(np.add.accumulate(terms, axis=axis), -1, axis=axis))


@cache
def _positions_first(stages: int, states: int, positions: int) -> NDArray[np.intp]:
    """The order of the unknowns in which the positions of all stages come before all else."""
    numbers = np.arange(stages * states).reshape(stages, states)
    return np.concatenate((numbers[:, :positions].ravel(), numbers[:, positions:].ravel()))
