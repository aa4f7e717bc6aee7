"""Runs of which only rows are wanted: compiled code goes through the events of rigid contacts, and
over branches of the derivative.
"""

from types import SimpleNamespace

import numpy as np

from eomgen.base.options import taking
from eomgen.run.compiled import Stretch, Touched, Watched, WholeRun
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
    """Whether compiled code can go through all that interrupts the motion: the events of rigid
    contacts, and branches of the derivative that depend on the state; nothing else is checked.
    """
    checked = problem.projection or problem.solved_loops or problem.scrutiny or problem.sampling
    switching = problem.switching
    if checked or (switching and switching.of_time) or (problem.corners and not switching):
        return False
    return bool(problem.contacts or switching)


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
    bounds, y = tolerances_of(asked, problem), problem.initial
    try:
        with np.errstate(all="ignore"):
            touched, watched = _touched(asked, problem), _watched(asked, problem, bounds.unseen)
    except (ArithmeticError, ValueError, StepFailure):
        return None
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
        watched=watched,
        touched=touched,
        only_whole=False,
        constrained=None,
    )
    return through(WholeRun(stretch, NEAR * asked.span, CHECK_STIFFNESS))


def _touched(asked: Asked, problem: Problem) -> Touched | None:
    """What steps are given of rigid contacts."""
    if problem.contacts is None:
        return None
    problem = problem.having(contacts=in_sizes(problem.contacts))
    touched = at_start(problem, (asked.t_start, asked.t_end), asked.rest_speed)
    return touched.copy(asked.t_start, problem.initial, TOGETHER)


def _watched(asked: Asked, problem: Problem, unseen: float) -> Watched | None:
    """What steps are checked for branches with; nothing is known of the functions there."""
    switching = problem.switching
    if not switching or not switching.of_state:
        return None
    unknown = np.nan, np.nan * switching.of_state(asked.t_start, problem.initial)
    how = switching.timed, switching.angles, unseen
    return Watched((unknown, unknown), -np.inf, np.inf, *how)
