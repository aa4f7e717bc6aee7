"""One run of a scene under a method's tolerance or step, and what it took."""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError, FixedStep, find_integrator
from eomgen.run.noise import least_tolerance
from eomgen.run.problem import Floats, Problem
from eomgen.run.progress import Progress
from eomgen.run.stepping import ADAPTIVE_SAMPLES
from eomgen.run.tally import Follow, Tally
from eomgen.run.trajectory import Trajectory
from eomgen.run.works import Powers
from eomgen.study.accuracy.cost import meter
from eomgen.study.accuracy.measure import scales

TIGHTEST = {"LSODA": 1e-12}
"""Relative tolerances beyond which a method gives up on many scenes."""
TIGHTEST_OF_ALL = 1e-13
ORDERS = {"RK45": 5, "DOP853": 8, "LSODA": 10, "Radau": 5, "BDF": 4, "gragg_bulirsch_stoer": 12}
"""Of adaptive methods: the time for an error e grows as e^(-1/order). That of LSODA goes up to 12,
and that of extrapolation as far as it finds worth it."""
LEAST = 1e-9
"""Less than this, s, no clock tells apart."""
OVER = "no time for more"
SOON = 0.2
"""Part of the work allowed after which a run's pace is judged."""
HARDLY = 0.3
"""Power of 2 by which equal steps may be longer than asked: twice the steps are twice the time."""
MARKS = 500
"""Times at which a run's pace is noted, about."""
SLOW = 2.5
"""So many times the work allowed, at the pace so far, end a run early."""

Watch = Callable[[str], AbstractContextManager[Progress]]
"""Shows what is being tried, and how far it is."""


def unseen(label: str) -> AbstractContextManager[Progress]:
    """Watch nothing."""
    return nullcontext(lambda fraction: None)


@dataclass(frozen=True)
class Method:
    """What theory says of a method: error ∝ τ^exponent, time ∝ τ^-growth (of an equal step, τ = h).

    tightest   relative tolerance that it is taken to; of an equal step 0
    multistep  whether it steps on from several states
    """

    name: str
    exponent: float
    growth: float
    tightest: float
    multistep: bool = False

    @property
    def equal_steps(self) -> bool:
        """Whether τ is a step, s."""
        return not self.tightest


def method_of(name: str) -> Method:
    """A method by its name. Raises `RunError` if there is none."""
    found = find_integrator(name)
    if isinstance(found, FixedStep):
        return Method(name, float(found.order), 1.0, 0.0)
    growth, tightest = 1 / ORDERS.get(name, 5), TIGHTEST.get(name, TIGHTEST_OF_ALL)
    return Method(name, 1.0, growth, tightest, not found.one_step)


@dataclass(frozen=True)
class Setting:
    """A method and how it is bounded: by tolerances, or by a step, s."""

    integrator: str
    rtol: float | None = None
    atol: float | None = None
    dt: float | None = None

    @property
    def tolerances(self) -> dict[str, Any]:
        """Those that are given, by name."""
        pairs = {"rtol": self.rtol, "atol": self.atol}
        return {name: value for name, value in pairs.items() if value is not None}

    @property
    def options(self) -> str:
        """What on the command line makes the same run."""
        steps = {} if self.dt is None else {"dt": self.dt}
        given = [f"--{name} {value!r}" for name, value in {**self.tolerances, **steps}.items()]
        return " ".join([f"--integrator {self.integrator}", *given])


@dataclass(frozen=True, eq=False)
class Tried:
    """A run, and what it took.

    seconds  by the clock on the wall
    work     counted, in units of `cost`: what methods are compared by
    extent   (2, ny), the least and the greatest value of each state at the ends of steps
    pace     (2, n), times, s, and the work done up to then
    """

    setting: Setting
    trajectory: Trajectory
    seconds: float
    work: float
    extent: Floats
    pace: Floats

    @property
    def tolerance(self) -> float:
        """Relative tolerance; of equal steps their length, s."""
        return self.setting.rtol or self.setting.dt or math.nan

    @property
    def interrupted(self) -> bool:
        """Whether the user ended it."""
        return self.trajectory.outcome.kind == "interrupted"

    @property
    def cut(self) -> bool:
        """Whether it was ended for taking too long."""
        return self.trajectory.outcome.kind == "ended"


