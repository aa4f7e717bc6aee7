"""A prediction of the stages of a step in doubles, by DOP853, or by Radau if that takes too many
steps, as it does for stiff motion.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from eomgen.run.integrators.unwarned import Radau
from eomgen.run.problem import FloatArray, Problem

FORECAST, ROUGHLY = 1e-10, 1e-5
"""Tolerances of the prediction by DOP853 and by Radau; its error is the first correction of the
collocation. The second is above the rounding errors of a stiff derivative."""
MANY = 16
"""Steps of DOP853 in one call before Radau replaces it; usually there are a few."""


class NoStep(ArithmeticError):
    """A step cannot be made; the text says why."""


@dataclass
class Forecast:
    """Predictions of the motion of a problem; `scale` is that of its states, (ny,).

    check  called at every step; what it raises ends the prediction
    stiff  whether it is by Radau
    """

    problem: Problem
    scale: FloatArray
    check: Callable[[], None]
    stiff: bool = False

    def __call__(self, t: float, y: FloatArray, times: FloatArray) -> FloatArray:
        """States (len(times), ny) at `times`, ascending and after t, of the solution through y at
        t.

        Raises `NoStep` if the integration fails before the last of them.
        """
        found: list[FloatArray] = []
        steps, solver = 0, self._solver(t, y, float(times[-1]))
        while len(found) < len(times):
            self.check()
            complaint = solver.step()
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise NoStep(complaint or "the forecast failed")
            steps += 1
            if steps > MANY and not self.stiff:
                self.stiff = True
                return self(t, y, times)
            piece = solver.dense_output()
            found += [piece(time) for time in times[len(found) :] if time <= solver.t]
        return np.array(found)

    def _solver(self, t: float, y: FloatArray, end: float) -> Any:
        problem, tolerance = self.problem, ROUGHLY if self.stiff else FORECAST
        method: Any = Radau if self.stiff else DOP853
        given = {"jac": problem.jacobian} if self.stiff else {}
        allowed = {"rtol": tolerance, "atol": tolerance * self.scale}
        return method(problem.derivative, t, y.copy(), end, **allowed, **given)
