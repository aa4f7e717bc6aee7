"""Euler's method: y_new = y + h f(t, y), explicit, order 1.

Here as the yardstick: it feeds energy into every oscillation, at a rate proportional to h.
"""

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray, Problem

ORDER = 1


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """Return y(t + h) - y(t), (ny,). Hairer, Norsett, Wanner, Solving ODEs I, section I.7."""
    return h * problem.derivative(t, y)


def stability(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """R(z) at z = hλ, (n,): what a step multiplies exp(λt) by."""
    return 1 + z
