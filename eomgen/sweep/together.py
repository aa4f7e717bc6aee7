"""The runs of many members at once by rk4 or DOP853, in vector registers."""

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.adaptive import Bounds
from eomgen.native import adaptive_lanes, lanes
from eomgen.native.accelerator import library_key
from eomgen.native.adaptive_lanes import AdaptiveLanes
from eomgen.native.lanes import Lanes
from eomgen.results.ensemble import FINISHED
from eomgen.run.checks import errors_of_sizes
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.module import as_problem, given_values
from eomgen.run.problem import USUAL_LENGTH, FloatArray, Problem
from eomgen.run.sizes import mechanism_size, state_sizes
from eomgen.store import interfaced_program_of
from eomgen.sweep.counter import Counter
from eomgen.sweep.members import Arrays, Task, compile_steps, module_of, run_members

METHODS = ("rk4", "DOP853")
"""The methods that run members together."""


def run_together(task: Task, values: FloatArray, counter: Counter | None = None) -> Arrays:
    """The same as `run_members`, to rounding.

    Members that overflow, or whose steps seem too long for stability or too many, are run one by
    one: so their messages are the same. Raises `RunError` if there is no compiler.
    """
    counter, kernels, settings = counter or Counter(), _library(task), task.settings
    starts = _Starts(task, values, kernels)
    k, u, y, sound = starts.k, starts.u, starts.y, starts.sound
    if isinstance(kernels, AdaptiveLanes):
        rows, valid = kernels.dop853(
            *(
                y,
                k,
                u,
                Bounds(starts.allowed(), settings["rtol"], settings["max_step"] or math.inf),
            ),
            times=np.array(task.times[1:]),
            addresses=counter.addresses,
        )
    else:
        rows, valid = kernels.rk4(
            *(y, k, u, Grid(0.0, task.t_end, task.dt, task.every)),
            sizes=starts.sizes(),
            unstable=settings["unstable"],
            addresses=counter.addresses,
        )
    counter.check()
    rows = np.concatenate([y[None], rows])
    sound &= valid
    count = len(values)
    found: Arrays = {
        "final": rows[-1].T.copy(),
        "t": np.full(count, task.t_end),
        "status": np.full(count, FINISHED, dtype=np.int8),
        "message": np.full(count, ""),
    }
    if len(task.times) > 2:
        found["rows"] = rows.transpose(2, 0, 1).copy()
    for name in task.outputs:
        found[name], valid = _output(task, kernels, name, rows, k, u)
        sound &= valid
    left = np.flatnonzero(~sound)
    if not left.size:
        return found
    counter.add(-left.size)
    alone = run_members(task, values[left], counter)
    if alone["message"].dtype.itemsize > found["message"].dtype.itemsize:
        found["message"] = found["message"].astype(alone["message"].dtype)
    for name, array in alone.items():
        found[name][left] = array
    return found


