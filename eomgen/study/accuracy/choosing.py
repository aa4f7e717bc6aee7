"""The method and tolerance that meet a required accuracy for the given scene.

Each method first runs at a loose tolerance, which is cheap, over the whole time span; a part of it
would miss a later spike, contact or onset of chaos. Differences between runs give their errors and
how these fall with the tolerance (`estimate`); the counted work gives how the cost grows. Then the
method that is predicted to be the cheapest runs with a tolerance that should give a tenth of the
required error, tightened by a few decades at a time. A run that seems accurate enough is checked by
a second run with a looser tolerance and constants perturbed by rounding errors. If that confirms
it, the run is the result and is not repeated.

The choice does not depend on the clock: it is the same on every machine whose arithmetic is the
same.
"""

import math
from collections.abc import Sequence

from eomgen.base.errors import RunError
from eomgen.run.problem import Problem
from eomgen.study.accuracy.estimate import ROUNDING, Law, fit
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.search import Choice, Plan, Say, Search
from eomgen.study.accuracy.trial import Case, Method, Tried, done, method_of

GOAL = 0.1
"""Tolerances are chosen for this part of the required error."""
HOPE = 0.3
"""A run is checked by a second one if other runs put its error below this part of the required
error."""
ENOUGH = 0.5
"""A run is accepted if the second one puts its error below this part of the required error."""
CLEAR = 0.3 * WRONG
"""Runs with larger errors show no convergence: errors of chaotic motion stay large."""
RUNG, RUNGS = 100.0, 1000.0
"""Factors by which a next run is to reduce the error: while the convergence is not known or steps
are bounded otherwise, and when it is known."""
BESIDE = 10.0
"""Factor between the error of a run and that of a looser one made to estimate it."""
TIGHTER = 3.0
"""Another run is made only if it is to reduce the error at least by this factor."""
SLACK = 1.5
"""A method's first run may take this many times the work of the cheapest so far."""
OVERRUN = 3.0
"""A run is stopped after this many times its expected work, and other methods are tried."""
SLOWED = 2.0
"""Steps of DOP853 that last this many times the fastest decay are limited by stability, not
accuracy: above about 6 they are unstable."""
STIFF = ("Rodas5P", "Radau")
"""Tried first where motion is stiff; the first of them only where compiled code makes its steps."""
PATIENT = "gauss_6"
"""Tried if the other methods at their tightest tolerances are not accurate enough. It takes equal
steps with compensated summation, which reduces rounding errors a thousandfold."""
PATIENCE = 10.0
"""The first run of `PATIENT` may take this many times the work of the best run so far."""
LIMIT = 30.0
"""Any run of `PATIENT` may be expected to take at most this many times the work of DOP853 at its
tightest. It gains three digits in less; if it needs more, rounding errors dominate.
"""
AGAIN = 8
"""A method's first run is repeated with tighter tolerances at most so often."""
SLIGHT = 0.02
"""If rounding causes less than this part of the required error, one perturbed run is enough."""
NO_WAY = 1e-9
"""The least share of its work that a stopped run is taken to have done."""
NEAR = 100.0
"""If the error asked for is less than doubles can represent, this many times their spacing in the
last state is aimed at instead."""
FIRST_STEPS = 64
"""Least number of equal steps in a method's first run."""


