"""Random states, the same for the same seed."""

import numpy as np

from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray

REACH = {"rad": 2 * np.pi, "m": 0.6, "rad/s": 3.0, "m/s": 1.0}
"""Greatest absolute value of a state of each unit; 1 for other units."""
LARGE = 12
"""Velocities above which a model is large."""


def number_of_states(model: Model, asked: int | None, many: int, few: int) -> int:
    """How many states are made: as many as asked for, or by default fewer for a large model."""
    return asked or (many if len(model.velocities) <= LARGE else few)


def random_state(module: GeneratedModule, rng: np.random.Generator) -> FloatArray:
    """A state (ny,) of a module: angles over two turns, displacements within 0.6 m, quaternions of
    any orientation, velocities up to 3 rad/s and 1 m/s.
    """
    reaches = [REACH.get(module.UNITS[state], 1.0) for state in module.STATES]
    y = np.array([reach * rng.uniform(-1.0, 1.0) for reach in reaches])
    for indices in map(list, module.QUATERNIONS):
        parts = rng.normal(size=4)
        y[indices] = parts / np.linalg.norm(parts)
    return y
