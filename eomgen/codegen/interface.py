"""What a program's numbers are called and what they mean: all that a backend knows beside it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from eomgen.codegen.system import ContactLabel, System
from eomgen.language.conditions import Condition, is_of_size
from eomgen.language.formula import written
from eomgen.model.model import Model, Prescribed
from eomgen.outputs import DERIVATIVES, JACOBIAN, OUTPUTS

ABOUT = {
    "initial_state": "The scene's initial state; momenta follow the parameters.",
    "derivative": "Time derivative of the state.",
    "jacobian": JACOBIAN.about,
    "gaps": "How far apart each of `CONTACTS` is, m or rad; negative where they overlap.",
    "gap_rates": "How fast each of `gaps` grows, m/s or rad/s.",
    "switching_functions": "`derivative` has another branch where one of these passes 0.",
    "switching_functions_of_time": "As `switching_functions`; these depend on time alone.",
}
"""Outputs that every program has for which there is a need; the others are in the table."""


@dataclass(frozen=True)
class Variable:
    """A state, an input or a parameter. `default` is its value unless given; `position` says of a
    state that it is a position or an angle, no rate.
    """

    name: str
    unit: str
    about: str
    default: float = 0.0
    position: bool = False


@dataclass(frozen=True)
class Given:
    """A coordinate that is no state, with the text of its value."""

    name: str
    value: str
    unit: str
    about: str


@dataclass(frozen=True)
class Function:
    """An output of the program as a function.

    shape    of its array, row by row; () for a number
    extra    names of what it takes beside time, state, parameters and inputs
    tangent  whether it computes how its first axis changes along a direction, `extra`, in place of
             a matrix of derivatives
    matrix   whether it is a matrix of derivatives of `derivative`
    """

    name: str
    about: str
    shape: tuple[int, ...]
    extra: tuple[str, ...]
    tangent: bool
    matrix: bool


@dataclass(frozen=True)
class Interface:
    """Names, units, shapes and defaults of a program, in order.

    name, title    of the scene
    form           of the state: 'velocity', 'momentum', 'redundant'
    coordinates    how many there are, and how many `velocities` and `others` after them
    conditions     what values of the parameters must keep, but for sizes and what the program's
                   own checks ask
    functions      the program's outputs
    quaternions    indices of each unit quaternion in the state
    effects        name and type of each
    driven, locked coordinates that are no states
    contacts       the rigid ones
    left_out       what the equations lack on purpose, a line each
    """

    name: str
    title: str
    form: str
    dimensions: int
    states: tuple[Variable, ...]
    coordinates: int
    velocities: int
    others: int
    inputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    conditions: tuple[Condition, ...]
    functions: tuple[Function, ...]
    quaternions: tuple[tuple[int, int, int, int], ...]
    effects: tuple[tuple[str, str], ...]
    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    points: tuple[str, ...]
    driven: tuple[Given, ...]
    locked: tuple[Given, ...]
    contacts: tuple[ContactLabel, ...]
    left_out: tuple[str, ...]


def interface_of(system: System) -> Interface:
    """The interface of a system's program."""
    model = system.model
    left_out = []
    if "velocity_forces" in model.leave_out:
        rest = ", of which V keeps what driving takes" if model.driven else ": M v̇ + G = F"
        left_out.append(f"Left out: velocity forces{rest}.")
    return Interface(
        name=model.name,
        title=model.title,
        form=model.form,
        dimensions=model.dimensions,
        states=tuple(Variable(s.name, s.unit, s.about, position=s.position) for s in system.states),
        coordinates=len(model.coordinates),
        velocities=len(model.velocities),
        others=len(model.states),
        inputs=tuple(Variable(i.name, i.unit, i.about) for i in model.inputs),
        parameters=tuple(Variable(p.name, p.unit, p.about, p.default) for p in model.parameters),
        conditions=tuple(dict.fromkeys(_conditions(model))),
        functions=tuple(_function(system, name) for name in system.program.outputs),
        quaternions=tuple(model.quaternions) if model.form == "velocity" else (),
        effects=tuple((effect.name, effect.type) for effect in model.effects),
        bodies=tuple(body.name for body in model.bodies),
        joints=tuple(body.joint.name for body in model.holding),
        points=tuple(point.name for point in model.points),
        driven=tuple(map(_given, model.driven)),
        locked=tuple(_given(c) for c in model.prescribed if c.locked),
        contacts=system.contacts,
        left_out=tuple(left_out),
    )


def _function(system: System, name: str) -> Function:
    about = ABOUT.get(name, "")
    if name in OUTPUTS:
        about = OUTPUTS[name].of(system.model.dimensions)[1]
    # With rigid contacts, whose forces only a run finds.
    lacks = name == "derivative" or (name in OUTPUTS and OUTPUTS[name].contacts)
    if lacks and system.contacts:
        about += " Forces of held contacts are left out."
    return Function(
        name,
        about,
        tuple(system.program.outputs[name].shape),
        tuple(system.extra.get(name, ())),
        name in system.tangents,
        name in DERIVATIVES,
    )


def _given(c: Prescribed) -> Given:
    return Given(c.position.name, written(c.value), c.position.unit, c.position.about)


def _conditions(model: Model) -> Iterator[Condition]:
    """The conditions that depend on parameters, but for those that are asked in other ways: sizes
    of single parameters, and masses and moments of which the equations ask more.
    """
    moments = {entry for body in model.bodies for entry in (body.mass, *body.inertia_com[:3])}
    for c in model.conditions:
        bound = c.low == 0.0 and c.high == math.inf and not c.strict
        if c.depends and not is_of_size(c) and not (bound and c.value in moments):
            yield c
