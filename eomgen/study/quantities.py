"""Named quantities along a run: states, energies, outputs and their components.

theta                  a state, or what follows from the states; t is the time
energy                 kinetic, potential and total energy
joint_forces           an output: all its components
joint_forces.hinge     those of one joint, body, point or effect
joint_forces.hinge.fx  one component; x is short for the first that ends in x
works, inputs          what the run keeps of them
coil                   an effect: its forces and its power
coil.force             its forces and moments on bodies about their centres of mass, in world axes,
                       and on coordinates
coil.force.arm.fx      one component, as that of a joint
coil.power             its power on the motion
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eomgen.base.errors import RunError, nearest
from eomgen.model.model import Model
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Trajectory
from eomgen.scene.effects import Effect
from eomgen.study.effect_loads import components_of
from eomgen.study.observed import Observed
from eomgen.study.recording import FOLLOWING, all_of, held_rows, labels_of, unknown_where
from eomgen.study.whole import following
from eomgen.tables.outputs import GROUPS, OUTPUTS, SAVED, WORDS

POWERS = "effect_powers"
MOST = 200
"""Greatest number of quantities in one figure."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity at n times.

    name    as it is asked for
    label   its name among those of the same `title`
    title   what it belongs to, in words; "" for a state
    unit    "" if it has none, or if its unit is not known
    values  (n,); nan where a rigid contact is held whose force would change it
    size    the greatest absolute value of the quantities of its kind: what is much smaller is
            rounding
    """

    name: str
    label: str
    title: str
    unit: str
    values: FloatArray
    size: float


def outputs_of(names: Sequence[str], trajectory: Trajectory, argument: str) -> tuple[str, ...]:
    """The outputs that a module must have for quantities of these names.

    Raises `RunError`, which calls the names `argument`, for a name that no run has.
    """
    found: list[str] = []
    for name in names:
        head = name.partition(".")[0]
        if head in (*trajectory.states, *following_in(trajectory)):
            continue
        if head in WORDS and WORDS[head].unit + WORDS[head].title:  # the run or every module has it
            continue
        if head not in (*GROUPS, *SAVED) and head in (effects := effects_in(trajectory)):
            found += [POWERS]
            continue
        if head not in (*GROUPS, *SAVED):
            near = (*trajectory.states, *effects, *WORDS, *SAVED)
            hint = nearest(head, near) or f"; states: {', '.join(trajectory.states[:12])}"
            raise RunError(f"{argument}: no state, effect or output '{head}'{hint}")
        found += GROUPS.get(head, (head,))
    return tuple(found)


def following_in(trajectory: Trajectory) -> tuple[str, ...]:
    """The names of coordinates and velocities that follow from the states of a run."""
    saved = trajectory.saved.get(FOLLOWING)
    return saved.columns if saved else ()


def effects_in(trajectory: Trajectory) -> tuple[str, ...]:
    """The names of the effects of a run's scene."""
    tables: Any = trajectory.setup.tables() if trajectory.setup else {}
    return tuple(table.get("name", table["type"]) for table in tables.get("effects", ()))


def quantities(
    names: Sequence[str], run: Observed, t: FloatArray, y: FloatArray, *, argument: str = "of"
) -> list[Quantity]:
    """Quantities at states (n, ny) of a run, in the order of their names.

    Raises `RunError` for an unknown name or component, or if the run does not keep it.
    """
    found: list[Quantity] = []
    for name in names:
        found += _found(name, run, t, y, argument)
    if len(found) > MOST:
        raise RunError(
            f"{argument}: these are {len(found)} quantities; name at most {MOST}, "
            f"{names[0]}.NAME for example"
        )
    return found


