"""Projection of a state onto the constraints of a mechanism, after each step.

The step of an integrator leaves the constraints by its error. Newton's method returns the
coordinates to them, and a linear solution the velocities, both to the nearest state in the metric
of the mass matrix (Hairer and Wanner II, VII.2; Eich 1993). The order of the method is kept, and no
error of the constraints adds up.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.run.integrators.interface import StepFailure
from eomgen.run.problem import FloatArray

MOST = 12
"""Most steps of Newton's method after a step; two suffice where steps are accurate."""
MET = 1e-15
"""A residual relative to the mechanism's size that is rounding, beside the last one."""
CLOSE = 1e-9
"""The largest residual that is left where Newton's method ends, in sizes."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The constraints of a module.

    names       of its rows
    sizes       size of each residual
    residuals   (t, y) -> (nc,), m or rad
    position    (t, y) -> (nq,), the coordinates after a step of Newton's method
    velocity    (t, y) -> (nv,), the velocities that meet the constraints
    """

    names: tuple[str, ...]
    sizes: FloatArray
    residuals: Callable[[float, FloatArray], FloatArray]
    position: Callable[[float, FloatArray], FloatArray]
    velocity: Callable[[float, FloatArray], FloatArray]
    coordinates: int

    def onto(self, t: float, y: FloatArray, unit: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """The state on the constraints; `unit` normalises quaternions.

        Raises `StepFailure` if the constraints cannot be met near the state.
        """
        y, nq = y.copy(), self.coordinates
        off = self._largest(t, y)
        for _ in range(MOST):
            if off <= MET:
                break
            there = y.copy()
            there[:nq] = self.position(t, y)
            there = unit(there)
            left = self._largest(t, there)
            if not left < off:  # rounding, or no way towards the constraints
                break
            y, off = there, left
        if not off <= CLOSE:
            worst = int(np.argmax(np.abs(self.residuals(t, y)) / self.sizes))
            raise StepFailure(
                f"constraint {self.names[worst]} cannot be met near t = {t:.6g} s",
                "take shorter steps, or a start farther from a singular position",
            )
        v = self.velocity(t, y)
        y[nq : nq + len(v)] = v
        return y

    def _largest(self, t: float, y: FloatArray) -> float:
        return float(np.abs(self.residuals(t, y) / self.sizes).max(initial=0.0))


def projection_of(module: Any, parameters: Any, inputs: Any, size: float) -> Projection | None:
    """The projection of a module of this size, m; None if it has no constraints."""
    names = getattr(module, "CONSTRAINTS", None)
    if not names:
        return None
    return Projection(
        tuple(names),
        np.array([size if module.UNITS[name] == "N" else 1.0 for name in names]),
        residuals=lambda t, y: module.constraint_residuals(t, y, parameters, inputs),
        position=lambda t, y: module.project_position(t, y, parameters, inputs),
        velocity=lambda t, y: module.project_velocity(t, y, parameters, inputs),
        coordinates=len(module.POSITIONS),
    )
