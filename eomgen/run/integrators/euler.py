"""Euler's method: y_new = y + h f(t, y), explicit, order 1.

For comparison only: it adds energy to every oscillation, at a rate proportional to h.
"""

import numpy as np
from numpy.typing import NDArray

from eomgen.run.integrators.interface import FixedStep
from eomgen.run.problem import FloatArray, Problem


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """Return y(t + h) - y(t), (ny,). Hairer, Norsett, Wanner, Solving ODEs I, section I.7."""
    return h * problem.derivative(t, y)


def stability(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """R(z) at z = hλ, (n,): the factors by which a step multiplies the solutions of y' = λ y."""
    return 1 + z


INTEGRATOR = FixedStep(lambda _: change, order=1, stability=stability, compiled="euler")
