"""Explicit Runge-Kutta methods with error estimates and dense output: a method is its tableau."""

from collections.abc import Mapping
from dataclasses import dataclass

from eomgen.engine import dop853_coefficients as dop853
from eomgen.subset.words import Row


@dataclass(frozen=True)
class Embedded:
    """A method whose error is as its steps' length to the power 8. Each sum over slopes is a row.

    nodes        c_i: slope i is that at the time t + c_i h
    stages       a_ij: and at the state y + h Σ a_ij k_j; slope `last` is that at the end of the
                 step, and those after it are for dense output
    end          b_j: the state at the end is y + h Σ b_j k_j
    long_error, short_error
                 the error estimates of orders 5 and 3, divided by h; `short_weight` is that of the
                 second one's square
    dense        the terms of the interpolating polynomial from the fourth on, divided by h
    safety, smallest, greatest
                 factor for the next step's length, and its bounds
    """

    name: str
    nodes: tuple[float, ...]
    stages: tuple[Row, ...]
    last: int
    end: Row
    long_error: Row
    short_error: Row
    dense: tuple[Row, ...]
    short_weight: float = 0.01
    safety: float = 0.9
    smallest: float = 0.2
    greatest: float = 10.0


def _row(factors: Mapping[int, float]) -> Row:
    return Row(sorted(factors.items()))


_SHORT = {i: dop853.END.get(i, 0.0) - dop853.ORDER_3.get(i, 0.0) for i in dop853.END}

DOP853 = Embedded(
    name="DOP853",
    nodes=dop853.NODES,
    stages=tuple(map(_row, (*dop853.STAGES, dop853.END, *dop853.DENSE_STAGES))),
    last=12,
    end=_row(dop853.END),
    long_error=_row(dop853.ERROR_5),
    short_error=_row(_SHORT),
    dense=tuple(map(_row, dop853.DENSE)),
)
"""Hairer, Norsett, Wanner, Solving ODEs I, sections II.5 and II.6."""