@dataclass(frozen=True, eq=False)
class Case:
    """What is run: a problem from 0 to `t_end`, s.

    units    of the states, by name
    kept     what else `integrate` is told, the same for all runs
    watch    shows each run
    moved    gives the problem with its constants moved by rounding in one way or another, by
             number (see `moved`); None where that is not known
    """

    problem: Problem
    t_end: float
    units: Mapping[str, str]
    kept: Mapping[str, Any] = field(default_factory=dict)
    watch: Watch = unseen
    moved: Callable[[int], Problem] | None = None

    @property
    def rows(self) -> int:
        """How many are to be kept."""
        return self.kept.get("samples") or ADAPTIVE_SAMPLES

    @property
    def bounded(self) -> bool:
        """Whether steps are kept short for other reasons than their error."""
        return self.problem.corners or self.kept.get("max_step") is not None

    def scale(self, y: Floats) -> Floats:
        """The scale of each state (ny,) of a motion y (n, ny), or of its extent (2, ny)."""
        return scales(self.problem.states, self.units, y)

    def setting(
        self, method: Method, tolerance: float, extent: Floats, noise: float = 0.0
    ) -> Setting:
        """A method at about a tolerance of few digits, or in equal steps, s, of about a length.

        Equal steps are the distance of the rows, halved so often that they are hardly longer than
        asked: all runs then have rows at the very same moments. The absolute tolerance is that part
        of the smallest scale in the motion of this `extent` (2, ny): no kind of state is then held
        to less than the relative tolerance of its own scale. It is no less than what the method
        can meet where rounding moves a state by `noise` in a step.
        """
        if method.equal_steps:
            dt = self.t_end / (self.rows - 1)
            while dt > tolerance * 2**HARDLY:
                dt /= 2
            return Setting(method.name, dt=dt)
        rtol = max(_plain(tolerance), method.tightest)
        size = 10.0 ** math.floor(math.log10(float(np.min(self.scale(extent)))))
        atol = max(rtol * size, least_tolerance(method.name, rtol) * noise)
        return Setting(method.name, rtol=rtol, atol=float(f"{atol:.0e}"))

    def run(
        self,
        setting: Setting,
        *,
        most: float = math.inf,
        due: float = math.inf,
        like: Tried | None = None,
        powers: Powers | None = None,
        moved: int | None = None,
        follow: Follow | None = None,
    ) -> Tried:
        """Make a run. It ends early when it takes `most` units of work, or is sure to, and when
        `time.perf_counter` is at `due`.

        like    a run whose pace this one's is judged by; else it is taken to be even
        powers  asks for the works of effects
        moved   the way in which constants are moved by rounding, where that is known
        follow  is told time and state after each step, and may end the run
        """
        problem = self.problem if moved is None or not self.moved else self.moved(moved)
        spent = meter(problem, setting.integrator)
        pace = _Pace(spent, most, due, self.t_end, like)
        tally = Tally(pace.check, follow)
        with self.watch(f"simulating {problem.name}") as progress:
            started = time.perf_counter()
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
            seconds = time.perf_counter() - started
        extent = np.array([tally.low, tally.high])
        work = max(spent(tally), 1.0)
        return Tried(setting, trajectory, max(seconds, LEAST), work, extent, pace.made(work))


@dataclass
class _Pace:
    """How a run gets on; it is ended when its work or its time is over, or is sure to be.

    spent  its work so far
    like   a run whose pace is what is to be expected
    marks  times, s, and the work done up to then
    """

    spent: Callable[[Tally], float]
    most: float
    due: float
    t_end: float
    like: Tried | None
    marks: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])

    def check(self, tally: Tally, t: float) -> None:
        """Take note of a step that ends at t. Raises `EndedRunError` to end the run."""
        marked = t >= self.marks[-1][0] + self.t_end / MARKS
        bounded = t < self.t_end and math.isfinite(self.most)
        if marked or bounded:
            work = self.spent(tally)
            if marked:
                self.marks.append((t, work))
            if bounded:
                hopeless = work > SOON * self.most and work > SLOW * self.most * self._share(t)
                if work > self.most or hopeless:
                    raise EndedRunError(OVER)
        if t < self.t_end and math.isfinite(self.due) and time.perf_counter() > self.due:
            raise EndedRunError(OVER)

    def made(self, work: float) -> Floats:
        """The pace of the whole run, which took some `work`."""
        return np.array([*self.marks, (self.t_end, work)]).T

    def _share(self, t: float) -> float:
        return done(self.like, t, self.t_end)


def done(run: Tried | None, t: float, t_end: float) -> float:
    """Which share of a run's work was done up to a time, s; of none, the share of the time."""
    if run is None:
        return t / t_end
    return float(np.interp(t, run.pace[0], run.pace[1])) / run.work


def _plain(value: float) -> float:
    """The next of 1, 2, 5, 10 … at or below a positive value."""
    power = math.floor(math.log10(value) + 1e-9)
    first = next(digit for digit in (5, 2, 1) if value * (1 + 1e-9) >= digit * 10.0**power)
    return float(f"{first}e{power}")
