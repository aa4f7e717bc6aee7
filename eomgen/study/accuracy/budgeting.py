"""The method and tolerance that give the smallest error within a time budget.

Methods are tried as for an accuracy (`choosing`), but with tolerances as tight as the time allows.
The work of a run is predicted by counting; the time per unit of work is measured on the runs made
so far. The clock is used for that and for the end of the budget only.
"""

import math
from dataclasses import dataclass

from eomgen.base.errors import RunError
from eomgen.study.accuracy.choosing import RUNG, TIGHTER, error_law, growth, patience, race, rung
from eomgen.study.accuracy.search import Choice, Plan, Say, Search
from eomgen.study.accuracy.trial import Case, Method, Tried, method_of

FULL = 0.85
"""A run and the one that estimates its error are planned for this share of the time left."""
SECOND = 0.8
"""Work of the run that estimates an error, relative to the work of the run itself."""
WORTH = 0.5
"""The search ends when no method is expected to reduce the best error to this part of it."""
FIRST = 1e-4
"""Tolerance of the first runs."""
LEAST = 1e-14
"""Smallest error that is aimed at: rounding keeps most runs in doubles from a smaller one."""


def within(
    case: Case, budget: float, asked: str | None = None, say: Say = lambda _: None
) -> Choice:
    """The most accurate run found within `budget`, s, which all runs of the search share.

    asked, say  as for `choosing.meet`

    Raises `RunError` if the budget is not positive and finite, or if no run reaches the end in it.
    """
    if not 0 < budget < math.inf:
        raise RunError(f"--budget: {budget:g} s is not a computing time; give e.g. 2s")
    search = Search(case, say, FIRST, budget)
    names = race(search, asked)
    while search.runs and not search.slides:
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
    """A method's next run, and the error that the method may reach in the time left."""

    plan: Plan
    reach: float


def _tightest(search: Search, method: Method, judged: dict[int, float], left: float) -> _Aim | None:
    """A method's tightest run that, with the run that estimates its error, takes `left` units of
    work. If its convergence is not known yet, an intermediate run. None if no tighter run is
    possible.
    """
    own = search.of(method.name)
    if not own or method.name in search.left_out or left <= 0:
        return None
    last, tightest = own[-1].tolerance, search.tightest(method)
    law, known = error_law(search, method, judged)
    # Loose runs grow less: a plan that trusts them takes more than the time that is left.
    work = growth(method, own if _steep(method, own) else own[-1:])
    whole = max(work.tolerance(left / (1 + SECOND)), tightest)
    if known:
        whole = max(whole, law.tolerance(LEAST))
    sure = known and _falls(own, judged)
    tolerance = whole if sure else max(whole, last / rung(method, RUNG))
    if tolerance > last / rung(method, TIGHTER) and not last > tolerance == tightest:
        return None
    if search.repeats(method, tolerance):
        return None
    cost = work.at(tolerance)
    reach = law.at(whole) if known else 0.0
    return _Aim(Plan(method, tolerance, law.at(tolerance), sure, cost, cost), reach)


def _steep(method: Method, own: list[Tried]) -> bool:
    """Whether a method's work grows at least as its order says."""
    return -growth(method, own).exponent >= method.growth


def _falls(own: list[Tried], judged: dict[int, float]) -> bool:
    """Whether the tightest of a method's runs has a smaller error than the next looser one."""
    return len(own) > 1 and judged[id(own[-1])] < judged[id(own[-2])]
