"""Which method and tolerance meet an accuracy, or make the most of a time, on the very scene.

Methods are first tried at a loose tolerance, where a run is cheap, over the whole span: a part of
it would say nothing of a spike, a contact or of chaos farther on. Differences of runs tell their
errors and how these fall with the tolerance (`estimate`), their times how those grow. Then the
method that promises to be the quickest is tried where its error should be a tenth of what is asked,
some decades tighter at once at most, until a run's own estimate says that it will do. That run is
the result; it is not made again.
"""

import math
from collections.abc import Sequence

from eomgen.errors import RunError
from eomgen.study.estimate import ROUNDING, Law, fit
from eomgen.study.measure import WRONG
from eomgen.study.search import Choice, Plan, Say, Search
from eomgen.study.trial import Case, Method, Tried, method_of

GOAL = 0.1
"""Of the error asked for: what a tolerance is chosen for."""
ENOUGH = 0.5
"""Of the error asked for: an estimate up to here will do."""
CLEAR = 0.3 * WRONG
"""Runs of greater errors tell nothing of how errors fall: those of chaotic motions stay large."""
RUNG, RUNGS = 100.0, 1000.0
"""So many times less an error is aimed at at once, where nothing or something is known of it; where
steps are bounded otherwise, too, errors do not yet fall as they will."""
BESIDE = 10.0
"""So many times more an error is that of a run made to tell that of the next one."""
TIGHTER = 3.0
"""So many times less an error makes another run worth while."""
SLACK = 1.5
"""Of the quickest so far: what another method may take at first."""
BETTER = 1.5
"""Among the runs that will do the most accurate counts, up to so many times the least time."""
OVERRUN = 3.0
"""Of the time expected of a run: after that others are tried."""
FULL, HALF = 0.7, 0.5
"""Of the time that is left: what a run is planned for. Of that, a run that only shows the way."""
WORTH = 0.5
"""Of the best error so far: where none less is expected, a budget is spent no further."""
FIRST = 1e-4
"""Tolerance of the first runs, where none is asked for."""
LOOSE = 1e-5
"""Errors asked for down to here may be met by few equal steps."""
FEW_ROWS = 257
"""With more, equal steps lose what they save."""
PATIENT = "gauss_6"
"""Tried where others at their tightest are not exact enough: in equal steps that are summed with
compensation, rounding disturbs a run a thousand times less."""
PATIENCE = 10.0
"""Of the time of the best run so far: what the first run of `PATIENT` may take."""
LIMIT = 30.0
"""Of the time of the tightest run of others: what any run of `PATIENT` may be expected to take. It
gains three digits in less; where it would need more, the motion is lost in rounding.
"""
FIRST_STEPS = 64
"""Of equal steps, in the first run of a method."""


def candidates(case: Case, asked: str | None) -> list[str]:
    """Methods that are tried, in this order: the one asked for, or those that have been found to be
    the quickest on one scene or another.

    A multistep method begins anew at each impact, which others do more lightly.
    """
    if asked is not None:
        return [method_of(asked).name]
    if case.problem.contacts is not None:
        return ["RK45", "DOP853"]
    return ["LSODA", "DOP853"]


def meet(case: Case, target: float, asked: str | None = None, say: Say = lambda _: None) -> Choice:
    """A run whose error in the last state is below `target`, in parts of the motion's scale.

    asked  the only method to try
    say    told of each run after the first ones, and of what is expected of it

    Raises `RunError` for a target that is none.
    """
    if not 0 < target < WRONG:
        raise RunError(f"--accuracy: {target:g} is not between 0 and {WRONG:g}; give e.g. 1e-6")
    start = min(1e-4, max(1e-6, 1e-4 * (target / 1e-3) ** (1 / 3)))
    search = Search(case, say, start)
    names = _race(search, candidates(case, asked), target >= LOOSE)
    while search.runs:
        judged = search.judged()
        done = [run for run in search.runs if judged[id(run)] <= ENOUGH * target]
        if done:
            most = BETTER * min(run.work for run in done)
            near = [run for run in done if run.work <= most]
            best = min(near, key=lambda run: (judged[id(run)], run.work))
            return search.chosen(best, judged, True)
        plans = [_towards(search, method_of(name), judged, GOAL * target) for name in names]
        possible = [plan for plan in plans if plan]
        best = min(search.runs, key=lambda run: judged[id(run)])
        if judged[id(best)] <= target and not possible:
            return search.chosen(best, judged, True)
        if asked is None and _patience(search, names, plans, PATIENCE * best.work):
            continue
        aside = None if _lost(search, judged) else _again(search, names)
        if not possible:
            possible = [plan for plan in (_beside(search, best), aside) if plan][:1]
        if not possible:
            return search.chosen(best, judged, False)
        plan = min(possible, key=lambda plan: plan.work)
        bounded = plan is not aside and (aside or len(possible) > 1)
        search.make(plan, OVERRUN * plan.seconds if bounded else math.inf)
    return search.nothing()


