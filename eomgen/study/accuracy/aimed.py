"""Runs chosen for a required accuracy or for a time budget."""

from collections.abc import Callable
from dataclasses import replace

from eomgen.base.errors import RunError
from eomgen.run.tally import Follow
from eomgen.run.works import Powers
from eomgen.study.accuracy.budgeting import within
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.search import Choice
from eomgen.study.accuracy.trial import Case, Tried

FEWEST = 201
"""Least number of rows by which runs are compared."""
UNKNOWN = "rounding errors or chaotic motion limit the accuracy"
"""The reason given for a missed accuracy if no other is known."""


def aimed(
    case: Case,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    integrator: str | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Choice:
    """The run whose error is below `accuracy`, relative to the motion's scale, or the most accurate
    run that takes about `budget`, s. With `integrator`, only that method is tried. `say` is called
    with a line of text for each run tried.

    Raises `RunError` unless exactly one of `accuracy` and `budget` is given.
    """
    case = replace(case, kept={**case.kept, "samples": max(case.rows, FEWEST)})
    if budget is not None and accuracy is None:
        return within(case, budget, integrator, say)
    if accuracy is not None and budget is None:
        return meet(case, accuracy, integrator, say)
    raise RunError("accuracy, budget: a run has only one aim; give one of them")


def made_again(
    case: Case, choice: Choice, powers: Powers | None, follow: Follow | None = None
) -> Tried:
    """The chosen run. It is repeated only if the works of effects are asked for, if more rows than
    it has are asked for, or if it is to be followed.
    """
    if powers is None and follow is None and case.rows >= FEWEST:
        return choice.tried
    return case.run(choice.tried.setting, powers=powers, follow=follow)
