"""The interface of compiled steps: many steps of a method at once, with the bits of Python's.

`eomgen.native.runs` implements it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stride:
    """Some steps of an adaptive method, in order: m of them, which may be none.

    ends         (m,), their times, s
    states       (m, ny), the states there
    memory       what of the solver determines the next step, by name, for each step
    derivatives  (m,), calls of the derivative so far
    sampled      (m,), number of rows passed so far
    rows         (r, ny), the states at the times of these rows
    usual        whether the next step may be made so, too
    """

    ends: Array
    states: Array
    memory: Mapping[str, Array]
    derivatives: NDArray[np.int64]
    sampled: NDArray[np.int64]
    rows: Array
    usual: bool


class Steps(Protocol):
    """Makes up to `most` steps from the state `y` at t, but none that would reach `t_end`.

    memory      of the solver, by name
    rtol, atol  tolerances, atol (ny,)
    longest     the longest step, s
    times       ascending times of the rows wanted, after t
    """

    def __call__(
        self,
        t: float,
        y: Array,
        memory: Mapping[str, float | Array],
        *,
        t_end: float,
        rtol: float,
        atol: Array,
        longest: float,
        times: Array,
        most: int,
    ) -> Stride: ...


@dataclass(frozen=True, eq=False)
class Compiled:
    """Compiled steps of a problem.

    derivative  the function whose steps they are: they serve no problem with another one
    steps       the steps of a method, by its name; None if there are none, or not yet. It is asked
                again and again during a run, and may begin to compile when the run is a long one
    """

    derivative: Callable[[float, Array], Array]
    steps: Callable[[str], Steps | None]
