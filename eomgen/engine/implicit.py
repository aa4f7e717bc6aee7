"""Implicit Runge-Kutta methods, whose stages are solved by Newton's method with the exact Jacobian,
or by its simplified iteration, which keeps the factors of one matrix.

The stages are solved to roundoff, because the methods conserve invariants only as well as their
equations are solved. Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit
Runge-Kutta methods (BIT 48, 2008) give two more causes of drift by rounding: rounded coefficients,
which the `shares` avoid, and sums of small changes to large states, which whoever adds the changes
compensates.
"""

from dataclasses import dataclass
from functools import cache
from math import isfinite, sqrt
from typing import Annotated, Any

import numpy as np

from eomgen.engine.elimination import Factors, factored, solve_by
from eomgen.engine.system import StiffSystem
from eomgen.subset.words import Known, Matrix, Vector, added, unrolled, with_arrays, zeros

MAX_ITERATIONS = 20
SINGULAR, DIVERGES, UNSOLVED, INVALID = 0, -1, -2, -3
"""What is returned in place of the number of iterations: a matrix is singular; updates grow; too
many iterations; a function has no valid result."""
ROUNDOFF = 4 * 2.0**-52
NOISE = 1e-10
"""If updates stop shrinking below this fraction of the state, they are rounding errors of the
derivative, and the iteration ends. Above it, the iteration has not converged."""
NOTHING = 1e-13
"""The same bound, absolute, for a state that is almost zero, as of a body at rest on the ground."""
GROWTH = 2.0
"""An update may be so much larger than the one before. Where it is more, the iteration begins too
far from a solution for the theorem of Newton and Kantorovich, and may well end at another one."""
SMALL = 1e-9
"""A component below this fraction of the largest one is solved to roundoff of that fraction, not of
itself: it may be 0 in exact arithmetic."""


@dataclass(frozen=True)
class Collocation:
    """A method of s stages with positive weights b (s,) and nodes c (s,).

    `shares` (s, s) are the a_ij / b_j. A method conserves quadratic invariants, and is symplectic,
    if share_ij + share_ji = 1 (Hairer, Lubich, Wanner, Geometric Numerical Integration, theorem
    IV.2.2). In this form the condition holds exactly in floating point: Antonana, Makazaga, Murua,
    Reducing and monitoring round-off error propagation for symplectic implicit Runge-Kutta schemes
    (Numerical Algorithms 76, 2017).
    """

    name: str
    shares: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]

    @property
    def rows(self) -> list[list[tuple[int, float]]]:
        """The shares of each stage, with their numbers."""
        return [list(enumerate(row)) for row in self.shares]


_LATE = 1 / 2 + sqrt(3) / 3
_NEXT = 1 / 2 + 3 * sqrt(15) / 20
_LAST = 1 / 2 + 3 * sqrt(15) / 25
IMPLICIT_MIDPOINT = Collocation("implicit_midpoint", ((1 / 2,),), (1.0,), (1 / 2,))
GAUSS_4 = Collocation(
    "gauss_4",
    ((1 / 2, 1 - _LATE), (_LATE, 1 / 2)),
    (1 / 2, 1 / 2),
    (1 / 2 - sqrt(3) / 6, 1 / 2 + sqrt(3) / 6),
)
GAUSS_6 = Collocation(
    "gauss_6",
    ((1 / 2, 1 - _NEXT, 1 - _LAST), (_NEXT, 1 / 2, 1 - _NEXT), (_LAST, _NEXT, 1 / 2)),
    (5 / 18, 4 / 9, 5 / 18),
    (1 / 2 - sqrt(15) / 10, 1 / 2, 1 / 2 + sqrt(15) / 10),
)
"""Gauss collocation: Hairer, Norsett, Wanner, Solving ODEs I, tables II.7.3 and II.7.4."""


