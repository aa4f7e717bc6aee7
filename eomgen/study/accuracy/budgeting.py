"""Which method and tolerance make the most of a time, on the very scene.

Methods are tried as for an accuracy (`choosing`), but as tight as the time allows: what a run will
take is counted beforehand, and what a unit of that takes here comes from the runs made so far. That
and the end of the time are all that a clock says.
"""

import math
from dataclasses import dataclass

from eomgen.errors import RunError
from eomgen.study.accuracy.choosing import TIGHTER, error_law, growth, patience, race, rung
from eomgen.study.accuracy.search import Choice, Plan, Say, Search
from eomgen.study.accuracy.trial import Case, Method, Tried, method_of

FULL = 0.85
"""Of the time that is left: what a run is planned for, with the one that tells its error."""
SECOND = 0.8
"""Of a run's work: what the one that tells its error takes."""
WORTH = 0.5
"""Of the best error so far: where no less is expected of any method, the budget is spent no
further."""
FIRST = 1e-4
"""Tolerance of the first runs."""
RUNG = 100.0
"""So many times less an error is aimed at at once, where little is known of how it falls."""


def within(
    case: Case, budget: float, asked: str | None = None, say: Say = lambda _: None
) -> Choice:
    """The most accurate run that, with all that is tried for it, takes up to `budget` s.

    asked, say  as of `choosing.meet`

    Raises `RunError` for a time that is none, and if no run comes to its end in it.
    """
    if not 0 < budget < math.inf:
        raise RunError(f"--budget: {budget:g} s is no time to compute in; give e.g. 2s")
    search = Search(case, say, FIRST, budget)
    names = race(search, asked, False)
    while search.runs:
        judged = search.judged()
        best = min(search.runs, key=lambda run: judged[id(run)])
        left = (budget - search.spent) / search.unit
        if left > SECOND * best.work and id(best) not in search.second:
            search.verify(best)
            continue
        left *= FULL
        least = WORTH * judged[id(best)]
        aims = [_tightest(search, method_of(name), judged, left) for name in names]
        aims = [aim if aim and aim.reach <= least else None for aim in aims]
        if asked is None and left > 0 and patience(search, names, aims, left):
            continue
        worth = [aim for aim in aims if aim]
        if not worth:
            return search.chosen(best, judged, True)
        search.make(min(worth, key=lambda aim: (aim.reach, aim.plan.cost)).plan)
    if all(tried.cut for tried in search.broken):
        raise RunError(
            f"--budget: no run of {case.problem.name} to t = {case.t_end:g} s fits into "
            f"{budget:g} s; give more, or a shorter --t-end"
        )
    return search.nothing()


@dataclass(frozen=True)
class _Aim:
    """A method's next run, and the error that it may get to in the time that is left."""

    plan: Plan
    reach: float


def _tightest(search: Search, method: Method, judged: dict[int, float], left: float) -> _Aim | None:
    """A method's tightest run for `left` units of work, with the one that tells its error; where
    little is known of its errors, one on the way to that; None if it can be held no tighter.
    """
    own = search.of(method.name)
    if not own or method.name in search.left_out or left <= 0:
        return None
    last, tightest = own[-1].tolerance, search.tightest(method)
    law, known = error_law(search, method, judged)
    work = growth(method, own)
    whole = max(work.tolerance(left / (1 + SECOND)), tightest)
    sure = known and _falls(own, judged)
    tolerance = whole if sure else max(whole, last / rung(method, RUNG))
    if tolerance > last / rung(method, TIGHTER) and not last > tolerance == tightest:
        return None
    if search.repeats(method, tolerance):
        return None
    cost = work.at(tolerance)
    reach = law.at(whole) if known else 0.0
    return _Aim(Plan(method, tolerance, law.at(tolerance), sure, cost, cost), reach)


def _falls(own: list[Tried], judged: dict[int, float]) -> bool:
    """Whether the tightest of a method's runs has another beside it that tells its error."""
    return len(own) > 1 and judged[id(own[-1])] < judged[id(own[-2])]