def meet(case: Case, target: float, asked: str | None = None, say: Say = lambda _: None) -> Choice:
    """A run whose error in the last state is below `target`, relative to the motion's scale.

    asked  the only method to try
    say    called with a line for each run after the first ones, with its expected error and time

    Raises `RunError` if the target is not between 0 and `WRONG`.
    """
    if not 0 < target < WRONG:
        raise RunError(f"--accuracy: {target:g} is not between 0 and {WRONG:g}; give e.g. 1e-6")
    start = min(1e-4, max(1e-6, 1e-4 * (target / 1e-3) ** (1 / 3)))
    search = Search(case, say, start)
    names = race(search, asked)
    while search.runs and not search.slides:
        judged = search.judged()
        best = min(search.runs, key=lambda run: judged[id(run)])
        aim, why = _aim(search, best, target)
        sure = [run for run in search.runs if id(run) in search.second]
        steady = [run for run in sure if search.estimate(run).most <= WRONG]
        enough = [run for run in steady if judged[id(run)] <= ENOUGH * aim]
        if enough:
            best = min(enough, key=lambda run: judged[id(run)])
            if search.may_miss(best):
                search.shorten(best)
                continue
            if search.disturbed <= SLIGHT * aim or id(best) in search.samples:
                return search.chosen(best, judged, not why, why)
            search.sample(best)
            continue
        hopeful = [run for run in search.runs if run not in sure and judged[id(run)] <= HOPE * aim]
        if hopeful:
            search.verify(min(hopeful, key=lambda run: run.work))
            continue
        plans = [_towards(search, method_of(name), judged, GOAL * aim) for name in names]
        possible = [plan for plan in plans if plan]
        if not possible and best not in sure:
            search.verify(best)
            continue
        if judged[id(best)] <= target and not possible and best in steady:
            return search.chosen(best, judged, not why, why)
        if asked is None and patience(search, names, plans, PATIENCE * best.work):
            continue
        aside = None if _lost(search, judged) else _again(search, names)
        if not possible:
            possible = [plan for plan in (_beside(search, best), aside) if plan][:1]
        if not possible and id(best) not in search.samples:
            search.sample(best)
            continue
        if not possible:
            return _missed(search, best, judged, target, why)
        other = asked is None and search.fast.noise.any() and not set(names) & set(STIFF)
        names += _go_on(search, possible, aside, _stiff(search.case) if other else [])
    return search.nothing()


def _go_on(
    search: Search, plans: Sequence[Plan], aside: Plan | None, stiff: list[str]
) -> list[str]:
    """Make the run that is expected to take the least work for the target. If it is stopped where
    there are others, methods for `stiff` motion are run, which are returned: rounding errors of a
    fast mode shorten explicit steps without end.
    """
    plan = min(plans, key=lambda plan: plan.work)
    bounded = plan is not aside and (aside or len(plans) > 1 or stiff)
    if search.make(plan, OVERRUN * plan.cost if bounded else math.inf):
        return []
    if not search.broken[-1].cut:
        return []
    for name in stiff:
        _first(search, method_of(name))
    return stiff


def _aim(search: Search, best: Tried, target: float) -> tuple[float, str]:
    """The error that is aimed at and, if doubles cannot represent the target, why it is another."""
    floor, state = search.representable(best)
    if floor <= ENOUGH * target:
        return target, ""
    return NEAR * floor, f"a double resolves {state} only to {floor:.1g} of its range of motion"


def _missed(
    search: Search, best: Tried, judged: dict[int, float], target: float, why: str
) -> Choice:
    """The best run, none being accurate enough, and `why`; by default rounding if it is large."""
    moved = search.rounded(best)
    if not why and judged[id(best)] <= target and (found := search.estimate(best)).most > WRONG:
        why = (
            f"rows differ by {found.most:.1g} at t = {found.at:.4g} s in a run with other rounding "
            "errors"
        )
    if not why and moved > ENOUGH * target:
        why = f"rounding errors alone, in constants and in each step, move the end by {moved:.1g}"
    return search.chosen(best, judged, False, why)


def _candidates(search: Search) -> list[str]:
    """The methods to try, in this order; each was the cheapest for some scene.

    DOP853 comes first, whose steps are made in compiled code where that is possible. For stiff
    motion implicit methods come before it: stability would force explicit ones to take thousands
    of steps. With contacts, a multistep method restarts at each impact, and it leaves the
    constraints of loops, so one-step methods replace it.
    """
    if search.fast.stiff:
        beside = "LSODA" if _takes_multistep(search.case.problem) else "RK45"
        return [*_stiff(search.case), beside, "DOP853"]
    return ["DOP853"]


def _stiff(case: Case) -> list[str]:
    """The methods for stiff motion."""
    return list(STIFF if _is_compiled(case.problem) else STIFF[1:])