def within(
    case: Case, budget: float, asked: str | None = None, say: Say = lambda _: None
) -> Choice:
    """The most accurate run that, with all that is tried for it, takes up to `budget` s.

    asked, say  as of `meet`

    Raises `RunError` for a time that is none, and if no run comes to its end in it.
    """
    if not 0 < budget < math.inf:
        raise RunError(f"--budget: {budget:g} s is no time to compute in; give e.g. 2s")
    search = Search(case, say, FIRST, budget)
    names = _race(search, candidates(case, asked), False)
    while search.runs:
        judged = search.judged()
        best = min(search.runs, key=lambda run: judged[id(run)])
        left = budget - search.spent
        plans = [_most(search, method_of(name), judged, left) for name in names]
        possible = [plan for plan in plans if plan]
        if asked is None and left > 0 and _patience(search, names, plans, HALF * left):
            continue
        if not possible:
            return search.chosen(best, judged, True)
        plan = min(possible, key=lambda plan: plan.error)
        if plan.error > WORTH * judged[id(best)]:
            return search.chosen(best, judged, True)
        search.make(plan)
    if all(tried.cut for tried in search.broken):
        raise RunError(
            f"--budget: no run of {case.problem.name} to t = {case.t_end:g} s fits into "
            f"{budget:g} s; give more, or a shorter --t-end"
        )
    return search.nothing()


def _race(search: Search, names: list[str], loose: bool) -> list[str]:
    """Try each method once, but those that take much longer than another not to the end; return
    the names of all that were.

    Where a method had to be implicit, a more accurate one that is is tried, too; where it had not,
    the motion is smooth, and a `loose` error is asked for, one that spends no time on its steps.
    """
    for name in names:
        _first(search, method_of(name))
    if len(names) == 1:
        return names
    more = []
    if not search.runs or any(run.trajectory.counts["jacobians"] for run in search.runs):
        more = ["Radau"]
    elif loose and _few_steps_do(search.case):
        more = ["rk4"]
    for name in more:
        _first(search, method_of(name))
    return [*names, *more]


def _patience(search: Search, names: list[str], plans: Sequence[Plan | None], most: float) -> bool:
    """Try `PATIENT`, too, for `most` s, if it is for this motion, is not among the `names`, and the
    explicit ones of these can be held no tighter.
    """
    explicit = [plan for name, plan in zip(names, plans, strict=True) if name != "Radau"]
    if PATIENT in names or any(explicit) or not (_spent(search) and _smooth(search.case)):
        return False
    names.append(PATIENT)
    _first(search, method_of(PATIENT), most)
    return True


def _few_steps_do(case: Case) -> bool:
    """Whether equal steps may be few: the motion is smooth, and not many rows are asked for, of
    which each is the end of a step.
    """
    return _smooth(case) and case.rows <= FEW_ROWS


def _smooth(case: Case) -> bool:
    """Whether a method's order holds all along the motion."""
    return not case.problem.corners and case.problem.contacts is None


def _first(search: Search, method: Method, most: float | None = None) -> None:
    """A method's first run, for `most` s or not much longer than the quickest; where it fails, a
    tighter one: too long a step may not be stable.
    """
    steps = max(FIRST_STEPS, search.case.rows - 1)
    tolerance = search.case.t_end / steps if method.equal_steps else search.first
    if most is None:
        most = SLACK * min((run.work for run in search.runs), default=math.inf)
    while not (search.attempt(method, tolerance, most) or search.broken[-1].cut):
        tolerance /= _rung(method, RUNG)
        if tolerance < search.tightest(method):
            return


def _rung(method: Method, errors: float) -> float:
    """How many times tighter makes an error so many times less; at most ten times the steps.

    Equal steps are halved at least.
    """
    least = 2.0 if method.equal_steps else 1.0
    return float(min(max(least, errors ** (1 / method.exponent)), 10 ** (1 / method.growth)))


