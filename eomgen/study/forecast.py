"""The motion ahead, roughly: LSODA's, which takes stiff motion as it takes any."""

import warnings
from typing import Any

import numpy as np
from scipy.integrate import LSODA

from eomgen.run.problem import Floats, Problem

FORECAST = 1e-10
"""Relative tolerance of the forecast; what it is off makes the first correction."""
ASTRAY = 1e-6
"""A forecast this far off, in parts of the scale, begins anew."""


class NoStep(ArithmeticError):
    """A step that cannot be made; the text says why."""


class Forecast:
    """The motion ahead, roughly: what one double-precision run yields, begun anew as it strays."""

    def __init__(self, problem: Problem, scale: Floats, t_end: float) -> None:
        self._problem, self._scale, self._t_end = problem, scale, t_end
        self._pieces: list[Any] = []
        self._solver: Any = None

    def __call__(self, t: float, y: Floats, times: Floats) -> Floats:
        """States (len(times), ny) at `times`, ascending and not before t, of the motion through y.

        Raises `NoStep` if it does not get there.
        """
        if self._solver is None or not self._reaches(t, t):
            self._begin(t, y)
        shift = y - self._at(t)
        if np.max(np.abs(shift) / self._scale) > ASTRAY:
            self._begin(t, y)
            shift = np.zeros_like(y)
        while not self._reaches(t, times[-1]):
            self._go_on()
        self._pieces = [piece for piece in self._pieces if piece.t >= t]
        return np.array([self._at(float(time)) + shift for time in times])

    def _begin(self, t: float, y: Floats) -> None:
        self._pieces = []
        self._solver = LSODA(
            self._problem.derivative,
            t,
            y.copy(),
            self._t_end,
            rtol=FORECAST,
            atol=FORECAST * self._scale,
            jac=self._problem.jacobian,
        )
        self._go_on()

    def _go_on(self) -> None:
        before = self._solver.t
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # LSODA says in one what it then fails with
            complaint = self._solver.step()
        if self._solver.status == "failed" or not np.isfinite(self._solver.y).all():
            raise NoStep(complaint or "the forecast failed")
        if self._solver.t > before:
            self._pieces.append(self._solver.dense_output())

    def _reaches(self, t: float, end: float) -> bool:
        pieces = self._pieces
        return bool(pieces) and pieces[0].t_old <= t and pieces[-1].t >= end

    def _at(self, t: float) -> Floats:
        piece = next(piece for piece in self._pieces if piece.t >= t)
        return np.asarray(piece(t))
