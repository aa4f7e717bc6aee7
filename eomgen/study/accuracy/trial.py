"""One run of a scene with a given tolerance or step, and what it took."""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError
from eomgen.run.noise import least_tolerance
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.progress import Progress
from eomgen.run.stepping import ADAPTIVE_SAMPLES
from eomgen.run.tally import Follow, Tally
from eomgen.run.trajectory import Trajectory
from eomgen.run.works import Powers
from eomgen.study.accuracy.measure import scales
from eomgen.study.accuracy.methods import Method, meter

LEAST = 1e-9
"""Shortest time that is measured, s."""
OVER = "no time for more"
HARDLY = 0.3
"""Equal steps may exceed the requested length by 2 to this power: halving them doubles the time."""
MARKS = 500
"""About how many parts of a run's time have their longest step recorded."""

Clock = Callable[[], float]
"""Tells the time, s."""
ShowProgress = Callable[[str], AbstractContextManager[Progress]]
"""Shows which run is being made, and its progress."""


def unseen(label: str) -> AbstractContextManager[Progress]:
    """Show nothing."""
    return nullcontext(lambda fraction: None)


@dataclass(frozen=True)
class Setting:
    """A method with its tolerances, or with its step `dt`, s."""

    integrator: str
    rtol: float | None = None
    atol: float | None = None
    dt: float | None = None

    @property
    def tolerances(self) -> dict[str, Any]:
        """The tolerances that are given, by name."""
        pairs = {"rtol": self.rtol, "atol": self.atol}
        return {name: value for name, value in pairs.items() if value is not None}

    @property
    def options(self) -> str:
        """The options of `eomgen simulate` that make the same run."""
        steps = {} if self.dt is None else {"dt": self.dt}
        given = [f"--{name} {value!r}" for name, value in {**self.tolerances, **steps}.items()]
        return " ".join([f"--integrator {self.integrator}", *given])

    @property
    def brief(self) -> str:
        """The step or relative tolerance as text."""
        return f"dt {self.dt:.4g}" if self.rtol is None else f"rtol {self.rtol:.0e}"


@dataclass(frozen=True, eq=False)
class Tried:
    """A run, and what it took.

    seconds  wall time
    busy     time of the processor, s
    work     counted, in units of `methods`, by which methods are compared
    extent   (2, ny), the least and the greatest value of each state at the ends of steps
    steps    (2, n): of each part of its time, the longest step, s, and when it began, s
    """

    setting: Setting
    trajectory: Trajectory
    seconds: float
    busy: float
    work: float
    extent: FloatArray
    steps: FloatArray

    @property
    def tolerance(self) -> float:
        """The relative tolerance or, with equal steps, the step, s."""
        return self.setting.rtol or self.setting.dt or math.nan

    @property
    def interrupted(self) -> bool:
        """Whether the user stopped it."""
        return self.trajectory.outcome.kind == "interrupted"

    @property
    def cut(self) -> bool:
        """Whether it was stopped for taking too long."""
        return self.trajectory.outcome.kind == "ended"


