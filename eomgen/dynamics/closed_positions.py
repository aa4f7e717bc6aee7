"""Positions in which a mechanism's constraints are met, along its motion from the assembled one."""

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from eomgen.dynamics.assembly import Array, Closure, newton
from eomgen.model.model import Model
from eomgen.scene.effects import Driven

STEP = 0.12
"""The distance of positions, rad, or in sizes of the mechanism."""
WALKS, LENGTH = 4, 60
"""Random walks along the motion, and the positions of each."""
SAFE = 0.02
"""The least pivot, relative to its row, with which dependent velocities may be solved for."""


def closed_positions(model: Model) -> tuple[Array, ...]:
    """Closed positions (nq,): walks along the freedoms, ahead, back and in seeded directions."""
    # Only drives have a say in them; other effects may hold tables, which cannot be keys.
    drives = tuple(effect for effect in model.effects if isinstance(effect, Driven))
    return _closed_positions(replace(model, effects=drives, outputs=(), route="auto"))


@lru_cache(maxsize=8)
def _closed_positions(model: Model) -> tuple[Array, ...]:
    return tuple(q for walk in range(WALKS) for q in _walk(model, walk))


def _walk(model: Model, seed: int) -> Iterator[Array]:
    closure, rng = Closure.of(model), random.Random(seed)
    everything = np.ones(len(model.velocities), dtype=bool)
    q = np.array(model.initial_q)
    before = np.array([rng.gauss(0.0, 1.0) for _ in model.velocities])
    before *= -1.0 if seed == 1 else 1.0
    if seed < 2:  # the same direction, ahead and back
        rng = random.Random(0)
        before = np.array([rng.gauss(0.0, 1.0) for _ in model.velocities]) * (1.0 - 2.0 * seed)
    for _ in range(LENGTH):
        matrix = closure.jacobian(q)
        step = before - np.linalg.lstsq(matrix, matrix @ before, rcond=1e-9)[0]
        size = float(np.abs(step).max())
        if size < 1e-9:
            return
        there = newton(closure, closure.moved(q, step * (STEP / size)), everything)
        if there is None or not closure.upright(there):
            return
        q, before = there, step / size
        yield q


def safely_dependent(model: Model) -> bool:
    """Whether the dependent velocities of `Model.pivots` follow from the others, with large pivots,
    in all of the closed positions.
    """
    closure = Closure.of(model)
    start = _pivots(closure.jacobian(np.array(model.initial_q)), model.pivots)
    for q in closed_positions(model):
        found = _pivots(closure.jacobian(q), model.pivots)
        if np.abs(found).min() < SAFE or (np.sign(found) != np.sign(start)).any():
            return False
    return True


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
