"""Steps of equal length that compiled code makes, many at once."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from eomgen.run.compiled import EqualSteps, EqualStride, Margins
from eomgen.run.integrators.closed_strides import MOST, kept_closed
from eomgen.run.integrators.interface import Advance, Resume
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import constrained_by
from eomgen.run.rows import Rows


class EqualStrides:
    """The compiled steps of a run from `t_start` to `t_end`; `steps` is asked for them each time.

    Steps that the monitor of stability looks at more closely are left to Python, and so are the
    first one, which it has nothing to compare with, and the last one, which may be shorter.
    """

    def __init__(
        self, steps: Callable[[], EqualSteps | None], t_start: float, t_end: float, dt: float
    ) -> None:
        self._steps, self._t_start, self._t_end, self._dt = steps, t_start, t_end, dt
        self._unusual, self._most = False, MOST

    def made(
        self,
        made: int,
        last: int,
        t: float,
        y: FloatArray,
        lost: FloatArray,
        monitor: StabilityMonitor | None,
        problem: Problem,
    ) -> EqualStride | None:
        """Make steps after step number `made`, but not the `last` one, onto constraints if there
        are any; None if Python must make the next, or if there are no compiled ones yet.
        """
        most = min(self._most, last - 1 - made)
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
            constrained=constrained_by(problem.projection),
        )
        count = len(stride.ends)
        if not count:
            return None
        kept, self._most = kept_closed(problem, t, y, stride, self._most)
        if kept is None:
            return None
        stride = kept
        self._unusual = not stride.usual
        if monitor:
            monitor.passed(count, stride.calls, stride.rate, stride.place, stride.slope)
        return stride


def advances_of(
    stride: EqualStride,
    made: int,
    every: int,
    problem: Problem,
    start: tuple[float, FloatArray],
    shorter: Callable[[float, FloatArray, float], FloatArray],
    continuation: Callable[[float, FloatArray, FloatArray], Resume],
    each: bool,
) -> Iterator[Advance]:
    """The steps after step number `made`, from `start`, as one `Advance`, or as one for each, with
    a sample at every `every`-th.

    shorter  (t, y, end) gives the state at `end` by a step from t, y
    """
    ends, states, margins = stride.ends.tolist(), stride.states, stride.margins
    count = len(ends)
    for first in range(count) if each else (0,):
        last = first if each else count - 1
        kept = slice(first + -(made + 1 + first) % every, last + 1, every)
        derivatives = (last + 1 - first) * stride.calls
        if stride.iterations is not None:
            derivatives = int(stride.iterations[first : last + 1].sum()) * stride.calls
        begin, from_ = (ends[last - 1], states[last - 1]) if last else start
        seen = None
        if margins is not None:
            seen = Margins(begin, float(margins[last]), float(margins[last + 1]))
        yield Advance(
            ends[last],
            states[last],
            Rows(stride.ends[kept].copy(), states[kept].copy()),  # no views, which keep all of it
            problem,
            partial(shorter, begin, from_),
            steps=last + 1 - first,
            derivatives=derivatives,
            jacobians=0 if stride.iterations is None else derivatives,
            resume=partial(continuation, ends[last], states[last], stride.losses[last]),
            margins=seen,
        )
