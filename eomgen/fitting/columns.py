"""Which columns of measurements are inputs, states and outputs of a model."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from eomgen.base.errors import RunError, listed, nearest
from eomgen.codegen.system import output_shape
from eomgen.fitting.logs import Log
from eomgen.fitting.motion import Rows
from eomgen.language.base import identifier
from eomgen.model.elaborate import available_in, outputs_for
from eomgen.model.model import Model
from eomgen.model.states import velocity_states
from eomgen.run.problem import FloatArray
from eomgen.study.recording import all_of, labels_of
from eomgen.tables.outputs import OUTPUTS, SAVED


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of some experiments.

    inputs    names of inputs that some columns give
    measured  names of columns that are measured quantities: `states` first, then `outputs`
    states    of these the state of each, with its unit in that of the state: π/180 for degrees
    outputs   of these the output of each and the index of its entry
    left_out  the others
    """

    inputs: tuple[str, ...]
    states: Mapping[str, tuple[int, float]]
    outputs: Mapping[str, tuple[str, int]]
    left_out: tuple[str, ...]

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of columns that are measured quantities."""
        return (*self.states, *self.outputs)

    @property
    def entries(self) -> tuple[tuple[str, int], ...]:
        """The outputs that are measured."""
        return tuple(self.outputs.values())

    def of(self, log: Log) -> FloatArray:
        """What is measured in an experiment, (n, m), nan where there is no sample; in units of the
        model.
        """
        none = np.full(len(log.t), np.nan)
        columns = [log.columns.get(name, none) for name in self.measured]
        units = [*(unit for _, unit in self.states.values()), *[1.0] * len(self.outputs)]
        return np.array([x * unit for x, unit in zip(columns, units, strict=True)]).T

    def inputs_of(self, log: Log, known: Mapping[str, float], constants: FloatArray) -> FloatArray:
        """The inputs at the times of an experiment, (n, nu): those that are not there are constant,
        and missing samples lie on the line between their neighbours. Raises `RunError`.
        """
        found = np.tile(constants, (len(log.t), 1))
        for i, name in enumerate(known):
            values = log.columns.get(name, log.columns.get(f"input_{name}"))
            if name not in self.inputs or values is None:
                continue
            there = np.isfinite(values)
            if not there.any():
                raise RunError(f"{log.place}: the input {name} has no finite value")
            found[:, i] = np.interp(log.t, log.t[there], values[there])
        return found

    def taken(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        """What is measured of a motion, (n, m), and its derivatives, (n, k, m)."""
        places = [place for place, _ in self.states.values()]
        return (
            np.concatenate((rows.states[:, places], rows.measured), axis=1),
            np.concatenate((rows.slopes[:, :, places], rows.measured_slopes), axis=2),
        )


def sorted_columns(
    model: Model, logs: Sequence[Log], wanted: Sequence[str], argument: str
) -> tuple[Columns, Model]:
    """The columns of experiments by what they are, and the model with the outputs among them.

    wanted  the measured quantities that are fitted; () for all

    Raises `RunError` if nothing is measured, or if something `wanted` is not.
    """
    names = list(dict.fromkeys(name for log in logs for name in log.columns))
    states, inputs, outputs, left = _states(model), [], dict[str, tuple[str, int]](), []
    known = {i.name for i in model.inputs}
    own = {name: states[identifier(name)] for name in names if identifier(name) in states}
    for name in names:
        plain = name.removeprefix("input_")
        if name in own:
            continue
        if plain in known:
            inputs.append(plain)
        elif (entry := _entry(model, name)) is not None:
            outputs[name] = entry
        else:
            left.append(name)
    everything = (*own, *outputs)
    for name in wanted:
        if name not in everything:
            hint = nearest(name, everything) or f"; there: {listed(everything) or 'none'}"
            raise RunError(f"{argument}: no measured column '{name}'{hint}")
    if not everything:
        raise RunError(
            f"{logs[0].place}: none of its columns is a state or an output; states: "
            f"{listed(s.name for s in velocity_states(model))}"
        )
    if wanted:
        left += [name for name in everything if name not in wanted]
        own = {name: x for name, x in own.items() if name in wanted}
        outputs = {name: x for name, x in outputs.items() if name in wanted}
    needed = tuple(dict.fromkeys(output for output, _ in outputs.values()))
    found = Columns(tuple(dict.fromkeys(inputs)), own, outputs, tuple(left))
    for name in found.measured:
        if not any(np.isfinite(log.columns.get(name, [np.nan])).any() for log in logs):
            raise RunError(f"{logs[0].place}: {name} has no finite value; leave it out")
    return found, replace(model, outputs=outputs_for(needed, argument, available_in(model)))


def _states(model: Model) -> dict[str, tuple[int, float]]:
    """The states by name, each with its place and unit; angles also in degrees."""
    found = {s.name: (i, 1.0) for i, s in enumerate(velocity_states(model))}
    degrees = {
        f"{s.name}_deg": (i, math.pi / 180.0)
        for i, s in enumerate(velocity_states(model))
        if "rad" in s.unit
    }
    return {**degrees, **found}


def _entry(model: Model, name: str) -> tuple[str, int] | None:
    """The output and the index of the entry that a column has: `output.part.part`, or with _ as in
    tables of runs. None if it has none.
    """
    available = available_in(model)
    for output in SAVED:
        rest = name.removeprefix(output)
        needs = OUTPUTS[output].needs
        if rest == name or rest[:1] not in ("", ".", "_") or (needs and not available[needs]):
            continue
        entries = all_of(labels_of(output, output_shape(output, model), model, _lists(model)))
        for sign in "._":
            joined = [sign.join((output, *entry)) for entry in entries]
            if name in joined:
                return output, joined.index(name)
    return None


def _lists(model: Model) -> SimpleNamespace:
    """The lists of a module that name the entries of outputs."""
    return SimpleNamespace(
        JOINTS=model.force_joints,
        BODIES=[body.name for body in model.bodies],
        POINTS=[point.name for point in model.points],
        EFFECT_NAMES=[effect.name for effect in model.effects],
        DRIVEN=[c.position.name for c in model.driven],
    )
