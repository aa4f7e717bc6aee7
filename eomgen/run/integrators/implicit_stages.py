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

from eomgen.engine.tableau import ButcherTableau
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.elimination import factored, product
from eomgen.run.integrators.interface import FixedStep
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Projection
from eomgen.run.tangents import tangents

MAX_ITERATIONS, MAX_PROJECTED = 20, 60
"""Most iterations, and those of a step with symmetric projection, which converge linearly."""
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
        newton = _Newton(self, problem, t, h, len(y))
        if problem.projection:
            return newton.projected(y, problem.projection)
        changes = np.zeros(newton.shape)
        previous = 0.0
        for _ in range(MAX_ITERATIONS):
            update = newton.update(y, changes)
            changes += update
            size = _finite(update)
            if size == 0 or (previous and _is_solved(y, changes, update, size, previous)):
                return _last(changes, axis=0)
            previous = size
        raise _unsolved()


class _Newton:
    """Newton's method for the stages of a step."""

    def __init__(
        self, method: ImplicitMethod, problem: Problem, t: float, h: float, states: int
    ) -> None:
        shares, b = method._arrays
        self._problem, self._shares, self._end, self._step = problem, shares, t + h, h
        self._times = [t + node * h for node in method.c]
        self._lengths = h * b
        self._coupling = self._lengths[:, None] * shares
        self.shape = stages, states = len(b), states
        self._positions = stages * problem.leading_positions
        self._order = _positions_first(stages, states, problem.leading_positions)
        self._slopes = np.empty(self.shape)
        self._matrix = np.empty((stages, states, stages, states))
        self._update = np.empty(self.shape)

    def update(self, start: FloatArray, changes: FloatArray) -> FloatArray:
        """The update of the stages' changes d in a step from `start`; valid until the next one.

        Raises `StepFailure` if its matrix is singular.
        """
        problem, order, slopes = self._problem, self._order, self._slopes
        unknowns = len(order)
        square = self._matrix.reshape(unknowns, unknowns)
        at_stages = start + _last(self._shares[:, :, None] * changes, axis=1)
        for i, time in enumerate(self._times):
            slopes[i] = problem.derivative(time, at_stages[i])
            jacobian = self._last = problem.jacobian(time, at_stages[i])
            np.multiply(self._coupling[i][:, None], jacobian[:, None, :], out=self._matrix[i])
        missing = self._lengths[:, None] * slopes - changes
        factors = factored(square[order[:, None], order], 1.0, self._positions)
        if factors is None:
            raise StepFailure("Newton's matrix is singular", REMEDY)
        self._update.ravel()[order] = factors.solve(missing.ravel()[order])
        return self._update

    def projected(self, y: FloatArray, projection: Projection) -> FloatArray:
        """The change of the state by a step with symmetric projection.

        The step starts from y + N(y) μ and ends at z + N(y') μ = y', z the end of the method's own
        step, with the μ for which y' meets the constraints. N are the constraints' normals. With a
        symmetric method the step is symmetric, and so keeps energy in the long run as the method
        does, which projection at the end alone does not (Hairer, Lubich, Wanner, V.4.1).

        Raises `StepFailure` if the iteration does not converge.
        """
        normals = normals_at(projection, self._end, y)
        beyond, changes = normals, np.zeros(self.shape)
        multipliers, previous = np.zeros(normals.shape[1]), 0.0
        for _ in range(MAX_PROJECTED):
            aside = product(normals, multipliers)
            update = self.update(y + aside, changes)
            changes += update
            step = aside + _last(changes, axis=0)
            end = y + step + product(beyond, multipliers)
            beyond = normals_at(projection, self._end, end)
            ways = self._carried(normals) + beyond
            more = -multipliers_at(projection, self._end, end, ways)
            before, multipliers = multipliers, multipliers + more
            updates = np.vstack((update, product(beyond, more)))
            size = _finite(updates)
            if size == 0 or (previous and _is_solved(y, changes, updates, size, previous)):
                return np.asarray(step + product(normals + beyond, more) + product(beyond, before))
            previous = size
        raise _unsolved(MAX_PROJECTED)

    def _carried(self, normals: FloatArray) -> FloatArray:
        """Changes (ny, k) of the start at the end of the step, about: by the implicit midpoint rule
        with the Jacobian of the last stage.
        """
        half = 0.5 * self._step * self._last
        factors = factored(half, 1.0, self._positions // self.shape[0])
        if factors is None:
            raise StepFailure("the matrix of a step is singular", REMEDY)
        begun = product(np.eye(len(normals)) + half, normals)
        return np.array([factors.solve(column) for column in begun.T]).T


def normals_at(projection: Projection, t: float, y: FloatArray) -> FloatArray:
    """Directions (ny, 2 nc) that lead off the constraints: of positions, then of velocities."""
    nq, jacobian = projection.coordinates, projection.scaled_jacobian(t, y)
    nc, nv = jacobian.shape
    found = np.zeros((len(y), 2 * nc))
    found[:nq, :nc] = product(tangents(y[:nq], projection.quaternions), jacobian.T)
    found[nq : nq + nv, nc:] = jacobian.T
    return found


def multipliers_at(projection: Projection, t: float, y: FloatArray, ways: FloatArray) -> FloatArray:
    """How far a state is off the constraints, in directions `ways` (ny, 2 nc), to first order,
    (2 nc,). Raises `StepFailure` if these do not lead off all of them.
    """
    jacobian, nq = projection.scaled_jacobian(t, y), projection.coordinates
    nv, sizes = jacobian.shape[1], projection.sizes
    moved = ways[:nq]
    if projection.quaternions:
        basis = tangents(y[:nq], projection.quaternions)  # its columns are orthogonal
        moved = product(basis.T, moved) / _last(basis**2, axis=0)[:, np.newaxis]
    matrix = np.vstack((product(jacobian, moved), product(jacobian, ways[nq : nq + nv])))
    off = np.concatenate((projection.residuals(t, y) / sizes, projection.rates(t, y) / sizes))
    factors = factored(-matrix, 0.0, 0)
    if factors is None:
        raise StepFailure("the constraints are singular", REMEDY)
    return factors.solve(off)


def _finite(update: FloatArray) -> float:
    """The size of an update. Raises `StepFailure` if it is not finite."""
    size = float(np.abs(update).max(initial=0.0))
    if not isfinite(size):
        raise StepFailure("Newton's iteration diverges", REMEDY)
    return size


def _unsolved(most: int = MAX_ITERATIONS) -> StepFailure:
    return StepFailure(f"Newton did not converge in {most} iterations", REMEDY)


def _is_solved(
    y: FloatArray, changes: FloatArray, update: FloatArray, size: float, previous: float
) -> bool:
    """Whether the iteration has converged to roundoff, by the sizes of the last two updates."""
    scale = np.abs(y) + _last(np.abs(changes), axis=0)
    largest = float(scale.max(initial=0.0))
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
