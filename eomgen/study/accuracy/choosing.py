"""Which method and tolerance meet an accuracy on the very scene.

Methods are first tried at a loose tolerance, where a run is cheap, over the whole span: a part of
it would say nothing of a spike, a contact or of chaos farther on. Differences of runs tell their
errors and how these fall with the tolerance (`estimate`), their counted work how that grows. Then
the method that promises to be the cheapest is tried where its error should be a tenth of what is
asked, some decades tighter at once at most. A run that will do by that is the result once a second
one, looser and with constants moved by rounding, says so, too; it is not made again.

No clock has a say in it: the same scene gives the same choice on every machine, as far as its
arithmetic is the same.
"""

import math
from collections.abc import Sequence

from eomgen.errors import RunError
from eomgen.study.accuracy.estimate import ROUNDING, Law, fit
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.search import Choice, Plan, Say, Search
from eomgen.study.accuracy.trial import Case, Method, Tried, done, method_of

GOAL = 0.1
"""Of the error asked for: what a tolerance is chosen for."""
HOPE = 0.3
"""Of the error asked for: where other runs put a run's error up to here, a second one is made."""
ENOUGH = 0.5
"""Of the error asked for: an estimate by a second run up to here will do."""
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
"""Of the cheapest so far: what another method may take at first."""
BETTER = 1.5
"""Among the runs that will do the most accurate counts, up to so many times the least work."""
OVERRUN = 3.0
"""Of the work expected of a run: after that others are tried."""
LOOSE = 1e-5
"""Errors asked for down to here may be met by few equal steps."""
FEW_ROWS = 257
"""With more, equal steps lose what they save."""
STIFF = "Radau"
"""Tried first where the motion is stiff."""
PATIENT = "gauss_6"
"""Tried where others at their tightest are not exact enough: in equal steps that are summed with
compensation, rounding disturbs a run a thousand times less."""
PATIENCE = 10.0
"""Of the work of the best run so far: what the first run of `PATIENT` may take."""
LIMIT = 30.0
"""Of the work of the tightest run of others: what any run of `PATIENT` may be expected to take. It
gains three digits in less; where it would need more, the motion is lost in rounding.
"""
AGAIN = 8
"""Times that a method's first run is made at most, ever tighter."""
SLIGHT = 0.02
"""Of the error asked for: where rounding makes less, one sample of it is enough."""
NO_WAY = 1e-9
"""Share of a run's work that any beginning is taken to be at least."""
NEAR = 100.0
"""Times what rounding the last state makes: what is aimed at where no run can do."""
FIRST_STEPS = 64
"""Of equal steps, in the first run of a method."""


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
    names = race(search, asked, target >= LOOSE)
    while search.runs:
        judged = search.judged()
        best = min(search.runs, key=lambda run: judged[id(run)])
        floor, state = search.representable(best)
        aim, why = target, ""
        if floor > ENOUGH * target:
            aim = NEAR * floor
            why = f"{state} as a double is known to {floor:.1g} of what it moves by"
        sure = [run for run in search.runs if id(run) in search.second]
        enough = [run for run in sure if judged[id(run)] <= ENOUGH * aim]
        if enough:
            best = _best(enough, judged)
            if search.disturbed <= SLIGHT * aim or id(best) in search.samples:
                return search.chosen(best, judged, not why, why)
            search.sample(best)
            continue
        hopeful = [run for run in search.runs if run not in sure and judged[id(run)] <= HOPE * aim]
        if hopeful:
            search.verify(_best(hopeful, judged))
            continue
        plans = [_towards(search, method_of(name), judged, GOAL * aim) for name in names]
        possible = [plan for plan in plans if plan]
        if not possible and best not in sure:
            search.verify(best)
            continue
        if judged[id(best)] <= target and not possible:
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
        plan = min(possible, key=lambda plan: plan.work)
        bounded = plan is not aside and (aside or len(possible) > 1)
        search.make(plan, OVERRUN * plan.cost if bounded else math.inf)
    return search.nothing()


