"""The runs of some members in this process. Its tasks and results can be sent to another one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.errors import EomgenError, RunError
from eomgen.model.model import Model
from eomgen.native.library import compiled_library
from eomgen.native.runs import MAIN, CompiledSteps
from eomgen.run.compiled import Compiled
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, given_values, load_module
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.trajectory import Trajectory
from eomgen.study.diagnosis import explained

Arrays = dict[str, NDArray[Any]]
FINISHED, STOPPED, REFUSED = 0, 1, 2
"""How a member ended: at its end time, before it, or not at all."""
WORDS = ("finished", "stopped", "refused")


@dataclass(frozen=True)
class Task:
    """What all members share.

    model       the scene's model
    source      the text of its module
    key         determines the kernels; `kernels` are the C sources of compiled steps, empty if
                there are none
    names       what is varied; `kinds` says of each whether it is a "parameter", "state" or "input"
    parameters, inputs  fixed values by name
    outputs     functions of the module that are computed at the kept rows
    t_end       end time, s
    times       (n,) of the rows that are kept, s; the last is `t_end`
    settings    further arguments of `run.integrate.integrate`
    vectors     the C sources of kernels for several members at once, see `sweep.together`; empty
                if members run one by one
    dt, every   for these the step, s, and that each `every`-th is kept
    """

    model: Model
    source: str
    key: str
    kernels: Mapping[str, str]
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    outputs: tuple[str, ...]
    t_end: float
    times: tuple[float, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    vectors: Mapping[str, str] = field(default_factory=dict)
    dt: float = 0.0
    every: int = 1


def run_members(task: Task, values: FloatArray) -> Arrays:
    """Run members with these values (m, k). Returns arrays of m rows:

    final    the state at the end, or where a member stopped; nan if it was refused
    t        the time of that, s
    status   `FINISHED`, `STOPPED` or `REFUSED`
    message  why it did not finish, or ""
    rows     (m, n, ny), the states at the kept times, nan after a stop; if there are more than two
    NAME     each of the outputs, (m, n, …) at these times, or (m, …) at the end
    """
    runs = [_run(task, row) for row in values.tolist()]
    module = module_of(task.source)
    ny, many = len(module.STATES), len(task.times) > 2
    nothing = np.full(ny, np.nan)
    found: Arrays = {
        "final": np.array([run.y[-1] if isinstance(run, Trajectory) else nothing for run in runs]),
        "t": np.array([run.t[-1] if isinstance(run, Trajectory) else 0.0 for run in runs]),
        "status": np.array([_status(run) for run in runs], dtype=np.int8),
        "message": np.array([run if isinstance(run, str) else run.message for run in runs]),
    }
    kept = np.array([_rows(task, run, ny) for run in runs])
    if many:
        found["rows"] = kept
    for name in task.outputs:
        each = [
            _output(task, module, name, row, states)
            for row, states in zip(values.tolist(), kept if many else kept[:, -1:], strict=True)
        ]
        found[name] = np.array(each) if many else np.array(each)[:, 0]
    return found


def _run(task: Task, row: Sequence[float]) -> Trajectory | str:
    """The run of a member, or why it was refused."""
    try:
        problem = _problem(task, row)
        return integrate(problem, t_end=task.t_end, samples=len(task.times), **task.settings)
    except EomgenError as error:
        return " ".join(error.lines)


def _given(task: Task, row: Sequence[float]) -> dict[str, dict[str, float]]:
    """The values of a member by kind and name."""
    given = {"parameter": dict(task.parameters), "input": dict(task.inputs), "state": {}}
    for name, kind, value in zip(task.names, task.kinds, row, strict=True):
        given[kind][name] = value
    return given


def _problem(task: Task, row: Sequence[float]) -> Problem:
    module = module_of(task.source)
    given = _given(task, row)
    values = given["parameter"] or None, given["input"] or None
    explain = explained(task.model, *given_values(module, *values))
    problem = as_problem(module, *values, explain=explain)
    if given["state"]:
        initial = problem.initial.copy()
        for name, value in given["state"].items():
            initial[module.STATES.index(name)] = value
        problem = replace(problem, initial=initial)
        problem = replace(problem, initial=problem.unit(initial))
    library = _library(task.key, tuple(task.kernels.items())) if task.kernels else None
    if library is None:
        return problem
    steps = CompiledSteps(module, library, *values)
    equal = partial(steps.equal, problem=problem)
    return replace(problem, compiled=Compiled(problem.derivative, steps.named, equal))


def _status(run: Trajectory | str) -> int:
    if isinstance(run, str):
        return REFUSED
    return FINISHED if run.finished else STOPPED


def _rows(task: Task, run: Trajectory | str, ny: int) -> FloatArray:
    """The states of a run at the kept times, nan where it has none; the last is that at its end."""
    rows = np.full((len(task.times), ny), np.nan)
    if isinstance(run, str):
        return rows
    times = np.array(task.times)
    near = 1e-9 * task.t_end
    at = np.searchsorted(run.t, times + near, side="right") - 1
    there = np.abs(run.t[at] - times) <= near
    rows[there] = run.y[at[there]]
    return rows


def _output(
    task: Task, module: Any, name: str, row: Sequence[float], states: FloatArray
) -> FloatArray:
    """An output of a member at some states (n, ny), nan where it has no value."""
    given = _given(task, row)
    times = task.times if len(states) > 1 else task.times[-1:]
    found = []
    for t, y in zip(times, states, strict=True):
        try:
            found.append(getattr(module, name)(t, y, given["parameter"] or None, given["input"]))
        except (ArithmeticError, ValueError):
            found.append(np.nan)
    shape = np.broadcast_shapes(*(np.shape(value) for value in found), _shape(task.source, name))
    return np.array([np.broadcast_to(value, shape) for value in found])


@lru_cache(64)
def _shape(source: str, name: str) -> tuple[int, ...]:
    """The shape of an output."""
    module = module_of(source)
    return np.shape(getattr(module, name)(0.0, module.initial_state()))


@lru_cache(4)
def module_of(source: str) -> Any:
    """The module of a source text."""
    return load_module(source, "sweep")


def compiled_steps(task: Task) -> Any:
    """The library of compiled steps, or None if there are no sources. Raises `RunError`."""
    return _compiled(task.key, tuple(task.kernels.items())) if task.kernels else None


@lru_cache(4)
def _compiled(key: str, kernels: tuple[tuple[str, str], ...]) -> Any:
    return compiled_library(key, lambda: dict(kernels), MAIN)


@lru_cache(4)
def _library(task_key: str, kernels: tuple[tuple[str, str], ...]) -> Any:
    """The same; None where it cannot be made: steps in Python have the same results."""
    try:
        return _compiled(task_key, kernels)
    except RunError:
        return None
