"""States at random, the same for the same seed."""

import numpy as np

from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Floats

REACH = {"rad": 2 * np.pi, "m": 0.6, "rad/s": 3.0, "m/s": 1.0}
"""How far from 0 a state of each unit may be; of any other unit 1."""


def random_state(module: GeneratedModule, rng: np.random.Generator) -> Floats:
    """A state (ny,) of a module: angles over two turns, slides within 0.6 m, unit quaternions of
    any attitude; 3 rad/s, 1 m/s.
    """
    reaches = [REACH.get(module.UNITS[state], 1.0) for state in module.STATES]
    y = np.array([reach * rng.uniform(-1.0, 1.0) for reach in reaches])
    for indices in map(list, module.QUATERNIONS):
        parts = rng.normal(size=4)
        y[indices] = parts / np.linalg.norm(parts)
    return y
