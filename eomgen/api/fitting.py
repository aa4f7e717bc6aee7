"""Parameters and initial states from measurements: `fit`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import check, named, values_of
from eomgen.api.inputs import constant_inputs
from eomgen.api.options import FitOptions
from eomgen.api.public import public
from eomgen.api.reporter import SILENT, Reporter
from eomgen.api.states import values_by_index
from eomgen.base.errors import RunError, listed, nearest
from eomgen.base.options import taking
from eomgen.fitting.columns import Columns, sorted_columns
from eomgen.fitting.estimate import Estimate, Residuals, Sought, Weighed, estimated, told
from eomgen.fitting.inertias import chart
from eomgen.fitting.logs import Data, Log, read_log
from eomgen.fitting.motion import Motion, Samples
from eomgen.model.clocks import check_no_samples
from eomgen.model.model import Model
from eomgen.results.fitted import Fit
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.diagnosis import problem_of


@public
@taking(FitOptions)
def fit(options: FitOptions) -> Fit:
    """Fit parameters and initial states of a scene to measurements.

    The sum of squares of what the motion has less what was measured is least, each quantity
    relative to its noise. Sensitivities are exact: they are integrated with the motion. A motion
    begins at the first time of its data, with the scene's initial state but for what is given or
    fitted. Raises `SceneError`, or `RunError` for an invalid argument or data.
    """
    return fitted(check(options.source), options)


def fitted(model: Model, options: FitOptions, reporter: Reporter = SILENT) -> Fit:
    """A checked model, fitted as `fit` describes."""
    return _Task.of(model, options, reporter).fit(reporter)


@dataclass(frozen=True, eq=False)
class _Task:
    """What is fitted to what.

    model       in form 'velocity', with the outputs that are measured
    names       of parameters that are fitted, then of states
    parameters  all values of parameters, (np,)
    logs        the experiments, and the columns that they have
    """

    model: Model
    module: GeneratedModule
    options: FitOptions
    names: tuple[str, ...]
    parameters: FloatArray
    state: Mapping[int, float]
    inputs: FloatArray
    logs: Sequence[Log]
    columns: Columns

    @classmethod
    def of(cls, model: Model, options: FitOptions, reporter: Reporter) -> "_Task":
        """The task, with all arguments checked. Raises `RunError`."""
        if model.constraints:
            raise RunError("fit: takes trees of bodies, and this scene has loops or constraints")
        check_no_samples(model, "fits")
        model = replace(model, form="velocity", outputs=())
        argument = reporter.argument
        logs = _logs(options.data)
        constants = constant_inputs(options.inputs, reporter)
        values, inputs = values_of(model, options.parameters, constants, reporter)
        columns, model = sorted_columns(model, logs, options.measured, argument("measured"))
        _, module = compiled(model, reporter=reporter)
        if getattr(module, "CONTACTS", ()):
            raise RunError("fit: rigid contacts strike, where sensitivities jump; make them soft")
        return cls(
            model,
            module,
            options,
            _names(options.names, model, module, argument("names")),
            np.array([*{**module.PARAMETERS, **values}.values()]),
            values_by_index(model, options.state, reporter),
            np.array([*{**module.INPUTS, **inputs}.values()], dtype=float),
            logs,
            columns,
        )

    def fit(self, reporter: Reporter) -> Fit:
        """The fit."""
        options, columns = self.options, self.columns
        with reporter.waiting(f"fitting {self.model.name} …"):
            problem = problem_of(self.module, self._given(), None, self.model)
            motion = Motion(
                self.model,
                self.names,
                columns.entries,
                columns.inputs,
                rtol=options.rtol,
                backend=options.backend,
            )
            fitting = _Fitting(self, motion, np.array(problem.sizes), problem.initial)
            sought = fitting.sought(reporter)
            noise = named(options.noise, columns.measured, reporter.argument("noise"), "column")
            found = estimated(fitting.residuals, sought, fitting.weighed(noise, reporter))
        return fitting.result(found, sought)

    def _given(self) -> dict[str, float]:
        return dict(zip(self.module.PARAMETERS, self.parameters.tolist(), strict=True))


class _Fitting:
    """The residuals of a task's experiments as a function of all values that are fitted: those of
    parameters, then for each experiment those of initial states.
    """

    def __init__(self, task: _Task, motion: Motion, sizes: FloatArray, initial: FloatArray) -> None:
        self._task, self._motion, self._initial = task, motion, initial
        module, names = task.module, task.names
        self._states = [module.STATES.index(n) for n in names if n in module.STATES]
        places = list(module.PARAMETERS)
        self._places = [places.index(n) for n in names if n in module.PARAMETERS]
        self._measured = [task.columns.of(log) for log in task.logs]
        self._samples = [
            Samples(log.t, task.columns.inputs_of(log, module.INPUTS, task.inputs))
            for log in task.logs
        ]
        scales = np.abs(task.parameters[self._places])
        scales = np.concatenate((np.where(scales > 0, scales, 1.0), sizes[self._states]))
        self._sizes = np.concatenate((sizes, np.outer(1.0 / scales, sizes).ravel()))
        self._there = [np.isfinite(values) for values in self._measured]

    @property
    def names(self) -> list[str]:
        """The names of all values."""
        own, many = self._task.names, len(self._task.logs)
        states, count = own[len(self._places) :], len(self._places)
        numbered = [f"{s}[{i}]" for i in range(many) for s in states] if many > 1 else states
        return [*own[:count], *numbered]

    def sought(self, reporter: Reporter) -> Sought:
        """Where the search begins, bounds and priors. Raises `RunError`."""
        options, names = self._task.options, self.names
        start = [*self._task.parameters[self._places]]
        start += [
            self._first(i, state) for i in range(len(self._samples)) for state in self._states
        ]
        bounds = _pairs(options.bounds, names, reporter.argument("bounds"), "a low and a high one")
        priors = _pairs(options.priors, names, reporter.argument("priors"), "mean and deviation")
        for name, (low, high) in bounds.items():
            if not low < high:
                raise RunError(f"{reporter.argument('bounds')}: {name} has none above {low:g}")
        for name, (_, deviation) in priors.items():
            if not deviation > 0:
                raise RunError(f"{reporter.argument('priors')}: the deviation of {name} is not > 0")
        within = np.array([_of(bounds, name, (-np.inf, np.inf)) for name in names])
        coordinates = chart(
            self._task.model, names, np.array(start), np.isfinite(within).any(axis=1)
        )
        known = np.array([_of(priors, name, (0.0, np.inf)) for name in names])
        low, high, mean, sigma = *within.T, *known.T
        return Sought(np.array(start, dtype=float), low, high, mean, sigma, coordinates)

    def _first(self, number: int, state: int) -> float:
        """The value of an initial state with which the search begins: as given; else the first
        sample if it is one of the motion's start; else that of the scene.
        """
        task = self._task
        name = task.module.STATES[state]
        if state not in task.state and name in task.columns.states:
            first = float(self._measured[number][0, task.columns.measured.index(name)])
            if np.isfinite(first):
                return first
        return task.state.get(state, float(self._initial[state]))

    def weighed(self, noise: Mapping[str, float], reporter: Reporter) -> Weighed:
        """What is measured, with the noise that is given. Raises `RunError`."""
        groups = [np.nonzero(there)[1] for there in self._there]
        scale = []
        for column, name in enumerate(self._task.columns.measured):
            if noise.get(name, 1.0) <= 0:
                raise RunError(f"{reporter.argument('noise')}: {name}: give a positive deviation")
            values = [
                m[w[:, column], column] for m, w in zip(self._measured, self._there, strict=True)
            ]
            spread = float(np.std(np.concatenate(values)))
            scale.append(spread if spread > 0 else 1.0)
        known = [noise.get(name, np.nan) for name in self._task.columns.measured]
        return Weighed(np.concatenate(groups), np.array(known), np.array(scale))

    def residuals(self, values: FloatArray) -> Residuals:
        """The residuals at these values, of all experiments."""
        found, slopes = [], []
        for number, there in enumerate(self._there):
            predicted, by = self._predicted(number, values)
            found.append((predicted - self._measured[number])[there])
            slopes.append(by[there])
        return Residuals(np.concatenate(found), np.concatenate(slopes))

    def _predicted(self, number: int, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What an experiment should have measured, (n, m), and its derivatives, (n, m, values)."""
        task, samples, own = self._task, self._samples[number], len(self._places)
        p, many = task.parameters.copy(), len(self._states)
        p[self._places] = values[:own]
        begin = own + number * many
        n, columns = len(samples.t), task.columns
        by = np.zeros((n, len(columns.measured), len(values)))
        try:
            start = self._motion.start(p, self._given(values[begin : begin + many]))
        except (ValueError, ArithmeticError):  # parameters that the scene does not allow
            return np.full(by.shape[:2], np.nan), by
        ny = len(task.module.STATES)
        for k, state in enumerate(self._states):
            start[ny * (1 + own + k) + state] = 1.0
        rows = self._motion.rows(p, start, self._sizes, samples)
        values_of_all, slopes = columns.taken(rows)
        by[:, :, :own] = slopes[:, :own].swapaxes(1, 2)
        by[:, :, begin : begin + many] = slopes[:, own:].swapaxes(1, 2)
        return values_of_all, by

    def _given(self, states: FloatArray) -> dict[int, float]:
        return {**self._task.state, **dict(zip(self._states, states.tolist(), strict=True))}

    def result(self, found: Estimate, sought: Sought) -> Fit:
        """The fit of an estimate."""
        task, names = self._task, self.names
        measured = task.columns.measured
        every = [np.where(there, 0.0, np.nan) for there in self._there]
        end = 0
        for array, there in zip(every, self._there, strict=True):
            begin, end = end, end + int(there.sum())
            array[there] = found.residuals[begin:end]
        notes = [told(direction, names) for direction in found.unknown]
        held = (found.values <= sought.low) | (found.values >= sought.high)
        notes += [
            f"{name} is at its bound, and its interval is that of a fit without one"
            for name, is_held in zip(names, held, strict=True)
            if is_held
        ]
        if left := task.columns.left_out:
            notes.append(f"columns that are no inputs, states or outputs: {listed(left)}")
        intervals = np.stack((found.values - found.half, found.values + found.half), axis=1)
        return Fit(
            task.model.name,
            dict(zip(names, found.values.tolist(), strict=True)),
            dict(zip(names, map(tuple, intervals.tolist()), strict=True)),
            found.covariance,
            found.rank,
            tuple(filter(None, (found.why, *notes))),
            {name: tuple(e[:, k] for e in every) for k, name in enumerate(measured)},
            dict(zip(measured, found.noise.tolist(), strict=True)),
            task.columns.left_out,
            found.calls,
            self._motion.compiled,
        )


