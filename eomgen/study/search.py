"""A search for a run that will do: the runs made so far, the next one's plan, and the choice."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from eomgen.run.problem import Floats
from eomgen.study.estimate import errors
from eomgen.study.trial import Case, Method, Tried

MOST_STEPS = 2**20
"""Of equal steps, in any run."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """A method's next run.

    error, seconds  expected of it, the error only where it is `known`
    work            that its run at the accuracy asked for should take, s of the processor
    """

    method: Method
    tolerance: float
    error: float
    known: bool
    seconds: float
    work: float


@dataclass(frozen=True)
class Choice:
    """The run chosen.

    error    its estimated error, in parts of the motion's scale; infinite if there is no estimate
    met      whether that is what was asked for
    runs     how many were made in all, which took `seconds` together, with this one
    """

    tried: Tried
    error: float
    met: bool
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
    left_out  methods that are gone on with no further, for now
    """

    case: Case
    say: Say
    first: float
    budget: float = math.inf
    runs: list[Tried] = field(default_factory=list)
    broken: list[Tried] = field(default_factory=list)
    left_out: set[str] = field(default_factory=set)
    started: float = field(default_factory=time.perf_counter)

    @property
    def spent(self) -> float:
        """s by the clock since the search began."""
        return time.perf_counter() - self.started

    @property
    def motion(self) -> Floats:
        """The motion as the run held tightest so far has it, or where it starts."""
        if not self.runs:
            return self.case.problem.initial[None, :]
        tightest = min(self.runs, key=lambda run: (run.setting.dt is not None, run.tolerance))
        return tightest.trajectory.y

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

    def attempt(self, method: Method, tolerance: float, most: float = math.inf) -> bool:
        """Make a run; where it comes to no end, the method is gone on with no further."""
        setting = self.case.setting(method, tolerance, self.motion)
        tried = self.case.run(setting, most=most, due=self.started + self.budget)
        if tried.interrupted:
            raise KeyboardInterrupt
        finished = tried.trajectory.finished
        (self.runs if finished else self.broken).append(tried)
        (self.left_out.discard if finished else self.left_out.add)(method.name)
        return finished

    def make(self, plan: Plan, most: float = math.inf) -> bool:
        """Make the run of a plan, and say what is expected of it; whether it came to its end."""
        setting = self.case.setting(plan.method, plan.tolerance, self.motion)
        error = f"an error of {plan.error:.1g} in " if plan.known else ""
        self.say(f"{setting.options}: expecting {error}{plan.seconds:.2g} s")
        return self.attempt(plan.method, plan.tolerance, most)

    def judged(self) -> dict[int, float]:
        """Estimated error of each run, by the run's identity."""
        found = errors(self.runs, self.case.scale(self.motion), self.case)
        return {id(run): error for run, error in zip(self.runs, found, strict=True)}

    def chosen(self, tried: Tried, judged: dict[int, float], met: bool) -> Choice:
        """A run as the choice, its error as `judged` has it."""
        runs = len(self.runs) + len(self.broken)
        return Choice(tried, judged[id(tried)], met, runs, self.spent)

    def nothing(self) -> Choice:
        """Of runs that all break off, the one that comes farthest."""
        farthest = max(self.broken, key=lambda tried: float(tried.trajectory.t[-1]))
        return self.chosen(farthest, {id(farthest): math.inf}, False)
