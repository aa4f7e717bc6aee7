"""What results hold beside states: energies, forces, points and other outputs along a run."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from eomgen.model.model import Model
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Saved, Trajectory
from eomgen.study.whole import following
from eomgen.tables.outputs import GROUPS, OUTPUTS, Size

FOLLOWING = "following"
"""The name under which coordinates and velocities that follow from the states are kept."""


def recorded(
    names: Sequence[str],
    model: Model,
    module: Any,
    trajectory: Trajectory,
    values: tuple[Mapping[str, float] | None, Mapping[str, float] | None],
) -> dict[str, Saved]:
    """What is named along a trajectory, (n, …) each, with the names of its columns.

    values  parameters and constant inputs

    Where a rigid contact is held, forces that depend on its force, which is not known afterwards,
    are nan. Coordinates and velocities that follow from the states in closed form are saved always.
    """
    found: dict[str, Saved] = {}
    if names_following := getattr(module, "FOLLOWING", ()):
        columns = following(module, model, trajectory.t, trajectory.y.T, *values)
        found[FOLLOWING] = Saved(columns.T, tuple(names_following))
    for name in names:
        if name == "inputs":
            found[name] = _inputs(module, trajectory, values[1])
        for output in GROUPS.get(name, (name,)):
            array = np.moveaxis(
                getattr(module, output)(trajectory.t, trajectory.y.T, *values), -1, 0
            )
            if OUTPUTS[output].contacts and trajectory.events:
                array = unknown_where(held_rows(trajectory), array)
            entries = all_of(labels_of(output, array.shape[1:], model, module))
            found[output] = Saved(array, tuple("_".join((output, *each)) for each in entries))
        if name == "energy":
            total = found["kinetic_energy"].values + found["potential_energy"].values
            found[name] = Saved(total, ("energy",))
    return found


def unknown_forces(trajectory: Trajectory) -> str:
    """A note if some of what is saved is nan; else ""."""
    if not any(np.isnan(saved.values).any() for saved in trajectory.saved.values()):
        return ""
    return "forces are nan where a rigid contact is held, because its own force is not kept"


def _inputs(module: Any, trajectory: Trajectory, constants: Mapping[str, float] | None) -> Saved:
    """The inputs at each row."""
    of_time = getattr(module, "inputs_of_time", None)
    if of_time is not None:
        values = of_time(trajectory.t).T
    else:
        values = np.tile([*{**module.INPUTS, **(constants or {})}.values()], (len(trajectory.t), 1))
    return Saved(values, tuple(f"input_{name}" for name in module.INPUTS))


def held_rows(trajectory: Trajectory) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """At which rows a rigid contact is held."""
    held = np.zeros(len(trajectory.t), dtype=bool)
    since: dict[str, float] = {}
    for event in trajectory.events:
        if event.kind == "rest":
            since[event.contact] = event.t
        elif event.kind == "lift" and event.contact in since:
            held |= (trajectory.t >= since.pop(event.contact)) & (trajectory.t <= event.t)
    for start in since.values():
        held |= trajectory.t >= start
    return held


def unknown_where(held: np.ndarray[Any, np.dtype[np.bool_]], array: FloatArray) -> FloatArray:
    """An array (n, …) with nan in the rows in which a contact is held."""
    return np.where(held.reshape(-1, *[1] * (array.ndim - 1)), np.nan, array)


def labels_of(
    output: str, shape: tuple[int, ...], model: Model, module: Any
) -> list[Sequence[str]]:
    """The names along each axis of an output of this shape."""
    axes, _ = OUTPUTS[output].of(model.dimensions)
    last = len(shape) - 1
    return [
        _names(output, axis, count, model, module, last=i == last)
        for i, (axis, count) in enumerate(zip(axes, shape, strict=True))
    ]


def all_of(labels: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    """All entries of an output by the names along its axes, row by row."""
    return list(product(*labels))


def _names(
    output: str, axis: Size, count: int, model: Model, module: Any, *, last: bool
) -> Sequence[str]:
    """The names along an axis of an output, `count` of them; `last` if it is its last axis."""
    if isinstance(axis, int):
        numbers = tuple(str(i + 1) for i in range(count))
        return OUTPUTS[output].parts.get(count, numbers) if last else numbers
    known: Mapping[str, Sequence[str]] = {
        "joints": module.JOINTS,
        "bodies": module.BODIES,
        "points": getattr(module, "POINTS", ()),
        "effects": module.EFFECT_NAMES,
        "driven": getattr(module, "DRIVEN", ()),
        "nv": [c.name for c in model.velocities],
        "nq": [c.name for c in model.coordinates],
        "constraints": [name for name, _ in model.rows],
        "dimensions": "xyz"[: model.dimensions],
    }
    return known[axis]
