"""Extrapolation of the explicit midpoint rule: Hairer, Norsett, Wanner, Solving ODEs I, II.9."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from eomgen.run.problem import FloatArray

Slope = Callable[[float, FloatArray], FloatArray]
MOST_ROWS = 10
SUBSTEPS = tuple(2 * row + 2 for row in range(MOST_ROWS))
"""Number of substeps for each row of the extrapolation table."""


@dataclass(frozen=True, eq=False)
class Row:
    """The explicit midpoint rule over a step: the change of y (ny,) up to the middle and the end,
    and the slopes at the start of each substep, (substeps, ny).
    """

    middle: FloatArray
    change: FloatArray
    slopes: FloatArray


def midpoint(
    fun: Slope, t: float, y: FloatArray, step: float, substeps: int, slope: FloatArray
) -> Row:
    """Hairer, Norsett, Wanner I, (II.9.13), for the change of y; `slope` is y' at the start."""
    h = step / substeps
    slopes = np.empty((substeps, len(y)))
    slopes[0] = slope
    before, change, middle = np.zeros_like(y), h * slope, y
    for i in range(1, substeps):
        if 2 * i == substeps:
            middle = change
        slope = slopes[i] = fun(t + i * h, y + change)
        before, change = change, before + 2 * h * slope
    return Row(middle, change, slopes)


def next_row(
    above: list[FloatArray], value: FloatArray, substeps: Sequence[int]
) -> list[FloatArray]:
    """A row of the Aitken-Neville table in the squares of the substeps, from the row above."""
    columns = [value]
    for i, left in enumerate(above):
        ratio = substeps[-1] / substeps[-2 - i]
        columns.append(columns[-1] + (columns[-1] - left) / (ratio * ratio - 1))
    return columns


def extrapolated(values: Sequence[FloatArray], substeps: Sequence[int]) -> FloatArray:
    """The extrapolation of values with the given numbers of substeps to infinitely many."""
    columns: list[FloatArray] = []
    for row, value in enumerate(values, 1):
        columns = next_row(columns, value, substeps[:row])
    return columns[-1]


def norm(x: FloatArray) -> float:
    """The root mean square."""
    return sqrt(float(x @ x) / len(x))
