"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian: see
`eomgen.engine.rosenbrock`.
"""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from eomgen.engine import few
from eomgen.engine.adaptive import Bounds, first_length
from eomgen.engine.rosenbrock import STAGES, Rodas, Solutions, rodas_step
from eomgen.run.integrators.interface import Adaptive, Remark, ignored
from eomgen.run.problem import FloatArray

TOO_SHORT = "Required step size is less than spacing between numbers."


class Rodas5P:
    """A solver of y' = fun(t, y) from `t0` on, with the interface of SciPy's.

    jac        its Jacobian df/dy, (t, y) -> (ny, ny)
    timed      whether `fun` depends on time
    positions  the number of states that are positions, which come first

    Its state consists of `t`, `y`, and `h_abs`, `h_last`, `error` and `lost` of `Rodas`.
    """

    remark: Remark = staticmethod(ignored)

    def __init__(
        self,
        fun: Callable[[float, FloatArray], FloatArray],
        t0: float,
        y0: FloatArray,
        t_bound: float,
        *,
        jac: Callable[[float, FloatArray], FloatArray],
        rtol: float,
        atol: float | FloatArray,
        max_step: float = math.inf,
        timed: bool = True,
        positions: int = 0,
    ) -> None:
        self.derivative, self.jacobian, self.max_step = fun, jac, max_step
        self.t, self.y, self.t_bound = float(t0), y0, t_bound
        self.t_old = self.t
        self.status: Literal["running", "finished", "failed"] = "running"
        self.nlu, self.lost = 0, np.zeros(len(y0))
        bounds = Bounds(np.zeros(len(y0)) + atol, rtol, max_step)
        longest = min(t_bound - self.t, max_step)
        self.h_abs = first_length(self, bounds, self.t, y0, fun(self.t, y0), longest)
        self.h_last, self.error = 0.0, 1.0
        n = len(y0)
        self._run = rodas(n, atol, (t_bound, max_step, rtol), positions, timed)
        self._run.solutions = Solutions(n)  # type: ignore[assignment]
        self._factors = few.factors_of(n, positions)
        self._step = (0.0, y0)

    def step(self) -> str | None:
        """Make a step; returns why it failed, or None."""
        run, t, y = self._run, self.t, self.y
        run.h_abs, run.h_last, run.error = self.h_abs, self.h_last, self.error
        run.longest, run.t_bound, run.factorisations = self.max_step, self.t_bound, self.nlu
        run.lost, run.last = self.lost.copy(), np.empty_like(y)
        is_made = rodas_step(self, run, self._factors, t, y)
        self.nlu = run.factorisations
        if not is_made:
            self.status = "failed"
            return TOO_SHORT
        self.h_abs, self.h_last, self.error = run.h_abs, run.h_last, run.error
        self.lost, self._step = run.lost, (run.end - t, y)
        self.t_old, self.t, self.y = t, run.end, run.last
        if self.t >= self.t_bound:
            self.status = "finished"
        return None

    def dense_output(self) -> Callable[[FloatArray | float], FloatArray]:
        """The states within the last step, as a function of times: (m,) -> (ny, m), or one."""
        (h, y), last, start = self._step, self.y.copy(), self.t_old
        first, second, third = self._run.dense.copy()

        def states(times: FloatArray | float) -> FloatArray:
            x = (np.asarray(times)[..., None] - start) / h
            back = 1 - x
            bend = back * (first + x * (second + x * third))
            return np.asarray(back * y + x * (last + bend)).T

        return states


def rodas(
    n: int,
    atol: float | FloatArray,
    limits: tuple[float, float, float],
    positions: int,
    timed: bool,
) -> Rodas:
    """What steps of n states are made with. The limits are the end, s, the longest step, s, and the
    relative tolerance.
    """
    t_bound, longest, rtol = limits
    lost, last, change = np.zeros((3, n))
    of = t_bound, longest, rtol, positions, timed, 0.0, 0.0, 1.0, 0.0, 0, 0
    room = np.zeros((STAGES, n)), np.zeros((3, n))
    return Rodas(*of, np.zeros(n) + atol, lost, last, change, *room)


INTEGRATOR = Adaptive(
    Rodas5P,
    uses_jacobian=True,
    asks_more=True,
    memory=("h_abs", "h_last", "error", "lost"),
    compiled="Rodas5P",
    smallest_rtol=1e-15,
)
