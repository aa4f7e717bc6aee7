"""States given by name, in place of a scene's initial state."""

import hashlib
import math
from collections.abc import Mapping

import numpy as np

from eomgen.api.given import Values, named
from eomgen.api.reporter import Reporter
from eomgen.base.errors import RunError
from eomgen.model.model import Model
from eomgen.run.origin import START, Origin
from eomgen.run.problem import FloatArray
from eomgen.study.constrained_start import on_constraints

UNIT_TOLERANCE = 1e-9
"""Deviation of a quaternion's length from 1 that is not reported."""


def state_names(model: Model) -> tuple[str, ...]:
    """The names by which a state can be given: those of [q, v, x], then `<name>_deg` of angles."""
    known = (*model.coordinates, *model.velocities)
    names = [*(c.name for c in known), *(state.name for state in model.extra)]
    return (*names, *(f"{c.name}_deg" for c in known if "rad" in c.unit))


def values_by_index(model: Model, given: Values | None, reporter: Reporter) -> dict[int, float]:
    """Given values of states by their index in [q, v, x]; angles in rad.

    Raises `RunError` for an unknown name, one that is given twice, or another state form.
    """
    option, names = reporter.argument("state"), state_names(model)
    if given and model.form != "velocity":
        raise RunError(
            f"{option}: is for form = 'velocity'; in the form '{model.form}', change [initial]"
        )
    count = len(model.coordinates) + len(model.velocities) + len(model.extra)
    found: dict[int, float] = {}
    for name, value in named(given, names, option, "state").items():
        index = names.index(name)
        if index >= count:
            index, value = names.index(name.removesuffix("_deg")), math.radians(value)
        if index in found:
            raise RunError(f"{option} {name}: {names[index]} is also given; give only one of them")
        found[index] = value
    return found


def initial_with(
    model: Model,
    initial: FloatArray,
    given: Mapping[int, float],
    reporter: Reporter,
    parameters: Values | None = None,
) -> FloatArray:
    """An initial state with given values; quaternions are scaled to length 1, with a note. Other
    values meet the constraints at these parameters, with a note; given ones are kept, but for
    rounding.

    Raises `RunError` for a quaternion without length, `SceneError` if constraints cannot be met.
    """
    option, names = reporter.argument("state"), state_names(model)
    y = initial.copy()
    for index, value in given.items():
        y[index] = value
    for indices in map(list, model.quaternions):
        length = float(np.linalg.norm(y[indices]))
        if not length:
            raise RunError(
                f"{option}: the quaternion that starts at {names[indices[0]]} has no length"
            )
        if abs(length - 1) > UNIT_TOLERANCE:
            reporter.note_scene(
                f"{option}: the quaternion that starts at {names[indices[0]]} has length "
                f"{length:g}; "
                "scaled to 1"
            )
        y[indices] /= length
    found, notices = on_constraints(model, parameters, y, [names[index] for index in given], option)
    for notice in notices:
        reporter.note_scene(notice)
    changed = [
        f"{name} = {value:.6g}"
        for i, (name, value) in enumerate(zip(names, found.tolist(), strict=False))
        if i not in given and value != initial[i]
    ]
    if given and changed:
        reporter.note_scene(f"{option}: to meet the constraints, {', '.join(changed)}")
    return found


def split(model: Model, y: FloatArray) -> tuple[tuple[float, ...], ...]:
    """The parts q, v and x of a state."""
    nq, nv = len(model.coordinates), len(model.velocities)
    values = tuple(y.tolist())
    return values[:nq], values[nq : nq + nv], values[nq + nv :]


def origin_from(origin: Origin | None, initial: FloatArray) -> Origin | None:
    """The origin of a motion that starts from another initial state than the scene's."""
    if origin is None:
        return None
    digest = hashlib.sha256(f"{origin.scene[START]} {initial.tolist()}".encode()).hexdigest()
    return Origin({**origin.scene, START: digest}, origin.parameters, origin.inputs)
