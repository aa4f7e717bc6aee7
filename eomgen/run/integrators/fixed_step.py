"""Steps of equal length."""

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from eomgen.engine.sums import Sum, add_compensated
from eomgen.run.compiled import EqualSteps
from eomgen.run.integrators.equal_strides import EqualStrides, advances_of
from eomgen.run.integrators.interface import Advance, Change, Resume, Stability
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.shaking import Shaken


def count_steps(span: float, dt: float) -> float:
    """The number of steps of `dt` that cover `span`, s; the last one may be shorter.

    A remainder below 1e-9 dt is a rounding error of the division and gets no step. The result is a
    whole number, or infinite if the division overflows.
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
    checked: Problem | None = None,
    stability: Stability | None = None,
    resume: Resume | None = None,
    compiled: Callable[[], EqualSteps | None] | None = None,
    each: bool = True,
) -> Iterator[Advance]:
    """Yield the steps of a method from time `t` on, with a sample at every `every`-th and the last.

    Steps end at t_start + i dt and at `t_end`; if `t` lies between, the first one is shorter.
    Quaternions are normalised after every step. The state within a step is that after a shorter
    step. Sums are compensated.

    checked    the problem by whose Jacobian the stability of steps is checked; None for no check
    stability  the method's stability function, if it has one
    resume     what an `Advance` of an earlier run gave
    compiled   compiled steps of the method, of which it is asked again and again; None if there
               are none. They have the same bits
    each       whether each compiled step is yielded, or many at once
    """
    steps = int(count_steps(t_end - t_start, dt))
    first = min(math.floor((t - t_start) / dt + 1e-9) + 1, steps)
    regular, y = t == t_start or resume is not None, problem.initial
    lost = np.zeros_like(y) if resume is None else resume["lost"]
    monitor = StabilityMonitor(change, stability)
    recorded = monitor.recording(problem) if checked else problem
    strides = EqualStrides(compiled, t_start, t_end, dt) if compiled else None
    seed = problem.scrutiny.seed if problem.scrutiny else None
    shaken = None if seed is None else Shaken(problem.derivative, seed)
    i = first - 1
    while i < steps:
        if strides and i >= first:
            given = (monitor if checked else None), problem
            last = min(steps, i + 1 + shaken.left) if shaken else steps
            stride = strides.made(i, last, t, y, lost, *given)
            if stride:
                shorter = partial(_shorter, change, problem)
                how = (problem, (t, y), shorter, _continuation, each)
                yield from advances_of(stride, i, every, *how)
                i += len(stride.ends)
                t, y, lost = float(stride.ends[-1]), stride.states[-1], stride.losses[-1]
                if shaken:
                    lost = lost + shaken.error(t, y, dt, len(stride.ends))
                continue
        i += 1
        # From the start each time: a sum of steps would accumulate rounding errors.
        mark = t_start + i * dt
        whole = i < steps or abs(mark - t_end) <= 4 * math.ulp(t_end)
        end = min(mark, t_end) if i < steps else t_end
        within = partial(_shorter, change, problem, t, y)
        length = dt if regular and whole else end - t
        step = change(recorded, t, y, length)
        if checked:
            monitor.check(checked, t, y, step, length)
            if i == steps:
                monitor.finish(checked, t, y, step, length)
        total = Sum(y, lost)
        add_compensated(total, step)
        y, lost = problem.projected(end, total.value), total.lost
        t, regular = end, True
        if shaken:
            lost = lost + shaken.error(t, y, length, 1)
        samples = [(t, y)] if i == steps or i % every == 0 else []
        continuation = partial(_continuation, mark, y, lost) if whole else None
        yield Advance(t, y, samples, problem, within, resume=continuation)


def _continuation(t: float, y: FloatArray, lost: FloatArray) -> Resume:
    return {"t": np.array(t), "y": y, "lost": lost}


def _shorter(change: Change, problem: Problem, t: float, y: FloatArray, end: float) -> FloatArray:
    """The state at `end` by a single step from `t`."""
    return problem.projected(end, y + change(problem, t, y, end - t)) if end > t else y
