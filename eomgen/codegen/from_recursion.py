"""The recursions run over the tape: the state's derivative and every output a model asks for."""

from collections.abc import Callable, Mapping, Sequence

from eomgen.codegen.contacts import contact_labels, contact_outputs
from eomgen.codegen.system import LARGEST_JACOBIAN, Made, System, output_shape, recorded
from eomgen.dynamics import observables
from eomgen.dynamics.composite import Entries, full, solved
from eomgen.dynamics.dynamics import Dynamics, Forward, Values
from eomgen.dynamics.kinematics import Axes
from eomgen.dynamics.reactions import reactions
from eomgen.dynamics.sensitivity import sensitivity
from eomgen.dynamics.vectors import Vec, in_space, sub, zeros
from eomgen.model.model import Model, is_zero
from eomgen.model.states import velocity_states
from eomgen.outputs import DERIVATIVES
from eomgen.program.differentiate import jacobian, substituted, tangent
from eomgen.program.program import Check
from eomgen.program.scalars import TapeScalars
from eomgen.program.tape import TIME, Node, Stage, Tape
from eomgen.routes import ROUTES


class Recording:
    """A model's dynamics on a tape by a route, and the nodes that are given to it.

    v̇ comes from the recursion of the route, `aba`, `ldl` or `orthogonal`, or from what `forward`
    makes. `axes` are those that the recursion works in, if not the usual ones, `orthogonal` works
    in the frames' own; `tape` is one to begin, if not a plain one.
    """

    def __init__(
        self,
        model: Model,
        route: str,
        forward: Callable[["Recording"], Forward] | None = None,
        axes: Axes | None = None,
        tape: Tape | None = None,
    ) -> None:
        self.model = model
        self.route = route
        self.tape = tape or Tape()
        self.scalars = TapeScalars(self.tape)
        self.parameters = {p.name: self.given(p.name, Stage.PARAMETERS) for p in model.parameters}
        self.q = [self.given(c.name, Stage.POSITIONS) for c in model.coordinates]
        self.v = [self.given(c.name, Stage.VELOCITIES) for c in model.velocities]
        self.inputs = {i.name: self.given(i.name, Stage.INPUTS) for i in model.inputs}
        self.x = [self.given(x.name, Stage.VELOCITIES) for x in model.states]
        extra = {x.name: node for x, node in zip(model.states, self.x, strict=True)}
        time = self.given(TIME, Stage.INPUTS)
        values = Values(self.parameters, self.inputs, self.q, self.v, extra, time)
        own: Axes | None = "own" if ROUTES[route].frame_axes else axes
        self.dynamics = Dynamics(model, values, self.scalars, own)
        self.forward: Forward
        self.forward = self.dynamics.forward(route) if forward is None else forward(self)
        self.vd = self.dynamics.vd = self.forward(None)
        self.position_rates = position_rates(model, self.q, self.v, self.tape)
        self.rates = [*self.position_rates, *self.vd, *self.dynamics.state_rates]

    def given(self, name: str, stage: Stage) -> Node:
        """An input of the program."""
        return self.tape.input(name, stage)

    def beside(self, prefix: str) -> list[Node]:
        """Inputs of an output of its own, one a velocity."""
        names = (f"{prefix}__{c.name}" for c in self.model.velocities)
        return [self.given(name, Stage.INPUTS) for name in names]


def position_rates(model: Model, q: Sequence[Node], v: Sequence[Node], tape: Tape) -> list[Node]:
    """q̇ of every coordinate: its own velocity, or ½ q ∘ ω of a quaternion (ω in its own axes)."""
    rates: list[Node] = []
    half = tape.constant(0.5)
    for index in model.joint_indices:
        rates += [v[j] for _, j in index.plain if j < len(v)]
        if index.quaternion:
            w, x, y, z = (q[i] for i in index.quaternion)
            a, b, c = (half * v[j] for j in index.spin)
            rates += [
                -(x * a + y * b + z * c),
                w * a + y * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y * a,
            ]
    return rates


