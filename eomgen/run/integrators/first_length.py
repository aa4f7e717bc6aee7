"""The length of the first step of an adaptive method."""

import math
from collections.abc import Callable

import numpy as np

from eomgen.run.problem import FloatArray


def first_length(
    fun: Callable[[float, FloatArray], FloatArray],
    t: float,
    y: FloatArray,
    slope: FloatArray,
    *,
    scale: FloatArray,
    power: float,
    longest: float,
) -> float:
    """The length in s of the first step from y (ny,) at t, at most `longest`.

    slope  the derivative there, (ny,)
    scale  the error allowed in each state, (ny,)
    power  1/k if the error of a step is proportional to its length to the power k

    Hairer, Norsett, Wanner, Solving ODEs I, section II.4.
    """
    if not len(y):
        return longest
    size, speed = norm(y / scale), norm(slope / scale)
    trial = 0.01 * size / speed if size >= 1e-5 and 1e-5 <= speed < math.inf else 1e-6
    trial = min(trial, longest)
    bend = norm((fun(t + trial, y + trial * slope) - slope) / scale) / trial
    if speed <= 1e-15 and bend <= 1e-15:
        length = max(1e-6, trial * 1e-3)
    else:
        length = (0.01 / max(speed, bend)) ** power
    return min(100 * trial, length, longest)


def norm(values: FloatArray) -> float:
    """The root of the mean square, summed in order; 0 of no values."""
    if not len(values):
        return 0.0
    return math.sqrt(float(np.add.accumulate(values * values)[-1]) / len(values))