def _towards(search: Search, method: Method, judged: dict[int, float], goal: float) -> Plan | None:
    """A method's next run on the way to an error; none if it can be held no tighter, or rounding
    is all that is left.
    """
    own = search.of(method.name)
    if not own or method.name in search.left_out or judged[id(own[-1])] <= ROUNDING:
        return None
    if method.name != PATIENT and _lost(search, judged):
        return None
    last, tightest = own[-1].tolerance, search.tightest(method)
    law, known = _error_law(search, method, judged)
    wanted = max(min(law.tolerance(goal), last / _rung(method, TIGHTER)), tightest)
    surely = known and not search.case.bounded
    tolerance = max(wanted, search.deepest(method) / _rung(method, RUNGS if surely else RUNG))
    if tolerance >= last:
        return None
    seconds = _growth(method, [(run.tolerance, run.seconds) for run in own])
    work = _growth(method, [(run.tolerance, run.work) for run in own])
    error, cost = law.at(tolerance), seconds.at(tolerance)
    spent = _spent(search)
    if method.name == PATIENT and spent and cost > LIMIT * spent.seconds:
        return None
    return Plan(method, tolerance, error, known, cost, work.at(wanted))


def _lost(search: Search, judged: dict[int, float]) -> bool:
    """Whether a run as tight as doubles go is wrong: the motion makes its rounding that large, and
    other methods' no smaller.
    """
    spent = _spent(search)
    return spent is not None and judged[id(spent)] >= CLEAR


def _spent(search: Search) -> Tried | None:
    """DOP853 as tight as it goes, if it has been run so."""
    own = search.of("DOP853")
    return own[-1] if own and own[-1].tolerance <= search.tightest(method_of("DOP853")) else None


def _beside(search: Search, best: Tried) -> Plan | None:
    """A run a little looser than the best, where that has none near it to tell its error by."""
    method = method_of(best.setting.integrator)
    others = [run.tolerance for run in search.of(method.name) if run is not best]
    near = min(others, default=math.inf) <= best.tolerance * _rung(method, RUNG)
    if near or method.name in search.left_out:
        return None
    tolerance = best.tolerance * _rung(method, BESIDE)
    return Plan(method, tolerance, math.nan, False, best.seconds, best.work)


def _again(search: Search, names: Sequence[str]) -> Plan | None:
    """A run of a method that was put aside for taking longer than others, or than was expected of
    it, now to its end; of several, of the one that has the least to go.
    """
    plans = []
    for name in names:
        own = [run for run in search.broken if run.setting.integrator == name]
        if own and own[-1].cut and name in search.left_out:
            method, cut = method_of(name), own[-1]
            tolerance = min(cut.tolerance, max(search.deepest(method), method.tightest))
            tolerance = cut.tolerance if search.of(name) else tolerance
            whole = cut.work * search.case.t_end / max(float(cut.trajectory.t[-1]), cut.tolerance)
            work = _growth(method, [(cut.tolerance, whole)]).at(tolerance)
            plans.append(Plan(method, tolerance, math.nan, False, work, work))
    return min(plans, key=lambda plan: plan.work, default=None)


def _most(search: Search, method: Method, judged: dict[int, float], left: float) -> Plan | None:
    """A method's best run in the time that is left; none if that is no better than its last."""
    own = search.of(method.name)
    if not own or method.name in search.left_out or left <= 0:
        return None
    last, tightest = own[-1].tolerance, search.tightest(method)
    law, known = _error_law(search, method, judged)
    seconds = _growth(method, [(run.tolerance, run.seconds) for run in own])
    tolerance = max(seconds.tolerance(FULL * left), tightest)
    rung = last / _rung(method, RUNG)
    if not (known and len(own) > 1) and seconds.at(rung) < HALF * FULL * left:
        tolerance = max(tolerance, rung)
    if tolerance > last / _rung(method, TIGHTER):
        return None
    cost = seconds.at(tolerance)
    return Plan(method, tolerance, law.at(tolerance), known, cost, cost)


def _error_law(search: Search, method: Method, judged: dict[int, float]) -> tuple[Law, bool]:
    """How a method's error falls, and whether that is known.

    Of a method whose runs were all too wrong to tell, it is that of the method held tightest: what
    makes small errors large is the motion. Where nothing is known, it is taken to begin to fall.
    """

    def clear(name: str) -> list[Tried]:
        return [run for run in search.of(name) if 0 < judged[id(run)] < CLEAR]

    told = clear(method.name)
    if not told:
        alike = [r for r in search.runs if (r.setting.dt is not None) == method.equal_steps]
        others = sorted({run.setting.integrator for run in alike})
        ladders = [runs for name in others if (runs := clear(name))]
        told = min(ladders, key=lambda runs: runs[-1].tolerance, default=[])
    if not told:
        return fit([search.deepest(method)], [CLEAR], method.exponent), False
    errors = [judged[id(run)] for run in told]
    return fit([run.tolerance for run in told], errors, method.exponent), True


def _growth(method: Method, times: Sequence[tuple[float, float]]) -> Law:
    """How a method's time grows, from pairs of tolerance and time."""
    return fit([pair[0] for pair in times], [pair[1] for pair in times], -method.growth)
