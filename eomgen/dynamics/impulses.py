"""Contact forces, and the impulses of an impact.

An impact takes no time: the coordinates stay, and impulses p along the contact's normal n and
tangents t change the velocities by M⁻¹ Jᵀ p. Here u = J v are the normal velocity, positive apart,
and the slip velocities. With A = J M⁻¹ Jᵀ and restitution e the law is that of A. Chatterjee and
A. Ruina, "A new algebraic rigid-body collision law based on impulse space considerations", J. Appl.
Mech. 65 (1998) 939-951, without tangential restitution:

    p = (1 + e) p_I + κ (p_II - p_I),    p_I = -(u_n / A_nn) n,    p_II = -A⁻¹ u,

where p_I ends the approach without friction, and p_II ends the slip too. κ is 1, or less if |p_t|
<= μ p_n requires it: p_I has no tangential part, so that κ = μ (1 + e) p_I,n / (|d_t| - μ d_n) with
d = p_II - p_I. The normal velocity becomes -e u_n whatever the friction, and for 0 <= e <= 1
kinetic energy never grows. A contact that sticks has no slip before it rebounds. The rebound has no
friction, and leaves the slip -e u_n A_tn / A_nn.
"""

from collections.abc import Sequence

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.tree.loads import AnyLoad, generalised, scaled
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.scene.effects.base import Contact, Load

LEAST = 1e-300
"""The least denominator: where it is used the numerator is 0, or the quotient is not used."""
IMMOVABLE = 1e-12
"""Along a direction whose part of A is at most this, the mechanism cannot move: it is rounding."""


def rough(d: Dynamics, contact: Contact) -> tuple[tuple[Load, ...], ...]:
    """The tangents along which friction acts; none without friction."""
    return () if d.scalars.is_zero(contact.friction) else contact.tangents


def pressed(d: Dynamics, contact: Contact, force: Scalar) -> tuple[list[AnyLoad], Scalar]:
    """The loads of a normal force on a contact with its friction, and their power, W.

    Friction is -μ force s / sqrt(s·s + slip_speed²) along the tangents, s the slip velocities.
    """
    loads, power = scaled(contact.normal, force), force * d.power_of(contact.normal)
    tangents = rough(d, contact)
    slips = [d.power_of(tangent) for tangent in tangents]
    if slips:
        speed = _root([*slips, contact.slip_speed], d.scalars)
        drag = contact.friction * force / speed
        for tangent, slip in zip(tangents, slips, strict=True):
            loads += scaled(tangent, -(drag * slip))
            power = power - drag * (slip * slip)
    return loads, power


def struck(
    d: Dynamics,
    directions: Sequence[Sequence[AnyLoad]],
    restitution: Scalar,
    friction: Scalar,
    route: str,
) -> list[Scalar]:
    """The velocities (nv,) after an impact along a normal and its tangents.

    `directions` are the loads of a unit impulse along each, the normal first.
    """
    scalars = d.scalars
    jacobian = [generalised(d, loads) for loads in directions]
    respond = d.response(route)
    responses = [respond(row[: d.nv]) for row in jacobian]
    n = len(directions)
    inverse_mass: list[list[Scalar]] = [[None] * n for _ in range(n)]
    for i in range(n):
        for j in range(i, n):
            inverse_mass[i][j] = inverse_mass[j][i] = _dot(
                jacobian[i][: d.nv], responses[j], scalars
            )
    speeds = [_dot(row, d.v[: d.moved], scalars) for row in jacobian]
    found = list(d.values.v)
    for p, along in zip(
        impulses(inverse_mass, speeds, restitution, friction, scalars), responses, strict=True
    ):
        found = [v + p * change for v, change in zip(found, along, strict=True)]
    return found


def impulses(
    inverse_mass: Sequence[Sequence[Scalar]],
    speeds: Sequence[Scalar],
    restitution: Scalar,
    friction: Scalar,
    scalars: Scalars,
) -> list[Scalar]:
    """The impulses p for A, u, e and μ: the normal, then none, one or two tangents.

    Directions across the normal along which the mechanism cannot move take no impulse. Never NaN.
    """
    A, u = inverse_mass, speeds
    across = range(1, len(u))
    zero, least = scalars.number(0.0), scalars.number(LEAST)
    against = scalars.call("max", A[0][0], least)
    plastic = -(u[0] / against)
    bounced = (scalars.number(1.0) + restitution) * plastic
    if not across:
        return [bounced]
    lean = [A[0][i] / against for i in across]
    # After p_I: the slip, and the inverse mass along the tangents at normal velocity 0.
    slip = [u[i] + A[0][i] * plastic for i in across]
    rest = [[A[i][j] - lean[i - 1] * A[0][j] for j in across] for i in across]
    floor = scalars.number(IMMOVABLE) * _sum([A[i][i] for i in across], scalars)
    stick = [-x for x in _least_solution(rest, slip, floor, scalars)]
    normal = -_dot(lean, stick, scalars)
    most = scalars.call("max", friction * bounced, zero)
    excess = _root(stick, scalars) - friction * normal
    share = most / scalars.call("max", scalars.call("max", excess, most), least)
    return [bounced + share * normal, *(share * x for x in stick)]


def _least_solution(
    matrix: Sequence[Sequence[Scalar]], right: Sequence[Scalar], floor: Scalar, scalars: Scalars
) -> list[Scalar]:
    """The shortest least-squares solution of S x = b, for S of one or two rows, symmetric and
    positive semidefinite. Eigenvalues up to `floor` count as 0.
    """
    zero, least = scalars.number(0.0), scalars.number(LEAST)
    if len(right) == 1:
        quotient = right[0] / scalars.call("max", matrix[0][0], least)
        return [scalars.call("select", matrix[0][0] - floor, quotient, zero)]
    ((a, b), (_, c)), (x, y) = matrix, right
    trace, determinant = a + c, a * c - b * b
    # λ₁ λ₂ > floor (λ₁ + λ₂): both are above it. Of rank one, S = λ e eᵀ has S / λ² for inverse.
    full = determinant - floor * trace
    over = scalars.call("max", scalars.call("select", full, determinant, trace * trace), least)
    tops = [(c * x - b * y, a * x + b * y), (a * y - b * x, b * x + c * y)]
    quotients = [scalars.call("select", full, *pair) / over for pair in tops]
    return [scalars.call("select", trace - floor, quotient, zero) for quotient in quotients]


def _root(parts: Sequence[Scalar], scalars: Scalars) -> Scalar:
    """|a|, at least 1e-150, so that it can be divided by."""
    square = _dot(parts, parts, scalars)
    return scalars.call("sqrt", scalars.call("max", square, scalars.number(LEAST)))


def _dot(a: Sequence[Scalar], b: Sequence[Scalar], scalars: Scalars) -> Scalar:
    return _sum([x * y for x, y in zip(a, b, strict=True)], scalars)


def _sum(parts: Sequence[Scalar], scalars: Scalars) -> Scalar:
    total = scalars.number(0.0)
    for part in parts:
        total = total + part
    return total
