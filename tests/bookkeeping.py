"""What effects do to the energy of a scene, and its Jacobian by differences, for tests."""

import numpy as np
from engine import Engine, along, exact

from eomgen.derivation.recursive.dynamics import Dynamics, Values
from eomgen.derivation.recursive.numbers import FloatScalars


def powers(made: Engine, y: np.ndarray, t: float = 0.0) -> list[float]:
    """What each effect does to the motion, W."""
    nq = len(made.model.coordinates)
    values = Values(made.module.PARAMETERS, {}, [*y[:nq]], [*y[nq:]], {}, t)
    dynamics = Dynamics(made.model, values, FloatScalars())
    return [float(dynamics.power(effect)) for effect in made.model.effects]


def gained(made: Engine, output: str, y: np.ndarray, t: float = 0.0) -> float:
    """How fast an energy grows, W, in 60 digits along the motion that the module computes."""
    rate = made.module.derivative(t, y)
    return float(along(lambda at: made.exactly(output, at), exact(y), exact(rate)))


def differences(made: Engine, y: np.ndarray, t: float, h: float = 1e-6) -> np.ndarray:
    """The Jacobian by central differences of the module."""
    steps = h * np.eye(len(y))
    f = made.module.derivative
    return np.array([(f(t, y + e) - f(t, y - e)) / (2 * h) for e in steps]).T
