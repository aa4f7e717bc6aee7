"""Rounding at random: stochastic arithmetic for the steps of a run.

Two runs with the same method may share rounding errors, and their difference does not show them.
Where states, and derivatives of them, are rounded up or down at random, runs differ by the effect
of rounding on the motion (Vignes, A stochastic arithmetic for reliable scientific computation,
Mathematics and Computers in Simulation 35 (1993), 233).

A method that compensates its sums only rounds where it evaluates the derivative. So what is rounded
at random is always that: the increments of steps f h, at states with random last bits. Compiled
steps and compensated sums take the sum of these errors every `EVERY` steps.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EVERY = 16
"""Steps between two random errors of the sum."""
UNIT = 2.0**-53
"""The greatest relative error of rounding."""


class Shaken:
    """A derivative f(t, y) with random rounding errors of y and of its values."""

    def __init__(self, derivative: Callable[[float, FloatArray], FloatArray], seed: int) -> None:
        self._plain, self._random, self._waiting = derivative, np.random.default_rng(seed), 0

    @property
    def left(self) -> int:
        """The number of steps to the next random error of the sum."""
        return EVERY - self._waiting

    def derivative(self, t: float, y: FloatArray) -> FloatArray:
        """The derivative, rounded at random."""
        slope = self._plain(t, self._rounded(y))
        return self._rounded(slope)

    def error(self, t: float, y: FloatArray, length: float, steps: int) -> FloatArray:
        """The random error (ny,) of the last steps, of which there were `steps` more, each about
        `length` s long; 0 until there are `EVERY`.
        """
        self._waiting += steps
        if self._waiting < EVERY:
            return np.zeros_like(y)
        count, self._waiting = self._waiting, 0
        off = self.derivative(t, y) - self._plain(t, y)
        return np.asarray(math.sqrt(count) * length * off)

    def _rounded(self, x: FloatArray) -> FloatArray:
        return np.asarray(x * (1.0 + UNIT * self._random.choice((-1.0, 1.0), size=x.shape)))