def _takes_multistep(problem: Problem) -> bool:
    """Whether multistep methods suit: there are no rigid contacts and no constraints."""
    return problem.contacts is None and problem.projection is None


def _is_compiled(problem: Problem) -> bool:
    """Whether compiled code can make the steps of a stiff method: forces switch at given times, at
    most, and there are no rigid contacts and no constraints.
    """
    in_time_only = problem.switching is not None and problem.switching.of_state is None
    return _takes_multistep(problem) and (in_time_only or not problem.corners)


def _slowed(search: Search) -> bool:
    """Whether no run finished, or stability limits the steps of the tightest."""
    run = search.tightest_run
    if run is None or not search.runs:
        return True
    steps = max(1, run.trajectory.counts["steps"])
    return search.fast.decay * search.case.t_end / steps >= SLOWED


def race(search: Search, asked: str | None) -> list[str]:
    """Run each method once; stop runs that take much more work than another. Return the names of
    all methods that were run.

    If stability limits the steps of DOP853, LSODA is run, too, which changes over to an implicit
    method. If a run needed Jacobians, or none finished, those of `STIFF` are run, too. Else the
    first of them is if a mode is fast: a small oscillation is damped instead of followed.
    """
    names = [method_of(asked).name] if asked is not None else _candidates(search)
    for name in names:
        _first(search, method_of(name))
        if search.slides:
            return names
    if asked is not None:
        return names
    if "LSODA" not in names and _takes_multistep(search.case.problem) and _slowed(search):
        names.append("LSODA")
        _first(search, method_of("LSODA"))
    more = _stiff(search.case)
    if search.runs and not any(run.trajectory.counts["jacobians"] for run in search.runs):
        more = more[:-1] if search.fast.quick else []
    more = [name for name in more if name not in names]
    for name in more:
        _first(search, method_of(name))
    return [*names, *more]


def patience(search: Search, names: list[str], plans: Sequence[object], most: float) -> bool:
    """Whether `PATIENT` was run now, for at most `most` units of work.

    It is run if the motion is smooth, DOP853 has been run at its tightest tolerance, and there is
    no plan left for an explicit method. `plans` belong to `names`; `PATIENT` is added to `names`.
    """
    explicit = [plan for name, plan in zip(names, plans, strict=True) if name not in STIFF]
    if PATIENT in names or any(explicit) or not (_spent(search) and _smooth(search.case)):
        return False
    names.append(PATIENT)
    _first(search, method_of(PATIENT), most)
    return True


def _smooth(case: Case) -> bool:
    """Whether methods keep their order: the motion has neither corners nor rigid contacts."""
    return not case.problem.corners and case.problem.contacts is None


def _first(search: Search, method: Method, most: float | None = None) -> None:
    """Make a method's first run, with at most `most` units of work or little more than the cheapest
    run so far. If it fails, tighten the tolerance and try again: a long step may be unstable.
    """
    steps = max(FIRST_STEPS, search.case.rows - 1)
    tolerance = search.case.t_end / steps if method.equal_steps else search.first
    if most is None:
        most = SLACK * min((run.work for run in search.runs), default=math.inf)
    for _ in range(AGAIN):
        if search.attempt(method, tolerance, most):
            if not search.misfits(method):
                return
        elif search.broken[-1].cut or search.slides:
            return
        else:
            tolerance /= rung(method, RUNG)
            if tolerance < search.tightest(method):
                return


def rung(method: Method, errors: float) -> float:
    """Factor by which to tighten the tolerance so that the error falls `errors` times.

    It makes at most ten times as many steps; equal steps are at least halved.
    """
    least = 2.0 if method.equal_steps else 1.0
    return float(min(max(least, errors ** (1 / method.exponent)), 10 ** (1 / method.growth)))


