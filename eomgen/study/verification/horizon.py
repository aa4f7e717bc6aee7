"""The time up to which a run in doubles agrees with one in extended precision."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.integrators.interface import SMALLEST_RTOL
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Problem
from eomgen.run.progress import Progress
from eomgen.run.trajectory import Trajectory
from eomgen.scene.schema import Simulation
from eomgen.study.accuracy.reference import ROWS, Reference, TooLongError, paced, reference
from eomgen.study.diagnosis import problem_of
from eomgen.study.precision.precise import BITS

PARTED = 0.01
"""Relative to the motion's scale (see `measure`): a run with a larger error is meaningless."""
METHOD = "DOP853"


@dataclass(frozen=True, repr=False)
class Horizon(Displayed):
    """The first time at which a run in doubles differs from one in extended precision.

    time   s; None if it agrees to the end
    t_end  s
    worst  the greatest difference up to the end, relative to the scale
    sure   the error bound of the run in extended precision, relative to the scale
    origin how that run was made
    """

    shown = ("words", "origin")

    time: float | None
    t_end: float
    worst: float
    sure: float
    origin: str

    @property
    def words(self) -> str:
        """The result in one line."""
        if self.time is None:
            means = f"doubles are meaningful for the whole run, {self.t_end:g} s"
        else:
            means = f"doubles are meaningful to t = {self.time:.4g} s of {self.t_end:g} s"
        return (
            f"{means}: a relative error of {self.worst:.2g} at most "
            f"({METHOD} at rtol {SMALLEST_RTOL:g}, against {self.origin}, "
            f"itself accurate to {self.sure:.1g})"
        )


def horizon(
    model: Model,
    wanted: Simulation,
    module: GeneratedModule,
    parameters: Any = None,
    inputs: Any = None,
    *,
    seconds: float = 60.0,
    progress: Progress = lambda _: None,
) -> Horizon:
    """Compare the scene's run, at the tightest tolerance, with extended precision.

    wanted   how the scene is to be run
    seconds  processor time for the run in extended precision, and for each run in doubles

    Raises `RunError` if there are rigid contacts or if that time is not enough, so that there is no
    reference, and if a run does not reach its end.
    """
    t_end = wanted.t_end
    problem = problem_of(module, parameters, inputs, model)
    if problem.contacts is not None:
        raise RunError(
            "horizon: rigid contacts strike, and runs in extended precision do not take these"
        )
    try:
        true = reference(
            model,
            module,
            parameters,
            inputs,
            t_end,
            seconds=seconds,
            rest_speed=wanted.rest_speed,
            progress=lambda part: progress(0.9 * part),
            doubles=False,
        )
    except RunError as error:
        raise RunError(
            f"horizon: {error}; give a longer --horizon, or a shorter t_end in the scene"
        ) from None
    watched = paced(problem, t_end, seconds, lambda part: progress(0.9 + 0.1 * part))
    try:
        run = _tight(watched, t_end, true)
    except TooLongError as reason:
        raise RunError(
            f"horizon: {METHOD} takes {reason}; give a longer --horizon, or a shorter t_end in the "
            "scene"
        ) from None
    if run.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    if not run.finished:
        raise RunError(f"horizon: {METHOD}: {run.message}")
    rows = run.y[np.searchsorted(run.t, true.t)]
    errors = np.max(np.abs(rows - true.y) / true.scale, axis=1)
    apart = np.flatnonzero(errors > PARTED)
    time = float(true.t[apart[0]]) if len(apart) else None
    return Horizon(time, t_end, float(np.max(errors)), true.error, f"{BITS}-bit Gauss collocation")


def _tight(problem: Problem, t_end: float, true: Reference) -> Trajectory:
    """The run as tight as doubles go."""
    return integrate(
        problem,
        METHOD,
        t_end,
        rtol=SMALLEST_RTOL,
        atol=SMALLEST_RTOL * 0.1 * float(np.min(true.scale)),
        samples=ROWS,
    )