def _output(
    task: Task,
    kernels: Lanes | AdaptiveLanes,
    name: str,
    rows: FloatArray,
    k: FloatArray,
    u: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """An output of all members at the times of rows that are kept, and where it is a number."""
    many = len(task.times) > 2
    chosen = zip(task.times, rows, strict=True) if many else [(task.t_end, rows[-1])]
    found = [kernels.output(name, t, states, k, u) for t, states in chosen]
    each = [np.moveaxis(value, -1, 0) for value, _ in found]
    sound = np.logical_and.reduce([valid for _, valid in found])
    return np.stack(each, axis=1) if many else each[0], sound


def run_chunk(task: Task, values: FloatArray, counter: Counter | None = None) -> Arrays:
    """Run members together if the task has kernels for that, else one by one."""
    run = run_together if task.together else run_members
    return run(task, values, counter)


def build(task: Task) -> None:
    """Compile the kernels of a task now. Raises `RunError` if there is no compiler, or it fails."""
    if task.together:
        _library(task)
    elif task.at_once:
        compile_steps(task)


@lru_cache(4)
def _library(task: Task) -> Lanes:
    name = task.settings["integrator"]
    make, of = (Lanes, lanes) if name == "rk4" else (AdaptiveLanes, adaptive_lanes)
    about = library_key(task.model, f"{name} {task.outputs}")
    return make(lambda: of.sources(*interfaced_program_of(task.model), task.outputs), about=about)


class _Starts:
    """Where members begin, as columns: constants k, inputs u, initial states y, and which members
    can be run together, `sound`.
    """

    def __init__(self, task: Task, values: FloatArray, kernels: Lanes) -> None:
        module, count = module_of(task.source), len(values)
        self._task, self._kernels, self._module = task, kernels, module
        columns = {name: values[:, i] for i, name in enumerate(task.names)}
        kinds = dict(zip(task.names, task.kinds, strict=True))
        own, _ = given_values(module, dict(task.parameters) or None)
        varied = {name: columns[name] for name in columns if kinds[name] == "parameter"}
        self._parameters: dict[str, float | FloatArray] = {**module.PARAMETERS, **own, **varied}
        p = _filled(self._parameters, count if varied else 1)
        self.k, self._own, sound = kernels.prepare(np.ascontiguousarray(p.T))
        pushes = {name: columns[name] for name in columns if kinds[name] == "input"}
        inputs: dict[str, float | FloatArray] = {
            **module.INPUTS,
            **task.inputs,
            **pushes,
        }
        self.u = _filled(inputs, count if pushes else 1)
        self.y = self._own.copy() if varied else np.repeat(self._own, count, axis=1)
        for name in columns:
            if kinds[name] == "state":
                self.y[module.STATES.index(name)] = columns[name]
        if "state" in task.kinds:
            for indices in module.QUATERNIONS:
                a, b, c, d = self.y[list(indices)]
                length = np.sqrt(a * a + b * b + c * c + d * d)
                sound = sound & (length > USUAL_LENGTH[0]) & (length < USUAL_LENGTH[1])
                self.y[list(indices)] /= np.where(sound, length, 1.0)
        self.sound = np.broadcast_to(sound, count).copy()

    def sizes(self) -> FloatArray:
        """The sizes of each state, (ny, n) or (ny, 1), as `as_problem` has them."""
        module = self._module
        count = max(self.k.shape[1], self.u.shape[1])
        y = self._own if self._own.shape[1] == count else np.repeat(self._own, count, axis=1)
        slope, _ = self._kernels.output("derivative", 0.0, y, self.k, self.u)
        start = dict(zip(module.STATES, y, strict=True))
        with np.errstate(all="ignore"):  # of members that are not sound
            size = mechanism_size(module.UNITS, self._parameters, start)
            found = state_sizes(module.STATES, module.UNITS, y, slope, size)
        return np.ascontiguousarray(found)

    def allowed(self) -> FloatArray:
        """The absolute tolerances of each state, (ny, n) or (ny, 1): as `run.checks` has them for
        a single run, with the noise of the scene's own values.
        """
        task, settings = self._task, self._task.settings
        if settings.get("atol") is not None:
            return np.full((len(self._module.STATES), 1), settings["atol"])
        with np.errstate(all="ignore"):  # of members that are not sound
            problem = _own_problem(task.source, *map(_pairs, (task.parameters, task.inputs)))
            found = errors_of_sizes(self.sizes(), problem, "DOP853", settings["rtol"], task.t_end)
        return np.ascontiguousarray(found)


Pairs = tuple[tuple[str, float], ...]


def _pairs(values: Mapping[str, float]) -> Pairs:
    return tuple(values.items())


@lru_cache(4)
def _own_problem(source: str, parameters: Pairs, inputs: Pairs) -> Problem:
    """The problem of a module at fixed values."""
    return as_problem(module_of(source), dict(parameters) or None, dict(inputs) or None)


def _filled(values: Mapping[str, float | FloatArray], count: int) -> FloatArray:
    """A row of `count` values for each name."""
    rows = [np.broadcast_to(value, count) for value in values.values()]
    return np.array(rows, dtype=float).reshape(len(values), count)
