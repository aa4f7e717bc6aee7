"""Steps of an adaptive method that compiled code makes, many at once."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
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
        self._atol = np.zeros(problem.initial.shape) + bounds.atol
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
        stride = steps(
            solver.t,
            solver.y,
            _Memory(solver, self._method.memory),
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
        if stride.ended:
            solver.status = "finished"
        return stride

    def advances(
        self, stride: Stride, sampled: int, resumes: bool, each: bool
    ) -> Iterator[Advance]:
        """The steps as one `Advance`, or as one for each; with `resumes` a run can continue from
        their ends.
        """
        ends = stride.ends.tolist()
        capped = [0] * len(ends)
        if self._bounds.longest < np.inf:
            lengths = np.diff(stride.ends, prepend=self._start)
            capped = np.cumsum(lengths >= self._bounds.longest * (1 - 1e-9)).tolist()
        derivatives, passed = stride.derivatives.tolist(), stride.sampled.tolist()
        times = self._times[sampled : sampled + passed[-1]].tolist()
        steps, rows, called, shortened = 0, 0, 0, 0
        whole = len(ends) - stride.ended  # the end shortens the last step
        for i in range(len(ends)) if each else (len(ends) - 1,):
            at = slice(rows, passed[i])
            yield Advance(
                ends[i],
                stride.states[i],
                list(zip(times[at], stride.rows[at], strict=True)) if at.stop > rows else [],
                self._problem,
                _unknown,
                steps=i + 1 - steps,
                derivatives=derivatives[i] - called,
                resume=partial(_after, stride, min(i, whole - 1)) if resumes and whole else None,
                capped=capped[i] - shortened,
            )
            steps, rows, called, shortened = i + 1, passed[i], derivatives[i], capped[i]


@dataclass(frozen=True)
class _Memory(Mapping[str, Any]):
    """What determines a solver's next step. It is read when it is used, for it may be computed."""

    solver: Any
    names: tuple[str, ...]

    def __getitem__(self, name: str) -> Any:
        return getattr(self.solver, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


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
