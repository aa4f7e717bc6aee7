"""A short run, and the drift of what exact motion conserves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.progress import Progress
from eomgen.run.trajectory import Trajectory
from eomgen.scene.schema import Simulation
from eomgen.study.diagnosis import problem_of
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.laws import AXES, Kept, kept
from eomgen.study.verification.sampled import ENOUGH
from eomgen.study.whole import whole_of

METHOD, RTOL = "DOP853", 1e-11
MOST_OPERATIONS = 10_000_000
"""Operations of all derivatives of the run: takes seconds, and ends the same on every machine."""
MOST_CALLS = 25_000
MOST_TIME = 10.0
"""Greatest duration of the motion, s."""


@dataclass(frozen=True)
class Drift:
    """The drift of a run, relative to the greatest amount of each quantity.

    until    its end time, s
    steps    number of steps
    stopped  why it failed; "" if it finished or was long enough
    keeps    what exact motion conserves, as its states show
    lost     by name, the drift of energy and of components of momentum that are conserved
    books    kinetic energy that the works of effects do not explain; None if there are no effects
    unit     greatest difference of a quaternion's length from 1
    """

    until: float
    steps: int
    stopped: str
    keeps: Kept
    lost: dict[str, float]
    books: float | None
    unit: float


def drift(
    model: Model,
    wanted: Simulation,
    module: GeneratedModule,
    full: Any,
    states: Sequence[State],
    progress: Progress = lambda _: None,
) -> Drift:
    """Run a module from its initial state for `MOST_TIME`, or to the end of the `wanted` run if
    that is earlier. `full` is a module that has energies, momentum and powers. What exact motion
    conserves is determined at `states` and where the energy of the run changes most: some effects
    act only for a short time.

    The drift of energy is relative to the greatest kinetic energy or exchange of energy, that of
    momentum to the greatest sum over bodies.
    """
    problem = problem_of(module, model=model)
    run = integrate(
        _short(problem, module),
        METHOD,
        min(wanted.t_end, MOST_TIME),
        rtol=RTOL,
        atol=RTOL * 1e-3,
        samples=101,
        progress=progress,
        rest_speed=wanted.rest_speed,
        powers=None if model.leave_out else as_powers(full),  # energy needs the velocity forces
    )
    if run.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    kinetic = _along(full.kinetic_energy, run.t, run.y)
    total = kinetic + _along(full.potential_energy, run.t, run.y)
    keeps = kept(model, [*states, *_beside_change(run, total, full, model)])
    lost: dict[str, float] = {}
    if keeps.energy and problem.contacts is None:
        lost["energy"] = _lost(total, max(np.max(kinetic), np.ptp(total - kinetic)))
    momenta = _along(full.momentum, run.t, run.y)
    if problem.contacts is None:
        for name, row, size in _components(model.dimensions, momenta):
            if name in keeps.momentum:
                lost[f"momentum {name}"] = _lost(momenta[row], size)
    books = None
    if run.works is not None:
        done = np.sum(run.works, axis=1)
        sizes = np.max(np.sum(np.abs(run.works), axis=1))
        books = _lost(kinetic - done, max(np.max(kinetic), sizes))
    unit = 0.0
    for indices in map(list, module.QUATERNIONS):
        unit = max(unit, float(np.max(np.abs(np.linalg.norm(run.y[:, indices], axis=1) - 1))))
    stopped = "" if run.outcome.kind in ("finished", "ended") else run.message
    return Drift(float(run.t[-1]), run.counts["steps"], stopped, keeps, lost, books, unit)


def _short(problem: Problem, module: GeneratedModule) -> Problem:
    """The problem, a run of which ends after a number of derivatives."""
    most = 1 + MOST_OPERATIONS // max(MOST_OPERATIONS // MOST_CALLS, _operations(module))
    calls = 0

    def derivative(t: float, y: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        if calls > most:
            raise EndedRunError(ENOUGH)
        return problem.derivative(t, y)

    return replace(problem, derivative=derivative)


def _beside_change(run: Trajectory, total: FloatArray, module: Any, model: Model) -> list[State]:
    """The rows before and after the greatest change of energy."""
    if len(run.t) < 2:
        return []
    k = int(np.argmax(np.abs(np.diff(total))))
    rows = [(i, float(run.t[i]), run.y[i]) for i in (k, k + 1)]
    return [State("short run", i, t, whole_of(module, model, t, y), {}) for i, t, y in rows]


def _operations(module: GeneratedModule) -> int:
    return module.COST["derivative"]["total"]


def _along(output: Any, t: FloatArray, y: FloatArray) -> FloatArray:
    """An output at every row, with rows as the last axis."""
    return np.stack([np.asarray(output(*row)) for row in zip(t, y, strict=True)], axis=-1)


def _lost(values: FloatArray, size: Any) -> float:
    change = float(np.max(np.abs(values - values[0])))
    return change / float(size) if size else change


def _components(dimensions: int, momenta: FloatArray) -> list[tuple[str, int, float]]:
    """Name, row and reference size of each component of momentum."""
    names = [*AXES[:dimensions], *(f"about {x}" for x in (AXES if dimensions == 3 else "z"))]
    linear, angular = momenta[:dimensions], momenta[dimensions:]
    sizes = [float(np.max(np.abs(part))) for part in (linear, angular)]
    return [(name, i, sizes[i >= dimensions]) for i, name in enumerate(names)]
