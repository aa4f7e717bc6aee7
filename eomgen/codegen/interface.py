"""The interface of a program: names, units, shapes and defaults, which is all a backend needs."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from eomgen.codegen.system import ContactLabel, SamplingLabel, System
from eomgen.language.conditions import Condition, is_of_size
from eomgen.language.formula import written
from eomgen.model.bodies import Prescribed
from eomgen.model.model import Model
from eomgen.model.states import velocity_states
from eomgen.tables.outputs import DERIVATIVES, JACOBIAN, OUTPUTS

ABOUT = {
    "initial_state": "The scene's initial state; momenta depend on the parameters.",
    "derivative": "Time derivative of the state.",
    "jacobian": JACOBIAN.about,
    "gaps": "Gap of each of `CONTACTS`, m or rad; negative if they overlap.",
    "gap_rates": "Time derivative of each of `gaps`, m/s or rad/s.",
    "constraint_residuals": "Each of `CONSTRAINTS`: how far it is from being met, m or rad.",
    "constraint_rates": "Rate of each of `CONSTRAINTS`, m/s or rad/s.",
    "constraint_jacobian": "Derivatives of `constraint_rates` by the velocities, (nc, nv).",
    "constraint_margins": "How far each of `CONSTRAINTS` is from following from others{}.",
    "project_position": "Coordinates (nq,) after one Newton step towards the constraints.",
    "project_velocity": "Velocities (nv,) that meet the constraints, the nearest.",
    "samples": "What samples of `CONTROLLERS` set, with a normal number for each noise.",
    "seeds": "The seed of the noise of each of `CONTROLLERS`.",
    "switching_functions": "`derivative` changes its branch where one of these passes 0.",
    "switching_functions_of_time": "As `switching_functions`; these depend on time only.",
}
"""Docstrings of the outputs that users do not ask for; those of the others are in `OUTPUTS`."""


@dataclass(frozen=True)
class Variable:
    """A state, an input or a parameter.

    `default` is the value of a parameter that is not given. `position` is true for states that are
    positions or angles.
    """

    name: str
    unit: str
    about: str
    default: float = 0.0
    position: bool = False


@dataclass(frozen=True)
class Given:
    """A prescribed coordinate; `value` is the text of its formula or number."""

    name: str
    value: str
    unit: str
    about: str


@dataclass(frozen=True)
class Function:
    """An output of the program as a function.

    shape    of the array it returns, in C order; () for a number
    extra    names of the inputs that it takes besides time, state, parameters and inputs
    tangent  whether it computes the product of the matrix with a direction, given as `extra`,
             instead of the matrix
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
    """The interface of a program.

    name, title     of the scene
    form            of the state: 'velocity', 'momentum', 'redundant'
    coordinates     number of coordinates in the state; `velocities` and `others`, the extra states,
                    are the numbers of those that follow
    forces          number of generalised forces: of velocities, those too that follow from others
    conditions      conditions on parameter values that the program's own checks do not cover
    functions       the program's outputs
    quaternions     indices of each unit quaternion in the state
    effects         name and type of each effect
    joints          names of the joints that transmit constraint forces
    driven, locked  prescribed coordinates
    contacts        rigid contacts
    sampling        effects that sample
    constraints     name and unit of the multiplier of each row of the constraints
    velocity_rows   names of those rows that restrict velocities alone
    following       name, unit and description of each coordinate and velocity that follows from
                    others in closed form
    ranged          names of angles among these, each within one turn
    left_out        terms that the scene leaves out of the equations, one line each
    """

    name: str
    title: str
    form: str
    dimensions: int
    states: tuple[Variable, ...]
    coordinates: int
    velocities: int
    others: int
    forces: int
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
    sampling: tuple[SamplingLabel, ...]
    constraints: tuple[tuple[str, str], ...]
    velocity_rows: tuple[str, ...]
    following: tuple[tuple[str, str, str], ...]
    ranged: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    def projected(self) -> bool:
        """Whether runs move states onto the constraints. In closed form they cannot leave them."""
        return any(function.name == "project_position" for function in self.functions)


def interface_of(system: System) -> Interface:
    """The interface of a system's program."""
    model = system.model
    left_out = []
    if "velocity_forces" in model.leave_out:
        rest = ", except the terms of the driven motion in V" if model.driven else ": M v̇ + G = F"
        left_out.append(f"Left out: velocity forces{rest}.")
    return Interface(
        name=model.name,
        title=model.title,
        form=model.form,
        dimensions=model.dimensions,
        states=tuple(Variable(s.name, s.unit, s.about, position=s.position) for s in system.states),
        coordinates=len(model.state_coordinates),
        velocities=len(model.state_velocities),
        others=len(model.extra),
        forces=len(model.velocities),
        inputs=tuple(Variable(i.name, i.unit, i.about, i.default) for i in model.inputs),
        parameters=tuple(Variable(p.name, p.unit, p.about, p.default) for p in model.parameters),
        conditions=tuple(dict.fromkeys(_conditions(model))),
        functions=tuple(_function(system, name) for name in system.program.outputs),
        quaternions=_quaternions(model) if model.form == "velocity" else (),
        effects=tuple((effect.name, effect.type) for effect in model.effects),
        bodies=tuple(body.name for body in model.bodies),
        joints=model.force_joints,
        points=tuple(point.name for point in model.points),
        driven=tuple(map(_given, model.driven)),
        locked=tuple(_given(c) for c in model.prescribed if c.locked),
        contacts=system.contacts,
        sampling=system.sampling,
        constraints=model.rows,
        velocity_rows=model.velocity_rows,
        following=_following(model),
        ranged=model.ranged,
        left_out=tuple(left_out),
    )


def _following(model: Model) -> tuple[tuple[str, str, str], ...]:
    """Coordinates and velocities that are no states."""
    own = {s.name for s in velocity_states(model)}
    every = (*model.coordinates, *model.velocities) if model.groups else ()
    return tuple((c.name, c.unit, c.about) for c in every if c.name not in own)


def _quaternions(model: Model) -> tuple[tuple[int, int, int, int], ...]:
    """The indices in the state of each unit quaternion."""
    place = {i: n for n, i in enumerate(model.state_coordinates)}
    return tuple((place[w], place[x], place[y], place[z]) for w, x, y, z in model.quaternions)


def _function(system: System, name: str) -> Function:
    jumps = ", and each of `RANGED` from where it jumps by a turn" if system.model.ranged else ""
    about = ABOUT.get(name, "").replace("{}", jumps)
    if name in OUTPUTS:
        about = OUTPUTS[name].of(system.model.dimensions)[1]
    # Forces of rigid contacts are known only during a simulation.
    incomplete = name == "derivative" or (name in OUTPUTS and OUTPUTS[name].contacts)
    if incomplete and system.contacts:
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
    """The conditions that depend on parameters, except those checked elsewhere: the sizes of single
    parameters, and masses and moments of inertia, for which the program has stricter checks.
    """
    moments = {entry for body in model.bodies for entry in (body.mass, *body.inertia_com[:3])}
    for c in model.conditions:
        bound = c.low == 0.0 and c.high == math.inf and not c.strict
        if c.depends and not is_of_size(c) and not (bound and c.value in moments):
            yield c