def from_recursion(record: Recording, *, jacobian: bool = True) -> System:
    """The whole system of a recorded model; with the derivative's Jacobian or without."""
    model = record.model
    ny = len(record.rates)
    tape = record.tape
    extras = (x.initial for x in model.states)
    start = [tape.constant(x) for x in (*model.initial_q, *model.initial_v, *extras)]
    made: Made = {
        "initial_state": ((ny,), start),
        "derivative": ((ny,), record.rates),
    }
    extra: dict[str, tuple[str, ...]] = {}
    tangents: set[str] = set()
    for name in derivatives(model, jacobian):
        by = variables(record, name)
        before, rows = len(tape.steps), _matrix(record, name) if _is_small(record, name) else None
        written = len(tape.steps) - before
        if rows is None or (ROUTES[record.route].differentiated and written > LARGEST_JACOBIAN):
            rows, extra[name] = along_directions(record, by)
            tangents.add(name)
        made[name] = ((ny, len(by)), [node for row in rows for node in row])
    for name in model.outputs:
        if name not in DERIVATIVES:
            made[name] = output(record, name, extra)
    if record.dynamics.contacts:
        more, taken = contact_outputs(
            record.dynamics, tape, record.route, record.forward, record.position_rates
        )
        made, extra = made | more, extra | taken
    return recorded(
        model,
        record.route,
        velocity_states(model),
        tape,
        made,
        checks(record),
        extra,
        frozenset(tangents),
        contact_labels(record.dynamics),
    )


def derivatives(model: Model, jacobian: bool) -> list[str]:
    """Names of the matrices of derivatives that are made of a model."""
    return ["jacobian"] * jacobian + [name for name in model.outputs if name in DERIVATIVES]


def output(
    record: Recording, name: str, extra: dict[str, tuple[str, ...]]
) -> tuple[tuple[int, ...], list[Node]]:
    """Shape and nodes of one output that is no matrix of derivatives."""
    d = record.dynamics
    if name in BESIDE:
        prefix, compute = BESIDE[name]
        given = record.beside(prefix)
        extra[name] = tuple(str(node.step.value) for node in given)
        nodes = compute(record, given)
    elif name in OBSERVED:
        nodes = OBSERVED[name](record)
    else:
        nodes = OF_DYNAMICS[name](d)
    return output_shape(name, record.model), nodes


def _inverse(record: Recording, vd: Sequence[Node]) -> list[Node]:
    pairs = zip(record.dynamics.inverse(vd), record.dynamics.applied_force, strict=True)
    return [needed - applied for needed, applied in pairs]


def _mass_matrix(record: Recording) -> list[Node]:
    return full(record.dynamics.mass_entries, len(record.v), record.scalars)


def _powers(record: Recording) -> list[Node]:
    return [record.dynamics.power(effect) for effect in record.model.effects]


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
        for f in reactions(record.dynamics, record.vd)
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
    """What is asked of each named point, by its body and its position in the body's axes."""
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
"""Outputs that take something beside the state, by what that is called and what computes them."""
OF_DYNAMICS: Mapping[str, Callable[[Dynamics], list[Node]]] = {
    "velocity_force": lambda d: d.bias(weightless=True),
    "gravity_force": lambda d: d.bias(still=True),
    "bias_force": lambda d: d.bias(),
    "applied_force": lambda d: d.applied_force,
    "kinetic_energy": lambda d: [d.kinetic_energy],
    "potential_energy": lambda d: [d.potential_energy],
    "driving_forces": lambda d: d.driving_forces,
}
"""Outputs that the recursions give as they are."""
OBSERVED: Mapping[str, Callable[[Recording], list[Node]]] = {
    "mass_matrix": _mass_matrix,
    "effect_powers": _powers,
    "momentum": _momentum,
    "centre_of_mass": _centre_of_mass,
    "joint_forces": _joint_forces,
    "body_poses": _poses,
    "body_velocities": _velocities,
    "point_positions": lambda record: _points(record, _point_position),
    "point_velocities": lambda record: _points(record, _point_velocity),
    "point_jacobians": lambda record: _points(record, _point_jacobian),
}
"""All other outputs but matrices of derivatives."""


