"""The state of a search for a run: the runs made so far, the plan of the next, and the choice."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.run.noise import Fast, fast, growth
from eomgen.run.problem import FloatArray
from eomgen.run.sliding import SLIDES
from eomgen.study.accuracy.estimate import (
    Estimate,
    by_looser_run,
    difference,
    errors,
    looser,
    representable,
)
from eomgen.study.accuracy.trial import Case, Method, Setting, Tried, method_of
from eomgen.tables.integrators import INTEGRATORS

MOST_STEPS = 2**20
"""Greatest number of equal steps in a run."""
LOOKS = 5
"""Number of states, from start to end of a motion, at which its fast components are determined."""
LONGEST, GROWN = 8, 3.0
"""At the beginnings of so many of the longest steps of an implicit method it is looked whether
deviations grow by more than exp(`GROWN`) in the step."""
FITS = 0.2
"""A run is made again if its absolute tolerance should have been below this part of what it was."""
SAMPLES = 2
"""Number of further runs that show the effect of rounding, where it matters."""
SHORTER = 16
"""How many times shorter steps are in a run that looks between those of another."""
UNIT = 1e-6
"""Time that a unit of work is assumed to take before the first run, s."""

Say = Callable[[str], None]


def _now() -> float:
    """The current time, s."""
    return time.perf_counter()


@dataclass(frozen=True)
class Plan:
    """A method's next run.

    error, cost  expected for it; the error only if it is `known`; the cost in units of work
    work         expected of the method's run at the required accuracy, in units of work
    """

    method: Method
    tolerance: float
    error: float
    known: bool
    cost: float
    work: float


@dataclass(frozen=True)
class Choice:
    """The chosen run.

    error     its estimated error in the last state, relative to the motion's scale; infinite if
              there is no estimate
    most, at  greatest estimated error of any row, and its time, s; infinite and nan if unknown
    met       whether that is what was asked for
    reason    why not, if it is known; else ""
    runs      number of runs made in all, this one included, which took `seconds` together
    """

    tried: Tried
    error: float
    most: float
    at: float
    met: bool
    reason: str
    runs: int
    seconds: float


@dataclass
class Search:
    """The runs of a case made so far, and the rules for making more.

    say       called with a line of text before each planned run
    first     tolerance of the first runs
    budget    s after the start at which runs are ended
    runs      finished runs
    broken    runs that did not reach the end
    pilots    finished runs that only helped to set up others
    second    runs that estimate another's error, by the `id` of that run
    samples   by the same key, runs with other perturbations of the constants
    shorter   by the same key, runs with shorter steps
    left_out  methods that are not continued for now
    """

    case: Case
    say: Say
    first: float
    budget: float = math.inf
    runs: list[Tried] = field(default_factory=list)
    broken: list[Tried] = field(default_factory=list)
    pilots: list[Tried] = field(default_factory=list)
    second: dict[int, Tried] = field(default_factory=dict)
    samples: dict[int, list[Tried]] = field(default_factory=dict)
    shorter: dict[int, Tried] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    started: float = field(default_factory=_now)
    _fast: dict[int, Fast] = field(default_factory=dict)
    _disturbed: float | None = None

    @property
    def spent(self) -> float:
        """Wall time since the search began, s."""
        return _now() - self.started

    @property
    def made(self) -> list[Tried]:
        """All runs made so far."""
        samples = [run for runs in self.samples.values() for run in runs]
        more = (*self.second.values(), *self.shorter.values())
        return [*self.runs, *self.broken, *self.pilots, *more, *samples]

    @property
    def slides(self) -> bool:
        """Whether a run ended in a sliding mode: then all do, and tighter ones take longer."""
        return any(run.trajectory.outcome.reason.startswith(SLIDES) for run in self.broken)

    @property
    def unit(self) -> float:
        """Time that a unit of work takes on this machine, s, measured on all runs so far."""
        work = sum(run.work for run in self.made)
        return sum(run.seconds for run in self.made) / work if work else UNIT

    @property
    def tightest_run(self) -> Tried | None:
        """The run with the tightest tolerance, of pilots the latest; None if there is none."""
        known = self.runs or [run for run in self.pilots[::-1] if run.trajectory.finished]
        return min(known, key=lambda run: (run.setting.dt is not None, run.tolerance), default=None)

    @property
    def extent(self) -> FloatArray:
        """Least and greatest value of each state, (2, ny), in the tightest run so far."""
        tightest = self.tightest_run
        return np.array([self.case.problem.initial] * 2) if tightest is None else tightest.extent

    @property
    def scale(self) -> FloatArray:
        """The scale of each state, (ny,)."""
        return self.case.scale(self.extent)

    @property
    def fast(self) -> Fast:
        """The fast components of the motion, from the tightest run or else from the start."""
        tightest = self.tightest_run
        if id(tightest) not in self._fast:
            states = [(0.0, self.case.problem.initial)]
            if tightest is not None:
                t, y = tightest.trajectory.t, tightest.trajectory.y
                places = np.linspace(0, len(t) - 1, LOOKS).astype(int)[1:]
                states += [(float(t[k]), y[k]) for k in places.tolist()]
            self._fast[id(tightest)] = fast(self.case.problem, states, self.case.t_end)
        return self._fast[id(tightest)]

    def of(self, name: str) -> list[Tried]:
        """The finished runs of a method, the tightest last."""
        own = [run for run in self.runs if run.setting.integrator == name]
        return sorted(own, key=lambda run: -run.tolerance)

    def tightest(self, method: Method) -> float:
        """The tightest tolerance, or shortest step, s, at which a method is run."""
        return method.tightest or self.case.t_end / MOST_STEPS

    def deepest(self, method: Method) -> float:
        """The tightest tolerance so far of methods with adaptive steps, or the shortest step, s, of
        methods with equal steps; infinite if none finished.
        """
        alike = (run for run in self.runs if (run.setting.dt is not None) == method.equal_steps)
        return min((run.tolerance for run in alike), default=math.inf)

    def setting(self, method: Method, tolerance: float) -> Setting:
        """A method's setting at about a tolerance or step, s, for the motion as known so far."""
        noise = float(np.max(self.fast.noise))
        return self.case.setting(method, tolerance, self.extent, noise)

    def repeats(self, method: Method, tolerance: float) -> bool:
        """Whether a run at about a tolerance would have the setting of a run already made: equal
        steps must end at rows, so there are few of them.
        """
        return self.setting(method, tolerance) in [run.setting for run in self.runs]

    def attempt(self, method: Method, tolerance: float, most: float = math.inf) -> bool:
        """Make a run, and return whether it finished. If not, its method is not continued.

        most  units of work that it may take
        """
        setting = self.setting(method, tolerance)
        due, like = self.started + self.budget, self.tightest_run
        tried = self.case.run(setting, most=most, due=due, like=like)
        if tried.interrupted:
            raise KeyboardInterrupt
        finished = tried.trajectory.finished and not self._passes_over_growth(tried)
        (self.runs if finished else self.broken).append(tried)
        (self.left_out.discard if finished else self.left_out.add)(method.name)
        return finished

    def _passes_over_growth(self, run: Tried) -> bool:
        """Whether an implicit method took steps over which deviations grow many times. It damps
        what it does not resolve, and stays at an unstable position, in all of its runs alike.
        """
        if INTEGRATORS[run.setting.integrator].kind != "implicit":
            return False
        t, y = run.trajectory.t, run.trajectory.y
        times, _, steps = run.pace
        longest = np.argsort(-steps[1:], kind="stable")[:LONGEST]
        begins = np.searchsorted(t, times[longest]).clip(max=len(t) - 1).tolist()
        return any(
            step * growth(self.case.problem, float(t[k]), y[k]) > GROWN
            for step, k in zip(steps[1:][longest].tolist(), begins, strict=True)
        )

    def misfits(self, method: Method) -> bool:
        """Whether the absolute tolerance of the last run, by this method, was too loose, because
        the scale of the motion was not known before. Then the run becomes a pilot. A tolerance that
        stays the same is not: the next run would be the same.
        """
        run = self.runs[-1]
        if run.setting.atol is None:
            return False
        again = self.case.setting(method, run.tolerance, run.extent, float(np.max(self.fast.noise)))
        assert again.atol is not None
        if again.atol > FITS * run.setting.atol:
            return False
        self.pilots.append(self.runs.pop())
        if self.setting(method, run.tolerance) == run.setting:
            self.runs.append(self.pilots.pop())
            return False
        return True

    def make(self, plan: Plan, most: float = math.inf) -> bool:
        """Make a planned run after saying what is expected of it; whether it finished."""
        setting = self.setting(plan.method, plan.tolerance)
        error = f"an error of {plan.error:.1g} in " if plan.known else ""
        self.say(f"{setting.options}: expecting {error}{plan.cost * self.unit:.2g} s")
        return self.attempt(plan.method, plan.tolerance, most)

    def verify(self, run: Tried) -> None:
        """Make a second run that estimates a run's error (`estimate.looser`)."""
        setting, case = looser(self.case, run)
        self.say(f"{setting.options}, with perturbed constants, to estimate the error")
        self.second[id(run)] = self._moved(case, setting, 0)

    def sample(self, run: Tried) -> None:
        """Make further runs that show the effect of rounding on a run."""
        seeds = range(1, 1 + SAMPLES) if self.case.moved is not None else ()
        self.samples[id(run)] = [self._moved(self.case, run.setting, seed) for seed in seeds]

    def may_miss(self, run: Tried) -> bool:
        """Whether a run may have passed over something between its steps, which its method cannot
        repeat.
        """
        problem = self.case.problem
        if run.setting.dt is None or problem.scrutiny is None or id(run) in self.shorter:
            return False
        return problem.corners or problem.scrutiny.localised is not None

    def shorten(self, run: Tried) -> None:
        """Make a run with `SHORTER` times shorter steps."""
        assert run.setting.dt is not None
        setting = replace(run.setting, dt=run.setting.dt / SHORTER)
        self.say(f"{setting.options}, for what may lie between longer steps")
        self.shorter[id(run)] = self._moved(self.case, setting, 0)

    @property
    def disturbed(self) -> float:
        """About how far rounding moves the end of the motion, relative to the scale; 0 if unknown.

        It is the difference of the cheapest run from one with perturbed constants. One-step methods
        come first: a perturbation changes the steps and orders of a multistep method.
        """
        if self._disturbed is None:
            run = min(
                self.runs,
                key=lambda run: (method_of(run.setting.integrator).multistep, run.work),
                default=None,
            )
            self._disturbed = 0.0
            if run is not None and self.case.moved is not None:
                twin = self._moved(self.case, run.setting, 0)
                self.pilots.append(twin)
                if twin.trajectory.finished:
                    self._disturbed = difference(run.trajectory, twin.trajectory, self.scale)
        return self._disturbed

    def _moved(self, case: Case, setting: Setting, seed: int) -> Tried:
        """A run with constants perturbed by rounding errors."""
        made = case.run(setting, due=self.started + self.budget, moved=seed)
        if made.interrupted:
            raise KeyboardInterrupt
        return made

    def estimate(self, run: Tried) -> Estimate:
        """The error of a run that has a second one."""
        own = self.of(run.setting.integrator)
        others = [other for other in own if other.tolerance > run.tolerance]
        samples = self.samples.get(id(run), [])
        if id(run) in self.shorter:
            samples = [*samples, self.shorter[id(run)]]
        return by_looser_run(self.case, run, self.second[id(run)], others, samples, self.scale)

    def rounded(self, run: Tried) -> float:
        """How far rounding moves a run's end, relative to the scale, as its samples show."""
        found = [s.trajectory for s in self.samples.get(id(run), []) if s.trajectory.finished]
        return max((difference(run.trajectory, one, self.scale) for one in found), default=0.0)

    def judged(self) -> dict[int, float]:
        """Estimated error of each run, by the run's `id`: from its second run if there is one, else
        from the other runs.
        """
        found = errors(self.runs, self.scale, self.case)
        judged = {id(run): error for run, error in zip(self.runs, found, strict=True)}
        for run in self.runs:
            if id(run) in self.second:
                judged[id(run)] = self.estimate(run).last
        return judged

    def representable(self, run: Tried) -> tuple[float, str]:
        """The error from rounding a run's last state to doubles, and the state with the largest."""
        floor, worst = representable(run, self.scale)
        return floor, self.case.problem.states[worst]

    def chosen(self, run: Tried, judged: dict[int, float], met: bool, reason: str = "") -> Choice:
        """A run as the choice, with its error from `judged`."""
        most, at = math.inf, math.nan
        if id(run) in self.second:
            found = self.estimate(run)
            most, at = found.most, found.at
        count = len(self.made)
        return Choice(run, judged[id(run)], most, at, met, reason, count, self.spent)

    def nothing(self) -> Choice:
        """If no run finishes: the run that got farthest, as a choice without an estimate."""
        farthest = max(self.broken, key=lambda tried: float(tried.trajectory.t[-1]))
        return self.chosen(farthest, {id(farthest): math.inf}, False)
