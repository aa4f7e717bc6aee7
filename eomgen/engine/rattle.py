"""RATTLE: the leapfrog of mechanisms with constraints. Order 2, symplectic, symmetric.

For a Hamiltonian system with a mass matrix that depends on positions (Hairer, Lubich, Wanner,
Geometric Numerical Integration, VII.1.4; H. C. Andersen, J. Comput. Phys. 52 (1983) 24-34, for
particles). With p = M v and the gradients of the kinetic energy T by q at fixed v,

    p' = p + h/2 (∂T/∂q(q, a) + F(q)) + J(q)ᵀ λ,    M(q) a = M(r) b = p'                (1)
    r = q + h/2 (a + b),    g(r) = 0                                                    (2)
    s = p' + h/2 (∂T/∂q(r, b) + F(r)) + J(r)ᵀ μ,    M(r) w = s,    J(r) w = 0           (3)

leads from q and v to r and w. F are the forces, up to those along Jᵀ, which λ and μ make up for:
M v̇ at rest.
"""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Annotated

import numpy as np

from eomgen.engine.elimination import Factors, factorised, solve_by, solve_rows
from eomgen.engine.explicit import Step
from eomgen.engine.implicit import DIVERGES, INVALID, SINGULAR, UNSOLVED
from eomgen.engine.projection import Linkage
from eomgen.subset.words import Matrix, Vector, copy, product, transposed, with_arrays, zeros

MOST = 60
"""Most iterations of a step; they converge linearly, by about h times the fastest rate."""
ROUNDOFF = 4 * 2.0**-52
NOISE = 1e-12
"""A change below this fraction of the coordinates is rounding if it is not smaller than that of two
iterations before. From one to the next it may grow while the iteration converges."""


@dataclass(slots=True)
class Linked:
    """Room for a step of n coordinates with constraints in rows: mass matrices and the rows J at
    its beginning and at its end, M⁻¹ Jᵀ as rows, and the matrix J M⁻¹ Jᵀ; and for the factors of
    two mass matrices and of this one.
    """

    n: int
    rows: int
    here: Annotated[Matrix, "n", "n"]
    mass: Annotated[Matrix, "n", "n"]
    before: Annotated[Matrix, "rows", "n"]
    after: Annotated[Matrix, "rows", "n"]
    ways: Annotated[Matrix, "rows", "n"]
    matrix: Annotated[Matrix, "rows", "rows"]
    first: Annotated[Factors, "n"]
    second: Annotated[Factors, "n"]
    third: Annotated[Factors, "rows"]


def _largest_of(n: int, x: Vector) -> float:
    return float(np.abs(x).max())


@with_arrays(_largest_of)
def largest_of(n: int, x: Annotated[Vector, "n"]) -> float:
    """The largest size of the entries; not a number if one is not."""
    largest = 0.0
    nothing = 0.0
    for i in range(n):
        nothing += 0.0 * x[i]
        if abs(x[i]) > largest:
            largest = abs(x[i])
    return largest + nothing


def _across(rows: int, n: int, factor: float, after: Matrix, ways: Matrix, to: Matrix) -> None:
    to[:] = factor * np.add.accumulate(after[:, None, :] * ways, axis=2)[:, :, -1]


@with_arrays(_across)
def across(
    rows: int,
    n: int,
    factor: float,
    after: Annotated[Matrix, "rows", "n"],
    ways: Annotated[Matrix, "rows", "n"],
    to: Annotated[Matrix, "rows", "rows"],
) -> None:
    """A factor times the matrix of products of rows with ways."""
    for i in range(rows):
        for k in range(rows):
            total = 0.0
            for j in range(n):
                total += after[i, j] * ways[k, j]
            to[i, k] = factor * total


