"""The runs of some members in this process. Its tasks and results can be sent to another one."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import EomgenError
from eomgen.model.model import Model
from eomgen.native.accelerator import Accelerator
from eomgen.native.needed import needed_by
from eomgen.results.ensemble import FINISHED, REFUSED, STOPPED
from eomgen.run.inputs import InputsOfTime, ModuleWithInputs, with_corners
from eomgen.run.integrate import integrate
from eomgen.run.integrators import find_integrator
from eomgen.run.module import as_problem, given_values, load_module
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.through_events import rows_through_events
from eomgen.run.trajectory import Trajectory
from eomgen.store import key_of, this_program
from eomgen.study.constrained_start import on_constraints
from eomgen.study.diagnosis import explained
from eomgen.study.whole import initial_of, names_of, on_branch
from eomgen.sweep.counter import Counter

Arrays = dict[str, NDArray[Any]]
Values = tuple[Mapping[str, float] | None, Mapping[str, float] | None]
"""Parameters and inputs by name."""


@dataclass(frozen=True, eq=False)
class Task:
    """What all members share.

    model       the scene's model
    source      the text of its module
    compiled    whether members run in compiled code, which is made where they run; else in Python
    at_once     whether that is compiled before the first run, or once it pays
    together    whether members run together, see `sweep.together`, or one by one
    threads     whether members that run one by one do so in threads: if Python does little in them
    names       what is varied; `kinds` says of each whether it is a "parameter", "state" or "input"
    parameters, inputs  fixed values by name
    varying     all inputs, if some of them are tables
    outputs     functions of the module that are computed at the kept rows
    t_end       end time, s
    times       (n,) of the rows that are kept, s; the last is `t_end`
    settings    further arguments of `run.integrate.integrate`
    dt, every   of equal steps that members make together: the step, s, and that each `every`-th is
                kept
    by          the version of this program that made the task, see `store.this_program`
    """

    model: Model
    source: str
    compiled: bool
    at_once: bool
    together: bool
    threads: bool
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    outputs: tuple[str, ...]
    t_end: float
    times: tuple[float, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    dt: float = 0.0
    every: int = 1
    varying: InputsOfTime | None = None
    by: str = field(default_factory=this_program)

    @cached_property
    def digest(self) -> str:
        """A digest of all that, beside its values, determines the results of a member."""
        parts: tuple[object, ...] = (
            *(key_of(self.model), self.source, self.names, self.kinds, self.outputs, self.t_end),
            *(sorted(self.parameters.items()), sorted(self.inputs.items())),
            *(self.times, sorted(self.settings.items()), self.together, self.by),
        )
        if self.varying is not None:
            parts = (*parts, self.varying.plain)
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]

    @property
    def _key(self) -> tuple[object, ...]:
        return self.digest, self.compiled, self.at_once

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Task) and self._key == other._key


def run_members(task: Task, values: FloatArray, counter: Counter | None = None) -> Arrays:
    """Run members with these values (m, k), counted as they end. Returns arrays of m rows:

    final    the state at the end, or where a member stopped; nan if it was refused
    t        the time of that, s
    status   `FINISHED`, `STOPPED` or `REFUSED`
    message  why it did not finish, what of its start was moved to meet constraints, or ""
    rows     (m, n, ny), the states at the kept times, nan after a stop; if there are more than two
    NAME     each of the outputs, (m, n, …) at these times, or (m, …) at the end
    """
    counter, prepared, done = counter or Counter(), _prepared(task), []
    for row in values.tolist():
        done.append(prepared.member(row))
        counter.add()
    found: Arrays = {
        "final": np.array([member.final for member in done]),
        "t": np.array([member.t for member in done]),
        "status": np.array([member.status for member in done], dtype=np.int8),
        "message": np.array([member.message for member in done]),
    }
    many = len(task.times) > 2
    if many:
        found["rows"] = np.array([member.rows for member in done])
    for i, name in enumerate(task.outputs):
        each = np.array([member.outputs[i] for member in done])
        found[name] = each if many else each[:, 0]
    return found


class _Member(NamedTuple):
    """The results of a member; `rows` and `outputs` are those at the kept times."""

    final: FloatArray
    t: float
    status: int
    message: str
    rows: FloatArray
    outputs: list[FloatArray]


class _Prepared:
    """What members share in this process."""

    def __init__(self, task: Task) -> None:
        self.task, self.module = task, module_of(task.source)
        self.times = np.array(task.times)
        self.asked = {"t_end": task.t_end, "samples": len(task.times), **task.settings}
        self.kept = task.times if len(task.times) > 2 else task.times[-1:]
        self.shapes = [output_shape(task.source, name) for name in task.outputs]
        self.accelerator: Accelerator | None = None
        if task.compiled:
            self.accelerator = Accelerator(task.model, self.module, None, None)

    def compile(self) -> None:
        """Compile now what all members need. Raises `RunError` if there is no compiler, or if it
        fails.
        """
        if self.accelerator is not None:
            method = find_integrator(self.task.settings["integrator"])
            self.accelerator.compile(needed_by(method, self.module))

    def member(self, row: Sequence[float]) -> _Member:
        """Run a member. One that is refused or stops says so."""
        given: dict[str, dict[str, float]] = {
            "parameter": dict(self.task.parameters),
            "input": dict(self.task.inputs),
            "state": {},
        }
        for name, kind, value in zip(self.task.names, self.task.kinds, row, strict=True):
            given[kind][name] = value
        module, varying = self.module, self.task.varying
        if varying is not None:
            varying = InputsOfTime({**varying.given, **given.pop("input")})
            module = ModuleWithInputs(module, varying)
        values = given["parameter"] or None, given.get("input") or None
        own = self.accelerator and self.accelerator.at(*values)
        notices: list[str] = []
        try:
            problem = self._problem(module, given["state"], values, own, notices.append)
            if varying is not None:
                problem = with_corners(problem, module, values[0], varying)
            made = self._made(problem)
        except EomgenError as error:
            nothing = np.full((len(self.times), len(self.module.STATES)), np.nan)
            text = " ".join(error.lines)
            return _Member(
                nothing[0], 0.0, REFUSED, text, nothing, self._outputs(module, nothing, values)
            )
        outputs = self._outputs(module, made.rows, values, own)
        text = "; ".join(filter(None, [*notices, made.message]))
        return made._replace(message=text, outputs=outputs)

    def _problem(
        self,
        module: Any,
        states: Mapping[str, float],
        values: Values,
        own: Accelerator | None,
        note: Callable[[str], None],
    ) -> Problem:
        model, given = self.task.model, given_values(module, *values)
        explain = explained(model, *given, module)

        def start(y: FloatArray, names: Sequence[str] = self.module.STATES) -> FloatArray:
            for name, value in states.items():
                y[names.index(name)] = value
            return y

        def assembled(_: FloatArray) -> FloatArray:
            y = start(initial_of(module, model, values[0]), names_of(model))
            for indices in map(list, model.quaternions):
                y[indices] /= np.linalg.norm(y[indices]) or 1.0
            whole, notices = on_constraints(model, values[0], y, states, "vary")
            for notice in notices:
                note(notice)
            return on_branch(module, model, whole, *values)

        loops = bool(self.task.model.constraints)
        problem = as_problem(module, *values, explain=explain, start=assembled if loops else None)
        if states and not loops:
            problem = replace(problem, initial=start(problem.initial.copy()))
        if states:
            problem = replace(problem, initial=problem.unit(problem.initial))
        return own.of(problem) if own else problem

    def _made(self, problem: Problem) -> _Member:
        """The run of a problem, without outputs."""
        found = rows_through_events(problem, **self.asked)
        if found is not None:
            return _Member(found[-1], self.task.t_end, FINISHED, "", found, [])
        run = integrate(problem, **self.asked)
        if run.outcome.kind == "interrupted":  # which is not a result of the member
            raise KeyboardInterrupt
        status = FINISHED if run.finished else STOPPED
        return _Member(run.y[-1], float(run.t[-1]), status, run.message, self._rows(run), [])

    def _rows(self, run: Trajectory) -> FloatArray:
        """The states at the kept times, nan where there is none; the last is that at the end."""
        rows, near = np.full((len(self.times), run.y.shape[1]), np.nan), 1e-9 * self.task.t_end
        at = np.searchsorted(run.t, self.times + near, side="right") - 1
        there = np.abs(run.t[at] - self.times) <= near
        rows[there] = run.y[at[there]]
        return rows

    def _outputs(
        self, module: Any, rows: FloatArray, values: Values, own: Accelerator | None = None
    ) -> list[FloatArray]:
        """The outputs at the kept rows, nan where they have no value."""
        found = []
        for name, shape in zip(self.task.outputs, self.shapes, strict=True):
            python = partial(_called, getattr(module, name), values)
            function = own.function(name, python) if own else python
            array = np.full((len(self.kept), *shape), np.nan)
            for i, (t, y) in enumerate(zip(self.kept, rows[-len(self.kept) :], strict=True)):
                with suppress(ArithmeticError, ValueError):
                    array[i] = function(t, y)
            found.append(array)
        return found


def _called(function: Any, values: Values, t: float, y: FloatArray) -> Any:
    return function(t, y, *values)


@lru_cache(4)
def _prepared(task: Task) -> _Prepared:
    return _Prepared(task)


def compile_steps(task: Task) -> None:
    """Compile the steps of members that run one by one. Raises `RunError` if that fails."""
    _prepared(task).compile()


@lru_cache(64)
def output_shape(source: str, name: str) -> tuple[int, ...]:
    """The shape of an output."""
    module = module_of(source)
    return np.shape(getattr(module, name)(0.0, module.initial_state()))


@lru_cache(4)
def module_of(source: str) -> Any:
    """The module of a source text."""
    return load_module(source, "sweep")
