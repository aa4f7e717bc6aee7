"""Builders of outputs of robotics: Jacobians of frames and their rates, momentum about the centre
of mass, operational space, the Coriolis matrix, the regressor, derivatives of dynamics.

As in `observed`, each returns from a recording the nodes of an output, in C order.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain

from eomgen.base.errors import SceneError
from eomgen.codegen.jacobians import forward_derivatives, inverse_derivatives
from eomgen.codegen.jacobians import inverse_mass_matrix as inverse_mass_columns
from eomgen.codegen.observed import frame_jacobian, of_points
from eomgen.codegen.recording import Recording
from eomgen.dynamics.regressor import InertialParameter, regressor
from eomgen.dynamics.tree import observables
from eomgen.dynamics.tree.composite import inverse
from eomgen.dynamics.tree.motion import Twist, accelerations
from eomgen.dynamics.tree.sensitivity import coriolis
from eomgen.dynamics.tree.vectors import Vec, add, cross, sub, times, transposed, zeros
from eomgen.program.tape import Node
from eomgen.tables.outputs import IN_PLANE, IN_SPACE


def _frame_jacobians(record: Recording, where: str) -> list[Node]:
    def rows(record: Recording, body: int, at: Vec) -> list[Node]:
        given = _given_in(record, body, at, where)
        columns = [given(column) for column in frame_jacobian(record, body, at)]
        return [x for row in zip(*columns, strict=True) for x in row]

    return of_points(record, rows)


def _frame_bias_accelerations(record: Recording, where: str) -> list[Node]:
    d, scalars = record.dynamics, record.scalars
    still = zeros(scalars)
    moving = accelerations(d.kinematics, d.twists, d.v, d.with_driven(None), still, scalars)

    def entries(record: Recording, body: int, at: Vec) -> list[Node]:
        found = observables.acceleration(d.linkage, d.kinematics, moving, body, at, scalars)
        if where:  # spatial accelerations, of points fixed in space (Featherstone 2008, 2.11)
            velocity, spin = d.point_velocity(body, at)
            found = Twist(found.angular, sub(found.linear, cross(spin, velocity)))
        return _given_in(record, body, at, where)(found)

    return of_points(record, entries)


frame_jacobians = partial(_frame_jacobians, where="")
frame_jacobians_local = partial(_frame_jacobians, where="local")
frame_jacobians_world = partial(_frame_jacobians, where="world")
frame_bias_accelerations = partial(_frame_bias_accelerations, where="")
frame_bias_accelerations_local = partial(_frame_bias_accelerations, where="local")
frame_bias_accelerations_world = partial(_frame_bias_accelerations, where="world")


def _given_in(record: Recording, body: int, at: Vec, where: str) -> Callable[[Twist], list[Node]]:
    """What gives motions of a point, in world axes, as in `tables.outputs.FRAMES`."""
    d, planar = record.dynamics, record.model.dimensions == 2

    def given(motion: Twist) -> list[Node]:
        angular, linear = motion.angular, motion.linear
        if where == "local":
            axes = observables.orientation(d.linkage, d.kinematics, body, record.scalars)
            angular, linear = (times(transposed(axes), x) for x in (angular, linear))
        elif where == "world":
            linear = add(linear, cross(d.point_position(body, at), angular))
        return [linear[0], linear[1], angular[2]] if planar else [*linear, *angular]

    return given


def _by_velocity(record: Recording) -> list[tuple[Vec, Vec]]:
    d, scalars = record.dynamics, record.scalars
    centre = observables.centre_of_mass(d.linkage, d.kinematics, d.origins, scalars)
    return observables.centroidal_momentum(d.kinematics, d.origins, centre, len(record.v), scalars)


def centre_of_mass_jacobian(record: Recording) -> list[Node]:
    """Jacobian of the centre of mass: momenta over the mass."""
    mass = record.scalars.number(0.0)
    for mount in record.dynamics.linkage.mounts:
        mass = mass + mount.mass
    columns = _by_velocity(record)
    return [p[i] / mass for i in range(record.model.dimensions) for p, _ in columns]


def centroidal_momentum_matrix(record: Recording) -> list[Node]:
    """Momentum and angular momentum about the centre of mass, by the velocities."""
    planar = record.model.dimensions == 2
    columns = [
        (p[0], p[1], about[2]) if planar else (*p, *about) for p, about in _by_velocity(record)
    ]
    return [x for row in zip(*columns, strict=True) for x in row]


def operational_mobilities(record: Recording) -> list[Node]:
    """J M⁻¹ Jᵀ of each named point; with constraints, that of what keeps them."""
    return [x for rows in _mobilities(record) for row in rows for x in row]


def operational_inertias(record: Recording) -> list[Node]:
    """The inverses of the mobilities.

    Raises `SceneError` for a point that cannot move in all ways.
    """
    ways = 6 if record.model.dimensions == 3 else 3
    is_zero = record.scalars.is_zero
    for point in record.model.points:
        columns = frame_jacobian(record, point.body, zeros(record.scalars))
        moved = sum(not all(map(is_zero, (*c.linear, *c.angular))) for c in columns)
        if moved < ways:
            raise SceneError(
                f"outputs: 'operational_inertias' needs {ways} velocities that move a point, and "
                f"'{point.name}' has {moved}; take 'operational_mobilities'"
            )
    inverses = [inverse(rows, record.scalars) for rows in _mobilities(record)]
    return [x for rows in inverses for row in rows for x in row]


def _mobilities(record: Recording) -> list[list[list[Node]]]:
    respond = record.dynamics.response(record.route)
    found: list[list[list[Node]]] = []

    def mobility(record: Recording, body: int, at: Vec) -> list[Node]:
        given = _given_in(record, body, at, "")
        columns = [given(column) for column in frame_jacobian(record, body, at)]
        rows = [list(row) for row in zip(*columns, strict=True)]
        responses = [respond(row) for row in rows]
        zero = record.scalars.number(0.0)
        upper = [
            [
                sum((x * y for x, y in zip(row, column, strict=True)), zero)
                for column in responses[i:]
            ]
            for i, row in enumerate(rows)
        ]
        n = range(len(rows))
        found.append([[upper[min(i, j)][abs(i - j)] for j in n] for i in n])
        return []

    of_points(record, mobility)
    return found


def coriolis_matrix(record: Recording) -> list[Node]:
    """C, row by row."""
    d, nv = record.dynamics, len(record.v)
    twists, _ = d.motion_in_world(record.vd)
    entries, zero = coriolis(d.in_world, twists, record.scalars), record.scalars.number(0.0)
    return [entries.get((i, j), zero) for i in range(nv) for j in range(nv)]


def inertial_regressor(record: Recording, vd: Sequence[Node]) -> list[Node]:
    """Y, by rows: bodies by their parameters."""
    names = IN_SPACE if record.model.dimensions == 3 else IN_PLANE
    every = [InertialParameter(body.name, name) for body in record.model.bodies for name in names]
    columns = regressor(record.dynamics, vd, every)
    return [x for row in zip(*columns, strict=True) for x in row]


def inverse_dynamics_derivatives(record: Recording, vd: Sequence[Node]) -> list[Node]:
    """∂τ/∂q along the velocities, and ∂τ/∂v."""
    return _by_rows(*inverse_derivatives(record, vd))


def forward_dynamics_derivatives(record: Recording, tau: Sequence[Node]) -> list[Node]:
    """∂v̇/∂q along the velocities, and ∂v̇/∂v."""
    return _by_rows(*forward_derivatives(record, tau))


def inverse_mass_matrix(record: Recording) -> list[Node]:
    """M⁻¹, row by row."""
    return _by_rows(inverse_mass_columns(record))


def _by_rows(*matrices: Sequence[Sequence[Node]]) -> list[Node]:
    """Matrices, each given by its columns, one after the other row by row."""
    rows = chain.from_iterable(zip(*columns, strict=True) for columns in matrices)
    return [x for row in rows for x in row]
