"""One run of a scene under a method's tolerance or step, and what it took."""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eomgen.run.integrate import integrate
from eomgen.run.integrators import FixedStep, StepFailure, find_integrator
from eomgen.run.problem import Floats, Problem
from eomgen.run.progress import Progress
from eomgen.run.stepping import ADAPTIVE_SAMPLES
from eomgen.run.trajectory import Trajectory
from eomgen.run.works import Powers
from eomgen.study.measure import scales

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
"""Part of the time allowed after which a run's pace is judged."""
HARDLY = 0.3
"""Power of 2 by which equal steps may be longer than asked: twice the steps are twice the time."""
SLOW = 2.5
"""So many times the time allowed, at the pace so far, end a run early."""

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
    """A run, and what it took, s: by the clock on the wall, and of the processor, which tells
    methods apart where the machine has other work, too.
    """

    setting: Setting
    trajectory: Trajectory
    seconds: float
    work: float

    @property
    def tolerance(self) -> float:
        """Relative tolerance; of equal steps their length, s."""
        return self.setting.rtol or self.setting.dt or math.nan

    @property
    def interrupted(self) -> bool:
        """Whether the user ended it."""
        return self.trajectory.message.startswith("interrupted")

    @property
    def cut(self) -> bool:
        """Whether it was ended for taking too long."""
        return OVER in self.trajectory.message


@dataclass(frozen=True, eq=False)
class Case:
    """What is run: a problem from 0 to `t_end`, s.

    units    of the states, by name
    kept     what else `integrate` is told, the same for all runs
    watch    shows each run
    """

    problem: Problem
    t_end: float
    units: Mapping[str, str]
    kept: Mapping[str, Any] = field(default_factory=dict)
    watch: Watch = unseen

    @property
    def rows(self) -> int:
        """How many are to be kept."""
        return self.kept.get("samples") or ADAPTIVE_SAMPLES

    @property
    def bounded(self) -> bool:
        """Whether steps are kept short for other reasons than their error."""
        return self.problem.corners or self.kept.get("max_step") is not None

    def scale(self, y: Floats) -> Floats:
        """The scale of each state (ny,) of a motion y (n, ny)."""
        return scales(self.problem.states, self.units, y)

    def setting(self, method: Method, tolerance: float, like: Floats) -> Setting:
        """A method at about a tolerance of few digits, or in equal steps, s, of about a length.

        Equal steps are the distance of the rows, halved so often that they are hardly longer than
        asked: all runs then have rows at the very same moments. The absolute tolerance is that part
        of the smallest scale in the motion `like` (n, ny): no kind of state is then held to less
        than the relative tolerance of its own scale.
        """
        if method.equal_steps:
            dt = self.t_end / (self.rows - 1)
            while dt > tolerance * 2**HARDLY:
                dt /= 2
            return Setting(method.name, dt=dt)
        rtol = max(_plain(tolerance), method.tightest)
        size = 10.0 ** math.floor(math.log10(float(np.min(self.scale(like)))))
        return Setting(method.name, rtol=rtol, atol=float(f"{rtol * size:.0e}"))

    def run(
        self,
        setting: Setting,
        *,
        most: float = math.inf,
        due: float = math.inf,
        powers: Powers | None = None,
    ) -> Tried:
        """Make a run. It ends early when it takes `most` s of the processor, or is sure to, and
        when `time.perf_counter` is at `due`. `powers` asks for the works of effects.
        """
        with self.watch(f"simulating {self.problem.name}") as progress:
            started, began = time.perf_counter(), time.thread_time()
            trajectory = integrate(
                self.problem,
                setting.integrator,
                self.t_end,
                dt=setting.dt,
                **setting.tolerances,
                **self.kept,
                progress=_limited(progress, began, most, due),
                powers=powers,
            )
            seconds, work = time.perf_counter() - started, time.thread_time() - began
        return Tried(setting, trajectory, max(seconds, LEAST), max(work, LEAST))


def _limited(progress: Progress, began: float, most: float, due: float) -> Progress:
    """`progress`, which ends the run when its time is over."""

    def told(fraction: float) -> None:
        progress(fraction)
        spent = time.thread_time() - began
        hopeless = spent > SOON * most and spent > SLOW * most * fraction
        if fraction < 1 and (spent > most or hopeless or time.perf_counter() > due):
            raise StepFailure(OVER)

    return told


def _plain(value: float) -> float:
    """The next of 1, 2, 5, 10 … at or below a positive value."""
    power = math.floor(math.log10(value) + 1e-9)
    first = next(digit for digit in (5, 2, 1) if value * (1 + 1e-9) >= digit * 10.0**power)
    return float(f"{first}e{power}")
