"""Equal steps from start to end."""

import math
from collections.abc import Iterator

from eomgen.run.integrators.interface import Advance, FixedStep
from eomgen.run.problem import Problem


def count_steps(span: float, dt: float) -> float:
    """Return how many steps of `dt` cover `span` s, the last one perhaps shorter.

    A remainder below 1e-9 dt is the rounding of the division and makes no step of its own. The
    result is a whole number, or infinite where the division overflows.
    """
    steps = span / dt
    return max(1, math.ceil(steps - 1e-9)) if math.isfinite(steps) else math.inf


def advances(
    method: FixedStep, problem: Problem, t_start: float, t_end: float, dt: float, every: int
) -> Iterator[Advance]:
    """Yield the steps of `method`, with a sample at every `every`-th and at the last one.

    Quaternions are scaled back to unit length after every step.
    """
    steps = int(count_steps(t_end - t_start, dt))
    t, y = t_start, problem.initial
    for i in range(1, steps + 1):
        last = i == steps
        y = problem.unit(method.step(problem, t, y, t_end - t if last else dt))
        # From the start each time: adding up dt would gather rounding.
        t = t_end if last else min(t_start + i * dt, t_end)
        yield Advance(t, y, [(t, y)] if last or i % every == 0 else [])
