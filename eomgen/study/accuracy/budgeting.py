"""The method and tolerance that give the smallest error within a time budget.

Methods are tried as for an accuracy (`choosing`), but with tolerances as tight as the time allows.
The work of a run is predicted by counting; the time per unit of work is measured on the runs made
so far. The clock is used for that and for the end of the budget only.
"""

import math
from dataclasses import replace

from eomgen.base.errors import RunError
from eomgen.study.accuracy.choosing import candidates
from eomgen.study.accuracy.estimate import work_of_both
from eomgen.study.accuracy.methods import method_of
from eomgen.study.accuracy.search import Choice, Say, Search
from eomgen.study.accuracy.trial import Case

FULL = 0.7
"""A run and the one that estimates its error are planned for this share of the time left."""
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
    search = Search(case, say, budget)
    names: list[str] = []
    while not search.slides:
        fresh = [name for name in candidates(search, asked) if name not in names]
        if fresh and search.spent < budget:
            names.append(fresh[0])
            method = method_of(fresh[0])
            search.begin(method, search.still_cheapest(method, LEAST))
            continue
        if not search.trials:
            break
        most = FULL * (budget - search.spent) / search.unit
        methods = [method_of(name) for name in names if most > 0]
        plans = [search.plan(method, LEAST, most / work_of_both(method)) for method in methods]
        possible = [plan for plan in plans if plan]
        if possible:
            search.make(min(possible, key=lambda plan: (plan.error, plan.cost)))
        else:
            return search.chosen(min(search.trials, key=search.error), True)
    if any(tried.trajectory.finished for tried in search.out.values()):
        return replace(search.nothing(), met=True)
    if all(tried.cut for tried in search.out.values()):
        raise RunError(
            f"--budget: no run of {case.problem.name} to t = {case.t_end:g} s fits into "
            f"{budget:g} s; give more, or a shorter --t-end"
        )
    return search.nothing()
