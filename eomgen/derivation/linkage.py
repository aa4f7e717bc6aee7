"""A mechanism's joints over symbols: rotations, what primitives do, and derivatives by time.

Rotations take vectors of a body's axes to its parent's. All derivations read the joints here; they
differ in what they do with them.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol

import sympy as sp

from eomgen.derivation.symbols import Expr
from eomgen.language.formula import Formula
from eomgen.model.bodies import Body
from eomgen.model.orientation import rows_of, turns_of
from eomgen.scalars.exact import Real, direction, orientation, quarters, radians
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Primitive


class Quantities(Protocol):
    """The symbols of quantities and of fixed numbers."""

    def value(self, formula: Formula) -> Expr:
        """A quantity."""

    def number(self, value: Real) -> Expr:
        """A number."""


def rate(e: Expr, rates: Mapping[Expr, Expr]) -> Expr:
    """Time derivative of an expression or vector; symbols without a rate are constant. A sum that a
    function depends on stays one: cos(θ + φ) gives -(θ̇ + φ̇) sin(θ + φ).
    """
    if isinstance(e, sp.MatrixBase):
        return e.applyfunc(lambda x: rate(x, rates))
    if not rates.keys() & e.free_symbols:
        return sp.S.Zero
    if e.is_Symbol:
        return rates[e]
    if e.is_Add:
        return sp.Add(*(rate(x, rates) for x in e.args))
    if e.is_Mul:
        factors = list(e.args)
        terms = [(i, rate(x, rates)) for i, x in enumerate(factors)]
        products = (sp.Mul(*factors[:i], x, *factors[i + 1 :]) for i, x in terms if x != 0)
        return sp.Add(*products)
    if isinstance(e, sp.Function) and len(e.args) == 1:
        return e.fdiff() * rate(e.args[0], rates)
    moving = sorted((s for s in e.free_symbols if s in rates), key=str)
    return sp.Add(*(sp.diff(e, s) * rates[s] for s in moving))


def quaternion_rates(q: Sequence[Expr], spin: Sequence[Expr]) -> tuple[Expr, ...]:
    """½ q ∘ ω of w, x, y, z, with ω in the rotated axes."""
    w, x, y, z = q
    a, b, c = spin
    half = sp.Rational(1, 2)
    return (
        -half * (x * a + y * b + z * c),
        half * (w * a + y * c - z * b),
        half * (w * b + z * a - x * c),
        half * (w * c + x * b - y * a),
    )


def quaternion_scale(q: Sequence[Expr]) -> Expr:
    """2/|q|², by which a quaternion of any length gives a rotation; it has no rate."""
    return 2 / sum(x**2 for x in q)


def primitive_motion(
    primitive: Primitive, q: Sequence[Expr], scale: Expr, quantities: Quantities
) -> tuple[Expr, Expr, Expr]:
    """Rotation, displacement and axis of a joint primitive at its coordinates; `scale` is that of
    a quaternion.
    """
    origin = sp.zeros(3, 1)
    if primitive.kind == "spherical":
        return of_quaternion(q, scale), origin, origin
    axis = sp.Matrix([quantities.number(part) for part in direction(primitive.axis)])
    if primitive.kind == "prismatic":
        return sp.eye(3), axis * q[0], axis
    return about(axis, q[0]), origin, axis


def fixed_axes(joint: Joint, quantities: Quantities) -> Expr:
    """The axes of a joint at q = 0 in its parent's, by numbers or by formulas of parameters."""
    if joint.orientation is None:
        fixed = orientation(joint.orientation_deg)
        return sp.Matrix([[quantities.number(entry) for entry in row] for row in fixed])
    rows = rows_of(joint.orientation)
    if len(rows) == 3:
        return sp.Matrix([[quantities.value(part) for part in row] for row in rows])
    if len(rows[0]) == 4:
        q = [quantities.value(part) for part in rows[0]]
        return of_quaternion(q, quaternion_scale(q))
    axes = sp.eye(3)
    for k, turn in turns_of(rows[0]):
        if isinstance(turn, tuple):
            axes = axes * sp.Matrix([[quantities.number(x) for x in row] for row in turn])
        else:
            axes = axes * about(sp.Matrix([int(i == k) for i in range(3)]), quantities.value(turn))
    return axes


def fixed_angle(joint: Joint, quantities: Quantities) -> Expr:
    """The angle of a joint's axes at q = 0 from its parent's, in the plane."""
    if joint.orientation is not None:
        return quantities.value(rows_of(joint.orientation)[0][0])
    count, rest = quarters(radians(joint.orientation_deg))
    return count * sp.pi / 2 + quantities.number(rest)


def vector(parts: tuple[Formula, ...], quantities: Quantities) -> Expr:
    """A vector with two or three components as one with three."""
    x, y, *z = (quantities.value(part) for part in parts)
    return sp.Matrix([x, y, *(z or [0])])


def inertia_of(body: Body, quantities: Quantities) -> Expr:
    """Inertia about the centre of mass, body axes; in the plane only about z."""
    entries = [quantities.value(entry) for entry in body.inertia_com]
    if len(entries) == 1:
        return sp.diag(0, 0, entries[0])
    xx, yy, zz, xy, xz, yz = entries
    return sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def about(axis: Expr, angle: Expr) -> Expr:
    """The rotation about a unit vector: n nᵀ + cos (1 - n nᵀ) + sin [n]x.

    1 - n_x² is n_y² + n_z², of which nothing cancels where n is nearly x.
    """
    along = axis * axis.T
    x, y, z = (along[i, i] for i in range(3))
    across = sp.diag(y + z, x + z, x + y) + sp.diag(x, y, z) - along
    return along + sp.cos(angle) * across + sp.sin(angle) * hat(axis)


def hat(a: Sequence[Expr]) -> Expr:
    """The matrix of a x."""
    x, y, z = a
    return sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def of_quaternion(q: Sequence[Expr], k: Expr) -> Expr:
    """The rotation of w, x, y, z with k = 2/|q|²: 1 + k (w [v]x + [v]x²), whatever its length."""
    w, x, y, z = q
    return sp.Matrix(
        [
            [1 - k * (y**2 + z**2), k * (x * y - w * z), k * (x * z + w * y)],
            [k * (x * y + w * z), 1 - k * (x**2 + z**2), k * (y * z - w * x)],
            [k * (x * z - w * y), k * (y * z + w * x), 1 - k * (x**2 + y**2)],
        ]
    )
