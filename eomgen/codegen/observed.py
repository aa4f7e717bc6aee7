"""Builders of outputs: from a recording the nodes of an output, in C order.

`tables.outputs` names the builder of each.
"""

from collections.abc import Callable, Sequence

from eomgen.codegen.constraints import constraint_loads
from eomgen.codegen.recording import Recording
from eomgen.dynamics.reactions import reactions
from eomgen.dynamics.tree import observables
from eomgen.dynamics.tree.composite import full
from eomgen.dynamics.tree.loads import generalised
from eomgen.dynamics.tree.motion import Twist
from eomgen.dynamics.tree.vectors import Vec, in_space, zeros
from eomgen.program import differentiate
from eomgen.program.tape import Node


def forward_dynamics(record: Recording, tau: Sequence[Node]) -> list[Node]:
    """Accelerations under generalised forces `tau` in addition to the effects."""
    return record.forward(tau)


def inverse_dynamics(record: Recording, vd: Sequence[Node]) -> list[Node]:
    """Generalised forces for accelerations `vd`, in addition to the effects."""
    pairs = zip(record.dynamics.inverse(vd), record.dynamics.applied_force, strict=True)
    return [needed - applied for needed, applied in pairs]


def mass_matrix(record: Recording) -> list[Node]:
    """M, row by row."""
    return full(record.dynamics.mass_entries, len(record.v), record.scalars)


def velocity_force(record: Recording) -> list[Node]:
    """V of M v̇ + V + G = F."""
    return record.dynamics.bias(weightless=True)


def gravity_force(record: Recording) -> list[Node]:
    """G of M v̇ + V + G = F."""
    return record.dynamics.bias(still=True)


def bias_force(record: Recording) -> list[Node]:
    """h = V + G."""
    return record.dynamics.bias()


def applied_force(record: Recording) -> list[Node]:
    """F of M v̇ + V + G = F."""
    return record.dynamics.applied_force


def kinetic_energy(record: Recording) -> list[Node]:
    """Kinetic energy, J."""
    return [record.dynamics.kinetic_energy]


def potential_energy(record: Recording) -> list[Node]:
    """Potential energy, J."""
    return [record.dynamics.potential_energy]


def kinetic_slopes(record: Recording) -> list[Node]:
    """Derivatives of the kinetic energy by the coordinates."""
    return differentiate.jacobian([record.dynamics.kinetic_energy], record.q)[0]


def effect_powers(record: Recording) -> list[Node]:
    """The power of each effect, W."""
    return [record.dynamics.power(effect) for effect in record.model.effects]


def effect_forces(record: Recording) -> list[Node]:
    """Jᵀ f of each effect's loads, row by row; of drives 0."""
    d = record.dynamics
    rows = [generalised(d, effect.loads(d)) for effect in record.model.effects]
    return [x for row in rows for x in row[: len(record.v)]]


def coordinates(record: Recording) -> list[Node]:
    """All coordinates."""
    return list(record.q)


def velocities(record: Recording) -> list[Node]:
    """All velocities."""
    return list(record.v)


def accelerations(record: Recording) -> list[Node]:
    """All accelerations."""
    return list(record.vd)


def momentum(record: Recording) -> list[Node]:
    """Momentum and angular momentum about the world's origin."""
    d = record.dynamics
    p, about = observables.momentum(d.kinematics, d.origins, d.twists, record.scalars)
    return [p[0], p[1], about[2]] if record.model.dimensions == 2 else [*p, *about]


def centre_of_mass(record: Recording) -> list[Node]:
    """The centre of mass of all bodies, m."""
    d = record.dynamics
    centre = observables.centre_of_mass(d.linkage, d.kinematics, d.origins, record.scalars)
    return list(centre[: record.model.dimensions])


def joint_forces(record: Recording) -> list[Node]:
    """Force and moment of each joint on its parent."""
    rows = [
        (f.force[0], f.force[1], f.moment[2])
        if record.model.dimensions == 2
        else (*f.force, *f.moment)
        for f in reactions(record.dynamics, record.vd, constraint_loads(record))
    ]
    return [x for row in rows for x in row]


def driving_forces(record: Recording) -> list[Node]:
    """Driving force or torque of each driven coordinate."""
    return record.dynamics.driving_forces


def body_poses(record: Recording) -> list[Node]:
    """Place and angle of each body, or the rows of its axes and place."""
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


def body_velocities(record: Recording) -> list[Node]:
    """Velocity of each centre of mass, and angular velocity."""
    count = len(record.model.bodies)
    moved = [_velocity(record, k, zeros(record.scalars)) for k in range(count)]
    if record.model.dimensions == 2:
        return [x for u, w in moved for x in (u[0], u[1], w[2])]
    return [x for u, w in moved for x in (*u, *w)]


def point_positions(record: Recording) -> list[Node]:
    """World position of each named point, m."""
    return of_points(record, _point_position)


def point_velocities(record: Recording) -> list[Node]:
    """World velocity of each named point, m/s."""
    return of_points(record, _point_velocity)


def point_jacobians(record: Recording) -> list[Node]:
    """Jacobian of the velocity of each named point."""
    return of_points(record, _point_jacobian)


def _velocity(record: Recording, body: int, at: Vec) -> tuple[Vec, Vec]:
    d = record.dynamics
    return observables.velocity(d.linkage, d.kinematics, d.twists, body, at, record.scalars)


def of_points(record: Recording, of: Callable[[Recording, int, Vec], Sequence[Node]]) -> list[Node]:
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
    columns = frame_jacobian(record, body, at)
    return [column.linear[i] for i in range(record.model.dimensions) for column in columns]


def frame_jacobian(record: Recording, body: int, at: Vec) -> list[Twist]:
    """The motion of a point that one of each velocity gives, in world axes."""
    d, nv = record.dynamics, len(record.v)
    return observables.frame_jacobian(
        d.linkage, d.kinematics, d.origins, body, at, nv, record.scalars
    )
