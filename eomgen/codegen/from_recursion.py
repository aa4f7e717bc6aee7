"""Systems of models by the recursions: the derivative of the state and all outputs on a tape."""

from collections.abc import Callable, Mapping, Sequence

from eomgen.codegen.constraints import (
    constraint_forces,
    constraint_loads,
    constraint_outputs,
)
from eomgen.codegen.contacts import contact_labels, contact_outputs
from eomgen.codegen.jacobians import matrices
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import (
    OutputNodes,
    System,
    names_of_inputs,
    output_shape,
    recorded,
)
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.reactions import reactions
from eomgen.dynamics.tree import observables
from eomgen.dynamics.tree.composite import full
from eomgen.dynamics.tree.vectors import Vec, in_space, zeros
from eomgen.language.formula import is_zero
from eomgen.model.states import initial_state, velocity_states
from eomgen.program import differentiate
from eomgen.program.program import Check
from eomgen.program.tape import Node
from eomgen.tables.outputs import DERIVATIVES

ExtraInputs = dict[str, tuple[str, ...]]
"""For some outputs the names of the inputs that they take besides the state."""


def from_recursion(
    record: Recording,
    *,
    jacobian: bool = True,
    given: Callable[[str, ExtraInputs], list[Node] | None] = lambda name, extra: None,
    conditions: Sequence[Check] = (),
) -> System:
    """The system of a recorded model, with or without the Jacobian of the derivative.

    given       the nodes of outputs that something else than the recursions computes
    conditions  conditions on parameters beside those of the recursions
    """
    model, tape, ny = record.model, record.tape, len(record.rates)
    start = [tape.constant(x) for x in initial_state(model)]
    nodes: OutputNodes = {"initial_state": ((ny,), start), "derivative": ((ny,), record.rates)}
    derivatives = matrices(record, with_jacobian=jacobian)
    nodes |= derivatives.nodes
    extra = dict(derivatives.extra)
    following = ("coordinates", "velocities", "accelerations") if model.groups else ()
    for name in dict.fromkeys((*model.outputs, *following)):
        if name not in DERIVATIVES:
            found = given(name, extra)
            found = output(record, name, extra) if found is None else found
            nodes[name] = output_shape(name, model), record.closed(found)
    if record.dynamics.contacts:
        more, more_extra = contact_outputs(
            record.dynamics, tape, record.route, record.forward, record.position_rates
        )
        nodes, extra = nodes | more, extra | more_extra
    if model.constraints:
        parts = constraint_outputs(record)
        nodes |= {name: (shape, record.closed(part)) for name, (shape, part) in parts.items()}
    tangents = derivatives.tangents
    program = recorded(tape, nodes, [*checks(record), *conditions], tangents)
    labels = contact_labels(record.dynamics)
    return System(model, record.route, velocity_states(model), program, extra, tangents, labels)


def output(record: Recording, name: str, extra: ExtraInputs) -> list[Node]:
    """The nodes of an output; for all outputs except matrices of derivatives.

    Enters into `extra` the names of the inputs that the output takes besides the state.
    """
    if name in BESIDE:
        prefix, compute = BESIDE[name]
        given = record.velocity_inputs(prefix)
        extra[name] = names_of_inputs(given)
        return compute(record, given)
    if name in OBSERVED:
        return OBSERVED[name](record)
    return OF_DYNAMICS[name](record.dynamics)


def _inverse(record: Recording, vd: Sequence[Node]) -> list[Node]:
    pairs = zip(record.dynamics.inverse(vd), record.dynamics.applied_force, strict=True)
    return [needed - applied for needed, applied in pairs]


def _mass_matrix(record: Recording) -> list[Node]:
    return full(record.dynamics.mass_entries, len(record.v), record.scalars)


def _powers(record: Recording) -> list[Node]:
    return [record.dynamics.power(effect) for effect in record.model.effects]


def _kinetic_slopes(record: Recording) -> list[Node]:
    return differentiate.jacobian([record.dynamics.kinetic_energy], record.q)[0]


def _momentum(record: Recording) -> list[Node]:
    d = record.dynamics
    p, about = observables.momentum(d.kinematics, d.origins, d.twists, record.scalars)
    return [p[0], p[1], about[2]] if record.model.dimensions == 2 else [*p, *about]


def _centre_of_mass(record: Recording) -> list[Node]:
    d = record.dynamics
    centre = observables.centre_of_mass(d.linkage, d.kinematics, d.origins, record.scalars)
    return list(centre[: record.model.dimensions])


def _joint_forces(record: Recording) -> list[Node]:
    rows = [
        (f.force[0], f.force[1], f.moment[2])
        if record.model.dimensions == 2
        else (*f.force, *f.moment)
        for f in reactions(record.dynamics, record.vd, constraint_loads(record))
    ]
    return [x for row in rows for x in row]