def force_at(
    system: Linkage,
    n: int,
    t: float,
    mass: Annotated[Matrix, "n", "n"],
    still: Annotated[Vector, "STATES"],
    slope: Annotated[Vector, "STATES"],
    force: Annotated[Vector, "n"],
) -> bool:
    """The generalised forces M v̇ at rest; the velocities of `still` become 0."""
    still[n:] = 0.0
    if not system.rates_at(t, still, slope):
        return False
    force[:] = product(mass, slope[n : 2 * n])
    return True


def rattle(
    system: Linkage, t: float, y: Annotated[Vector, "STATES"], h: float, room: Linked, step: Step
) -> int:
    """A step of length h from y. Returns the number of iterations, or why there is no step."""
    half = h / 2.0
    q = copy(y[: room.n])
    v = copy(y[room.n : 2 * room.n])
    still = zeros(len(y))
    slope = zeros(len(y))
    there = zeros(len(y))
    at = zeros(len(y))
    force = zeros(room.n)
    bend = zeros(room.n)
    middle = zeros(room.n)
    a = copy(v)
    b = copy(v)
    off = zeros(room.rows)
    multipliers = zeros(room.rows)
    if not system.inertia_at(t, y, room.here) or not system.rows_at(t, y, room.before):
        return INVALID
    if not factorised(room.first, room.here):
        return SINGULAR
    solve_rows(room.rows, room.first, room.before, room.ways)
    still[: room.n] = q
    if not force_at(system, room.n, t, room.here, still, slope, force):
        return INVALID
    begun = product(room.here, v)
    begun = begun + half * force
    move = h * v
    there[: room.n] = q + move
    there[room.n : 2 * room.n] = b
    at[: room.n] = q
    earlier = inf
    before = inf
    iterations = 0
    while iterations < MOST:
        iterations += 1
        at[room.n : 2 * room.n] = a
        if not system.slopes_at(t, at, bend):
            return INVALID
        held = product(transposed(room.before), multipliers)
        middle = begun + half * bend + held  # (1)
        if not system.rows_at(t, there, room.after) or not system.inertia_at(t, there, room.mass):
            return INVALID
        if not factorised(room.second, room.mass):
            return SINGULAR
        a = copy(middle)
        b = copy(middle)
        solve_by(room.first, a)
        solve_by(room.second, b)
        found = half * (a + b)  # (2)
        change = found - move
        move = copy(found)
        there[: room.n] = q + move
        there[room.n : 2 * room.n] = b
        if not system.off_by(t, there, off):
            return INVALID
        across(room.rows, room.n, h, room.after, room.ways, room.matrix)
        if not factorised(room.third, room.matrix):
            return SINGULAR
        solve_by(room.third, off)
        multipliers = multipliers - off
        back = product(transposed(room.ways), off)
        back = h * back
        moved = largest_of(room.n, change)
        far = largest_of(room.n, back)
        moved = max(moved, far)
        size = largest_of(room.n, move)
        if not isfinite(moved + far + size):
            return DIVERGES
        if moved <= ROUNDOFF * size:
            break
        if earlier <= moved and moved <= NOISE * (largest_of(room.n, q) + size):
            break
        earlier = before
        before = moved
        if iterations == MOST:
            return UNSOLVED
    if not system.inertia_at(t, there, room.mass):
        return INVALID
    still[: room.n] = there[: room.n]
    if not force_at(system, room.n, t, room.mass, still, slope, force):
        return INVALID
    if not system.slopes_at(t, there, bend):
        return INVALID
    if not factorised(room.first, room.mass):
        return SINGULAR
    last = middle + half * (force + bend)  # (3)
    solve_by(room.first, last)
    solve_rows(room.rows, room.first, room.after, room.ways)
    across(room.rows, room.n, 1.0, room.after, room.ways, room.matrix)
    if not factorised(room.third, room.matrix):
        return SINGULAR
    off = product(room.after, last)
    solve_by(room.third, off)
    back = product(transposed(room.ways), off)
    total = zeros(len(y))
    total[: room.n] = move
    total[room.n : 2 * room.n] = last - back - v
    step.change = total
    step.place = still
    step.slope = slope
    return iterations
