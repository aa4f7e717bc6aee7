"""Steps of equal length that compiled code makes, many at once."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from eomgen.run.compiled import EqualSteps, EqualStride
from eomgen.run.integrators.interface import Advance, Resume
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.problem import FloatArray, Problem

MOST = 1024
"""Greatest number of steps at once: between them progress is shown, and Ctrl-C is heard."""


class EqualStrides:
    """The compiled steps of a run from `t_start` to `t_end`; `steps` is asked for them each time.

    Steps that the monitor of stability looks at more closely are left to Python, and so are the
    first one, which it has nothing to compare with, and the last one, which may be shorter.
    """

    def __init__(
        self, steps: Callable[[], EqualSteps | None], t_start: float, t_end: float, dt: float
    ) -> None:
        self._steps, self._t_start, self._t_end, self._dt = steps, t_start, t_end, dt
        self._unusual = False

    def made(
        self,
        made: int,
        last: int,
        t: float,
        y: FloatArray,
        lost: FloatArray,
        monitor: StabilityMonitor | None,
    ) -> EqualStride | None:
        """Make steps after step number `made`, but not the `last` one; None if Python must make the
        next, or if there are no compiled ones yet.
        """
        most = min(MOST, last - 1 - made)
        if most < 1 or self._unusual:
            self._unusual = False
            return None
        steps = self._steps()
        limits = monitor.limits if monitor else (np.zeros_like(y), np.full_like(y, np.inf))
        if steps is None or limits is None:
            return None
        stride = steps(
            t,
            y,
            lost,
            t_start=self._t_start,
            t_end=self._t_end,
            dt=self._dt,
            made=made,
            most=most,
            limits=limits,
        )
        count = len(stride.ends)
        if not count:
            return None
        self._unusual = not stride.usual
        if monitor:
            monitor.passed(count, stride.calls, stride.rate, stride.place, stride.slope)
        return stride


def advances_of(
    stride: EqualStride,
    made: int,
    every: int,
    problem: Problem,
    continuation: Callable[[float, FloatArray, FloatArray], Resume],
    each: bool,
) -> Iterator[Advance]:
    """The steps after step number `made` as one `Advance`, or as one for each, with a sample at
    every `every`-th.
    """
    ends, states = stride.ends.tolist(), stride.states
    count = len(ends)
    for first in range(count) if each else (0,):
        last = first if each else count - 1
        kept = range(first + -(made + 1 + first) % every, last + 1, every)
        derivatives = (last + 1 - first) * stride.calls
        if stride.iterations is not None:
            derivatives = int(stride.iterations[first : last + 1].sum()) * stride.calls
        yield Advance(
            ends[last],
            states[last],
            [(ends[j], states[j].copy()) for j in kept],  # not a view that keeps all in memory
            problem,
            _unknown,
            steps=last + 1 - first,
            derivatives=derivatives,
            jacobians=0 if stride.iterations is None else derivatives,
            resume=partial(continuation, ends[last], states[last], stride.losses[last]),
        )


def _unknown(t: float) -> FloatArray:
    raise AssertionError("compiled steps are not made where states within them are needed")