@dataclass(slots=True)
class Stages:
    """The stages of a step: the changes d of the state in them, their last update, and the
    Jacobians J_i there, one below the other; the h b_i a_ij / b_j, and their products with J_i, in
    rows and columns of which the positions of all stages come first.

    newton       the factors of its matrix
    change       that of the state
    simplified   whether iterations go on with the factors of an earlier one, if there are such:
                 more of them, but without a Jacobian. Hairer, Wanner, Solving ODEs II, section IV.8
    has_factors  whether there are such, of a step of the same length
    """

    many: int
    positions: int
    changes: Annotated[Matrix, "many", "STATES"]
    update: Annotated[Matrix, "many", "STATES"]
    jacobians: Annotated[Matrix, "many * STATES", "STATES"]
    couplings: Annotated[Matrix, "many", "many"]
    matrix: Annotated[Matrix, "many * STATES", "many * STATES"]
    newton: Annotated[Factors, "many * STATES"]
    change: Annotated[Vector, "STATES"]
    simplified: bool = False
    has_factors: bool = False


@cache
def _order(many: int, n: int, positions: int) -> Any:
    """The numbers of the unknowns of the stages, those of all positions first."""
    numbers = np.arange(many * n).reshape(many, n)
    return np.concatenate((numbers[:, :positions].ravel(), numbers[:, positions:].ravel()))


def _couple(many: int, n: int, positions: int, a: Matrix, jacobians: Matrix, to: Matrix) -> None:
    products = a[:, None, :, None] * jacobians.reshape(many, n, 1, n)
    order = _order(many, n, positions)
    to[:] = products.reshape(many * n, many * n)[order[:, None], order]


@with_arrays(_couple)
def couple(
    many: int,
    n: int,
    positions: int,
    a: Annotated[Matrix, "many", "many"],
    jacobians: Annotated[Matrix, "many * n", "n"],
    to: Annotated[Matrix, "many * n", "many * n"],
) -> None:
    """Write a_ik J_i where stage i depends on stage k."""
    others = n - positions
    first = many * positions - positions
    for i in range(many):
        for row in range(n):
            place = i * positions + row
            if row >= positions:
                place = first + i * others + row
            for k in range(many):
                factor = a[i, k]
                for j in range(positions):
                    to[place, k * positions + j] = factor * jacobians[i * n + row, j]
                for j in range(positions, n):
                    to[place, first + k * others + j] = factor * jacobians[i * n + row, j]


def _arrange(many: int, n: int, positions: int, x: Matrix, to: Vector) -> None:
    to[:] = x.ravel()[_order(many, n, positions)]


@with_arrays(_arrange)
def arrange(
    many: int,
    n: int,
    positions: int,
    x: Annotated[Matrix, "many", "n"],
    to: Annotated[Vector, "many * n"],
) -> None:
    """Write a number for each state in each stage, those of the positions of all stages first."""
    first = many * positions
    for i in range(many):
        for j in range(positions):
            to[i * positions + j] = x[i, j]
        for j in range(n - positions):
            to[first + i * (n - positions) + j] = x[i, positions + j]


def _spread(many: int, n: int, positions: int, x: Vector, to: Matrix) -> None:
    to.ravel()[_order(many, n, positions)] = x


@with_arrays(_spread)
def spread(
    many: int,
    n: int,
    positions: int,
    x: Annotated[Vector, "many * n"],
    to: Annotated[Matrix, "many", "n"],
) -> None:
    """What `arrange` has undone."""
    first = many * positions
    for i in range(many):
        for j in range(positions):
            to[i, j] = x[i * positions + j]
        for j in range(n - positions):
            to[i, positions + j] = x[first + i * (n - positions) + j]


def _largest_update(many: int, n: int, update: Matrix) -> float:
    return float(np.abs(update).max(initial=0.0))


@with_arrays(_largest_update)
def largest_update(many: int, n: int, update: Annotated[Matrix, "many", "n"]) -> float:
    """The size of an update; not finite if it is not."""
    largest = 0.0
    nothing = 0.0
    for i in range(many):
        for j in range(n):
            nothing += update[i, j] * 0.0
            if abs(update[i, j]) > largest:
                largest = abs(update[i, j])
    return largest + nothing


def _is_solved(
    many: int, n: int, scale: Vector, update: Matrix, size: float, previous: float
) -> bool:
    largest = float(scale.max(initial=0.0))
    missing = np.abs(update) * (size / previous)
    if (missing <= ROUNDOFF * np.maximum(scale, SMALL * largest)).all():
        return True
    return previous <= 2 * size and size <= max(NOISE * largest, NOTHING)


