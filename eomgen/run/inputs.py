"""Inputs that change with time: tables and functions, beside constants."""

import inspect
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.run.intervals import Interval
from eomgen.run.module import over_intervals
from eomgen.run.problem import FloatArray, Problem, Switching

Function = Callable[[float], float]
"""The value of an input at a time, s."""


@dataclass(frozen=True, eq=False)
class Table:
    """Values (n,) of an input at times t (n,), ascending, s; between them it is linear, before the
    first and after the last it is constant.
    """

    t: FloatArray
    values: FloatArray

    def __call__(self, t: float) -> float:
        """The value at a time."""
        return float(np.interp(t, self.t, self.values))

    def over(self, t: Interval) -> Interval:
        """All values in an interval of time."""
        within = (self.t >= t.low) & (self.t <= t.high)
        found = [self(t.low), self(t.high), *self.values[within].tolist()]
        return Interval(min(found), max(found))

    @property
    def corners(self) -> list[float]:
        """The times at which its slope changes."""
        slopes = np.diff(self.values, prepend=self.values[0], append=self.values[-1])
        lengths = np.diff(self.t, prepend=-np.inf, append=np.inf)
        found: list[float] = self.t[np.diff(slopes / lengths) != 0].tolist()
        return found


@dataclass(frozen=True, eq=False)
class InputsOfTime:
    """The inputs of a module by name, in its order: constants, tables and functions of time."""

    given: Mapping[str, float | Table | Function]

    def __call__(self, t: float | FloatArray) -> FloatArray:
        """Their values (nu,) at a time, or (nu, n) at n times."""
        if np.ndim(t):
            return np.array([self(time) for time in np.asarray(t).tolist()]).T
        return np.array([x(float(t)) if callable(x) else x for x in self.given.values()])

    @property
    def plain(self) -> list[tuple[str, Any]]:
        """The numbers of constants and tables, by name, from which a digest can be made."""
        return [
            (name, x if not isinstance(x, Table) else (x.t.tolist(), x.values.tolist()))
            for name, x in self.given.items()
        ]

    def over(self, t: Interval) -> tuple[Interval, ...]:
        """All their values in an interval of time. There are no functions among them."""
        return tuple(
            x.over(t) if isinstance(x, Table) else Interval(x, x)  # type: ignore[arg-type]
            for x in self.given.values()
        )

    @property
    def corners(self) -> list[float] | None:
        """The times, in order, at which slopes change; None if a function is among them."""
        tables = [x for x in self.given.values() if isinstance(x, Table)]
        if any(callable(x) and not isinstance(x, Table) for x in self.given.values()):
            return None
        return sorted({time for table in tables for time in table.corners})


class ModuleWithInputs:
    """A generated module whose functions of time take inputs of time instead of constant ones."""

    def __init__(self, module: Any, inputs: InputsOfTime) -> None:
        self._module, self.inputs_of_time = module, inputs

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if name.startswith("_") or not inspect.isfunction(found):
            return found
        wanted = list(inspect.signature(found).parameters)
        if wanted[:1] != ["t"] or "u" not in wanted:
            return found
        at, inputs = wanted.index("u"), self.inputs_of_time

        def with_inputs(t: float, *rest: Any, **named: Any) -> Any:
            return found(t, *rest[: at - 1], **{**named, "u": inputs(t)})

        setattr(self, name, with_inputs)
        return with_inputs


def with_corners(problem: Problem, module: Any, parameters: Any, inputs: InputsOfTime) -> Problem:
    """The problem of a `ModuleWithInputs`, which knows the corners of its inputs.

    With functions among them these are not known, and neither are those of effects.
    """
    corners, switching = inputs.corners, problem.switching or Switching()
    if corners is None:
        return replace(problem, corners=True, switching=None)
    if not corners and problem.switching is None:
        return problem
    kernel = getattr(module, "_switching_functions_of_time", None)
    own = over_intervals(module, kernel, parameters, inputs.over) if kernel else None

    def of_time(t: Interval) -> Sequence[Interval]:
        # A function of time that changes its sign at each corner.
        before, after = bisect_right(corners, t.low), bisect_right(corners, t.high)
        sign = 1.0 if before % 2 else -1.0
        ends = (sign, sign) if before == after else (-1.0, 1.0)
        return [*(own(t) if own else ()), Interval(*ends)]

    switching = replace(switching, timed=True, of_time=of_time)
    return replace(problem, corners=True, switching=switching)