def _best(runs: Sequence[Tried], judged: dict[int, float]) -> Tried:
    """The most accurate of those that take hardly more work than the cheapest."""
    most = BETTER * min(run.work for run in runs)
    near = [run for run in runs if run.work <= most]
    return min(near, key=lambda run: (judged[id(run)], run.work))


def _missed(
    search: Search, best: Tried, judged: dict[int, float], target: float, why: str
) -> Choice:
    """The best run where none will do, and `why`, if that is not rounding of all steps."""
    moved = search.rounded(best)
    if not why and moved > ENOUGH * target:
        why = f"rounding alone, of constants and of each step, moves its end by {moved:.1g}"
    return search.chosen(best, judged, False, why)


def _candidates(search: Search) -> list[str]:
    """Methods that are tried, in this order: those that have been found to be the cheapest on one
    scene or another.

    A multistep method begins anew at each impact, which others do more lightly. Where the motion is
    stiff, explicit ones would take thousands of steps that accuracy does not ask for.
    """
    others = ["LSODA", "DOP853"] if search.case.problem.contacts is None else ["RK45", "DOP853"]
    return [STIFF, *others] if search.fast.stiff else others


def race(search: Search, asked: str | None, loose: bool) -> list[str]:
    """Try each method once, but those that take much more work than another not to the end; return
    the names of all that were.

    Where a method had to be implicit, a more accurate one that is is tried, too; where it had not,
    the motion is smooth, and a `loose` error is asked for, one that spends no time on its steps.

    asked  the only method to try
    """
    names = [method_of(asked).name] if asked is not None else _candidates(search)
    for name in names:
        _first(search, method_of(name))
    if asked is not None:
        return names
    more = []
    if not search.runs or any(run.trajectory.counts["jacobians"] for run in search.runs):
        more = [STIFF]
    elif loose and _few_steps_do(search.case):
        more = ["rk4"]
    more = [name for name in more if name not in names]
    for name in more:
        _first(search, method_of(name))
    return [*names, *more]


def patience(search: Search, names: list[str], plans: Sequence[object], most: float) -> bool:
    """Try `PATIENT`, too, for `most` units of work, if it is for this motion, is not among the
    `names`, and none of the `plans` for these, by name, is one for an explicit method.
    """
    explicit = [plan for name, plan in zip(names, plans, strict=True) if name != STIFF]
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
    """A method's first run, for `most` units of work or not much more than the cheapest; where it
    fails, a tighter one: too long a step may not be stable.
    """
    steps = max(FIRST_STEPS, search.case.rows - 1)
    tolerance = search.case.t_end / steps if method.equal_steps else search.first
    if most is None:
        most = SLACK * min((run.work for run in search.runs), default=math.inf)
    for _ in range(AGAIN):
        if search.attempt(method, tolerance, most):
            if not search.misfits(method):
                return
        elif search.broken[-1].cut:
            return
        else:
            tolerance /= rung(method, RUNG)
            if tolerance < search.tightest(method):
                return


def rung(method: Method, errors: float) -> float:
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
    near = min(others, default=math.inf) <= best.tolerance * rung(method, RUNG)
    if near or method.name in search.left_out:
        return None
    tolerance = best.tolerance * rung(method, BESIDE)
    if search.repeats(method, tolerance):
        return None
    return Plan(method, tolerance, math.nan, False, best.work, best.work)


def _again(search: Search, names: Sequence[str]) -> Plan | None:
    """A run of a method that was put aside for taking more than others, or than was expected of
    it, now to its end; of several, of the one that has the least to go.
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


def growth(method: Method, runs: Sequence[Tried]) -> Law:
    """How the work of a method grows."""
    return fit([run.tolerance for run in runs], [run.work for run in runs], -method.growth)