@dataclass(frozen=True, eq=False)
class Case:
    """What is simulated: a problem from 0 to `t_end`, s.

    units    of the states, by name
    kept     further arguments of `integrate`, the same for all runs
    show_progress
             shows each run
    moved    gives, by number, the problem with constants perturbed in one of several ways (see
             `moved`); None if that is not possible
    """

    problem: Problem
    t_end: float
    units: Mapping[str, str]
    kept: Mapping[str, Any] = field(default_factory=dict)
    show_progress: ShowProgress = unseen
    moved: Callable[[int], Problem] | None = None

    @property
    def rows(self) -> int:
        """Number of rows to be kept."""
        return self.kept.get("samples") or ADAPTIVE_SAMPLES

    @property
    def bounded(self) -> bool:
        """Whether steps are bounded by something else than their error."""
        return self.problem.corners or self.kept.get("max_step") is not None

    def scale(self, y: FloatArray) -> FloatArray:
        """The scale of each state (ny,) of a motion y (n, ny), or of its extent (2, ny)."""
        return scales(self.problem.states, self.units, y)

    def setting(
        self, method: Method, tolerance: float, extent: FloatArray, noise: float = 0.0
    ) -> Setting:
        """The setting of a method at about a relative tolerance, or about a step, s.

        Equal steps are the distance of the rows, halved until they hardly exceed the requested
        step: so all runs have rows at the same times. The absolute tolerance is rtol times the
        smallest scale, down to a power of ten, of a motion with this `extent` (2, ny): so no group
        of states has a tolerance below rtol of its own scale. It is at least what the method can
        meet if rounding moves a state by `noise` in a step.
        """
        if method.equal_steps:
            dt = self.t_end / (self.rows - 1)
            while dt > tolerance * 2**HARDLY:
                dt /= 2
            return Setting(method.name, dt=dt)
        rtol = max(plain(tolerance), method.tightest)
        size = 10.0 ** math.floor(math.log10(float(np.min(self.scale(extent)))))
        atol = max(rtol * size, least_tolerance(method.name, rtol) * noise)
        return Setting(method.name, rtol=rtol, atol=float(f"{atol:.0e}"))

    def run(
        self,
        setting: Setting,
        *,
        most: float = math.inf,
        due: float = math.inf,
        clock: Clock | None = None,
        powers: Powers | None = None,
        moved: int | None = None,
        follow: Follow | None = None,
    ) -> Tried:
        """Make a run. It stops early if it takes `most` units of work, and when `clock` (by default
        `time.perf_counter`) reaches `due`.

        powers  given to record the works of effects
        moved   number of the perturbation of constants, if those are possible
        follow  called with time and state after each step; may end the run
        """
        problem = self.problem if moved is None or not self.moved else self.moved(moved)
        if moved is not None and self.problem.scrutiny:
            problem = replace(problem, scrutiny=replace(self.problem.scrutiny, seed=moved))
        spent = meter(problem, setting.integrator)
        limits = _Limits(spent, most, due, clock or time.perf_counter, self.t_end)
        tally = Tally(limits.check, follow)
        with self.show_progress(f"simulating {problem.name}") as progress:
            started, busy = time.perf_counter(), time.process_time()
            trajectory = integrate(
                problem,
                setting.integrator,
                self.t_end,
                dt=setting.dt,
                **setting.tolerances,
                **self.kept,
                progress=progress,
                powers=powers,
                tally=tally,
            )
            seconds, busy = time.perf_counter() - started, time.process_time() - busy
        extent = np.array([tally.low, tally.high])
        work = max(spent(tally), 1.0)
        steps = np.array(limits.longest).T
        return Tried(setting, trajectory, max(seconds, LEAST), busy, work, extent, steps)


@dataclass
class _Limits:
    """The work and time that a run may take, and the longest step in each part of its time.

    spent    gives its work so far
    longest  lengths, s, and when they began, s
    """

    spent: Callable[[Tally], float]
    most: float
    due: float
    clock: Clock
    t_end: float
    longest: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])
    _t: float = 0.0
    _steps: int = 0
    _part: int = 0

    def check(self, tally: Tally, t: float) -> None:
        """Record one step or several that end at t. Raises `EndedRunError` to stop the run."""
        length = (t - self._t) / max(tally.steps - self._steps, 1)
        part = int(MARKS * t / self.t_end)
        if part > self._part:
            self.longest.append((length, self._t))
        elif length > self.longest[-1][0]:
            self.longest[-1] = (length, self._t)
        self._t, self._steps, self._part = t, tally.steps, part
        if t >= self.t_end:
            return
        if math.isfinite(self.most) and self.spent(tally) > self.most:
            raise EndedRunError(OVER)
        if math.isfinite(self.due) and self.clock() > self.due:
            raise EndedRunError(OVER)


def plain(value: float) -> float:
    """The greatest of …, 1, 2, 5, 10, … at or below a positive value."""
    power = math.floor(math.log10(value) + 1e-9)
    first = next(digit for digit in (5, 2, 1) if value * (1 + 1e-9) >= digit * 10.0**power)
    return float(f"{first}e{power}")
