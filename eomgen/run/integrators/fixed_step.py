"""Equal steps from start to end."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from eomgen.run.integrators.interface import Advance, Change
from eomgen.run.problem import Floats, Problem


def count_steps(span: float, dt: float) -> float:
    """Return how many steps of `dt` cover `span` s, the last one perhaps shorter.

    A remainder below 1e-9 dt is the rounding of the division and makes no step of its own. The
    result is a whole number, or infinite where the division overflows.
    """
    steps = span / dt
    return max(1, math.ceil(steps - 1e-9)) if math.isfinite(steps) else math.inf


def advances(
    change: Change,
    problem: Problem,
    t: float,
    *,
    t_start: float,
    t_end: float,
    dt: float,
    every: int,
) -> Iterator[Advance]:
    """Yield the steps of a method from time `t` on, with a sample at every `every`-th and the last.

    Steps end at t_start + i dt and at `t_end`, so that the first is shorter if `t` lies between.
    Quaternions are scaled back to unit length after every step. Within a step the state is that
    after a shorter one. What rounding cuts off a step's change is added to the next one's: else
    it would gather in long runs (Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    """
    steps = int(count_steps(t_end - t_start, dt))
    first = min(math.floor((t - t_start) / dt + 1e-9) + 1, steps)
    regular, y = t == t_start, problem.initial
    lost = np.zeros_like(y)
    for i in range(first, steps + 1):
        last = i == steps
        # From the start each time: adding up dt would gather rounding.
        end = t_end if last else min(t_start + i * dt, t_end)
        within = partial(_shorter, change, problem, t, y)
        length = dt if regular and not last else end - t
        y, lost = _sum(y, change(problem, t, y, length) + lost)
        y = problem.unit(y)
        t, regular = end, True
        yield Advance(t, y, [(t, y)] if last or i % every == 0 else [], problem, within)


def _shorter(change: Change, problem: Problem, t: float, y: Floats, end: float) -> Floats:
    """The state at `end` after one step from `t`."""
    return problem.unit(y + change(problem, t, y, end - t)) if end > t else y


def _sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The rounded sum and exactly what rounding cut off it (Knuth's two-sum)."""
    total = a + b
    rest = total - a
    return total, (a - (total - rest)) + (b - rest)
