"""Steps of adaptive methods in Python: what the engine's text is given, which runs as it stands."""

import math
from functools import partial
from typing import Any

import numpy as np

from eomgen.engine.adaptive import AGAIN, EVENT, MADE, UNUSUAL, Progress
from eomgen.engine.adaptive_steps import Records, Start, adaptive_steps
from eomgen.engine.contact_times import SHARE
from eomgen.engine.structures import with_room
from eomgen.run.branches import Retry, Step
from eomgen.run.compiled import MEMORY, Stride
from eomgen.run.contacts import Within, meets
from eomgen.run.failure import NOT_FINITE, StepFailure
from eomgen.run.integrators.maker import Maker
from eomgen.run.integrators.stepper import Stepper
from eomgen.run.problem import FloatArray, Problem

AHEAD = 32
"""Greatest number of steps made at once: Ctrl-C is heard in each, progress is shown after them."""
STALLED = 100
"""A run stops after this many steps in a row that do not advance the time."""


class InPython:
    """Makes the steps of a run, and is what the engine checks them with: see `Checks`."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper, sizes = stepper, {"STATES": len(stepper.problem.initial)}
        times = stepper.times
        self._kept = with_room(Records, wide=0, most=AHEAD, count=len(times), times=times, **sizes)
        self._rows, self._stalled, self._stage = self._kept.rows, 0, 0
        self._retry: tuple[Retry, float] | None = None
        self._failure: BaseException | None = None
        self._last: tuple[FloatArray, FloatArray] = (times, times)

    def made(self, most: int) -> Stride | None:
        """Make up to `most` steps from where the run is; None if the next one is to be made again,
        for which the stepper is prepared. Steps before one that fails are given before it does.
        """
        if self._failure:
            raise self._failure
        stepper, kept, solver = self._stepper, self._kept, self._stepper.solver
        solver.begin()
        shortest = 10.0 * abs(math.nextafter(solver.t, math.inf) - solver.t)
        at = Progress(solver.t, length=max(solver.h_abs, shortest))
        solver.bounds.until = stepper.until
        kept.made, kept.passed, kept.most = 0, 0, min(most, AHEAD)
        kept.times = stepper.times[stepper.sampled :]
        kept.count, kept.rows = len(kept.times), self._rows
        start, self._stage, self._retry = Start(solver.y, solver.y, solver.lost), 0, None
        try:
            why = adaptive_steps(solver, self, solver.bounds, at, start, kept)
        except BaseException as failure:
            if not kept.made:
                raise
            why, self._failure = UNUSUAL, failure
        if why == UNUSUAL and self._failure is None and (self._stage or not kept.made):
            reason = NOT_FINITE if self._stage == 2 else solver.why
            self._failure = StepFailure(reason, stepper.method.remedy)
        if kept.made:
            return self._stride(at, why == EVENT)
        if why == AGAIN and self._retry:
            stepper.repeat(*self._retry)
            return None
        assert self._failure
        raise self._failure

    def _stride(self, at: Progress, is_event: bool) -> Stride:
        """The steps that were made."""
        stepper, kept, solver, n = self._stepper, self._kept, self._stepper.solver, self._kept.made
        passed, before = int(kept.sampled[n - 1]), float(kept.ends[n - 2]) if n > 1 else solver.t
        # LSODA continues with steps so short that t + h rounds to t; the others stop by themselves.
        # Far from t = 0 its first few steps may be that short before they grow.
        self._stalled = 0 if before < kept.ends[n - 1] else self._stalled + 1
        if self._stalled == STALLED:
            raise StepFailure("the steps have shrunk to nothing", stepper.method.remedy)
        step = Progress(before, at.h, at.end, is_dense=at.is_dense)
        return Stride(
            kept.ends[:n].copy(),
            kept.states[:n].copy(),
            {name: getattr(kept, MEMORY[name])[:n].copy() for name in stepper.method.memory},
            {name: getattr(kept, name)[:n].copy() for name in solver.counts},
            kept.sampled[:n].copy(),
            kept.rows[:passed].copy(),
            event=is_event,
            within=partial(_within, solver.frozen(), step, *self._last),
        )

    def begins(self) -> None:
        """A step begins."""
        self._stage = 1

    def is_usual(self) -> bool:
        """Errors are raised."""
        self._stage = 2
        return True

    def placed(self, t: float, y: FloatArray) -> bool:
        """Put a state on the constraints; raises `StepFailure` if they cannot be met near it."""
        found = self._stepper.problem.projected(float(t), y)
        if found is not y:
            y[:] = found
        return True

    def seen(self, at: Progress, y: FloatArray, raw: FloatArray, last: FloatArray) -> int:
        """See `Checks`; raises `StepFailure` if an event is not found."""
        stepper, solver, met = self._stepper, self._stepper.solver, self._stepper.touched
        self._last = y, raw
        states = partial(_within, solver, at, y, raw, 0)
        branches = stepper.branches
        if branches and at.t < at.end:
            slopes = solver.slopes if branches.features else None
            retry = branches.check(Step(at.t, at.end, y, last, states, slopes))
            if retry:
                self._retry = retry, at.end
                return AGAIN
        if met:
            met.at.t, met.at.y = at.t, y
            between = partial(_placed, stepper.problem, states)
            if meets(met, Within(at.t, y, last, at.end, between), SHARE):
                at.end, last[:] = met.at.t, met.at.y
                return EVENT
        return MADE

    def keeps(self, i: int, at: Progress, last: FloatArray) -> bool:
        """A step is kept."""
        self._stage = 0
        return True


def _within(
    solver: Maker, at: Progress, y: FloatArray, raw: FloatArray, _: int, times: Any
) -> FloatArray:
    """The states (m, ny) at times (m,) within a step, or one (ny,) at a single time."""
    place = np.empty((*np.shape(times), len(y)))
    solver.between(at, y, raw, np.asarray(times)[..., None], place)
    return place


def _placed(problem: Problem, states: Any, t: float) -> FloatArray:
    return problem.projected(t, states(t))
