"""Steps of equal length for columns of states, in NumPy.

`eomgen.native.stepper` makes the same steps in compiled code, with the same bits.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import CodeType
from typing import Any

import numpy as np

from eomgen.base.errors import RunError, nearest
from eomgen.engine.sums import Sum, add_compensated
from eomgen.run.contact_columns import Lane, apart
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Change
from eomgen.run.module import GeneratedModule, load_module
from eomgen.run.problem import USUAL_LENGTH, FloatArray, Problem
from eomgen.run.projection import projection_of
from eomgen.run.sine import cosine, sine

BY_LIBRARY = {
    **dict.fromkeys(("tan", "asin", "acos", "atan", "exp", "log", "tanh"), 1),
    "atan2": 2,
}
"""Functions that the mathematical library computes, with how many arguments each takes."""


def by_library(name: str) -> Callable[..., FloatArray]:
    """A function of arrays with the bits of the mathematical library; NumPy has its own."""
    function = getattr(math, name)

    def value(*x: float) -> float:
        try:
            return float(function(*x))
        except OverflowError:
            return math.inf
        except ValueError:
            return math.nan

    made = np.frompyfunc(value, BY_LIBRARY[name], 1)
    return lambda *x: np.asarray(made(*x), dtype=np.float64)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: by_library(name) for name in BY_LIBRARY},
    "sin": sine,
    "cos": cosine,
    "min": lambda a, b: np.where(b < a, b, a),
    "max": lambda a, b: np.where(b > a, b, a),
}
"""Functions of columns whose bits are the same in compiled code and on every machine, the
mathematical library aside."""


def module_for_columns(source: str, name: str, code: CodeType | None = None) -> GeneratedModule:
    """A generated module whose functions of columns are computed by `FUNCTIONS`."""
    module: Any = load_module(source, name, code)
    module._COLUMNS.update({f: FUNCTIONS[f] for f in module._COLUMNS if f in FUNCTIONS})
    made: GeneratedModule = module
    return made


@dataclass(frozen=True, eq=False)
class Given:
    """What columns of states are stepped with.

    t     time at the start, s, of all or of each, (k,)
    u, p  inputs (nu,) or (nu, k), parameters (np,) or (np, k); None for the scene's own
    """

    t: float | FloatArray = 0.0
    u: FloatArray | None = None
    p: FloatArray | None = None

    def of(self, chosen: Any) -> "Given":
        """The same of some of the columns: a mask, indices, or an index."""
        t = self.t[chosen] if isinstance(self.t, np.ndarray) else self.t
        u, p = (x[:, chosen] if x is not None and x.ndim == 2 else x for x in (self.u, self.p))
        return Given(t, u, p)


class ColumnSteps:
    """Steps of dt, s, for columns of states of a module, by the change of a method.

    problem  the module's, at the scene's parameters and inputs
    size     size of the mechanism, to which residuals of constraints are relative
    rest     speed below which rigid contacts do not bounce; None for the default
    """

    def __init__(
        self,
        module: GeneratedModule,
        problem: Problem,
        change: Change,
        dt: float,
        size: float,
        rest: float | None,
    ) -> None:
        self._module, self._problem, self._change = module, problem, change
        self._dt, self._size, self._rest = dt, size, rest

    def __call__(
        self, y: FloatArray, lost: FloatArray, given: Given, steps: int
    ) -> tuple[FloatArray, FloatArray]:
        """The states (ny, k) after this many steps, and the rounding errors of the sums there.

        lost  those of the sums before, which the first step adds: see `fixed_step.advances`

        A state that is not finite, or leaves the constraints for good, becomes nan as a whole.
        """

        def derivative(t: float, y: FloatArray) -> FloatArray:
            return self._module.derivative(t, y, given.p, given.u)

        def implicit_step(t: float, y: FloatArray, h: float) -> FloatArray:
            module: Any = self._module
            return np.asarray(module.implicit_step(t, y, h, given.p, given.u))

        own = None if self._problem.implicit_step is None else implicit_step
        problem = replace(self._problem, derivative=derivative, implicit_step=own)
        with np.errstate(all="ignore"):
            for i in range(steps):
                t: Any = given.t + i * self._dt
                change = self._change(problem, t, y, self._dt)
                total = Sum(y.copy(), lost)
                add_compensated(total, change)
                end = Given(given.t + (i + 1) * self._dt, given.u, given.p)
                last = self.projected(total.value, end)
                if self._problem.contacts:
                    self._lead(replace(given, t=t), end, y, lost, last, total.lost)
                y, lost = last, total.lost
        wrong = ~np.isfinite(y).all(axis=0)
        y[:, wrong], lost[:, wrong] = np.nan, 0.0
        return y, lost

    def _lead(
        self,
        given: Given,
        end: Given,
        y: FloatArray,
        lost: FloatArray,
        last: FloatArray,
        left: FloatArray,
    ) -> None:
        """Make the steps of columns whose contacts touch, or may close, through all events: put
        their ends in `last`, and what rounding took in `left`.
        """
        contacts, module = self._problem.contacts, self._module
        assert contacts is not None
        places = ((given.t, y, given.p, given.u), (end.t, last, given.p, given.u))
        gaps, rates = zip(*((module.gaps(*x), module.gap_rates(*x)) for x in places), strict=True)  # type: ignore[attr-defined]
        for i in np.flatnonzero(~apart(contacts, gaps, rates)).tolist():
            one, until = given.of([i]), end.of(i)
            t = float(given.of(i).t)

            def placed(t: float, y: FloatArray, one: Given = one) -> FloatArray:
                return self.projected(y, replace(one, t=np.array([t])))

            lane = Lane(module, (one.p, one.u), self._problem, self._rest, self._change, placed)
            made = lane.led(t, y[:, i], lost[:, i], self._dt, float(until.t))
            last[:, i], left[:, i] = made or (np.nan, 0.0)

    def projected(self, y: FloatArray, given: Given) -> FloatArray:
        """The states with normalised quaternions, on the constraints if there are any; `y` is
        changed. One without such a state near it becomes nan.
        """
        problem, alone = self._problem, np.zeros(y.shape[1], dtype=bool)
        for indices in map(list, problem.quaternions):
            a, b, c, d = y[indices]
            length = np.sqrt(a * a + b * b + c * c + d * d)
            usual = (USUAL_LENGTH[0] < length) & (length < USUAL_LENGTH[1])
            alone |= ~usual
            y[indices] /= np.where(usual, length, 1.0)
        for i in np.flatnonzero(alone).tolist():
            y[:, i] = problem.unit(y[:, i])
        if problem.projection is None:
            return y
        for i in range(y.shape[1]):
            own = given.of(i)
            onto = projection_of(self._module, own.p, own.u, self._size)
            assert onto is not None
            try:
                y[:, i] = onto.onto(float(own.t), y[:, i], problem.unit)
            except (StepFailure, ValueError, ArithmeticError):
                y[:, i] = np.nan
        return y


def check_columns(problem: Problem, method: str, takes: Sequence[str]) -> None:
    """Raise `RunError` if there are no steps of a method for columns of a problem."""
    if method not in takes:
        raise RunError(
            f"method: no '{method}' with steps of equal length{nearest(method, takes)}; "
            f"known: {', '.join(takes)}"
        )
    if problem.projection is not None and method.startswith("leapfrog"):
        raise RunError(f"method: {method} with constraints solves equations; take rk4")
