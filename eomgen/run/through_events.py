"""Runs with rigid contacts of which only rows are wanted: compiled code goes through all events."""

from types import SimpleNamespace

import numpy as np

from eomgen.base.options import taking
from eomgen.run.compiled import Stretch, WholeRun
from eomgen.run.contacts import in_sizes
from eomgen.run.events import at_start
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.adaptive import CHECK_STIFFNESS
from eomgen.run.integrators.interface import Adaptive
from eomgen.run.options import Wanted
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.stepping import Asked, compiled_of, times_of, tolerances_of

THROUGH_EVENTS = ("DOP853", "Rodas5P")
"""The methods for which there is such code."""
TOGETHER = 256
"""So many steps are recorded before their records are used again."""
NEAR = 1e-9
"""A row this part of the run before a strike is the state after it."""


def goes_through(problem: Problem) -> bool:
    """Whether compiled code can go through all events of a problem: its derivative is smooth
    between those of rigid contacts, and nothing else is checked of steps.
    """
    checked = problem.projection or problem.solved_loops or problem.scrutiny or problem.sampling
    return bool(problem.contacts) and not (checked or problem.corners or problem.switching)


@taking(Wanted)
def rows_through_events(wanted: Wanted) -> FloatArray | None:
    """The rows (n, ny) of a run from `t_start` to `t_end`, with the bits of those of `integrate` at
    the same times; after a strike if one is so near as `NEAR` says. None if compiled code cannot
    make it, or if anything in it is unusual.
    """
    asked, problem = Asked.of(wanted)
    compiled, method = compiled_of(problem), asked.method
    if compiled is None or not isinstance(method, Adaptive) or not goes_through(problem):
        return None
    through = compiled.through(method.compiled)
    if through is None:
        return None
    contacts = problem.contacts
    assert contacts is not None
    problem = problem.having(contacts=in_sizes(contacts))
    try:
        with np.errstate(all="ignore"):
            touched = at_start(problem, (asked.t_start, asked.t_end), asked.rest_speed)
    except (ArithmeticError, ValueError, StepFailure):
        return None
    bounds, y = tolerances_of(asked, problem), problem.initial
    stretch = Stretch(
        solver=SimpleNamespace(t=asked.t_start, y=y.copy(), f=y * 0.0, lost=y * 0.0, h_abs=0.0),
        until=asked.t_end,
        reaches=True,
        rtol=bounds.rtol,
        atol=np.zeros(len(y)) + bounds.atol,
        longest=bounds.longest,
        most=TOGETHER,
        dense=False,
        counts_terms=False,
        times=times_of(asked),
        watched=None,
        touched=touched.copy(asked.t_start, y, TOGETHER),
        only_whole=False,
        constrained=None,
    )
    return through(WholeRun(stretch, NEAR * asked.span, CHECK_STIFFNESS))
