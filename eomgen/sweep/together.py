"""The runs of many members at once by the classical Runge-Kutta method, in vector registers."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eomgen.native.lanes import Lanes
from eomgen.run.module import given_values
from eomgen.run.problem import USUAL_LENGTH, FloatArray
from eomgen.sweep.members import FINISHED, Arrays, Task, compiled_steps, module_of, run_members

METHOD = "rk4"


def run_together(task: Task, values: FloatArray) -> Arrays:
    """The same as `run_members`, to rounding.

    Members that overflow, or whose steps seem too long for stability, are run one by one: so their
    messages are the same. Raises `RunError` if there is no compiler.
    """
    lanes = _library(tuple(task.vectors.items()))
    k, u, y, sound = _starts(task, values, lanes)
    rows, stable = lanes.rk4(y, k, u, t_end=task.t_end, dt=task.dt, every=task.every)
    rows = np.concatenate([y[None], rows])
    sound &= stable
    count = len(values)
    found: Arrays = {
        "final": rows[-1].T.copy(),
        "t": np.full(count, task.t_end),
        "status": np.full(count, FINISHED, dtype=np.int8),
        "message": np.full(count, ""),
    }
    many = len(task.times) > 2
    if many:
        found["rows"] = rows.transpose(2, 0, 1).copy()
    for name in task.outputs:
        chosen = zip(task.times, rows, strict=True) if many else [(task.t_end, rows[-1])]
        each = []
        for t, states in chosen:
            value, valid = lanes.output(name, t, states, k, u)
            sound &= valid
            each.append(np.moveaxis(value, -1, 0))
        found[name] = np.stack(each, axis=1) if many else each[0]
    left = np.flatnonzero(~sound)
    if not left.size:
        return found
    alone = run_members(task, values[left])
    if alone["message"].dtype.itemsize > found["message"].dtype.itemsize:
        found["message"] = found["message"].astype(alone["message"].dtype)
    for name, array in alone.items():
        found[name][left] = array
    return found


def run_chunk(task: Task, values: FloatArray) -> Arrays:
    """Run members together if the task has kernels for that, else one by one."""
    return run_together(task, values) if task.vectors else run_members(task, values)


def build(task: Task) -> None:
    """Compile the kernels of a task now. Raises `RunError` if there is no compiler, or it fails."""
    if task.vectors:
        _library(tuple(task.vectors.items()))
    else:
        compiled_steps(task)


@lru_cache(4)
def _library(texts: tuple[tuple[str, str], ...]) -> Lanes:
    return Lanes(dict(texts))


def _starts(
    task: Task, values: FloatArray, lanes: Lanes
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Constants, inputs and initial states of members, as columns, and which can be used."""
    module = module_of(task.source)
    columns = {name: values[:, i] for i, name in enumerate(task.names)}
    kinds = dict(zip(task.names, task.kinds, strict=True))
    own, _ = given_values(module, dict(task.parameters) or None)
    varied = [name for name in columns if kinds[name] == "parameter"]
    count = len(values) if varied else 1
    p = _filled({**module.PARAMETERS, **own}, {name: columns[name] for name in varied}, count)
    k, y, sound = lanes.prepare(np.ascontiguousarray(p.T))
    pushes = [name for name in columns if kinds[name] == "input"]
    inputs = {**module.INPUTS, **task.inputs}
    given = {name: columns[name] for name in pushes}
    u = _filled(inputs, given, len(values) if pushes else 1)
    if not varied:
        y = np.repeat(y, len(values), axis=1)
    for name in columns:
        if kinds[name] == "state":
            y[module.STATES.index(name)] = columns[name]
    if "state" in task.kinds:
        for indices in module.QUATERNIONS:
            a, b, c, d = y[list(indices)]
            length = np.sqrt(a * a + b * b + c * c + d * d)
            sound = sound & (length > USUAL_LENGTH[0]) & (length < USUAL_LENGTH[1])
            y[list(indices)] /= np.where(sound, length, 1.0)
    return k, u, y, np.broadcast_to(sound, len(values)).copy()


def _filled(own: Mapping[str, float], columns: Mapping[str, FloatArray], count: int) -> FloatArray:
    """A row for each name: its own value, or its column of `count` values."""
    rows = [np.broadcast_to(columns.get(name, value), count) for name, value in own.items()]
    return np.array(rows, dtype=float).reshape(len(own), count)
