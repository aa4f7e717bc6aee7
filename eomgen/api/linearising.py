"""A mechanism linearised about an equilibrium or a state: `linearise`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from eomgen.api.generating import compiled
from eomgen.api.given import Source, Values, check, named
from eomgen.api.reporter import SILENT, Reporter
from eomgen.errors import RunError
from eomgen.model.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray
from eomgen.study.diagnosis import problem_of

if TYPE_CHECKING:
    from eomgen.linear.linearise import Linearisation

Place = Literal["equilibrium", "rest", "initial"]
LENGTH = 1e-9
"""How far from 1 a quaternion's length may be without being worth a word."""


@dataclass(frozen=True, eq=False)
class About:
    """A linearisation, and what it is about.

    module  that was linearised, of form 'velocity'
    start   the state that was given (ny,), from which an equilibrium was sought
    whole   A, B and where
    steady  whether a state that was given moves steadily
    """

    module: GeneratedModule
    start: FloatArray
    whole: "Linearisation"
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
    """A and B of δẏ = A δy + B δu about an equilibrium, where it comes to rest, or a state.

    at          "equilibrium": the nearest, stable or not; "rest": where it comes to rest;
                "initial": the state itself, moving as it may
    state       what of the scene's initial state is another, by name; `<name>_deg` in degrees
    hold, trim  coordinates that stay as they are, and inputs that are found, too

    Raises `RunError` where there is no equilibrium.
    """
    return linearised_about(
        linearisable(check(source)),
        at=at,
        state=state,
        parameters=parameters,
        inputs=inputs,
        hold=hold,
        trim=trim,
    ).whole


def linearisable(model: Model) -> Model:
    """A model in the form that is linearised, with what that takes.

    Forms other than [q, v] have states that move with the parameters.
    """
    wanted = ("input_jacobian",) if model.inputs else ()
    return replace(model, form="velocity", outputs=wanted)


def linearised_about(
    model: Model,
    *,
    at: Place = "equilibrium",
    state: Values | None = None,
    parameters: Values | None = None,
    inputs: Values | None = None,
    hold: Sequence[str] = (),
    trim: Sequence[str] = (),
    reporter: Reporter = SILENT,
) -> About:
    """A model that is `linearisable`, linearised as `linearise` describes it."""
    # Imported here: who does not linearise needs no SciPy.
    from eomgen.linear.equilibrium import equilibrium
    from eomgen.linear.linearise import is_steady
    from eomgen.linear.linearise import linearise as linearised

    if at not in ("equilibrium", "rest", "initial"):
        raise RunError(f"{reporter.argument('at')}: '{at}' is none of equilibrium, rest, initial")
    given = named(parameters, model.defaults, reporter.argument("parameters"), "parameter")
    pushes = named(inputs, [i.name for i in model.inputs], reporter.argument("inputs"), "input")
    _, module = compiled(model, reporter=reporter)
    with reporter.located():
        problem = problem_of(module, given or None, pushes or None, model)
        y = start = _state(model, problem.initial, state, at, reporter)
        u: Mapping[str, float] | FloatArray = pushes
        if at != "initial":
            settle = at == "rest"
            y, u = equilibrium(module, y, pushes, given, hold=hold, trim=trim, settle=settle)
        elif hold or trim:
            options = f"{reporter.argument('hold')}, {reporter.argument('trim')}"
            raise RunError(
                f"{options}: are for finding an equilibrium; leave out {reporter.argument('at')} "
                "initial"
            )
        whole = linearised(module, y, u, given)
        steady = at == "initial" and is_steady(module, whole, given)
    return About(module, start, whole, steady)


def state_names(model: Model) -> tuple[str, ...]:
    """What a state is given by: names of states, and those of angles in degrees."""
    known = (*model.coordinates, *model.velocities)
    names = [*(c.name for c in known), *(state.name for state in model.states)]
    return (*names, *(f"{c.name}_deg" for c in known if "rad" in c.unit))


def _state(
    model: Model, initial: FloatArray, state: Values | None, at: Place, reporter: Reporter
) -> FloatArray:
    """The initial state with what is to be another, quaternions scaled with a notice."""
    option, names = reporter.argument("state"), state_names(model)
    nq, nv = len(model.coordinates), len(model.velocities)
    y = initial.copy()
    for name, value in named(state, names, option, "state").items():
        index = names.index(name)
        if index >= len(y):
            index, value = names.index(name.removesuffix("_deg")), math.radians(value)
        if at != "initial" and nq <= index < nq + nv:
            raise RunError(
                f"{option} {name}: an equilibrium is at rest; leave it out, or give "
                f"{reporter.argument('at')} initial"
            )
        y[index] = value
    for indices in map(list, model.quaternions):
        length = float(np.linalg.norm(y[indices]))
        if not length:
            raise RunError(f"{option}: the quaternion from {names[indices[0]]} on has no length")
        if abs(length - 1) > LENGTH:
            reporter.note_scene(
                f"{option}: the quaternion from {names[indices[0]]} on has length {length:g}; "
                "scaled to 1"
            )
        y[indices] /= length
    return y
