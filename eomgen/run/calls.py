"""The calls of functions in a run: how many, and where one failed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eomgen.run.problem import FloatArray


@dataclass
class Count:
    """The number of calls of functions of t and y, and where one last raised an error.

    `axes` is the number of axes of their values. If a function raises an error at a state that is
    not finite, its value is nan instead, so that the method rejects the step.
    """

    axes: int
    calls: int = 0
    failed: tuple[float, FloatArray] | None = None

    def of(
        self, function: Callable[[float, FloatArray], FloatArray]
    ) -> Callable[[float, FloatArray], FloatArray]:
        """The same function, but its calls are counted."""

        def counted(t: float, y: FloatArray) -> FloatArray:
            self.calls += 1
            try:
                return function(t, y)
            except (ArithmeticError, ValueError):
                if not np.isfinite(y).all():
                    return np.full((len(y),) * self.axes, np.nan)
                self.failed = float(t), np.array(y)
                raise

        return counted


@dataclass(frozen=True)
class Calls:
    """The calls of the derivative and of the Jacobian in a run."""

    derivatives: Count
    jacobians: Count
