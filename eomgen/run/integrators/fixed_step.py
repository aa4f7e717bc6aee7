"""Equal steps from start to end."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from eomgen.run.integrators.interface import Advance, Change, Resume, Stability
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.problem import FloatArray, Problem


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
    watched: Problem | None = None,
    stability: Stability | None = None,
    resume: Resume | None = None,
) -> Iterator[Advance]:
    """Yield the steps of a method from time `t` on, with a sample at every `every`-th and the last.

    Steps end at t_start + i dt and at `t_end`, so that the first is shorter if `t` lies between.
    Quaternions are scaled back to unit length after every step. Within a step the state is that
    after a shorter one. What rounding cuts off a step's change is added to the next one's: else
    it would gather in long runs (Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    Steps of an explicit method are watched for being too long, the problem to look at being
    `watched`, its function `stability`, if it has one; `resume` is what an `Advance` gave.
    """
    steps = int(count_steps(t_end - t_start, dt))
    first = min(math.floor((t - t_start) / dt + 1e-9) + 1, steps)
    regular, y = t == t_start or resume is not None, problem.initial
    lost = np.zeros_like(y) if resume is None else resume["lost"]
    monitor = StabilityMonitor(change, stability)
    seen = monitor.seeing(problem) if watched else problem
    for i in range(first, steps + 1):
        # From the start each time: adding up dt would gather rounding.
        mark = t_start + i * dt
        whole = i < steps or abs(mark - t_end) <= 4 * math.ulp(t_end)
        end = min(mark, t_end) if i < steps else t_end
        within = partial(_shorter, change, problem, t, y)
        length = dt if regular and whole else end - t
        step = change(seen, t, y, length)
        if watched:
            monitor.see(watched, t, y, step, length)
            if i == steps:
                monitor.settle(watched)
        y, lost = _sum(y, step + lost)
        y = problem.unit(y)
        t, regular = end, True
        samples = [(t, y)] if i == steps or i % every == 0 else []
        stands = partial(_stands, mark, y, lost) if whole else None
        yield Advance(t, y, samples, problem, within, resume=stands)


def _stands(t: float, y: FloatArray, lost: FloatArray) -> Resume:
    return {"t": np.array(t), "y": y, "lost": lost}


def _shorter(change: Change, problem: Problem, t: float, y: FloatArray, end: float) -> FloatArray:
    """The state at `end` after one step from `t`."""
    return problem.unit(y + change(problem, t, y, end - t)) if end > t else y


def _sum(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rounded sum and exactly what rounding cut off it (Knuth's two-sum)."""
    total = a + b
    rest = total - a
    return total, (a - (total - rest)) + (b - rest)
