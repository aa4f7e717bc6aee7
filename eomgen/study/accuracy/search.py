"""The state of a search for a run: the runs made so far, each method's next one, and the choice."""

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
    difference,
    estimated,
    representable,
    second_of,
)
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.methods import Method, method_of
from eomgen.study.accuracy.trial import Case, Setting, Tried
from eomgen.tables.integrators import INTEGRATORS

FIRST = 1e-4
"""Relative tolerance of a method's first run; equal steps are those of the rows."""
MOST_STEPS = 2**20
"""Greatest number of equal steps in a run."""
CLEAR = 0.3 * WRONG
"""Runs with larger errors show no convergence: errors of chaotic motion stay large."""
TIGHTER, RUNG = 3.0, 1e4
"""The next run of a method is to reduce the error at least, and at most, by these factors."""
LOOKS = 5
"""Number of states, from start to end of a motion, at which its fast components are determined."""
LONGEST, GROWN = 8, 3.0
"""At the beginnings of so many of the longest steps of an implicit method it is looked whether
deviations grow by more than exp(`GROWN`) in the step."""
SAMPLES = 2
"""Number of further runs that show the effect of rounding on the run that is chosen."""

Say = Callable[[str], None]


def _now() -> float:
    """The current time, s."""
    return time.perf_counter()


@dataclass(frozen=True)
class Plan:
    """A method's next run.

    error, cost  expected for it, the cost in units of work; nan if nothing is known
    work         expected of the method's run at the required accuracy, in units of work
    """

    method: Method
    tolerance: float
    error: float
    cost: float
    work: float