def _poses(record: Recording) -> list[Node]:
    d, scalars = record.dynamics, record.scalars
    nodes: list[Node] = []
    for k in range(len(record.model.bodies)):
        centre = d.centre(k)
        if record.model.dimensions == 2:
            nodes += [centre[0], centre[1], d.angle(k)]
        else:
            matrix = observables.orientation(d.linkage, d.kinematics, k, scalars)
            nodes += [x for row, y in zip(matrix, centre, strict=True) for x in (*row, y)]
    return nodes


def _velocities(record: Recording) -> list[Node]:
    count = len(record.model.bodies)
    moved = [_velocity(record, k, zeros(record.scalars)) for k in range(count)]
    if record.model.dimensions == 2:
        return [x for u, w in moved for x in (u[0], u[1], w[2])]
    return [x for u, w in moved for x in (*u, *w)]


def _velocity(record: Recording, body: int, at: Vec) -> tuple[Vec, Vec]:
    d = record.dynamics
    return observables.velocity(d.linkage, d.kinematics, d.twists, body, at, record.scalars)


def _points(record: Recording, of: Callable[[Recording, int, Vec], Sequence[Node]]) -> list[Node]:
    """The results of `of` for all named points; it takes a body and a position in body axes."""
    nodes: list[Node] = []
    for point in record.model.points:
        at = in_space([record.dynamics.value(part) for part in point.at], record.scalars)
        nodes += of(record, point.body, at)
    return nodes


def _point_position(record: Recording, body: int, at: Vec) -> Sequence[Node]:
    return record.dynamics.point_position(body, at)[: record.model.dimensions]


def _point_velocity(record: Recording, body: int, at: Vec) -> Sequence[Node]:
    return _velocity(record, body, at)[0][: record.model.dimensions]


def _point_jacobian(record: Recording, body: int, at: Vec) -> Sequence[Node]:
    d, nv = record.dynamics, len(record.v)
    columns = observables.point_jacobian(
        d.linkage, d.kinematics, d.origins, body, at, nv, record.scalars
    )
    return [column[i] for i in range(record.model.dimensions) for column in columns]


BESIDE: Mapping[str, tuple[str, Callable[[Recording, Sequence[Node]], list[Node]]]] = {
    "forward_dynamics": ("tau", lambda record, tau: record.forward(tau)),
    "inverse_dynamics": ("vd", _inverse),
}
"""Outputs that take one more input for each velocity: the prefix of their names, and a function."""
OF_DYNAMICS: Mapping[str, Callable[[Dynamics], list[Node]]] = {
    "velocity_force": lambda d: d.bias(weightless=True),
    "gravity_force": lambda d: d.bias(still=True),
    "bias_force": lambda d: d.bias(),
    "applied_force": lambda d: d.applied_force,
    "kinetic_energy": lambda d: [d.kinetic_energy],
    "potential_energy": lambda d: [d.potential_energy],
    "driving_forces": lambda d: d.driving_forces,
}
"""Outputs that are results of `Dynamics`."""
OBSERVED: Mapping[str, Callable[[Recording], list[Node]]] = {
    "coordinates": lambda record: list(record.q),
    "velocities": lambda record: list(record.v),
    "accelerations": lambda record: list(record.vd),
    "mass_matrix": _mass_matrix,
    "kinetic_slopes": _kinetic_slopes,
    "effect_powers": _powers,
    "momentum": _momentum,
    "centre_of_mass": _centre_of_mass,
    "joint_forces": _joint_forces,
    "constraint_forces": constraint_forces,
    "body_poses": _poses,
    "body_velocities": _velocities,
    "point_positions": lambda record: _points(record, _point_position),
    "point_velocities": lambda record: _points(record, _point_velocity),
    "point_jacobians": lambda record: _points(record, _point_jacobian),
}
"""The other outputs, except matrices of derivatives."""


def checks(record: Recording) -> list[Check]:
    """Conditions on a user's parameters: masses and moments of inertia are not negative, and a mass
    that is positive in the scene stays positive.
    """
    found = []
    model, d = record.model, record.dynamics
    for body in model.bodies:
        if not is_zero(body.mass):
            may_vanish = model.value(body.mass) == 0.0
            node = d.value(body.mass)
            found.append(Check(f"mass of {body.name}", node.index, may_vanish))
        for entry, word in zip(body.inertia_com[:3], ("xx", "yy", "zz"), strict=False):
            if not is_zero(entry):
                what = f" {word}" if model.dimensions == 3 else ""
                about = f"inertia_com{what} of {body.name}"
                found.append(Check(about, d.value(entry).index, may_vanish=True))
    return found
