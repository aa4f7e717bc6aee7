"""Steps with symmetric projection: Hairer, Lubich, Wanner, Geometric Numerical Integration, V.4.1,
algorithm V.4.1.

The step starts from y + N(y)ᵀ μ and ends at z + N(y')ᵀ μ = y', z the end of the method's own step,
with the μ for which y' meets the constraints; the rows of N are the constraints' normals. With a
symmetric method the step is symmetric (theorem V.4.2), and so keeps energy in the long run as the
method does, which projection at the end alone does not.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Annotated

from eomgen.engine.elimination import Factors, factored, factorised, solve_by
from eomgen.engine.implicit import (
    DIVERGES,
    INVALID,
    SINGULAR,
    UNSOLVED,
    Stages,
    begin_stages,
    improved,
    is_solved,
    largest_update,
)
from eomgen.engine.projection import Linkage
from eomgen.engine.quaternions import tangents
from eomgen.engine.system import StiffSystem
from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    Whole,
    added,
    copy,
    product,
    transposed,
    zeros,
)

MOST_PROJECTED = 60
"""Most iterations of a step, which converge linearly."""


@dataclass(slots=True)
class Projected:
    """Room for a step of n coordinates and nv velocities with constraints in rows.

    quaternions  the four coordinates of each one, one after another
    basis   small displacements of the coordinates, see `tangents`
    jacobian
            the derivatives J of the constraints' rates by the velocities
    normals, beyond
            directions that lead off the constraints, of positions, then of velocities: at the
            beginning, and at the end
    ways    how the end moves with the multipliers
    both    sums of normals; and how far off each way leads in `matrix`
    half, whole
            half the step times the Jacobian of the rates, without and with 1 on the diagonal
    updates  the last update of the stages, and that of the end
    first, second
            factors of `half` and of `matrix`
    """

    n: int
    nv: int
    rows: int
    many: int
    stages: int
    states: int
    quaternions: Annotated[Whole, "4 * many"]
    basis: Annotated[Matrix, "n", "nv"]
    jacobian: Annotated[Matrix, "rows", "nv"]
    normals: Annotated[Matrix, "2 * rows", "states"]
    beyond: Annotated[Matrix, "2 * rows", "states"]
    ways: Annotated[Matrix, "2 * rows", "states"]
    both: Annotated[Matrix, "2 * rows", "states"]
    matrix: Annotated[Matrix, "2 * rows", "2 * rows"]
    half: Annotated[Matrix, "states", "states"]
    whole: Annotated[Matrix, "states", "states"]
    updates: Annotated[Matrix, "stages", "states"]
    first: Annotated[Factors, "states"]
    second: Annotated[Factors, "2 * rows"]


def normals_at(
    system: Linkage,
    t: float,
    y: Annotated[Vector, "STATES"],
    room: Projected,
    normals: Annotated[Matrix, "2 * room.rows", "room.states"],
) -> bool:
    """Directions that lead off the constraints: of positions, then of velocities."""
    if not system.rows_at(t, y, room.jacobian):
        return False
    tangents(room.n, room.nv, room.many, room.quaternions, y, 1.0, room.basis)
    normals[:, :] = 0.0
    for k in range(room.rows):
        along = product(room.basis, room.jacobian[k])
        normals[k, : room.n] = along
        normals[room.rows + k, room.n : room.n + room.nv] = room.jacobian[k]
    return True


def carried(
    h: float,
    jacobian: Annotated[Matrix, "room.states", "room.states"],
    positions: int,
    room: Projected,
) -> bool:
    """The ways of the end when the start moves along its normals, about: by the implicit midpoint
    rule, with the Jacobian of the last stage. False if its matrix is singular.
    """
    room.half[:, :] = 0.5 * h * jacobian
    room.whole[:, :] = room.half
    for i in range(room.states):
        room.whole[i, i] += 1.0
    if not factored(room.first, 1.0, positions, room.half):
        return False
    for k in range(2 * room.rows):
        way = product(room.whole, room.normals[k])
        solve_by(room.first, way)
        room.ways[k, :] = way + room.beyond[k]
    return True


def multipliers_at(
    system: Linkage,
    t: float,
    y: Annotated[Vector, "STATES"],
    room: Projected,
    off: Annotated[Vector, "2 * room.rows"],
) -> int:
    """How far a state is off the constraints, along `ways`, to first order; returns 1, or why that
    is not known. The Jacobian and the displacements are those at the state.
    """
    sizes = zeros(room.nv)
    for i in range(room.n):
        sizes = sizes + room.basis[i] * room.basis[i]
    for k in range(2 * room.rows):
        moved = copy(room.ways[k, : room.nv])
        if room.many > 0:
            moved = product(transposed(room.basis), room.ways[k, : room.n])
            moved = moved / sizes
        column = product(room.jacobian, moved)
        room.matrix[: room.rows, k] = column
        column = product(room.jacobian, room.ways[k, room.n : room.n + room.nv])
        room.matrix[room.rows :, k] = column
    if not system.off_by(t, y, off[: room.rows]) or not system.drift_at(t, y, off[room.rows :]):
        return INVALID
    if not factorised(room.second, room.matrix):
        return SINGULAR
    solve_by(room.second, off)
    return 1


def projected_change(
    system: StiffSystem,
    linkage: Linkage,
    method: Known,
    t: float,
    h: float,
    y: Annotated[Vector, "STATES"],
    stages: Stages,
    room: Projected,
) -> int:
    """The change of the state in a step of length h. Returns the number of iterations, or why there
    is none.
    """
    many = stages.many
    end = t + h
    off = zeros(2 * room.rows)
    multipliers = zeros(2 * room.rows)
    if not normals_at(linkage, end, y, room, room.normals):
        return INVALID
    room.beyond[:, :] = room.normals
    begin_stages(system, method, h, stages)
    previous = 0.0
    for count in range(1, MOST_PROJECTED + 1):
        aside = product(transposed(room.normals), multipliers)
        place = y + aside
        if not improved(system, method, t, h, place, stages):
            return SINGULAR
        step = aside + added(stages.changes[i] for i in range(len(method.b)))
        last = product(transposed(room.beyond), multipliers)
        last = y + step + last
        if not normals_at(linkage, end, last, room, room.beyond):
            return INVALID
        if not carried(h, stages.jacobians[(many - 1) * len(y) :], stages.positions, room):
            return SINGULAR
        made = multipliers_at(linkage, end, last, room, off)
        if made != 1:
            return made
        off = 0.0 - off
        before = copy(multipliers)
        multipliers = multipliers + off
        update = product(transposed(room.beyond), off)
        room.updates[:many] = stages.update
        room.updates[many, :] = update
        size = largest_update(many + 1, len(y), room.updates)
        if not isfinite(size):
            return DIVERGES
        solved = size == 0.0
        if not solved and previous > 0.0:
            scale = abs(y) + added(abs(stages.changes[i]) for i in range(len(method.b)))
            solved = is_solved(many + 1, len(y), scale, room.updates, size, previous)
        if solved:
            room.both[:, :] = room.normals + room.beyond
            ahead = product(transposed(room.both), off)
            behind = product(transposed(room.beyond), before)
            stages.change[:] = step + ahead + behind
            return count
        previous = size
    return UNSOLVED
