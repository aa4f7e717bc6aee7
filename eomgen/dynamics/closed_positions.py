"""Positions in which a mechanism's constraints are met, along its motion from the assembled one."""

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from eomgen.dynamics.assembly import Array, Closure
from eomgen.dynamics.clusters import clusters_of, span
from eomgen.dynamics.constraints import rows_of
from eomgen.model.model import Model

STEP = 0.15
"""The distance of positions, rad, or in sizes of the mechanism."""
WALKS = 4
"""Walks along the motion: ahead, back, and in two other seeded directions."""
LONGEST, SHORTEST, ALL = 60, 6, 600
"""Most and fewest positions of a walk; fewer for more velocities, whose product is bounded."""
MET = 1e-8
"""A residual, in sizes, that is small enough here."""
SAFE = 0.02
"""The least pivot, relative to its row, with which dependent velocities may be solved for."""


@lru_cache(maxsize=8)
def closed_positions(model: Model) -> tuple[Array, ...]:
    """Closed positions (nq,): walks along the freedoms."""
    return tuple(q for walk in range(WALKS) for q, _ in _walk(model, walk))


def _walk(model: Model, walk: int) -> Iterator[tuple[Array, Array]]:
    """Positions along a walk with their J."""
    closure, nv = Closure.of(model), len(model.velocities)
    rng = random.Random(walk // 2)
    heading = np.array([rng.gauss(0.0, 1.0) for _ in range(nv)]) * (1.0 if walk % 2 else -1.0)
    q = np.array(model.initial_q)
    _, matrix = closure.both(q)
    for _ in range(max(SHORTEST, min(LONGEST, ALL // nv))):
        step = heading - np.linalg.lstsq(matrix, matrix @ heading, rcond=1e-9)[0]
        size = float(np.abs(step).max())
        if size < 1e-9:
            return
        q = closure.moved(q, np.multiply(step, STEP / size, dtype=np.float64))
        for _ in range(4):
            g, matrix = closure.both(q)
            if float(np.abs(g).max()) < MET:
                break
            q = closure.moved(q, np.asarray(-np.linalg.lstsq(matrix, g, rcond=1e-9)[0]))
        else:
            return
        if not closure.upright(q):
            return
        heading = step / size
        yield q, matrix


def with_safe_pivots(model: Model) -> Model:
    """The model with only those `pivots` whose dependent velocities follow from the others, with
    large pivots, in all closed positions; all pivots of a cluster or none.
    """
    closure = Closure.of(model)
    start = _pivots(closure.jacobian(np.array(model.initial_q)), model.pivots)
    safe = np.abs(start) >= SAFE
    for walk in range(WALKS):
        for _, matrix in _walk(model, walk):
            found = _pivots(matrix, model.pivots)
            safe &= (np.abs(found) >= SAFE) & (np.sign(found) == np.sign(start))
    fit = {row for (row, _), is_safe in zip(model.pivots, safe, strict=True) if is_safe}
    kept = [rows for rows in _rows_by_cluster(model) if rows <= fit]
    pivots = tuple(pair for pair in model.pivots if any(pair[0] in rows for rows in kept))
    return replace(model, pivots=pivots)


def _rows_by_cluster(model: Model) -> list[set[int]]:
    d = Closure.of(model).dynamics(np.array(model.initial_q))
    found: dict[int, set[int]] = {}
    for i, row in enumerate(rows_of(d)):
        _, frames = span(d, row)
        first = next(c.frames[0] for c in clusters_of(d) if frames & set(c.frames))
        found.setdefault(first, set()).add(i)
    return list(found.values())


def _pivots(matrix: Array, order: Sequence[tuple[int, int]]) -> Array:
    """The pivots of elimination in an order, each relative to the greatest entry of its row."""
    work, found = matrix.copy(), []
    for n, (i, j) in enumerate(order):
        found.append(work[i, j] / (np.abs(matrix[i]).max() or 1.0))
        if not work[i, j]:
            return np.zeros(len(order))
        for k, _ in order[n + 1 :]:
            work[k] -= work[k, j] / work[i, j] * work[i]
    return np.array(found)
