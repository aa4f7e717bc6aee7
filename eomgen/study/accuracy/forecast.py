"""A prediction of the motion by LSODA, or by Radau if LSODA takes too many steps.

LSODA is much cheaper, for stiff motion too. But if rounding errors of a stiff derivative exceed its
tolerance, its steps become very short. Radau then has a looser tolerance, above those errors.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from eomgen.run.integrators.unwarned import LSODA, Radau
from eomgen.run.noise import step_noise
from eomgen.run.problem import FloatArray, Problem

FORECAST, ROUGHLY = 1e-10, 1e-5
"""Relative tolerances of the prediction by LSODA and by Radau; its error is the first correction
of the collocation."""
OF_NOISE = 10.0
"""Tolerances are at least this many times the rounding error of a state."""
ASTRAY = 1e-6
"""The prediction restarts when it is this far off, relative to the scale."""
MANY = 500
"""Steps of LSODA in one call before Radau replaces it; usually there are a few dozen."""


class NoStep(ArithmeticError):
    """A step cannot be made; the text says why."""


class Forecast:
    """A prediction of the motion by one run in doubles, which restarts when it drifts off.

    `check` is called at every step; what it raises ends the prediction.
    """

    def __init__(
        self, problem: Problem, scale: FloatArray, t_end: float, check: Callable[[], None]
    ) -> None:
        self._check = check
        self.problem, self.scale, self._t_end = problem, scale, t_end
        self._method: Any = LSODA
        self._tolerance, self._astray = FORECAST, ASTRAY * scale
        self._pieces: list[Any] = []
        self._solver: Any = None

    def __call__(self, t: float, y: FloatArray, times: FloatArray) -> FloatArray:
        """States (len(times), ny) at `times`, ascending and not before t, of the solution through
        y at t.

        Raises `NoStep` if the integration fails before the last of them.
        """
        if self._solver is None or not self._reaches(t, t):
            self._begin(t, y)
        shift = y - self._at(t)
        if np.any(np.abs(shift) > self._astray):
            self._begin(t, y)
            shift = np.zeros_like(y)
        steps = 0
        while not self._reaches(t, times[-1]):
            steps += 1
            if steps > MANY and self._method is LSODA:
                self._method, self._tolerance = Radau, ROUGHLY
                self._begin(t, y)
                shift = np.zeros_like(y)
            self._go_on()
        self._pieces = [piece for piece in self._pieces if piece.t >= t]
        return np.array([self._at(float(time)) + shift for time in times])

    def _begin(self, t: float, y: FloatArray) -> None:
        self._pieces = []
        noise = step_noise(self.problem.derivative, self.problem.jacobian, t, y, self._t_end)
        atol = np.maximum(self._tolerance * self.scale, OF_NOISE * noise)
        off = OF_NOISE * (atol + self._tolerance * self.scale)
        self._astray = np.maximum(ASTRAY * self.scale, off)
        self._solver = self._method(
            self.problem.derivative,
            t,
            y.copy(),
            self._t_end,
            rtol=self._tolerance,
            atol=atol,
            jac=self.problem.jacobian,
        )
        self._go_on()

    def _go_on(self) -> None:
        self._check()
        before = self._solver.t
        complaint = self._solver.step()
        if self._solver.status == "failed" or not np.isfinite(self._solver.y).all():
            raise NoStep(complaint or "the forecast failed")
        if self._solver.t > before:
            self._pieces.append(self._solver.dense_output())

    def _reaches(self, t: float, end: float) -> bool:
        pieces = self._pieces
        return bool(pieces) and pieces[0].t_old <= t and pieces[-1].t >= end

    def _at(self, t: float) -> FloatArray:
        piece = next(piece for piece in self._pieces if piece.t >= t)
        return np.asarray(piece(t))