@with_arrays(_is_solved)
def is_solved(
    many: int,
    n: int,
    scale: Annotated[Vector, "n"],
    update: Annotated[Matrix, "many", "n"],
    size: float,
    previous: float,
) -> bool:
    """Whether the iteration has converged to roundoff, by the sizes of the last two updates.

    The remaining error is about the next update: this one times the last contraction factor.
    Hairer, Wanner, Solving ODEs II, section IV.8.
    """
    largest = 0.0
    for j in range(n):
        largest = max(largest, scale[j])
    ratio = size / previous
    all_small = True
    for i in range(many):
        for j in range(n):
            if abs(update[i, j]) * ratio > ROUNDOFF * max(scale[j], SMALL * largest):
                all_small = False
    if all_small:
        return True
    return previous <= 2.0 * size and size <= max(NOISE * largest, NOTHING)


def is_noise(n: int, scale: Annotated[Vector, "n"], size: float) -> bool:
    """Whether updates of this size may be rounding errors of the derivative."""
    largest = 0.0
    for j in range(n):
        largest = max(largest, scale[j])
    return size <= max(NOISE * largest, NOTHING)


def improved(
    system: StiffSystem,
    method: Known,
    t: float,
    h: float,
    start: Annotated[Vector, "STATES"],
    stages: Stages,
) -> bool:
    """An iteration of Newton's method for the changes d_i = h b_i f(t + c_i h, Y_i) with
    Y_i = start + Σ share_ij d_j; False if its matrix is singular.
    """
    many = stages.many
    n = len(start)
    for i in unrolled(range(len(method.b))):
        now = t + method.c[i] * h
        place = start + added(a * stages.changes[j] for j, a in method.rows[i])
        if not stages.has_factors:
            stages.jacobians[i * n : i * n + n] = system.jacobian(now, place)
        slope = system.derivative(now, place)
        stages.update[i, :] = h * method.b[i] * slope - stages.changes[i]
    if not stages.has_factors:
        couple(many, n, stages.positions, stages.couplings, stages.jacobians, stages.matrix)
        if not factored(stages.newton, 1.0, many * stages.positions, stages.matrix):
            return False
        stages.has_factors = stages.simplified
    missing = zeros(stages.many * len(start))
    arrange(many, n, stages.positions, stages.update, missing)
    solve_by(stages.newton, missing)
    spread(many, n, stages.positions, missing, stages.update)
    stages.changes[:, :] += stages.update
    return True


def begin_stages(system: StiffSystem, method: Known, h: float, stages: Stages) -> None:
    """Begin a step of length h with no changes; an explicit predictor would be far off on stiff
    problems.
    """
    stages.changes[:, :] = 0.0
    for i in unrolled(range(len(method.b))):
        for j, a in unrolled(method.rows[i]):
            stages.couplings[i, j] = h * method.b[i] * a


def implicit_change(
    system: StiffSystem,
    method: Known,
    t: float,
    h: float,
    y: Annotated[Vector, "STATES"],
    stages: Stages,
) -> int:
    """The change of the state in a step of length h: the sum of the stages' changes d. Returns the
    number of iterations, or why there is none.
    """
    begin_stages(system, method, h, stages)
    previous = 0.0
    for count in range(1, MAX_ITERATIONS + 1):
        if not improved(system, method, t, h, y, stages):
            return SINGULAR
        size = largest_update(stages.many, len(y), stages.update)
        if not isfinite(size):
            return DIVERGES
        solved = size == 0.0
        if not solved and previous > 0.0:
            scale = abs(y) + added(abs(stages.changes[i]) for i in range(len(method.b)))
            if size > GROWTH * previous and not is_noise(len(y), scale, size):
                return DIVERGES
            solved = is_solved(stages.many, len(y), scale, stages.update, size, previous)
        if solved:
            # Linear convergence ends not far below roundoff.
            if stages.simplified and not improved(system, method, t, h, y, stages):
                return SINGULAR
            stages.change[:] = added(stages.changes[i] for i in range(len(method.b)))
            return count
        previous = size
    return UNSOLVED
