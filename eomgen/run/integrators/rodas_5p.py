"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian: see
`eomgen.engine.rosenbrock`.
"""

from functools import partial
from typing import Any

import numpy as np

from eomgen.engine import few
from eomgen.engine.adaptive import Bounds
from eomgen.engine.rosenbrock import STAGES, Rodas, Solutions, rodas_step
from eomgen.run.integrators.interface import Adaptive, Remark, ignored
from eomgen.run.integrators.solver import Solver, States
from eomgen.run.problem import FloatArray
from eomgen.subset.structures import with_room


class Rodas5P(Solver):
    """Its state has `h_abs`, `h_last` and `error` of `Rodas`.

    jac        the Jacobian df/dy, (t, y) -> (ny, ny)
    timed      whether the derivative depends on time
    positions  the number of states that are positions, which come first
    """

    remark: Remark = staticmethod(ignored)

    def __init__(
        self, *given: Any, jac: Any, timed: bool = True, positions: int = 0, **options: Any
    ) -> None:
        super().__init__(*given, **options)
        self.jacobian, y = jac, self.y
        self.h_abs = self.first_length(self.derivative(self.t, y))
        self.h_last, self.error = 0.0, 1.0
        self._run = rodas(len(y), self.bounds, positions, timed)
        self._run.solutions = Solutions(len(y))  # type: ignore[assignment]
        self._factors = few.factors_of(len(y), positions)
        self._step = (0.0, y)

    def made(self) -> tuple[float, FloatArray] | None:
        """See `Solver`."""
        run, t, y = self._run, self.t, self.y
        run.h_abs, run.h_last, run.error = self.h_abs, self.h_last, self.error
        run.longest, run.t_bound, run.factorisations = self.bounds.longest, self.t_bound, self.nlu
        run.lost, run.last = self.lost.copy(), np.empty_like(y)
        is_made = rodas_step(self, run, self._factors, t, y)
        self.nlu = run.factorisations
        if not is_made:
            return None
        self.h_abs, self.h_last, self.error = run.h_abs, run.h_last, run.error
        self.lost, self._step = run.lost, (run.end - t, y)
        return run.end, run.last

    def dense_output(self) -> States:
        """See `Solver`."""
        (h, y), last = self._step, self.y.copy()
        terms = np.vstack((self._run.dense, last))
        return partial(between, self.t_old, h, y, terms)


def between(
    start: float, h: float, y: FloatArray, terms: FloatArray, times: FloatArray | float
) -> FloatArray:
    """The states at times within a step of length h from `y` at `start`, from the terms (4, ny) of
    its interpolant, of which the last is the state at its end.
    """
    first, second, third, last = terms
    x = (np.asarray(times)[..., None] - start) / h
    back = 1 - x
    bend = back * (first + x * (second + x * third))
    return np.asarray(back * y + x * (last + bend)).T


def rodas(n: int, bounds: Bounds, positions: int, timed: bool) -> Rodas:
    """What steps of n states are made with, up to the end of the bounds."""
    limits = {"t_bound": bounds.until, "longest": bounds.longest, "rtol": bounds.rtol}
    sizes = {"STATES": n, "STAGES": STAGES}
    return with_room(Rodas, atol=bounds.atol, positions=positions, timed=timed, **limits, **sizes)


INTEGRATOR = Adaptive(
    Rodas5P,
    uses_jacobian=True,
    asks_more=True,
    memory=("h_abs", "h_last", "error", "lost"),
    compiled="Rodas5P",
    smallest_rtol=1e-15,
)
