"""The method and tolerance that meet a required accuracy for the given scene.

Each method first runs at a loose tolerance, which is cheap, over the whole time span; a part of it
would miss a later spike, contact or onset of chaos. A second run, with another tolerance and
constants perturbed by rounding errors, estimates its error (`estimate`). Theory says how the error
falls and how the counted work grows with the tolerance. So the method that is predicted to be the
cheapest runs with the tolerance that should do, until an estimate is small enough. If further runs
show that rounding does not undo it, that run is the result and is not repeated.

The choice does not depend on the clock: it is the same on every machine whose arithmetic is the
same.
"""

import math

from eomgen.base.errors import RunError
from eomgen.run.problem import Problem
from eomgen.study.accuracy.estimate import CHANCE
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.methods import method_of
from eomgen.study.accuracy.search import CLEAR, Choice, Plan, Say, Search, Trial
from eomgen.study.accuracy.trial import Case

ENOUGH, GOAL = 0.5, 0.2
"""A run is accepted if its estimated error is below the first part of the required error;
tolerances are chosen for the second."""
SLIGHT = 0.02
"""If the second run, whose constants are perturbed, differs by less than this part of the required
error, no more perturbed runs are needed."""
OVERRUN = 3.0
"""Where there are other methods, a run is stopped after this many times its expected work."""
SLOWED = 2.0
"""Steps of DOP853 that last this many times the fastest decay are limited by stability, not
accuracy: above about 6 they are unstable."""
STIFF = ("Rodas5P", "Radau")
"""For stiff motion; the first of them only where compiled code makes its steps."""
PATIENT, LIMIT = "gauss_6", 30.0
"""Tried if the other methods at their tightest tolerances are not accurate enough. It takes equal
steps with compensated summation, which reduces rounding errors a thousandfold. A run of it may take
at most this many times the work of the best run of the others: if it needs more, rounding errors
dominate."""


def meet(case: Case, target: float, asked: str | None = None, say: Say = lambda _: None) -> Choice:
    """A run whose error in the last state is below `target`, relative to the motion's scale.

    asked  the only method to try
    say    called with a line for each run, with its expected error and time

    Raises `RunError` if the target is not between 0 and `WRONG`.
    """
    if not 0 < target < WRONG:
        raise RunError(f"--accuracy: {target:g} is not between 0 and {WRONG:g}; give e.g. 1e-6")
    search = Search(case, say)
    names: list[str] = []
    while not search.slides:
        accepted = [trial for trial in search.trials if _holds(search, trial, ENOUGH * target)]
        if accepted:
            best = min(accepted, key=search.error)
            if best.samples or search.error(best) <= SLIGHT * target:
                return search.chosen(best, True)
            search.sample(best)
            continue
        fresh = [name for name in candidates(search, asked) if name not in names]
        if fresh:
            names.append(fresh[0])
            method = method_of(fresh[0])
            search.begin(method, search.still_cheapest(method, GOAL * target))
            continue
        if not search.trials:
            break
        best = min(search.trials, key=search.error)
        plans = [_towards(search, name, target) for name in names]
        possible = [plan for plan in plans if plan]
        if not possible and _holds(search, best, target):
            if best.samples:
                return search.chosen(best, True)
            search.sample(best)
            continue
        possible = possible or _aside(search, names, best)
        if possible:
            plan = min(possible, key=lambda plan: plan.work)
            search.make(plan, OVERRUN * plan.cost if len(possible) > 1 else math.inf)
        elif asked is None and PATIENT not in names and _may_gain(search, best, target):
            names.append(PATIENT)
            search.begin(method_of(PATIENT), LIMIT * best.run.work)
        elif not best.samples:
            search.sample(best)
        else:
            return search.chosen(best, False, _why_missed(search, best, target))
    return search.nothing()


def candidates(search: Search, asked: str | None = None) -> list[str]:
    """The methods to try, as far as is known now: the one that is `asked` for, or DOP853, whose
    steps are made in compiled code where that is possible.

    For stiff motion implicit methods come before it: stability would force it to take thousands of
    steps. If stability limits its steps, or a mode is fast, they come after it: a small oscillation
    is damped instead of followed.
    """
    if asked is not None:
        return [method_of(asked).name]
    stiff = _stiff(search.case.problem)
    if search.fast.stiff:
        return [*stiff, "DOP853"]
    return ["DOP853", *(stiff if search.fast.quick or _slowed(search) else [])]


def _stiff(problem: Problem) -> list[str]:
    """The methods for stiff motion. Compiled code can make the steps of the first of them if forces
    switch at given times, at most, and there are no rigid contacts and no constraints.
    """
    in_time_only = problem.switching is not None and problem.switching.of_state is None
    free = problem.contacts is None and problem.projection is None
    return list(STIFF if free and (in_time_only or not problem.corners) else STIFF[1:])


def _slowed(search: Search) -> bool:
    """Whether no run of DOP853 finished, or stability limits the steps of the tightest run."""
    run = search.tightest_run
    if run is None:
        return "DOP853" in search.out
    steps = max(1, run.trajectory.counts["steps"])
    return search.fast.decay * search.case.t_end / steps >= SLOWED


def _may_gain(search: Search, best: Trial, target: float) -> bool:
    """Whether a method with less rounding may be better: methods keep their order, doubles can
    represent the target, and the best run is not wrong, as one of chaotic motion is whatever its
    method.
    """
    floor, _ = search.representable(best.run)
    return search.smooth and floor <= ENOUGH * target and search.error(best) < CLEAR


def _holds(search: Search, trial: Trial, error: float) -> bool:
    """Whether a run's estimated error is below `error` at the end, and no row is wrong."""
    found = search.estimate(trial)
    return found.last <= error and found.most <= WRONG


def _towards(search: Search, name: str, target: float) -> Plan | None:
    """A method's next run; None if it has none, if its error no longer falls, or if rounding alone,
    as samples show, does not allow the target.
    """
    method = method_of(name)
    own = search.of(method)
    if any(CHANCE * search.rounded(trial) > target for trial in own) or search.stands(method):
        return None
    plan = search.plan(method, GOAL * target)
    if plan and name == PATIENT:
        others = [trial for trial in search.trials if trial.run.setting.integrator != PATIENT]
        return plan if plan.work <= LIMIT * max(trial.run.work for trial in others) else None
    return plan


def _aside(search: Search, names: list[str], best: Trial) -> list[Plan]:
    """The runs of methods that were stopped for their work, which may now finish. None if the best
    run is wrong: then the motion amplifies rounding errors so much that others are no better.
    """
    if search.error(best) >= CLEAR:
        return []
    cut = [search.out[name] for name in names if name in search.out and search.out[name].cut]
    return [
        Plan(method_of(run.setting.integrator), run.tolerance, math.nan, run.work, run.work)
        for run in cut
        if run.setting.integrator != PATIENT
    ][:1]


def _why_missed(search: Search, best: Trial, target: float) -> str:
    """Why no run is accurate enough; "" if that is not known."""
    floor, state = search.representable(best.run)
    if floor > ENOUGH * target:
        return f"a double resolves {state} only to {floor:.1g} of its range of motion"
    found, moved = search.estimate(best), search.rounded(best)
    if found.last <= target and found.most > WRONG:
        return (
            f"rows differ by {found.most:.1g} at t = {found.at:.4g} s in a run with other rounding "
            "errors"
        )
    if moved > ENOUGH * target:
        return f"rounding errors alone, in constants and in each step, move the end by {moved:.1g}"
    return ""
