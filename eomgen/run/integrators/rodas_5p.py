"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian: see
`eomgen.engine.rosenbrock`.
"""

import copy
from types import SimpleNamespace
from typing import Any

from eomgen.engine import few
from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.adaptive_steps import Records
from eomgen.engine.rosenbrock import (
    STAGES,
    Rodas,
    Solutions,
    rodas_within,
    rosenbrock_step,
)
from eomgen.engine.structures import with_room
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.integrators.maker import Maker
from eomgen.subset.words import Vector


class Rodas5P(Maker):
    """Its state has `h_abs`, `h_last` and `error` of `Rodas`.

    jac        the Jacobian df/dy, (t, y) -> (ny, ny)
    timed      whether the derivative depends on time
    positions  the number of states that are positions, which come first
    """

    counts = ("factorisations",)

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

    def begin(self) -> None:
        """See `Maker`, also for what follows."""
        run = self._run
        run.h_last, run.error, run.factorisations = self.h_last, self.error, 0

    def make(self, run: Bounds, at: Progress, y: Vector, lost: Vector, raw: Vector) -> bool:
        self._run.lost = lost
        made = rosenbrock_step(self, self._run, self._factors, run, at, y, raw)
        self.factorisations = self._run.factorisations
        return made

    def between(self, at: Progress, y: Vector, raw: Vector, t: Any, place: Vector) -> None:
        rodas_within(self._run, y, (t - at.t) / at.h, place)

    def record(self, run: Bounds, at: Progress, y: Vector, raw: Vector, kept: Records) -> None:
        kept.errors[kept.made] = self._run.error
        kept.factorisations[kept.made] = self.factorisations

    def frozen(self) -> "Rodas5P":
        made = copy.copy(self)
        made._run = copy.copy(self._run)
        made._run.dense, made._run.last = self._run.dense.copy(), self._run.last.copy()
        return made


def between(at: Progress, y: Vector, terms: Any, t: Any, place: Vector) -> None:
    """The state at a time within a step from y, from the terms (4, ny) of its interpolant, of which
    the last is the state at its end.
    """
    *dense, last = terms
    known: Any = SimpleNamespace(dense=dense, last=last)
    rodas_within(known, y, (t - at.t) / at.h, place)


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