def along_directions(
    record: Recording, by: Sequence[Node]
) -> tuple[list[list[Node]], tuple[str, ...]]:
    """How the rates change along directions of `by`, and the names of those.

    By a recursion, v̇ as M v̇ + V + G = F says: inverse dynamics is differentiated at the
    accelerations found, which takes fewer operations than forward dynamics, and M solved for them.
    """
    directions = [record.given(f"d__{node.step.value}", Stage.INPUTS) for node in by]
    names = tuple(str(d.step.value) for d in directions)
    seeds = {x.index: d for x, d in zip(by, directions, strict=True)}
    if ROUTES[record.route].differentiated:
        return [[node] for node in tangent(record.rates, seeds)], names
    d, inputs = record.dynamics, record.beside("vd")
    found = {x.index: vd for x, vd in zip(inputs, record.vd, strict=True)}
    moved, needed = (tangent(f, seeds) for f in (d.applied_force, d.inverse(inputs)))
    left = [a - b for a, b in zip(moved, substituted(needed, found), strict=True)]
    above, beside = (tangent(f, seeds) for f in (record.position_rates, d.state_rates))
    return [[node] for node in (*above, *d.response(record.route)(left), *beside)], names


def variables(record: Recording, name: str) -> list[Node]:
    """What a matrix of derivatives is taken by: state, inputs or parameters."""
    return {
        "jacobian": [*record.q, *record.v, *record.x],
        "input_jacobian": list(record.inputs.values()),
        "parameter_jacobian": list(record.parameters.values()),
    }[name]


def _is_small(record: Recording, name: str) -> bool:
    """Whether a matrix is worth writing out: its entries, or what its columns take to be solved
    for, are few.
    """
    pairs, columns = sum(record.model.carriers), len(variables(record, name))
    products = 100 if record.model.dimensions == 3 else 20
    operations = 4 * pairs * columns + products * pairs
    return max(operations, columns * len(record.rates)) <= LARGEST_JACOBIAN


def _matrix(record: Recording, name: str) -> list[list[Node]]:
    """∂f by state, inputs or parameters: inverse dynamics is differentiated at the accelerations
    found, and M solved for them, ∂v̇ = -M⁻¹ ∂τ; or else the steps of the route are.
    """
    d, tape = record.dynamics, record.tape
    zero = tape.constant(0.0)
    by = variables(record, name)
    if ROUTES[record.route].differentiated:
        return jacobian(record.rates, by)
    factors = d.factors
    moved = jacobian(d.applied_force, by)
    if name == "jacobian":
        columns = _state_columns(record)
    elif name == "parameter_jacobian":
        # Accelerations as inputs, so that nothing of what they depend on is differentiated.
        inputs = record.beside("vd")
        found = {x.index: vd for x, vd in zip(inputs, record.vd, strict=True)}
        rows = [substituted(row, found) for row in jacobian(d.inverse(inputs), by)]
        columns = [list(column) for column in zip(*rows, strict=True)]
    else:
        columns = [[zero] * len(record.v) for _ in by]
    answers = [
        solved(factors, [row[k] - part for row, part in zip(moved, column, strict=True)])
        for k, column in enumerate(columns)
    ]
    below = [list(row) for row in zip(*answers, strict=True)] or [[] for _ in record.v]
    above = jacobian(record.position_rates, by)
    return [*above, *below, *jacobian(record.dynamics.state_rates, by)]


def _state_columns(record: Recording) -> list[list[Node]]:
    """∂τ/∂q and ∂τ/∂v as columns; small angles of a spin as changes of its quaternion."""
    d, model, tape = record.dynamics, record.model, record.tape
    base = sub(zeros(record.scalars), d.down)
    twists, accelerating = d.motion_in_world(record.vd)
    slopes = sensitivity(d.in_world, twists, accelerating, base, record.scalars)
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
        # δ = (2/|q|²) Im(q* dq): the small angle in own axes that a change of q is.
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


def checks(record: Recording) -> list[Check]:
    """What a user's own parameters must keep: masses and moments of inertia not negative."""
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
