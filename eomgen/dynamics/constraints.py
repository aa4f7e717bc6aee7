"""Forward dynamics under constraints: loops, and whatever else restricts the motion of the tree.

With J the matrix of the constraints' rates by the velocities, ġ = J v + drift, the multipliers λ
follow from g̈ = 0 (range-space method; Featherstone 2008, 8.5):

    M v̇ + h = F + Jᵀ λ,    J v̇ + β = 0,    A λ = -(J v̇₀ + β),    A = J M⁻¹ Jᵀ

v̇₀ is the acceleration without constraints, β is g̈ at v̇ = 0. M⁻¹ is applied by the recursion of the
route, so that the tree's mass matrix is not needed. A has a row for each constraint. It is
symmetric, and positive definite if these are independent; its factors L D Lᵀ are written out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from eomgen.dynamics.loads import generalised, power_of
from eomgen.dynamics.mechanism_state import MechanismState, Values
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.constraints.base import Row

Forward = Callable[[Sequence[Scalar] | None], list[Scalar]]
"""v̇ (nv,) under the effects and further generalised forces (nv,), or None for none."""
Response = Callable[[Sequence[Scalar]], list[Scalar]]
"""M⁻¹ f (nv,) of generalised forces f."""


def rows_of(d: MechanismState) -> list[Row]:
    """The rows of all constraints but those that follow from others, in the order of the model's
    `rows`.
    """
    found = [row for constraint in d.model.constraints for row in constraint.rows(d)]
    names = [name for name, _ in d.model.every_row]
    return [row for name, row in zip(names, found, strict=True) if name not in d.model.dropped]


@dataclass(frozen=True, eq=False)
class Held:
    """The constraints of a mechanism at a state, with A factored.

    jacobian   J, a row (nv,) for each constraint
    responses  M⁻¹ Jᵀ, a column (nv,) for each
    factors    of A
    """

    rows: Sequence[Row]
    jacobian: Sequence[Sequence[Scalar]]
    responses: Sequence[Sequence[Scalar]]
    factors: "Factored"
    scalars: Scalars

    def impulses(self, residuals: Sequence[Scalar]) -> list[Scalar]:
        """λ with A λ = -residuals."""
        return self.factors.solved([-x for x in residuals])

    def changed(self, by: Sequence[Scalar], impulses: Sequence[Scalar]) -> list[Scalar]:
        """`by` + M⁻¹ Jᵀ λ."""
        found = list(by)
        for impulse, response in zip(impulses, self.responses, strict=True):
            found = [x + impulse * y for x, y in zip(found, response, strict=True)]
        return found


def held(d: MechanismState, response: Response) -> Held:
    """The constraints at a state; `response` applies M⁻¹."""
    rows = rows_of(d)
    jacobian = [generalised(d, row.loads)[: d.nv] for row in rows]
    responses = [response(row) for row in jacobian]
    count = range(len(rows))
    matrix = [[inner(jacobian[i], responses[j], d.scalars) for j in count[: i + 1]] for i in count]
    names = [name for name, _ in d.model.rows]
    return Held(rows, jacobian, responses, factored(matrix, names, d.scalars), d.scalars)


def constrained(d: MechanismState, forward: Forward, response: Response) -> Forward:
    """Forward dynamics under the constraints, from that without them."""

    def found(tau: Sequence[Scalar] | None) -> list[Scalar]:
        free = forward(tau)
        at = held(d, response)
        return at.changed(free, _multipliers(d, at, free))

    return found


def multipliers(d: MechanismState, forward: Forward, response: Response) -> list[Scalar]:
    """The multipliers λ of the rows under the effects, N or N m; `forward` has no constraints."""
    return _multipliers(d, held(d, response), forward(None))


def _multipliers(d: MechanismState, at: Held, free: Sequence[Scalar]) -> list[Scalar]:
    bend = accelerations_at_rest(d)
    return at.impulses(
        [inner(row, free, d.scalars) + b for row, b in zip(at.jacobian, bend, strict=True)]
    )


def residuals(d: MechanismState) -> list[Scalar]:
    """g of each row, m or rad; 0 for a row of velocities alone."""
    return [d.scalars.number(0.0) if row.residual is None else row.residual for row in rows_of(d)]


def rates(d: MechanismState) -> list[Scalar]:
    """ġ of each row, m/s or rad/s."""
    found = []
    for row in rows_of(d):
        rate = power_of(d, row.loads)
        found.append(rate if row.drift is None else rate + row.drift)
    return found


def accelerations_at_rest(d: MechanismState) -> list[Scalar]:
    """β: the second derivative of each g at v̇ = 0, by dual numbers along q̇ and t."""
    model, values, scalars = d.model, d.values, d.scalars
    dual, one = Duals(scalars), scalars.number(1.0)
    moving = Values(
        {name: dual.still(x) for name, x in values.parameters.items()},
        {name: dual.still(x) for name, x in values.inputs.items()},
        [Dual(x, rate) for x, rate in zip(values.q, position_rates(d), strict=True)],
        [dual.still(x) for x in values.v],
        {name: dual.still(x) for name, x in values.states.items()},
        Dual(values.time, one),
    )
    return [rate.rate for rate in rates(MechanismState(model, moving, dual, d.axes))]


def position_rates(d: MechanismState, v: Sequence[Scalar] | None = None) -> list[Scalar]:
    """q̇ for velocities `v`, by default those of the state: the velocity of each coordinate, or
    ½ q ∘ ω for a quaternion q, with ω in body axes.
    """
    q, v = d.values.q, d.values.v if v is None else v
    rates: list[Scalar] = []
    half = d.scalars.number(0.5)
    for index in d.model.joint_indices:
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


def projected_position(d: MechanismState, response: Response) -> list[Scalar]:
    """q after one Newton step towards g = 0, the nearest in the metric of M."""
    at = held(d, response)
    still = [d.scalars.number(0.0)] * d.nv
    step = position_rates(d, at.changed(still, at.impulses(residuals(d))))
    return [x + dx for x, dx in zip(d.values.q, step, strict=True)]


def projected_velocity(d: MechanismState, response: Response) -> list[Scalar]:
    """v with ġ = 0, the nearest in the metric of M."""
    at = held(d, response)
    return at.changed(d.values.v, at.impulses(rates(d)))


# The factors of A.


@dataclass(frozen=True, eq=False)
class Factored:
    """A = L D Lᵀ with unit lower triangular L; entries of L that are 0 are left out."""

    d: Sequence[Scalar]
    lower: Sequence[dict[int, Scalar]]

    def solved(self, right: Sequence[Scalar]) -> list[Scalar]:
        """x with A x = right."""
        x = list(right)
        for i, row in enumerate(self.lower):
            for j, entry in row.items():
                x[i] = x[i] - entry * x[j]
        x = [a / d for a, d in zip(x, self.d, strict=True)]
        for i in reversed(range(len(x))):
            for j, entry in self.lower[i].items():
                x[j] = x[j] - entry * x[i]
        return x


def factored(
    matrix: Sequence[Sequence[Scalar]], names: Sequence[str], scalars: Scalars
) -> Factored:
    """The factors of a symmetric positive definite matrix, given by its lower triangle."""
    pivots: list[Scalar] = []
    lower: list[dict[int, Scalar]] = []
    for i, row in enumerate(matrix):
        work = list(row)
        own: dict[int, Scalar] = {}
        for j in range(i):
            for k, entry in lower[j].items():
                if k in own:
                    work[j] = work[j] - own[k] * pivots[k] * entry
            if not scalars.is_zero(work[j]):
                own[j] = work[j] / pivots[j]
                work[i] = work[i] - own[j] * work[j]
        lower.append(own)
        pivots.append(scalars.named(work[i], f"pivot_{names[i]}"))
    return Factored(pivots, lower)


def inner(a: Sequence[Scalar], b: Sequence[Scalar], scalars: Scalars) -> Scalar:
    """a · b without terms that are 0."""
    total: Scalar | None = None
    for x, y in zip(a, b, strict=True):
        if not (scalars.is_zero(x) or scalars.is_zero(y)):
            total = x * y if total is None else total + x * y
    return scalars.number(0.0) if total is None else total
