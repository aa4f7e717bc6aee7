"""A search for a run that will do: the runs made so far, the next one's plan, and the choice."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from eomgen.run.noise import Fast, fast
from eomgen.run.problem import Floats
from eomgen.study.accuracy.estimate import (
    Estimate,
    by_looser_run,
    difference,
    errors,
    looser,
    representable,
)
from eomgen.study.accuracy.trial import Case, Method, Setting, Tried, method_of

MOST_STEPS = 2**20
"""Of equal steps, in any run."""
LOOKS = 5
"""States of a motion, from its start to its end, at which it is asked what is fast."""
FITS = 0.2
"""Of the absolute tolerance of a run: where it should have been less, it is made again."""
SAMPLES = 2
"""More samples of rounding, where it counts."""
UNIT = 1e-6
"""s that a unit of work is taken to be before any run was made."""

Say = Callable[[str], None]


def _now() -> float:
    """What the clock shows, s."""
    return time.perf_counter()


@dataclass(frozen=True)
class Plan:
    """A method's next run.

    error, cost  expected of it, the error only where it is `known`; the cost in units of work
    work         that its run at the accuracy asked for should take
    """

    method: Method
    tolerance: float
    error: float
    known: bool
    cost: float
    work: float


@dataclass(frozen=True)
class Choice:
    """The run chosen.

    error     its estimated error in the last state, in parts of the motion's scale; infinite if
              there is no estimate
    most, at  the same of all rows, and the time of the worst, s; infinite and nan likewise
    met       whether that is what was asked for
    reason    why not, as far as it is known; else ""
    runs      how many were made in all, which took `seconds` together, with this one
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
    """Runs of a case made so far, and by what rules more are made.

    say       told of each planned run before it is made
    first     tolerance of the first runs
    budget    s from the start on after which runs are ended
    runs      those that came to the end
    broken    those that did not
    pilots    those that only told how others are to be made
    second    those that were made to tell another's error, by the identity of that
    samples   likewise, more samples of rounding
    left_out  methods that are gone on with no further, for now
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
    left_out: set[str] = field(default_factory=set)
    started: float = field(default_factory=_now)
    _fast: dict[int, Fast] = field(default_factory=dict)
    _disturbed: float | None = None

    @property
    def spent(self) -> float:
        """s by the clock since the search began."""
        return _now() - self.started

    @property
    def made(self) -> list[Tried]:
        """All runs made so far."""
        samples = [run for runs in self.samples.values() for run in runs]
        return [*self.runs, *self.broken, *self.pilots, *self.second.values(), *samples]

    @property
    def unit(self) -> float:
        """What a unit of work takes here, s, by all runs made so far."""
        work = sum(run.work for run in self.made)
        return sum(run.seconds for run in self.made) / work if work else UNIT

    @property
    def tightest_run(self) -> Tried | None:
        """The run held tightest so far."""
        known = self.runs or [run for run in self.pilots if run.trajectory.finished]
        return min(known, key=lambda run: (run.setting.dt is not None, run.tolerance), default=None)

    @property
    def extent(self) -> Floats:
        """Between which states the motion lies, (2, ny), as the run held tightest so far has it."""
        tightest = self.tightest_run
        return np.array([self.case.problem.initial] * 2) if tightest is None else tightest.extent

    @property
    def scale(self) -> Floats:
        """The scale of each state, (ny,)."""
        return self.case.scale(self.extent)

    @property
    def fast(self) -> Fast:
        """What is fast in the motion, as the run held tightest has it, or where it starts."""
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
        """The tightest tolerance, or shortest step, s, that a method is taken to."""
        return method.tightest or self.case.t_end / MOST_STEPS

    def deepest(self, method: Method) -> float:
        """The tightest tolerance so far, or shortest step, of methods of its kind; infinite if none
        came to its end.
        """
        alike = (run for run in self.runs if (run.setting.dt is not None) == method.equal_steps)
        return min((run.tolerance for run in alike), default=math.inf)

    def setting(self, method: Method, tolerance: float) -> Setting:
        """A method at about a tolerance or a step, s, for the motion as far as it is known."""
        noise = float(np.max(self.fast.noise))
        return self.case.setting(method, tolerance, self.extent, noise)

    def repeats(self, method: Method, tolerance: float) -> bool:
        """Whether a run at about a tolerance would be one that was made: equal steps end at rows,
        which bounds them.
        """
        return self.setting(method, tolerance) in [run.setting for run in self.runs]

    def attempt(self, method: Method, tolerance: float, most: float = math.inf) -> bool:
        """Make a run; where it comes to no end, the method is gone on with no further.

        most  units of work that it may take
        """
        setting = self.setting(method, tolerance)
        due, like = self.started + self.budget, self.tightest_run
        tried = self.case.run(setting, most=most, due=due, like=like)
        if tried.interrupted:
            raise KeyboardInterrupt
        finished = tried.trajectory.finished
        (self.runs if finished else self.broken).append(tried)
        (self.left_out.discard if finished else self.left_out.add)(method.name)
        return finished

    def misfits(self, method: Method) -> bool:
        """Whether the last run, by this method, was held to another part of the motion than it
        should have been, for how far that goes was not known before; it counts no more then.
        """
        run = self.runs[-1]
        if run.setting.atol is None:
            return False
        again = self.case.setting(method, run.tolerance, run.extent, float(np.max(self.fast.noise)))
        assert again.atol is not None
        if again.atol > FITS * run.setting.atol:
            return False
        self.pilots.append(self.runs.pop())
        return True

    def make(self, plan: Plan, most: float = math.inf) -> bool:
        """Make the run of a plan, and say what is expected of it; whether it came to its end."""
        setting = self.setting(plan.method, plan.tolerance)
        error = f"an error of {plan.error:.1g} in " if plan.known else ""
        self.say(f"{setting.options}: expecting {error}{plan.cost * self.unit:.2g} s")
        return self.attempt(plan.method, plan.tolerance, most)

    def verify(self, run: Tried) -> None:
        """Make a second run that tells a run's error (`estimate.looser`)."""
        setting, case = looser(self.case, run)
        self.say(f"{setting.options}, constants moved by rounding: to tell the error")
        self.second[id(run)] = self._moved(case, setting, 0)

    def sample(self, run: Tried) -> None:
        """Make more samples of what rounding makes of a run."""
        ways = range(1, 1 + SAMPLES) if self.case.moved is not None else ()
        self.samples[id(run)] = [self._moved(self.case, run.setting, way) for way in ways]

    @property
    def disturbed(self) -> float:
        """About how far rounding moves the end of the motion, in parts of the scale: what the
        cheapest run is off from one with constants moved by rounding; 0 where that is not known.

        Of multistep methods any disturbance makes other steps: others' runs go first.
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

    def _moved(self, case: Case, setting: Setting, way: int) -> Tried:
        """A run with constants moved by rounding."""
        made = case.run(setting, due=self.started + self.budget, moved=way)
        if made.interrupted:
            raise KeyboardInterrupt
        return made

    def estimate(self, run: Tried) -> Estimate:
        """The error of a run that has a second one."""
        own = self.of(run.setting.integrator)
        others = [other for other in own if other.tolerance > run.tolerance]
        samples = self.samples.get(id(run), [])
        return by_looser_run(self.case, run, self.second[id(run)], others, samples, self.scale)

    def rounded(self, run: Tried) -> float:
        """How far rounding moves a run's end, in parts of the scale, as far as samples tell."""
        found = [s.trajectory for s in self.samples.get(id(run), []) if s.trajectory.finished]
        return max((difference(run.trajectory, one, self.scale) for one in found), default=0.0)

    def judged(self) -> dict[int, float]:
        """Estimated error of each run, by the run's identity: by a second one where it was made,
        by the other runs where not.
        """
        found = errors(self.runs, self.scale, self.case)
        judged = {id(run): error for run, error in zip(self.runs, found, strict=True)}
        for run in self.runs:
            if id(run) in self.second:
                judged[id(run)] = self.estimate(run).last
        return judged

    def representable(self, run: Tried) -> tuple[float, str]:
        """What rounding a run's last state alone makes its error, and of which state."""
        floor, worst = representable(run, self.scale)
        return floor, self.case.problem.states[worst]

    def chosen(self, run: Tried, judged: dict[int, float], met: bool, reason: str = "") -> Choice:
        """A run as the choice, its error as `judged` has it."""
        most, at = math.inf, math.nan
        if id(run) in self.second:
            found = self.estimate(run)
            most, at = found.most, found.at
        count = len(self.made)
        return Choice(run, judged[id(run)], most, at, met, reason, count, self.spent)

    def nothing(self) -> Choice:
        """Of runs that all break off, the one that comes farthest."""
        farthest = max(self.broken, key=lambda tried: float(tried.trajectory.t[-1]))
        return self.chosen(farthest, {id(farthest): math.inf}, False)
