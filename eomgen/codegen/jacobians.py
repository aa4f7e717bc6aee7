"""Matrices of derivatives of the state's derivative, by state, inputs or parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from eomgen.codegen.recording import Recording
from eomgen.codegen.system import LARGEST_JACOBIAN, OutputNodes, names_of_inputs
from eomgen.dynamics.tree.composite import Entries, solved
from eomgen.dynamics.tree.sensitivity import Sensitivity, sensitivity
from eomgen.dynamics.tree.vectors import sub, zeros
from eomgen.program.differentiate import jacobian, substituted, tangent
from eomgen.program.tape import Node, Stage
from eomgen.tables.outputs import DERIVATIVES
from eomgen.tables.routes import ROUTES


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

    A matrix of more than `LARGEST_JACOBIAN` operations is computed along directions.
    """
    found = Matrices()
    asked = [name for name in record.model.outputs if name in DERIVATIVES]
    for name in (*["jacobian"] * with_jacobian, *asked):
        by = _variables(record, name)
        before = len(record.tape.steps)
        rows = _matrix(record, name) if _is_small(record, name) else None
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
        columns = _state_columns(record)
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


def forward_derivatives(
    record: Recording, tau: Sequence[Node]
) -> tuple[list[list[Node]], list[list[Node]], list[list[Node]]]:
    """The columns of the derivatives of accelerations under generalised forces `tau` beside the
    effects: by position and velocity as in `inverse_derivatives`, and by `tau`.
    """
    found, tape = record.forward(tau), record.tape
    if _differentiated(record):
        by = [*record.q, *record.v, *tau]
        columns = list(zip(*jacobian(found, by), strict=True))
        nq, nv = len(record.q), len(record.v)
        along = _along_velocities(record, columns[:nq])
        return along, [list(c) for c in columns[nq:][:nv]], [list(c) for c in columns[nq + nv :]]
    zero, one = tape.constant(0.0), tape.constant(1.0)
    rows, factors = range(len(record.v)), record.dynamics.factors
    by_position, by_velocity = (
        [solved(factors, [zero - x for x in column]) for column in columns]
        for columns in inverse_derivatives(record, found)
    )
    units = ([one if i == j else zero for i in rows] for j in rows)
    return by_position, by_velocity, [solved(factors, unit) for unit in units]


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


def _state_columns(record: Recording) -> list[list[Node]]:
    """The columns of ∂τ/∂y at fixed accelerations, for a state y = [q, v, x].

    `sensitivity` differentiates by a small rotation δ in body axes; for a quaternion q the chain
    rule takes δ = (2/|q|²) Im(q* dq).
    """
    model, tape = record.model, record.tape
    slopes = _slopes(record, record.vd)
    nv, zero, two = len(record.v), tape.constant(0.0), tape.constant(2.0)

    def column(entries: Entries, j: int) -> list[Node]:
        return [entries.get((i, j), zero) for i in range(nv)]

    columns: list[list[Node]] = []
    for index in model.joint_indices:
        columns += [column(slopes.by_position, j) for _, j in index.plain if j < nv]
        if not index.quaternion:
            continue
        w, x, y, z = (record.q[i] for i in index.quaternion)
        k = two / (w * w + x * x + y * y + z * z)
        rotations = [column(slopes.by_position, j) for j in index.spin]
        for signs in ((-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w)):
            weights = [k * sign for sign in signs]
            columns.append(
                [
                    weights[0] * a + weights[1] * b + weights[2] * c
                    for a, b, c in zip(*rotations, strict=True)
                ]
            )
    columns += [column(slopes.by_velocity, j) for j in range(nv)]
    return columns + [[zero] * nv for _ in record.x]
