"""Linearisation about an equilibrium or a state: `linearise`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, named, values_of
from eomgen.api.reporter import SILENT, Reporter
from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.linear.linearise import Linearisation

Place = Literal["equilibrium", "rest", "initial"]
UNIT_TOLERANCE = 1e-9
"""Deviations of a quaternion's length from 1 above this are reported."""


@dataclass(frozen=True)
class Point:
    """The point about which a model is linearised, and how it is found; see `linearise`."""

    at: Place = "equilibrium"
    state: Values | None = None
    parameters: Values | None = None
    inputs: Values | None = None
    hold: Sequence[str] = ()
    trim: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Linearised:
    """A linearisation with what it was made from.

    module         the module that was linearised, of form 'velocity'
    start          the given state (ny,), from which an equilibrium was searched
    linearisation  A, B and the point
    steady         whether a given state moves steadily: no velocity changes
    """

    module: GeneratedModule
    start: FloatArray
    linearisation: "Linearisation"
    steady: bool


def linearise(
    source: Source,
    *,
    at: Place = "equilibrium",
    state: Values | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    hold: Sequence[str] = (),
    trim: Sequence[str] = (),
) -> "Linearisation":
    """Linearise a scene: A and B of δẏ = A δy + B δu about an equilibrium or a state.

    at          "equilibrium": the nearest one, stable or not; "rest": where the motion comes to
                rest; "initial": the given state, which may move
    state       values that replace those of the scene's initial state, by name; `<name>_deg` in
                degrees
    parameters  values that replace those of the scene, by name
    inputs      constant values, by name; others are 0
    hold        coordinates that keep their values while an equilibrium is searched
    trim        inputs whose values are searched as well

    Raises `SceneError`, or `RunError` for an invalid argument or if there is no equilibrium.
    """
    point = Point(at, state, parameters, inputs, hold, trim)
    return linearised_at(linearisable(check(source)), point).linearisation


def linearisable(model: Model) -> Model:
    """A model in form 'velocity' with the outputs that its linearisation needs.

    In the other forms the initial state depends on the parameters.
    """
    needed = ("input_jacobian",) if model.inputs else ()
    return replace(model, form="velocity", outputs=needed)


def linearised_at(model: Model, point: Point, reporter: Reporter = SILENT) -> Linearised:
    """A `linearisable` model, linearised as `linearise` describes."""
    # Imported here: they import SciPy.
    from eomgen.linear.equilibrium import equilibrium
    from eomgen.linear.linearise import is_steady
    from eomgen.linear.linearise import linearise as linearised

    at, hold, trim = point.at, point.hold, point.trim
    if at not in ("equilibrium", "rest", "initial"):
        raise RunError(f"{reporter.argument('at')}: '{at}' is none of equilibrium, rest, initial")
    parameters, inputs = values_of(model, point.parameters, point.inputs, reporter)
    _, module = compiled(model, reporter=reporter)
    with reporter.located():
        problem = problem_of(module, parameters or None, inputs or None, model)
        y = start = _start(model, problem.initial, point, reporter)
        u: Mapping[str, float] | FloatArray = inputs
        if at != "initial":
            settle = at == "rest"
            y, u = equilibrium(module, y, inputs, parameters, hold=hold, trim=trim, settle=settle)
        elif hold or trim:
            raise RunError(
                f"{reporter.argument('hold')}, {reporter.argument('trim')}: are for finding an "
                f"equilibrium; leave out {reporter.argument('at')} initial"
            )
        found = linearised(module, y, u, parameters)
        steady = at == "initial" and is_steady(module, found, parameters)
    return Linearised(module, start, found, steady)


def state_names(model: Model) -> tuple[str, ...]:
    """The names by which a state can be given: those of [q, v, x], then `<name>_deg` of angles."""
    known = (*model.coordinates, *model.velocities)
    names = [*(c.name for c in known), *(state.name for state in model.states)]
    return (*names, *(f"{c.name}_deg" for c in known if "rad" in c.unit))


def _start(model: Model, initial: FloatArray, point: Point, reporter: Reporter) -> FloatArray:
    """The initial state with the given values; quaternions are scaled to length 1, with a note."""
    option, names = reporter.argument("state"), state_names(model)
    nq, nv = len(model.coordinates), len(model.velocities)
    y = initial.copy()
    for name, value in named(point.state, names, option, "state").items():
        index = names.index(name)
        if index >= len(y):
            index, value = names.index(name.removesuffix("_deg")), math.radians(value)
        if point.at != "initial" and nq <= index < nq + nv:
            raise RunError(
                f"{option} {name}: an equilibrium is at rest; leave it out, or give "
                f"{reporter.argument('at')} initial"
            )
        y[index] = value
    for indices in map(list, model.quaternions):
        length = float(np.linalg.norm(y[indices]))
        if not length:
            raise RunError(f"{option}: the quaternion from {names[indices[0]]} on has no length")
        if abs(length - 1) > UNIT_TOLERANCE:
            reporter.note_scene(
                f"{option}: the quaternion from {names[indices[0]]} on has length {length:g}; "
                "scaled to 1"
            )
        y[indices] /= length
    return y