def _towards(search: Search, method: Method, judged: dict[int, float], goal: float) -> Plan | None:
    """A method's next run on the way to the error `goal`; None if no tighter run is possible, or if
    only rounding errors are left.
    """
    own = search.of(method.name)
    if not own or method.name in search.left_out or judged[id(own[-1])] <= ROUNDING:
        return None
    if method.name != PATIENT and _lost(search, judged):
        return None
    last, tightest = own[-1].tolerance, search.tightest(method)
    law, known = error_law(search, method, judged)
    wanted = max(min(law.tolerance(goal), last / rung(method, TIGHTER)), tightest)
    surely = known and not search.case.bounded
    tolerance = max(wanted, search.deepest(method) / rung(method, RUNGS if surely else RUNG))
    if tolerance >= last or search.repeats(method, tolerance):
        return None
    work = growth(method, own)
    cost, spent = work.at(tolerance), _spent(search)
    if method.name == PATIENT and spent and cost > LIMIT * spent.work:
        return None
    return Plan(method, tolerance, law.at(tolerance), known, cost, work.at(wanted))


def _lost(search: Search, judged: dict[int, float]) -> bool:
    """Whether DOP853 at its tightest tolerance is wrong: then the motion amplifies rounding errors
    so much that other methods are no better.
    """
    spent = _spent(search)
    return spent is not None and judged[id(spent)] >= CLEAR


def _spent(search: Search) -> Tried | None:
    """The run of DOP853 at its tightest tolerance; None if there is none."""
    own = search.of("DOP853")
    return own[-1] if own and own[-1].tolerance <= search.tightest(method_of("DOP853")) else None


def _beside(search: Search, best: Tried) -> Plan | None:
    """A run a little looser than the best, if no other of its method is near enough to estimate its
    error.
    """
    method = method_of(best.setting.integrator)
    others = [run.tolerance for run in search.of(method.name) if run is not best]
    near = min(others, default=math.inf) <= best.tolerance * rung(method, RUNG)
    if near or method.name in search.left_out:
        return None
    tolerance = best.tolerance * rung(method, BESIDE)
    if search.repeats(method, tolerance):
        return None
    return Plan(method, tolerance, math.nan, False, best.work, best.work)


def _again(search: Search, names: Sequence[str]) -> Plan | None:
    """A repeated run of a method whose last run was stopped for its work; this one may finish. Of
    several, the one that is expected to take the least work.
    """
    plans = []
    for name in names:
        own = [run for run in search.broken if run.setting.integrator == name]
        if own and own[-1].cut and name in search.left_out:
            method, cut = method_of(name), own[-1]
            tolerance = min(cut.tolerance, max(search.deepest(method), method.tightest))
            tolerance = cut.tolerance if search.of(name) else tolerance
            t, like = float(cut.trajectory.t[-1]), search.tightest_run
            whole = cut.work / max(done(like, t, search.case.t_end), NO_WAY)
            work = fit([cut.tolerance], [whole], -method.growth).at(tolerance)
            plans.append(Plan(method, tolerance, math.nan, False, work, work))
    return min(plans, key=lambda plan: plan.work, default=None)


def error_law(search: Search, method: Method, judged: dict[int, float]) -> tuple[Law, bool]:
    """How a method's error falls with its tolerance, and whether that is known.

    If all runs of a method are too inaccurate, the law of the method with the tightest run is
    taken: the motion is what amplifies errors. If nothing is known, the error is taken to start
    from `CLEAR` with the method's theoretical order.
    """

    def clear(name: str) -> list[Tried]:
        return [run for run in search.of(name) if 0 < judged[id(run)] < CLEAR]

    reported = clear(method.name)
    if not reported:
        alike = [r for r in search.runs if (r.setting.dt is not None) == method.equal_steps]
        others = sorted({run.setting.integrator for run in alike})
        ladders = [runs for name in others if (runs := clear(name))]
        reported = min(ladders, key=lambda runs: runs[-1].tolerance, default=[])
    if not reported:
        return fit([search.deepest(method)], [CLEAR], method.exponent), False
    errors = [judged[id(run)] for run in reported]
    return fit([run.tolerance for run in reported], errors, method.exponent), True


def growth(method: Method, runs: Sequence[Tried]) -> Law:
    """How a method's work grows with its tolerance."""
    return fit([run.tolerance for run in runs], [run.work for run in runs], -method.growth)
