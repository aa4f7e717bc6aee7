"""Heun's method."""

import numpy as np
from numpy.typing import NDArray

from eomgen.run.integrators.interface import FixedStep
from eomgen.run.problem import FloatArray, Problem


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """y(t + h) - y(t), (ny,). Hairer, Norsett, Wanner, Solving ODEs I, section II.1."""
    first = problem.derivative(t, y)
    return 0.5 * h * (first + problem.derivative(t + h, y + h * first))


def stability(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """R(z) = 1 + z + z²/2."""
    return 1 + z + z * z / 2


HEUN = FixedStep(lambda _: change, order=2, stability=stability)
