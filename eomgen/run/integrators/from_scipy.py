"""SciPy's adaptive methods as integrators."""

import copy
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy import integrate

from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.adaptive_steps import Records
from eomgen.run.integrators import unwarned
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.maker import Maker
from eomgen.subset.words import Vector


class OfSciPy(Maker):
    """The steps of a solver of SciPy of some `kind`.

    memory    those of its attributes that, with time and state, determine the next step
    one_step  whether it goes on from the state that is given, not from its own
    """

    counts = ("factorisations",)
    h_abs = math.inf
    f: Vector

    def __init__(
        self,
        kind: Any,
        memory: Sequence[str],
        one_step: bool,
        *given: Any,
        max_step: float = math.inf,
        **options: Any,
    ) -> None:
        tolerances = {name: options[name] for name in ("rtol", "atol")}
        super().__init__(*given, max_step=max_step, **tolerances)
        self._solver = kind(*given, max_step=max_step, **options)
        self._solver.remark = lambda text: self.remark(text)
        self._memory, self._one_step = memory, one_step
        for name in memory:
            setattr(self, name, getattr(self._solver, name))
        self._dense: Any = None
        self._factored = 0

    def begin(self) -> None:
        """See `Maker`, also for what follows."""
        self._factored = self._solver.nlu
        for name in self._memory:
            setattr(self._solver, name, getattr(self, name))

    def make(self, run: Bounds, at: Progress, y: Vector, lost: Vector, raw: Vector) -> bool:
        solver, self._dense = self._solver, None
        solver.t_bound = run.until
        if self._one_step:
            solver.y = y.copy()
        why = solver.step()
        self.factorisations = int(solver.nlu - self._factored)
        if solver.status == "failed":
            self.why = (why or "the method failed").rstrip(".")
            return False
        at.end, raw[:] = float(solver.t), solver.y
        at.h = at.end - at.t
        if self._memory:
            at.length = float(solver.h_abs)
        return True

    def between(self, at: Progress, y: Vector, raw: Vector, t: Any, place: Vector) -> None:
        self._dense = self._dense or self._solver.dense_output()
        place[:] = self._dense(np.ravel(t)).T

    def record(self, run: Bounds, at: Progress, y: Vector, raw: Vector, kept: Records) -> None:
        kept.factorisations[kept.made] = self.factorisations
        if self._memory:
            kept.slopes[kept.made] = self._solver.f

    def frozen(self) -> "OfSciPy":
        self._dense = self._dense or self._solver.dense_output()
        return copy.copy(self)

    @property
    def slopes(self) -> Vector | None:
        return np.array([self.f, self._solver.f]) if self._memory else None


def _method(kind: Any, memory: tuple[str, ...] = (), one_step: bool = True, **of: Any) -> Adaptive:
    make = partial(OfSciPy, kind, memory, one_step)
    return Adaptive(make, memory=memory, one_step=one_step, **of)


RK45 = _method(integrate.RK45, ("h_abs", "f"))
RADAU = _method(unwarned.Radau, uses_jacobian=True)
RADAU_DIFFERENCES = _method(unwarned.Radau)
BDF = _method(unwarned.BDF, uses_jacobian=True, one_step=False)
BDF_DIFFERENCES = _method(unwarned.BDF, one_step=False)
LSODA = _method(unwarned.LSODA, uses_jacobian=True, one_step=False)
