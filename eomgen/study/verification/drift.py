"""A short run, and what it loses of what exact motion keeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError
from eomgen.run.module import GeneratedModule, as_powers
from eomgen.run.problem import Floats
from eomgen.run.progress import Progress
from eomgen.run.trajectory import Trajectory
from eomgen.scene.schema import Simulation
from eomgen.study.diagnosis import problem_of
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.laws import AXES, Kept, kept
from eomgen.study.verification.visited import ENOUGH

METHOD, RTOL = "DOP853", 1e-11
MOST_OPERATIONS = 10_000_000
"""Of all derivatives of the run together: seconds at most, and the same on every machine."""
MOST_CALLS = 25_000
MOST_TIME = 10.0
"""s of motion."""


@dataclass(frozen=True)
class Drift:
    """What a run loses, in parts of what there was of it at most.

    until    how far it went, s
    steps    how many it took
    stopped  why it ended before its time, if not for its length
    keeps    what exact motion keeps, as far as its states tell
    lost     by name, energy and components of momentum that it keeps
    books    what of the change of kinetic energy the works of effects do not account for; None if
             there are no effects
    unit     the most that a quaternion is off unit length
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
    """Run a module from its initial state, at most `MOST_TIME` and no further than is `wanted`;
    `full` is one that has energies, momentum and powers. What exact motion keeps is asked at some
    `states`, and where the run's energy changes the most: there something may act for a while only.

    What was lost is counted in parts: of energy, of the greatest that was kinetic, or went to and
    fro; of momentum, of the sum over bodies.
    """
    problem = problem_of(module, model=model)
    most = 1 + MOST_OPERATIONS // max(MOST_OPERATIONS // MOST_CALLS, _operations(module))
    calls = 0

    def derivative(t: float, y: Floats) -> Floats:
        nonlocal calls
        calls += 1
        if calls > most:
            raise EndedRunError(ENOUGH)
        return problem.derivative(t, y)

    run = integrate(
        replace(problem, derivative=derivative),
        METHOD,
        min(wanted.t_end, MOST_TIME),
        rtol=RTOL,
        atol=RTOL * 1e-3,
        samples=101,
        progress=progress,
        rest_speed=wanted.rest_speed,
        powers=None if model.leave_out else as_powers(full),  # else energy is not kept
    )
    if run.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    kinetic = _along(full.kinetic_energy, run.t, run.y)
    total = kinetic + _along(full.potential_energy, run.t, run.y)
    keeps = kept(model, [*states, *_beside_change(run, total)])
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


def _beside_change(run: Trajectory, total: Floats) -> list[State]:
    """The rows before and after energy changes the most."""
    if len(run.t) < 2:
        return []
    k = int(np.argmax(np.abs(np.diff(total))))
    return [State("short run", i, float(run.t[i]), run.y[i], {}) for i in (k, k + 1)]


def _operations(module: GeneratedModule) -> int:
    return module.COST["derivative"]["total"]


def _along(output: Any, t: Floats, y: Floats) -> Floats:
    """An output at every row, the rows last."""
    return np.stack([np.asarray(output(*row)) for row in zip(t, y, strict=True)], axis=-1)


def _lost(values: Floats, size: Any) -> float:
    off = float(np.max(np.abs(values - values[0])))
    return off / float(size) if size else off


def _components(dimensions: int, momenta: Floats) -> list[tuple[str, int, float]]:
    """Names of the components of momentum, their rows, and the size of what they are part of."""
    names = [*AXES[:dimensions], *(f"about {x}" for x in (AXES if dimensions == 3 else "z"))]
    linear, angular = momenta[:dimensions], momenta[dimensions:]
    sizes = [float(np.max(np.abs(part))) for part in (linear, angular)]
    return [(name, i, sizes[i >= dimensions]) for i, name in enumerate(names)]
