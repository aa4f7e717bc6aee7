"""Steps of an adaptive method that compiled code makes, many at once."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Protocol

import numpy as np

from eomgen.run.compiled import Steps, Stride
from eomgen.run.integrators.interface import Adaptive, Advance, Resume
from eomgen.run.problem import FloatArray, Problem

MOST = 1024
"""Greatest number of steps at once: between them progress is shown, and Ctrl-C is heard."""


class Tolerances(Protocol):
    """What `adaptive.Bounds` says of the error and the length of steps."""

    @property
    def rtol(self) -> float: ...
    @property
    def atol(self) -> float | FloatArray: ...
    @property
    def longest(self) -> float: ...


class Strides:
    """The compiled steps of a run, with rows at `times`; `steps` is asked for them each time."""

    def __init__(
        self,
        method: Adaptive,
        problem: Problem,
        t_end: float,
        bounds: Tolerances,
        times: FloatArray,
        steps: Callable[[str], Steps | None],
    ) -> None:
        self._steps = steps
        self._method, self._problem, self._t_end, self._bounds = method, problem, t_end, bounds
        self._times = times
        self._atol = np.array(np.broadcast_to(bounds.atol, problem.initial.shape), dtype=float)
        self._unusual = False

    def made(self, solver: Any, sampled: int, most: int) -> Stride | None:
        """Make at most so many steps and put the solver at their end; None if Python must make the
        next, or if there are no compiled ones yet. `sampled` is the number of rows so far.
        """
        steps = self._steps(self._method.compiled)
        if steps is None:
            return None
        if self._unusual:  # the last stride ended before a step that Python must make
            self._unusual = False
            return None
        memory = {name: getattr(solver, name) for name in self._method.memory}
        stride = steps(
            solver.t,
            solver.y,
            memory,
            t_end=self._t_end,
            rtol=self._bounds.rtol,
            atol=self._atol,
            longest=self._bounds.longest,
            times=self._times[sampled:],
            most=min(most, MOST),
        )
        count = len(stride.ends)
        if not count:
            return None
        self._unusual = not stride.usual
        self._start = solver.t
        solver.t_old = float(stride.ends[-2]) if count > 1 else solver.t
        solver.t, solver.y = float(stride.ends[-1]), stride.states[-1].copy()
        for name, values in stride.memory.items():
            last = values[-1]
            setattr(solver, name, last.copy() if last.ndim else float(last))
        return stride

    def advances(
        self, stride: Stride, sampled: int, resumes: bool, each: bool
    ) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each; with `resumes` a run can continue from
        their ends.
        """
        ends = stride.ends.tolist()
        lengths = np.diff(stride.ends, prepend=self._start)
        capped = np.cumsum(lengths >= self._bounds.longest * (1 - 1e-9)).tolist()
        passed, counts = stride.sampled.tolist(), _counts(stride)
        times = self._times[sampled : sampled + passed[-1]].tolist()
        steps, rows, called, shortened = 0, 0, [0, 0, 0], 0
        for i in range(len(ends)) if each else (len(ends) - 1,):
            at = slice(rows, passed[i])
            derivatives, jacobians, factorisations = (
                now - before for now, before in zip(counts[i], called, strict=True)
            )
            yield Advance(
                ends[i],
                stride.states[i],
                list(zip(times[at], stride.rows[at], strict=True)) if at.stop > rows else [],
                self._problem,
                _unknown,
                steps=i + 1 - steps,
                derivatives=derivatives,
                jacobians=jacobians,
                factorisations=factorisations,
                resume=partial(_after, stride, i) if resumes else None,
                capped=capped[i] - shortened,
            )
            steps, rows, called, shortened = i + 1, passed[i], counts[i], capped[i]


def _counts(stride: Stride) -> list[list[int]]:
    """The numbers of derivatives, Jacobians and factorisations up to the end of each step."""
    none = np.zeros_like(stride.derivatives)
    others = (none if x is None else x for x in (stride.jacobians, stride.factorisations))
    counts: list[list[int]] = np.column_stack((stride.derivatives, *others)).tolist()
    return counts


def _after(stride: Stride, i: int) -> Resume:
    """What a later run needs to continue after step i."""
    memory = {name: values[i] for name, values in stride.memory.items()}
    return continuation(float(stride.ends[i]), stride.states[i], memory)


def continuation(t: float, y: FloatArray, memory: Mapping[str, Any]) -> Resume:
    """What a later run needs to continue from the state `y` at t."""
    arrays = {name: np.array(value, dtype=np.float64) for name, value in memory.items()}
    return {"t": np.array(t), "y": y, **arrays}


def _unknown(t: float) -> FloatArray:
    raise AssertionError("compiled steps are not made where states within them are needed")
