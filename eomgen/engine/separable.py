"""Whether leapfrog, or with constraints RATTLE, can make the steps of a mechanism."""

from typing import Annotated

from eomgen.engine.elimination import Factors, factorised, solve_by
from eomgen.engine.explicit import Split
from eomgen.engine.projection import Linkage
from eomgen.engine.rattle import Linked, across, force_at, largest_of
from eomgen.engine.system import System
from eomgen.subset.words import Matrix, Vector, Whole, copy, product, transposed, zeros

MOVED = 0.3
"""By so much a state is moved, relative to its size or 1, to see what depends on it."""
NEAR, SAME = 1e-5, 1e-6
"""The step of differences, and what counts as equal."""
NONE, UNKNOWN = -1, -2
"""No rate, or no force, depends on what it must not; that is not known."""


def coupled(
    system: System,
    many: int,
    group: Annotated[Whole, "many"],
    t: float,
    y: Annotated[Vector, "STATES"],
) -> int:
    """i many + j if the rate of state number i of a group depends on number j of it; or `NONE`."""
    rates = system.derivative(t, y)
    for j in range(many):
        place = copy(y)
        k = group[j]
        place[k] += MOVED * max(1.0, abs(y[k]))
        others = system.derivative(t, place)
        for i in range(many):
            if abs(others[group[i]] - rates[group[i]]) > 0.0:
                return i * many + j
    return NONE


def varying(system: System, split: Split, t: float, y: Annotated[Vector, "STATES"]) -> int:
    """The number of the position whose rate is not as the matrix of the split says; or `NONE`."""
    slope = system.derivative(t, y)
    rates = copy(slope[split.positions])
    velocities = copy(y[split.others])
    drift = product(split.rates, velocities)
    size = 0.0
    for i in range(len(split.positions)):
        size = max(size, abs(drift[i]))
    for i in range(len(split.positions)):
        if abs(rates[i] - drift[i]) > SAME * size:
            return i
    return NONE


def kept_by(
    rows: int,
    n: int,
    jacobian: Annotated[Matrix, "rows", "n"],
    factors: Factors,
    x: Annotated[Vector, "n"],
) -> None:
    """Take from x what lies along the rows, with the factors of J Jᵀ."""
    off = product(jacobian, x)
    solve_by(factors, off)
    along = product(transposed(jacobian), off)
    x[:] = x - along


def moved_force(system: Linkage, y: Annotated[Vector, "STATES"], room: Linked) -> int:
    """The number of the coordinate on which a force depends on velocities; or `NONE`, `UNKNOWN`.

    At the velocities of y, or those that keep the constraints, M v̇ + Ṁ v - ∂T/∂q, up to what acts
    along Jᵀ, is compared with that at rest.
    """
    still = copy(y)
    moving = copy(y)
    near = copy(y)
    slope = zeros(len(y))
    at_rest = zeros(room.n)
    bend = zeros(room.n)
    change = zeros(room.n)
    if not system.inertia_at(0.0, y, room.here) or not system.rows_at(0.0, y, room.before):
        return UNKNOWN
    across(room.rows, room.n, 1.0, room.before, room.before, room.matrix)
    if not factorised(room.third, room.matrix):
        return UNKNOWN
    if not force_at(system, room.n, 0.0, room.here, still, slope, at_rest):
        return UNKNOWN
    v = copy(y[room.n : 2 * room.n])
    kept_by(room.rows, room.n, room.before, room.third, v)
    moving[room.n : 2 * room.n] = v
    if not system.rates_at(0.0, moving, slope) or not system.slopes_at(0.0, moving, bend):
        return UNKNOWN
    change[:] = product(room.here, slope[room.n : 2 * room.n])
    near[: room.n] = y[: room.n] + NEAR * v
    if not system.inertia_at(0.0, near, room.mass):
        return UNKNOWN
    ahead = product(room.mass, v)
    near[: room.n] = y[: room.n] - NEAR * v
    if not system.inertia_at(0.0, near, room.mass):
        return UNKNOWN
    behind = product(room.mass, v)
    change[:] = change + (ahead - behind) / (2.0 * NEAR)
    left = change - bend - at_rest
    kept_by(room.rows, room.n, room.before, room.third, left)
    size = largest_of(room.n, change) + largest_of(room.n, at_rest)
    worst = 0
    for i in range(1, room.n):
        if abs(left[i]) > abs(left[worst]):
            worst = i
    return worst if abs(left[worst]) > SAME * size else NONE