def _logs(data: Data | Sequence[Data]) -> list[Log]:
    """The experiments. Raises `RunError`."""
    if not isinstance(data, Sequence) or isinstance(data, str):
        return [read_log(data, "data")]
    if not data:
        raise RunError("data: there is none; give a path, a DataFrame or a mapping")
    return [read_log(each, f"data[{i}]") for i, each in enumerate(data)]


def _names(
    given: str | Sequence[str], model: Model, module: GeneratedModule, argument: str
) -> tuple[str, ...]:
    """The parameters that are fitted, then the states. Raises `RunError`."""
    wanted = [given] if isinstance(given, str) else list(dict.fromkeys(given))
    in_quaternions = {module.STATES[i] for q in module.QUATERNIONS for i in q}
    known = (*module.PARAMETERS, *(s for s in module.STATES if s not in in_quaternions))
    if not wanted:
        raise RunError(f"{argument}: there are none; name parameters or states of the scene")
    for name in wanted:
        if name in in_quaternions:
            raise RunError(f"{argument}: {name} is a part of a quaternion, which is not fitted")
        if name not in known:
            hint = nearest(name, known) or f"; known: {listed(known)}"
            raise RunError(f"{argument}: no parameter or state '{name}'{hint}")
    return (
        *(name for name in wanted if name in module.PARAMETERS),
        *(name for name in wanted if name not in module.PARAMETERS),
    )


def _pairs(
    given: Mapping[str, Any] | None, names: Sequence[str], argument: str, what: str
) -> dict[str, tuple[float, float]]:
    """Pairs of numbers by name. Raises `RunError`."""
    known = dict.fromkeys((*names, *(name.partition("[")[0] for name in names)))
    found = {}
    for name, pair in (given or {}).items():
        if name not in known:
            hint = nearest(name, known) or f"; known: {listed(known)}"
            raise RunError(f"{argument}: '{name}' is not fitted{hint}")
        try:
            first, second = map(float, pair)
        except (TypeError, ValueError):
            first = second = np.nan
        if np.isnan(first) or np.isnan(second):
            raise RunError(f"{argument}: {name}: give {what}, (0.1, 2.0) for example")
        found[name] = (first, second)
    return found


def _of(
    pairs: Mapping[str, tuple[float, float]], name: str, none: tuple[float, float]
) -> tuple[float, float]:
    """The pair of a name, or of the state of which it is that in one experiment."""
    return pairs.get(name, pairs.get(name.partition("[")[0], none))
