"""States sampled from a scene's run."""

from dataclasses import dataclass, replace

import numpy as np

from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.integrators import Adaptive, EndedRunError, FixedStep, find_integrator
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.run.progress import Progress
from eomgen.scene.schema import Simulation
from eomgen.study.diagnosis import problem_of

MOST_OPERATIONS = 20_000_000
"""Operations of all derivatives of the run: takes seconds, and ends the same on every machine."""
ENOUGH = "enough states"


@dataclass(frozen=True, eq=False)
class SampledRun:
    """Times t (n,) and states y (n, ny) of a run, and its end time, s."""

    t: FloatArray
    y: FloatArray
    until: float


def sampled(
    model: Model,
    wanted: Simulation,
    module: GeneratedModule,
    count: int,
    progress: Progress = lambda _: None,
) -> SampledRun:
    """About `count` states at which the integrator of the `wanted` run calls the derivative.

    They are evenly spaced among its calls, and so are denser where it takes small steps. A run that
    takes too long, or fails, gives the states up to there. Taylor series call no derivative: for
    them DOP853 runs.

    Raises `RunError` if the module has no derivative at its initial state.
    """
    problem = problem_of(module, model=model)
    keep = _Keep(count, most=1 + MOST_OPERATIONS // max(1, module.COST["derivative"]["total"]))

    def derivative(t: float, y: FloatArray) -> FloatArray:
        keep.see(t, y)
        return problem.derivative(t, y)

    method = find_integrator(wanted.integrator)
    fixed = isinstance(method, FixedStep)
    run = integrate(
        replace(problem, derivative=derivative),
        "DOP853" if isinstance(method, Adaptive) and method.series else wanted.integrator,
        wanted.t_end,
        dt=wanted.dt if fixed else None,
        rtol=wanted.rtol,
        atol=wanted.atol,
        progress=progress,
    )
    if run.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    chosen = np.unique(np.linspace(0, len(keep.rows) - 1, count).round().astype(int))
    rows = [keep.rows[i] for i in chosen]
    return SampledRun(np.array([t for t, _ in rows]), np.array([y for _, y in rows]), keep.last)


class _Keep:
    """Records every k-th state; k doubles whenever there are too many."""

    def __init__(self, count: int, most: int) -> None:
        self.rows: list[tuple[float, FloatArray]] = []
        self.last = 0.0
        self._limit, self._most = 20 * count, most
        self._every, self._seen = 1, 0

    def see(self, t: float, y: FloatArray) -> None:
        """Record a state. Raises `EndedRunError` when there have been enough."""
        if self._seen >= self._most:
            raise EndedRunError(ENOUGH)
        if self._seen % self._every == 0 and np.all(np.isfinite(y)):
            self.rows.append((float(t), np.array(y, dtype=float)))
            self.last = max(self.last, float(t))
            if len(self.rows) > self._limit:
                del self.rows[1::2]
                self._every *= 2
        self._seen += 1
