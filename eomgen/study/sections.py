"""Poincaré sections: quantities of a run where a function of its states passes through 0."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eomgen.base.errors import RunError, listed, nearest
from eomgen.language.formula import Formula, FormulaError, evaluate, names_in, parse
from eomgen.run.problem import FloatArray
from eomgen.scalars.floats import ArrayScalars
from eomgen.scalars.functions import FUNCTIONS
from eomgen.study.between import Between, Direction, crossings
from eomgen.study.observed import Observed
from eomgen.study.quantities import Quantity, quantities

DIRECTIONS: tuple[Direction, ...] = ("rising", "falling", "both")


@dataclass(frozen=True, eq=False)
class Section:
    """Where a run passes through a surface: m crossings.

    at          the condition, as it was given
    t           (m,), s
    y           states (m, ny)
    quantities  what was asked for, at the crossings
    error       estimated error of the interpolated states, relative to the range of each
    """

    at: str
    t: FloatArray
    y: FloatArray
    quantities: tuple[Quantity, ...]
    error: float


def section(
    run: Observed,
    states: Between,
    names: Sequence[str],
    at: str,
    direction: Direction = "rising",
    *,
    argument: str = "at",
) -> Section:
    """The section of a run at a condition such as "phi = 0", of t, states and parameters, where
    the left side passes the right one: upwards ("rising"), downwards, or both.

    Raises `RunError` for a condition that is none, or a run that never meets it.
    """
    if direction not in DIRECTIONS:
        raise RunError(f"direction: '{direction}' is none of {', '.join(DIRECTIONS)}")
    times = crossings(states, _function(run, at, argument), direction)
    if not len(times):
        raise RunError(
            f"{argument}: '{at}' is not passed {'' if direction == 'both' else direction + ' '}"
            "in this run; simulate longer, or choose another condition"
        )
    y = states(times)
    return Section(at, times, y, tuple(quantities(names, run, times, y)), states.error())


def _function(
    run: Observed, at: str, argument: str
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """The left side of a condition minus the right one, as a function of times and states."""
    sides = at.split("=")
    if len(sides) != 2:
        raise RunError(f"{argument}: '{at}' is no condition; write for example 'phi = 0'")
    try:
        left, right = map(parse, sides)
    except FormulaError as error:
        raise RunError(f"{argument}: '{at}' {error}") from None
    names = run.trajectory.states
    known = ("t", *names, *run.parameters)
    for word in (*names_in(left), *names_in(right)):
        if word not in known:
            hint = nearest(word, (*known, *FUNCTIONS)) or f"; known: {listed(known)}"
            raise RunError(f"{argument}: '{at}': no state or parameter '{word}'{hint}")

    def value(t: FloatArray, y: FloatArray) -> FloatArray:
        given = {**run.parameters, **dict(zip(names, y.T, strict=True)), "t": t}
        with np.errstate(all="ignore"):
            return _evaluated(left, given, t) - _evaluated(right, given, t)

    return value


def _evaluated(formula: Formula, given: dict[str, object], t: FloatArray) -> FloatArray:
    return np.broadcast_to(np.asarray(evaluate(formula, given, ArrayScalars()), float), t.shape)
