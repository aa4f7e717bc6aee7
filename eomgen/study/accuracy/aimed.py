"""Runs that are asked for by their error or by their time."""

from collections.abc import Callable
from dataclasses import replace

from eomgen.errors import RunError
from eomgen.run.tally import Follow
from eomgen.run.works import Powers
from eomgen.study.accuracy.budgeting import within
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.search import Choice
from eomgen.study.accuracy.trial import Case, Tried

FEWEST = 201
"""Rows by which runs are compared."""
UNKNOWN = "rounding or chaos stands in the way"
"""Why an accuracy is not reached, where nothing more is known."""


def aimed(
    case: Case,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    integrator: str | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Choice:
    """The run whose error is below `accuracy`, in parts of the motion's scale, or the most exact
    one that takes about `budget`, s; by one method if it is named. `say` is told each run tried.

    Raises `RunError` where neither or both are given.
    """
    case = replace(case, kept={**case.kept, "samples": max(case.rows, FEWEST)})
    if budget is not None and accuracy is None:
        return within(case, budget, integrator, say)
    if accuracy is not None and budget is None:
        return meet(case, accuracy, integrator, say)
    raise RunError("accuracy, budget: a run has one aim; give one of them")


def made_again(
    case: Case, choice: Choice, powers: Powers | None, follow: Follow | None = None
) -> Tried:
    """The chosen run, made again only where it has no works, not the rows that are asked for, or is
    to be followed.
    """
    if powers is None and follow is None and case.rows >= FEWEST:
        return choice.tried
    return case.run(choice.tried.setting, powers=powers, follow=follow)