@dataclass(frozen=True, eq=False)
class Trial:
    """A finished run, and those that show its error.

    second   see `estimate.second_of`
    samples  runs with the same setting and other perturbations of the constants
    """

    run: Tried
    second: Tried
    samples: list[Tried] = field(default_factory=list)


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
    """The runs of a case made so far, and how more are made.

    say     called with a line of text before each run
    budget  s after the start at which runs are ended
    trials  finished runs
    out     by method, its last run, if that did not reach the end
    """

    case: Case
    say: Say
    budget: float = math.inf
    trials: list[Trial] = field(default_factory=list)
    out: dict[str, Tried] = field(default_factory=dict)
    started: float = field(default_factory=_now)
    _made: list[Tried] = field(default_factory=list)
    _fast: dict[int, Fast] = field(default_factory=dict)

    @property
    def spent(self) -> float:
        """Wall time since the search began, s."""
        return _now() - self.started

    @property
    def slides(self) -> bool:
        """Whether a run ended in a sliding mode: then all do, and tighter ones take longer."""
        return any(run.trajectory.outcome.reason.startswith(SLIDES) for run in self.out.values())

    @property
    def smooth(self) -> bool:
        """Whether methods keep their order: the motion has neither corners nor rigid contacts."""
        return not self.case.problem.corners and self.case.problem.contacts is None

    @property
    def unit(self) -> float:
        """Time that a unit of work takes on this machine, s, measured on all runs so far."""
        return sum(run.seconds for run in self._made) / sum(run.work for run in self._made)

    @property
    def tightest_run(self) -> Tried | None:
        """The finished run with the tightest tolerance; None if there is none."""
        runs = [trial.run for trial in self.trials]
        return min(runs, key=lambda run: (run.setting.dt is not None, run.tolerance), default=None)

    @property
    def scale(self) -> FloatArray:
        """The scale of each state, (ny,), in the tightest run."""
        assert self.tightest_run is not None
        return self.case.scale(self.tightest_run.extent)

    @property
    def fast(self) -> Fast:
        """The fast components of the motion, from the tightest run or else from the start."""
        return self._fast_of(self.tightest_run)

    def _fast_of(self, run: Tried | None) -> Fast:
        if id(run) not in self._fast:
            states = [(0.0, self.case.problem.initial)]
            if run is not None:
                t, y = run.trajectory.t, run.trajectory.y
                places = np.linspace(0, len(t) - 1, LOOKS).astype(int)[1:]
                states += [(float(t[k]), y[k]) for k in places.tolist()]
            self._fast[id(run)] = fast(self.case.problem, states, self.case.t_end)
        return self._fast[id(run)]

    def of(self, method: Method) -> list[Trial]:
        """The trials of a method, the tightest last."""
        own = [trial for trial in self.trials if trial.run.setting.integrator == method.name]
        return sorted(own, key=lambda trial: -trial.run.tolerance)

    def tightest(self, method: Method) -> float:
        """The tightest tolerance, or shortest step, s, at which a method is run."""
        return method.tightest or self.case.t_end / MOST_STEPS

    def setting(self, method: Method, tolerance: float) -> Setting:
        """A method's setting at about a tolerance or step, s, for the motion as known so far."""
        return self._setting(method, tolerance, self.tightest_run)

    def _setting(self, method: Method, tolerance: float, like: Tried | None) -> Setting:
        """The same, where the motion is like that of a run."""
        extent = np.array([self.case.problem.initial] * 2) if like is None else like.extent
        noise = float(np.max(self._fast_of(like).noise))
        return self.case.setting(method, tolerance, extent, noise)

    def still_cheapest(self, method: Method, goal: float) -> float:
        """Units of work of a method's first run with which it may still be the cheapest at an
        estimated error `goal`.
        """
        most = math.inf
        for trial in self.trials:
            other = method_of(trial.run.setting.integrator)
            ratio = max(min(self.error(trial), CLEAR) / goal, 1.0)
            gain = other.growth / other.exponent - method.growth / method.exponent
            most = min(most, trial.run.work * math.pow(ratio, gain))
        return most

    def begin(self, method: Method, most: float = math.inf) -> None:
        """Make a method's first run, with at most `most` units of work. If it breaks off, tighten
        the tolerance and try again: a long step may be unstable.
        """
        tolerance = self.case.t_end / (self.case.rows - 1) if method.equal_steps else FIRST
        plan = Plan(method, tolerance, math.nan, math.nan, math.nan)
        while not self.make(plan, most) and not self.slides and not self.out[method.name].cut:
            if plan.tolerance <= self.tightest(method) or self.spent > self.budget:
                return
            plan = replace(plan, tolerance=plan.tolerance / rung(method, RUNG))

    def make(self, plan: Plan, most: float = math.inf) -> bool:
        """Make a planned run after saying what is expected of it, and if it finishes the one that
        estimates its error; whether it finished. `most` is the units of work that it may take.
        """
        setting = self.setting(plan.method, plan.tolerance)
        cost = f": expecting {plan.cost * self.unit:.2g} s" if plan.cost < math.inf else ""
        if plan.error < CLEAR:
            cost = cost.replace("expecting", f"expecting an error of {plan.error:.1g} in")
        self.say(f"{setting.options}{cost}")
        run = self._run(self.case, setting, most=most)
        if run.trajectory.finished and not self.trials:  # now the motion's scale is known
            again = self._setting(plan.method, plan.tolerance, run)
            if again.atol is not None and setting.atol is not None and again.atol < setting.atol:
                run = self._run(self.case, again, most=most)
        self.out[plan.method.name] = run
        if not run.trajectory.finished or self._passes_over_growth(run):
            return False
        setting, case = second_of(self.case, run)
        self.say(f"{setting.options}, with perturbed constants, to estimate the error")
        second = self._run(case, setting, moved=0)
        if not second.trajectory.finished:
            return False
        del self.out[plan.method.name]
        self.trials.append(Trial(run, second))
        return True

    def _run(
        self, case: Case, setting: Setting, *, most: float = math.inf, moved: int | None = None
    ) -> Tried:
        made = case.run(setting, most=most, due=self.started + self.budget, moved=moved)
        if made.interrupted:
            raise KeyboardInterrupt
        self._made.append(made)
        return made

    def _passes_over_growth(self, run: Tried) -> bool:
        """Whether an implicit method took steps over which deviations grow many times. It damps
        what it does not resolve, and stays at an unstable position, in all of its runs alike.
        """
        if INTEGRATORS[run.setting.integrator].kind != "implicit":
            return False
        t, y = run.trajectory.t, run.trajectory.y
        lengths, begins = run.steps
        longest = np.argsort(-lengths, kind="stable")[:LONGEST]
        rows = np.searchsorted(t, begins[longest]).clip(max=len(t) - 1).tolist()
        return any(
            length * growth(self.case.problem, float(t[k]), y[k]) > GROWN
            for length, k in zip(lengths[longest], rows, strict=True)
        )

    def sample(self, trial: Trial) -> None:
        """Make further runs that show the effect of rounding on a run. If one of them breaks off,
        its method is out.
        """
        for seed in range(1, 1 + SAMPLES):
            sample = self._run(self.case, trial.run.setting, moved=seed)
            if not sample.trajectory.finished:
                self.trials.remove(trial)
                self.out[sample.setting.integrator] = sample
                return
            trial.samples.append(sample)

    def estimate(self, trial: Trial) -> Estimate:
        """The error of a run. As two runs may agree by accident, it is at least what theory makes
        of the error of the next looser run of its method.
        """
        scale, method = self.scale, method_of(trial.run.setting.integrator)
        found = estimated(self.case, trial.run, trial.second, scale, trial.samples)
        looser = [one for one in self.of(method) if one.run.tolerance > trial.run.tolerance]
        if looser:
            other = estimated(self.case, looser[-1].run, looser[-1].second, scale).last
            falls = math.pow(trial.run.tolerance / looser[-1].run.tolerance, method.exponent)
            if other < WRONG:
                last = max(found.last, other * falls)
                found = replace(found, last=last, most=max(found.most, last))
        return found

    def error(self, trial: Trial) -> float:
        """The error of a run's last state."""
        return self.estimate(trial).last

    def stands(self, method: Method) -> bool:
        """Whether a method's error no longer falls in smooth motion: then it consists of rounding.
        Of runs that are wrong it is not known what tighter ones do.
        """
        errors = [self.error(trial) for trial in self.of(method)[-2:]]
        return self.smooth and len(errors) > 1 and errors[0] <= errors[1] < CLEAR

    def rounded(self, trial: Trial) -> float:
        """How far rounding moves a run's end, relative to the scale, as its samples show."""
        found = [sample.trajectory for sample in trial.samples]
        return max((difference(trial.run.trajectory, s, self.scale) for s in found), default=0.0)

    def plan(self, method: Method, goal: float, most: float = math.inf) -> Plan | None:
        """A method's next run on the way to an estimated error `goal`, in at most `most` units of
        work; None if it has none, or cannot be run with a tighter tolerance.
        """
        own = self.of(method)
        if not own or method.name in self.out:
            return None
        run, error = own[-1].run, self.error(own[-1])
        falls = (min(error, CLEAR) / goal) ** (1 / method.exponent)
        wanted = min(run.tolerance / falls, run.tolerance / rung(method, TIGHTER))
        affordable = run.tolerance * math.pow(run.work / most, 1 / method.growth)
        if affordable > run.tolerance / rung(method, TIGHTER):
            return None
        wanted = max(wanted, affordable, self.tightest(method))
        tolerance = max(wanted, run.tolerance / rung(method, RUNG))
        if self.setting(method, tolerance) in [trial.run.setting for trial in own]:
            return None
        ratio = run.tolerance / tolerance
        cost, work = (
            run.work * math.pow(run.tolerance / each, method.growth) for each in (tolerance, wanted)
        )
        return Plan(method, tolerance, error / math.pow(ratio, method.exponent), cost, work)

    def representable(self, run: Tried) -> tuple[float, str]:
        """The error from rounding a run's last state to doubles, and the state with the largest."""
        floor, worst = representable(run, self.scale)
        return floor, self.case.problem.states[worst]

    def chosen(self, trial: Trial, met: bool, reason: str = "") -> Choice:
        """A run as the choice."""
        found, runs = self.estimate(trial), len(self._made)
        return Choice(trial.run, found.last, found.most, found.at, met, reason, runs, self.spent)

    def nothing(self) -> Choice:
        """If no run has an estimate: the run that got farthest."""
        farthest = max(self.out.values(), key=lambda tried: float(tried.trajectory.t[-1]))
        unknown = math.inf, math.inf, math.nan
        return Choice(farthest, *unknown, False, "", len(self._made), self.spent)


def rung(method: Method, errors: float) -> float:
    """Factor by which to tighten the tolerance so that the error falls `errors` times. Equal steps
    are at least halved.
    """
    return errors if not method.equal_steps else max(2.0, math.pow(errors, 1 / method.exponent))
