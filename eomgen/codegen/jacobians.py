"""Matrices of derivatives of the state's derivative, by state, inputs or parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import LARGEST_JACOBIAN, OutputNodes, names_of_inputs
from eomgen.dynamics.tree.composite import Entries, solved
from eomgen.dynamics.tree.sensitivity import Sensitivity, sensitivity
from eomgen.dynamics.tree.slopes import ForwardSlopes
from eomgen.dynamics.tree.vectors import sub, zeros
from eomgen.program.differentiate import jacobian, substituted, tangent
from eomgen.program.program import Output, cost, finish
from eomgen.program.tape import Node, Stage
from eomgen.tables.outputs import DERIVATIVES
from eomgen.tables.routes import ROUTES

Columns = list[list[Node]]
"""A matrix by its columns."""


@dataclass
class Matrices:
    """Nodes of matrices of derivatives, the directions that some take as extra inputs, and the
    names of these, whose nodes are the product with the direction instead of all entries.
    """

    nodes: OutputNodes = field(default_factory=dict)
    extra: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def tangents(self) -> frozenset[str]:
        """Names of the matrices that are computed along directions."""
        return frozenset(self.extra)


def matrices(record: Recording, *, with_jacobian: bool) -> Matrices:
    """The matrices of derivatives that the model asks for, and the Jacobian `with_jacobian`.

    A matrix of more than `LARGEST_JACOBIAN` operations is computed along directions. Before that, a
    Jacobian by the state is tried by the recursion for derivatives of accelerations.
    """
    found = Matrices()
    asked = [name for name in record.model.outputs if name in DERIVATIVES]
    for name in (*["jacobian"] * with_jacobian, *asked):
        by = _variables(record, name)
        before = len(record.tape.steps)
        rows = None
        if _is_small(record, name):
            rows = _matrix(record, name)
        elif name == "jacobian" and not _differentiated(record) and _recursion_is_small(record):
            rows = _by_recursion(record)
        steps = len(record.tape.steps) - before
        if rows is None or (_differentiated(record) and steps > LARGEST_JACOBIAN):
            rows, found.extra[name] = _along_direction(record, by)
        shape = (len(record.rates), len(by))
        found.nodes[name] = (shape, [node for row in rows for node in row])
    return found


def _variables(record: Recording, name: str) -> list[Node]:
    """The variables of a matrix of derivatives: state, inputs or parameters."""
    return {
        "jacobian": record.state,
        "input_jacobian": list(record.inputs.values()),
        "parameter_jacobian": list(record.parameters.values()),
    }[name]


def _differentiated(record: Recording) -> bool:
    """Whether the steps that compute v̇ are differentiated; those of constraints always are."""
    return ROUTES[record.route].differentiated or bool(record.model.constraints)


def _is_small(record: Recording, name: str) -> bool:
    """Whether a matrix takes at most `LARGEST_JACOBIAN` operations entry by entry, by an estimate:
    the products of inverse dynamics, and the solution with the factors of M for each column.
    """
    pairs, columns = sum(record.model.carriers), len(_variables(record, name))
    products = 100 if record.model.dimensions == 3 else 20
    operations = 4 * pairs * columns + products * pairs
    return max(operations, columns * len(record.rates)) <= LARGEST_JACOBIAN


def _recursion_is_small(record: Recording) -> bool:
    """The same of the recursion for derivatives of accelerations: each column takes all axes once,
    and more those on the way to the root.
    """
    nv, space = len(record.v), record.model.dimensions == 3
    own, each, carrier = (150, 12, 70) if space else (40, 7, 25)
    operations = 2 * nv * (own + each * nv) + carrier * sum(record.model.carriers)
    return operations <= LARGEST_JACOBIAN


def _along_direction(
    record: Recording, by: Sequence[Node]
) -> tuple[list[list[Node]], tuple[str, ...]]:
    """The directional derivative of the rates, and the names of the direction's components.

    The steps that compute v̇ are differentiated. To differentiate inverse dynamics and to solve for
    ∂v̇ takes a sixth less, but forces are then summed over bodies before accelerations are known,
    and a light limb on a heavy body loses two to three digits.
    """
    directions = [record.input(f"d__{node.step.value}", Stage.INPUTS) for node in by]
    seeds = {x.index: d for x, d in zip(by, directions, strict=True)}
    return [[node] for node in tangent(record.rates, seeds)], names_of_inputs(directions)


def _matrix(record: Recording, name: str) -> list[list[Node]]:
    """A matrix of derivatives of the rates, row by row.

    Unless the route's own steps are differentiated, inverse dynamics is, at the accelerations
    found, and M ∂v̇ = -∂τ is solved with the factors of M.
    """
    d, tape = record.dynamics, record.tape
    zero = tape.constant(0.0)
    by = _variables(record, name)
    if _differentiated(record):
        return jacobian(record.rates, by)
    factors = d.factors
    applied = jacobian(d.applied_force, by)
    if name == "jacobian":
        slopes, nv = _slopes(record, record.vd), range(len(record.v))
        columns = _state_columns(
            record,
            [[slopes.by_position.get((i, j), zero) for i in nv] for j in nv],
            [[slopes.by_velocity.get((i, j), zero) for i in nv] for j in nv],
        )
    elif name == "parameter_jacobian":
        # Accelerations as inputs, so that the steps that compute them are not differentiated.
        inputs = record.velocity_inputs("vd")
        accelerations = {x.index: vd for x, vd in zip(inputs, record.vd, strict=True)}
        rows = [substituted(row, accelerations) for row in jacobian(d.inverse(inputs), by)]
        columns = [list(column) for column in zip(*rows, strict=True)]
    else:
        columns = [[zero] * len(record.v) for _ in by]
    solutions = [
        solved(factors, [row[k] - part for row, part in zip(applied, column, strict=True)])
        for k, column in enumerate(columns)
    ]
    middle = [list(row) for row in zip(*solutions, strict=True)] or [[] for _ in record.v]
    above = jacobian(record.position_rates, by)
    return [*above, *middle, *jacobian(d.state_rates, by)]


def inverse_derivatives(
    record: Recording, vd: Sequence[Node]
) -> tuple[list[list[Node]], list[list[Node]]]:
    """The columns of the derivatives of inverse dynamics at accelerations `vd`, less the effects':
    by a small motion along each velocity, which of a spherical joint is a small rotation in body
    axes, and by the velocities.
    """
    slopes, nv = _slopes(record, vd), range(len(record.v))
    by_position, by_velocity = _applied_slopes(record)
    zero = record.tape.constant(0.0)

    def less(entries: Entries, applied: list[list[Node]]) -> list[list[Node]]:
        return [[entries.get((i, j), zero) - applied[j][i] for i in nv] for j in nv]

    return less(slopes.by_position, by_position), less(slopes.by_velocity, by_velocity)


def forward_derivatives(record: Recording, tau: Sequence[Node]) -> tuple[Columns, Columns]:
    """The columns of the derivatives of accelerations under generalised forces `tau` beside the
    effects, as in `inverse_derivatives`; by the recursion that takes fewer operations.
    """
    found, nq = record.forward(tau), len(record.q)
    if _differentiated(record):
        rows = jacobian(found, [*record.q, *record.v])
        columns = [list(column) for column in zip(*rows, strict=True)]
        return _along_velocities(record, columns[:nq]), columns[nq:]
    ways = [_by_articulated_bodies(record, found)]
    if _is_small(record, "jacobian"):
        ways.append(_by_factors(record, found))
    return min(ways, key=lambda way: _operations(record, *way))


def inverse_mass_matrix(record: Recording) -> Columns:
    """The columns of M⁻¹; with constraints of what keeps them. By fewer operations, too."""
    zero, one = record.tape.constant(0.0), record.tape.constant(1.0)
    nv, d = range(len(record.v)), record.dynamics
    units = [[one if i == j else zero for i in nv] for j in nv]
    if _differentiated(record):
        return [d.response(record.route)(unit) for unit in units]
    slopes = _forward_slopes(record, record.vd)
    ways = [[slopes.by_force(j) for j in nv], [solved(d.factors, unit) for unit in units]]
    lower = ([[c[min(i, j)][max(i, j)] for i in nv] for j in nv] for c in ways)
    return min(lower, key=lambda way: _operations(record, way))


def _by_articulated_bodies(record: Recording, vd: Sequence[Node]) -> tuple[Columns, Columns]:
    """The columns of the derivatives of accelerations `vd` by their own recursion."""
    by_position, by_velocity = _accelerating(record, vd)
    of_forces = _applied_slopes(record)
    return (
        _with_forces(record, by_position, of_forces[0]),
        _with_forces(record, by_velocity, of_forces[1]),
    )


def _with_forces(record: Recording, columns: Columns, forces: Columns) -> Columns:
    """Columns of accelerations, with those by columns of generalised forces."""
    found = []
    for column, force in zip(columns, forces, strict=True):
        if not all(map(record.scalars.is_zero, force)):
            more = solved(record.dynamics.factors, force)
            column = [x + y for x, y in zip(column, more, strict=True)]
        found.append(column)
    return found


def _by_factors(record: Recording, vd: Sequence[Node]) -> tuple[Columns, Columns]:
    """The same by derivatives of inverse dynamics and the factors of M."""
    zero, factors = record.tape.constant(0.0), record.dynamics.factors
    by_position, by_velocity = (
        [solved(factors, [zero - x for x in column]) for column in columns]
        for columns in inverse_derivatives(record, vd)
    )
    return by_position, by_velocity


def _operations(record: Recording, *matrices: Columns) -> int:
    """The operations of matrices."""
    nodes = tuple(x.index for columns in matrices for column in columns for x in column)
    program = finish(record.tape, {"": Output((len(nodes),), nodes)}, ())
    return cost(program, "")["total"]


def _accelerating(record: Recording, vd: Sequence[Node]) -> tuple[Columns, Columns]:
    """The columns of the derivatives of accelerations without those of applied forces."""
    slopes = _forward_slopes(record, vd)
    pairs = [slopes.columns_by(j) for j in range(len(record.v))]
    return [first for first, _ in pairs], [second for _, second in pairs]


def _forward_slopes(record: Recording, vd: Sequence[Node]) -> ForwardSlopes:
    d = record.dynamics
    base, moving = sub(zeros(record.scalars), d.down), d.accelerating(vd)
    nv = len(record.v)
    return ForwardSlopes(d.kinematics, d.felt[1], moving, base, nv, record.scalars)


def _by_recursion(record: Recording) -> list[list[Node]]:
    """The Jacobian by the state, row by row, by the recursion for derivatives of accelerations."""
    d, by = record.dynamics, record.state
    columns = _state_columns(record, *_accelerating(record, record.vd))
    forces = [list(column) for column in zip(*jacobian(d.applied_force, by), strict=True)]
    middle = [list(row) for row in zip(*_with_forces(record, columns, forces), strict=True)]
    return [*jacobian(record.position_rates, by), *middle, *jacobian(d.state_rates, by)]


def _applied_slopes(record: Recording) -> tuple[list[list[Node]], list[list[Node]]]:
    """The columns of the derivatives of applied forces, as in `inverse_derivatives`."""
    rows = jacobian(record.dynamics.applied_force, [*record.q, *record.v])
    columns = [list(column) for column in zip(*rows, strict=True)]
    nq = len(record.q)
    return _along_velocities(record, columns[:nq]), columns[nq:]


def _along_velocities(record: Recording, columns: Sequence[Sequence[Node]]) -> list[list[Node]]:
    """Derivatives by small motions along the velocities, from those by the coordinates: a rotation
    δ in body axes is dq = ½ q (0, δ) for a quaternion q.
    """
    nv, half = len(record.v), record.tape.constant(0.5)
    found: list[list[Node]] = [[] for _ in range(nv)]
    for index in record.model.joint_indices:
        for i, j in index.plain:
            if j < nv:
                found[j] = list(columns[i])
        if not index.quaternion:
            continue
        w, x, y, z = (half * record.q[i] for i in index.quaternion)
        parts = [columns[i] for i in index.quaternion]
        for j, weights in zip(
            index.spin, ((-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w)), strict=True
        ):
            found[j] = [
                sum((k * part for k, part in zip(weights, row, strict=True)), half - half)
                for row in zip(*parts, strict=True)
            ]
    return found


def _slopes(record: Recording, vd: Sequence[Node]) -> Sensitivity:
    """Derivatives of inverse dynamics without effects at accelerations."""
    d = record.dynamics
    base = sub(zeros(record.scalars), d.down)
    twists, accelerating = d.motion_in_world(vd)
    return sensitivity(d.inertias_in_world, twists, accelerating, base, record.scalars)


def _state_columns(
    record: Recording, by_position: Columns, by_velocity: Columns
) -> list[list[Node]]:
    """The columns of derivatives by a state y = [q, v, x], from those by small motions along the
    velocities, of a spherical joint a small rotation δ in body axes, and by v. For a quaternion q
    the chain rule takes δ = (2/|q|²) Im(q* dq).
    """
    model, tape = record.model, record.tape
    nv, zero, two = len(record.v), tape.constant(0.0), tape.constant(2.0)
    columns: list[list[Node]] = []
    for index in model.joint_indices:
        columns += [by_position[j] for _, j in index.plain if j < nv]
        if not index.quaternion:
            continue
        w, x, y, z = (record.q[i] for i in index.quaternion)
        k = two / (w * w + x * x + y * y + z * z)
        rotations = [by_position[j] for j in index.spin]
        for signs in ((-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w)):
            weights = [k * sign for sign in signs]
            columns.append(
                [
                    weights[0] * a + weights[1] * b + weights[2] * c
                    for a, b, c in zip(*rotations, strict=True)
                ]
            )
    columns += by_velocity
    return columns + [[zero] * nv for _ in record.x]
