"""Positions in which a mechanism's constraints are met, along its motion from the assembled one."""

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import takewhile

import numpy as np

from eomgen.dynamics.loops.clusters import clusters_of, span
from eomgen.dynamics.start.constraint_equations import Array, ConstraintEquations
from eomgen.language.formula import Formula, names_in
from eomgen.model.model import Model
from eomgen.scene.constraints import ConstraintTable

Place = tuple[Array, Array]
"""A position (nq,) and J there."""
STEP = 0.15
"""The distance of positions, rad, or in sizes of the mechanism."""
WALKS = 4
"""Walks along the motion: ahead, back, and in two other seeded directions."""
LONGEST, SHORTEST, ALL = 60, 6, 600
"""Most and fewest positions of a walk; fewer for more velocities, whose product is bounded."""
MET = 1e-8
"""A residual, in sizes, that is small enough here."""
REGULAR = 0.05
"""The least regularity of a position that is not near a singular one."""
SAFE = 0.02
"""The least pivot, relative to its row, with which dependent velocities may be solved for."""


def walked_positions(model: Model) -> tuple[Array, ...]:
    """Closed positions (nq,): walks along the freedoms."""
    return tuple(q for walk in _walks(model) for q, _ in walk)


def regular_positions(model: Model) -> tuple[Array, ...]:
    """The same without those near singular positions, where any elimination loses digits."""
    return tuple(q for walk in _walks(model) for q, matrix in walk if _is_regular(matrix))


def reached_positions(model: Model) -> tuple[Array, ...]:
    """The closed positions from the assembled one to the first singular one, where a run ends, in
    each walk.
    """
    return tuple(q for q, _ in _reached(model))


def _reached(model: Model) -> Iterator[Place]:
    for walk in _walks(model):
        yield from takewhile(lambda place: _is_regular(place[1]), walk)


def _is_regular(matrix: Array) -> bool:
    return _regularity(matrix) >= REGULAR


def _regularity(matrix: Array) -> float:
    """The least singular value of J relative to the greatest, its rows of length 1."""
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    if not lengths.all():
        return 0.0
    sizes = np.linalg.svd(matrix / lengths, compute_uv=False)
    return float(sizes[-1] / sizes[0])


def _walks(model: Model) -> tuple[tuple[Place, ...], ...]:
    """All walks. They are the same for each way to write the equations, and those that are compared
    ask for them one after another.
    """
    alike = replace(model, pivots=(), blocks=(), groups=(), outputs=(), notices=())
    return _walked(replace(alike, route="auto", loops_kept="auto"))


@lru_cache(maxsize=2)
def _walked(model: Model) -> tuple[tuple[Place, ...], ...]:
    equations = ConstraintEquations.of(model)
    return tuple(tuple(_walk(equations, walk)) for walk in range(WALKS))


def _walk(equations: ConstraintEquations, walk: int) -> Iterator[Place]:
    """Positions along a walk with their J. It ends near a singular one, where a run ends too:
    beyond, a linkage may go on in another way than the one it was assembled in.
    """
    model, nv = equations.model, len(equations.model.velocities)
    rng = random.Random(walk // 2)
    heading = np.array([rng.gauss(0.0, 1.0) for _ in range(nv)]) * (1.0 if walk % 2 else -1.0)
    q = np.array(model.initial_q)
    _, matrix = equations.both(q)
    least = min(REGULAR, _regularity(matrix) / 2)
    has_margins = any(row.margin is not None for row in equations.dynamics(q).rows)
    for _ in range(max(SHORTEST, min(LONGEST, ALL // nv))):
        step = heading - np.linalg.lstsq(matrix, matrix @ heading, rcond=1e-9)[0]
        size = float(np.abs(step).max())
        if size < 1e-9:
            return
        q = equations.moved(q, np.multiply(step, STEP / size, dtype=np.float64))
        for _ in range(4):
            g, matrix = equations.both(q)
            if not (np.isfinite(g).all() and np.isfinite(matrix).all()):
                return  # a constraint ends here
            if float(np.abs(g).max()) < MET:
                break
            q = equations.moved(q, np.asarray(-np.linalg.lstsq(matrix, g, rcond=1e-9)[0]))
        else:
            return
        if not equations.upright(q) or _regularity(matrix) < least:
            return
        if has_margins and equations.margin(q) < REGULAR**2:
            return
        heading = step / size
        yield q, matrix


def with_safe_pivots(model: Model) -> Model:
    """The model with only those `pivots` whose dependent velocities follow from the others, with
    large pivots, in all closed positions up to the first singular ones, where a run ends; all
    pivots of a cluster or none. None where something is driven: the walks know the positions at
    t = 0 only.
    """
    equations = ConstraintEquations.of(model)
    if model.driven or timed(model):
        return replace(model, pivots=())
    start = relative_pivots(equations.jacobian(np.array(model.initial_q)), model.pivots)
    safe = np.abs(start) >= SAFE
    for _, matrix in _reached(model):
        found = relative_pivots(matrix, model.pivots)
        safe &= (np.abs(found) >= SAFE) & (np.sign(found) == np.sign(start))
    fit = {row for (row, _), is_safe in zip(model.pivots, safe, strict=True) if is_safe}
    kept = [rows for rows in _rows_by_cluster(model) if rows <= fit]
    pivots = tuple(pair for pair in model.pivots if any(pair[0] in rows for rows in kept))
    return replace(model, pivots=pivots)


def safely_dependent(model: Model) -> bool:
    """Whether that is so of all rows."""
    return len(with_safe_pivots(model).pivots) == len(model.rows)


def timed(model: Model) -> bool:
    """Whether a constraint depends on time."""
    tables = [c for c in model.constraints if isinstance(c, ConstraintTable)]
    values = (getattr(c, field) for c in tables for field in type(c).model_fields)
    formulas = (f for x in values for f in (x if isinstance(x, tuple) else (x,)))
    return any("t" in names_in(f) for f in formulas if isinstance(f, Formula))


def _rows_by_cluster(model: Model) -> list[set[int]]:
    d = ConstraintEquations.of(model).dynamics(np.array(model.initial_q))
    clusters = clusters_of(d)
    found: dict[int, set[int]] = {}
    for i, row in enumerate(d.rows):
        _, frames = span(d, row)
        first = next(c.frames[0] for c in clusters if frames & set(c.frames))
        found.setdefault(first, set()).add(i)
    return list(found.values())


def relative_pivots(matrix: Array, order: Sequence[tuple[int, int]]) -> Array:
    """The pivots of elimination in an order, each relative to the greatest entry of its row."""
    work, found = matrix.copy(), []
    for n, (i, j) in enumerate(order):
        found.append(work[i, j] / (np.abs(matrix[i]).max() or 1.0))
        if not work[i, j]:
            return np.zeros(len(order))
        for k, _ in order[n + 1 :]:
            work[k] -= work[k, j] / work[i, j] * work[i]
    return np.array(found)