def _found(
    name: str, run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> Iterator[Quantity]:
    head, *parts = name.split(".")
    states, units = run.trajectory.states, run.functions.UNITS
    if name in states:
        alike = [k for k, other in enumerate(states) if units[other] == units[name]]
        size = float(np.abs(run.trajectory.y[:, alike]).max())
        yield Quantity(name, name, "", units[name], y[:, states.index(name)], size)
    elif name in following_in(run.trajectory):
        own = following_in(run.trajectory)
        rows = following(run.functions, run.model, t, y.T, *run.values(t))
        alike = [k for k, other in enumerate(own) if units[other] == units[name]]
        size = float(np.abs(run.trajectory.saved[FOLLOWING].values[:, alike]).max())
        yield Quantity(name, name, "", units[name], rows[own.index(name)], size)
    elif name == "t":
        yield Quantity(name, name, "", WORDS[name].unit, t, float(np.abs(t).max()))
    elif head in states or head == "t":
        raise RunError(f"{argument}: {name}: a state has no components; take {head}")
    elif head == "energy":
        yield from _energies(name, parts, run, t, y, argument)
    elif head in ("works", "inputs"):
        yield from _kept(head, parts, run, t, argument)
    elif head in (*GROUPS, *SAVED):
        for output in GROUPS.get(head, (head,)):
            yield from _of_output(output, parts, run, t, y, argument)
    else:
        yield from _of_effect(name, run, t, y, argument)


def _of_effect(
    name: str, run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> Iterator[Quantity]:
    head, *parts = name.split(".")
    what = parts[0] if parts else ""
    if what not in ("", "force", "power"):
        raise RunError(f"{argument}: {name}: of an effect take {head}.force or {head}.power")
    if what != "power":
        effect = next(effect for effect in run.model.effects if effect.name == head)
        yield from _forces_of(effect, parts[1:], run, t, y, argument)
    if what != "force":
        if parts[1:]:
            raise RunError(f"{argument}: {name}: a power has no components; take {head}.power")
        (power,) = _of_output(POWERS, [head], run, t, y, argument)
        yield replace(power, name=f"{head}.power")


def _forces_of(
    effect: Effect, parts: list[str], run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> Iterator[Quantity]:
    found = components_of(effect, run, t, y, argument)
    chosen = [each for each in found if _is_chosen(each[0], parts)]
    if not chosen:
        known = ", ".join(".".join(names) for names, *_ in found)
        raise RunError(
            f"{argument}: {effect.name}.force has no '{'.'.join(parts)}'; known: {known}"
        )
    sizes: dict[str, float] = {}
    for _, unit, values in found:
        sizes[unit] = max(sizes.get(unit, 0.0), np.nan_to_num(np.abs(values)).max(initial=0.0))
    for names, unit, values in chosen:
        label, what = ".".join(names), "force" if unit == "N" else "moment"
        title = f"{effect.name.replace('_', ' ')} {what}"
        yield Quantity(f"{effect.name}.force.{label}", label, title, unit, values, sizes[unit])


def _is_chosen(names: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether the parts of a name stand in these, in order."""
    left = iter(names)
    return all(any(_match(part, [name]) for name in left) for part in parts)


def _energies(
    name: str, parts: list[str], run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> Iterator[Quantity]:
    word = WORDS["energy"]
    kinetic, potential = (run.output(output, t, y) for output in word.outputs)
    size = float(max(np.abs(each).max(initial=0.0) for each in (kinetic, potential)))
    values = dict(zip(word.parts, (kinetic, potential, kinetic + potential), strict=True))
    for (label,) in _chosen(name, parts, [word.parts], argument):
        yield Quantity(f"energy.{label}", label, word.title, word.unit, values[label], size)


def _kept(
    head: str, parts: list[str], run: Observed, t: FloatArray, argument: str
) -> Iterator[Quantity]:
    """Works or inputs, which are known at the rows of the run; between them they are linear."""
    trajectory, setup = run.trajectory, run.setup
    if head == "works":
        if trajectory.works is None:
            raise RunError(f"{argument}: works: this run has none; simulate with --works")
        names, values = trajectory.work_names, trajectory.works
    else:
        names = tuple(run.functions.INPUTS)
        constant = np.array([*{**run.functions.INPUTS, **setup.inputs}.values()])
        varying = setup.varying
        values = np.tile(constant, (len(trajectory.t), 1)) if varying is None else varying
        if not names:
            raise RunError(f"{argument}: inputs: {trajectory.name} has none")
    for (label,) in _chosen(head, parts, [list(names)], argument):
        column = np.interp(t, trajectory.t, values[:, names.index(label)])
        unit = WORDS[head].unit or run.functions.UNITS[label].partition(" | ")[0]
        yield Quantity(
            f"{head}.{label}", label, WORDS[head].title, unit, column, float(np.abs(values).max())
        )


def _of_output(
    output: str, parts: list[str], run: Observed, t: FloatArray, y: FloatArray, argument: str
) -> Iterator[Quantity]:
    if not hasattr(run.functions, output):
        raise RunError(f"{argument}: '{output}' is made for form = 'velocity' only")
    array = run.output(output, t, y)
    spec = OUTPUTS[output]
    if spec.contacts and run.trajectory.events:
        rows = np.searchsorted(run.trajectory.t, t, side="right") - 1
        array = unknown_where(held_rows(run.trajectory)[rows], array)
    labels = labels_of(output, array.shape[1:], run.model, run.functions)
    columns = array.reshape(len(t), -1)
    flat = all_of(labels)
    units = [spec.unit(entry[-1] if entry else "", run.model.dimensions) for entry in flat]
    largest = np.nan_to_num(np.abs(columns)).max(axis=0, initial=0.0)
    sizes = {unit: float(max(largest[[u == unit for u in units]])) for unit in dict.fromkeys(units)}
    if output == "joint_forces":  # a moment is small beside a force on a lever of the mechanism
        sizes["N m"] = max(sizes.get("N m", 0.0), run.length * sizes["N"])
    for entry in _chosen(output, parts, labels, argument):
        index = flat.index(entry)
        yield Quantity(
            ".".join((output, *entry)),
            ".".join(entry) or output,
            spec.title(entry[-1] if entry else "") or output.replace("_", " "),
            units[index],
            columns[:, index],
            sizes[units[index]],
        )


def components(
    name: str, shape: tuple[int, ...], model: Model, functions: Any, argument: str
) -> list[tuple[int, str]]:
    """The entries of an output of this shape that a name chooses, as in `quantities`: the place of
    each in the flat array, and its whole name. Raises `RunError` for an unknown component.
    """
    output, *parts = name.split(".")
    labels = labels_of(output, shape, model, functions)
    flat = all_of(labels)
    chosen = _chosen(output, parts, labels, argument)
    return [(flat.index(entry), ".".join((output, *entry))) for entry in chosen]


def _chosen(
    name: str, parts: Sequence[str], labels: Sequence[Sequence[str]], argument: str
) -> list[tuple[str, ...]]:
    """The entries that the parts of a name choose: each part an axis, those not named all."""
    kept = [list(names) for names in labels]
    axis = 0
    for part in parts:
        matches = ((k, _match(part, kept[k])) for k in range(axis, len(kept)))
        axis, match = next(((k, m) for k, m in matches if m is not None), (0, ""))
        if not match:
            known = [label for names in labels for label in names]
            hint = nearest(part, known) or f"; known: {', '.join(known[:12]) or 'none'}"
            raise RunError(f"{argument}: {name} has no component '{part}'{hint}")
        kept[axis] = [match]
        axis += 1
    return all_of(kept)


def _match(part: str, names: Sequence[str]) -> str | None:
    """The name itself, or the first short name that ends in it: fx for x."""
    if part in names:
        return part
    short = (name for name in names if len(name) == 2 and len(part) == 1 and name[1] == part)
    return next(short, None)
