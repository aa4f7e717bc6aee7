"""The joints as constraints on the poses of bodies, differentiated twice by SymPy.

Vectors have three components in the axes of the body they belong to; ' is the derivative of
components. A point that is fixed in axes turning at ω moves by r' + ω x r.

    joint's axes   world_R_joint = world_R_parent E
    rotation       world_R_child = world_R_joint Q(q)
    constraint     x_child + r_child = x_parent + r_parent + E s(q)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import sympy as sp

from eomgen.derivation.projected.symbols import Ledger, Symbols, rate, real, triple
from eomgen.derivation.symbols import Expr
from eomgen.language.formula import Formula
from eomgen.model.model import Body, Model
from eomgen.model.orientation import rows_of, turns_of
from eomgen.scalars.exact import Real, direction, orientation, quarters, radians
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Primitive


@dataclass(frozen=True)
class MotionSymbols:
    """Symbols of one body's motion in its own axes.

    `omega`, `velocity`: angular velocity and velocity of the centre of mass; `alpha`,
    `acceleration`: their derivatives in the world.
    """

    omega: Expr
    velocity: Expr
    alpha: Expr
    acceleration: Expr


@dataclass(frozen=True)
class Constraint:
    """One body's joint, and its motion by that of its parent.

    `axes` is E and `rotation` Q; `reach` runs from the parent's centre of mass to the joint's point
    on the child in the joint's axes, `arm` from the child's to it in the child's. `relative_omega`
    is the angular velocity relative to the parent. `axis_angle` is the coordinate axis and the
    angle of the whole rotation E Q, if it has one. The last four fields are the components of `own`
    over the symbols of `parent`, of `own` before them, of coordinates, and of v and v̇.
    """

    axes: Expr
    rotation: Expr
    reach: Expr
    arm: Expr
    relative_omega: Expr
    axis_angle: tuple[Expr, Expr] | None
    parent: MotionSymbols
    own: MotionSymbols
    omega: Expr
    velocity: Expr
    alpha: Expr
    acceleration: Expr


def state_joints(model: Model, symbols: Symbols, ledger: Ledger) -> tuple[Constraint, ...]:
    """State every joint's constraint and differentiate it; long rotations get definitions."""
    found: list[Constraint] = []
    at_rest = MotionSymbols(*(sp.zeros(3, 1) for _ in range(4)))
    starts = zip(model.bodies, model.first_position, model.first_velocity, strict=True)
    for body, i, j in starts:
        q = symbols.q[i : i + len(body.positions)]
        v = symbols.v[j : j + len(body.velocities)]
        a = symbols.a[j : j + len(body.velocities)]
        parent = found[body.parent].own if body.parent >= 0 else at_rest
        words = ("omega", "u", "alpha", "a")
        own = MotionSymbols(*(triple(word, body.name) for word in words))
        ledger.rates.update(zip(v, a, strict=True))
        ledger.rates.update(zip(own.omega, own.alpha, strict=True))
        found.append(_differentiated(body, model, symbols, q, v, parent, own, ledger))
    return tuple(found)


def _differentiated(
    body: Body,
    model: Model,
    symbols: Symbols,
    q: Sequence[Expr],
    v: Sequence[Expr],
    parent: MotionSymbols,
    own: MotionSymbols,
    ledger: Ledger,
) -> Constraint:
    joint = body.joint
    axes, r_parent, arm = sp.eye(3), sp.zeros(3, 1), sp.zeros(3, 1)
    if joint.holds:
        axes = fixed_axes(joint, symbols)
        r_parent, arm = symbols.vector(joint.r_parent), symbols.vector(joint.r_child)
    primitives = joint.primitives(model.dimensions)
    rotation, relative_omega, slide = _relative_motion(body.name, primitives, q, v, symbols, ledger)
    if primitives and not all(_simple(primitive) for primitive in primitives):
        rotation = _entries(body.name, rotation, relative_omega, ledger)
    inward, back = axes.T, rotation.T
    reach = inward * r_parent + slide
    base = inward * parent.omega

    def in_joint(vector: Expr) -> Expr:
        return rate(vector, ledger.rates) + base.cross(vector)

    def in_child(vector: Expr) -> Expr:
        return rate(vector, ledger.rates) + own.omega.cross(vector)

    moved = in_joint(reach)
    omega = back * base + relative_omega
    return Constraint(
        axes=axes,
        rotation=rotation,
        reach=reach,
        arm=arm,
        relative_omega=relative_omega,
        axis_angle=_axis_angle_of(joint, primitives, q, symbols, model.dimensions),
        parent=parent,
        own=own,
        omega=omega,
        velocity=back * (inward * parent.velocity + moved) - in_child(arm),
        alpha=rate(omega, ledger.rates),
        acceleration=back * (inward * parent.acceleration + in_joint(moved))
        - in_child(in_child(arm)),
    )


class Quantities(Protocol):
    """The symbols of quantities and of fixed numbers."""

    def value(self, formula: Formula) -> Expr:
        """A quantity."""

    def number(self, value: Real) -> Expr:
        """A number."""


def fixed_axes(joint: Joint, symbols: Quantities) -> Expr:
    """The axes of a joint at q = 0 in its parent's, by numbers or by formulas of parameters."""
    if joint.orientation is None:
        fixed = orientation(joint.orientation_deg)
        return sp.Matrix([[symbols.number(entry) for entry in row] for row in fixed])
    rows = rows_of(joint.orientation)
    if len(rows) == 3:
        return sp.Matrix([[symbols.value(part) for part in row] for row in rows])
    if len(rows[0]) == 4:
        q = [symbols.value(part) for part in rows[0]]
        return of_quaternion(q, 2 / sum(x**2 for x in q))
    axes = sp.eye(3)
    for k, turn in turns_of(rows[0]):
        if isinstance(turn, tuple):
            axes = axes * sp.Matrix([[symbols.number(x) for x in row] for row in turn])
        else:
            axes = axes * about(sp.Matrix([int(i == k) for i in range(3)]), symbols.value(turn))
    return axes


def _relative_motion(
    name: str,
    primitives: Sequence[Primitive],
    q: Sequence[Expr],
    v: Sequence[Expr],
    symbols: Symbols,
    ledger: Ledger,
) -> tuple[Expr, Expr, Expr]:
    """Rotation, angular velocity in the rotated axes, and displacement of a sequence of primitives;
    also registers q'.
    """
    rotation, relative_omega, slide = sp.eye(3), sp.zeros(3, 1), sp.zeros(3, 1)
    q, v = list(q), list(v)
    for primitive in primitives:
        if primitive.kind == "spherical":
            w, x, y, z = q[:4]
            a, b, c = v[:3]
            half = sp.Rational(1, 2)
            ledger.rates[w] = -half * (x * a + y * b + z * c)
            ledger.rates[x] = half * (w * a + y * c - z * b)
            ledger.rates[y] = half * (w * b + z * a - x * c)
            ledger.rates[z] = half * (w * c + x * b - y * a)
            # |q|² is constant, so k has no rate.
            k = ledger.define(real(f"k__{name}"), 2 / (w**2 + x**2 + y**2 + z**2))
            rotated_by, spin = of_quaternion(q[:4], k), sp.Matrix(v[:3])
            rotation, relative_omega = rotation * rotated_by, rotated_by.T * relative_omega + spin
            q, v = q[4:], v[3:]
            continue
        ledger.rates[q[0]] = v[0]
        axis = sp.Matrix([symbols.number(part) for part in direction(primitive.axis)])
        if primitive.kind == "prismatic":
            slide += rotation * axis * q[0]
        else:
            rotated_by = about(axis, q[0])
            rotation, relative_omega = (
                rotation * rotated_by,
                rotated_by.T * relative_omega + axis * v[0],
            )
        q, v = q[1:], v[1:]
    return rotation, relative_omega, slide


def _axis_angle_of(
    joint: Joint,
    primitives: Sequence[Primitive],
    q: Sequence[Expr],
    symbols: Symbols,
    dimensions: int,
) -> tuple[Expr, Expr] | None:
    """Coordinate axis and angle of a joint whose rotations are all about one axis; angle 0 if none.

    Angles about one axis add, also over several joints.
    """
    axis, angle = sp.zeros(3, 1), sp.Integer(0)
    degrees = joint.orientation_deg
    if joint.orientation is not None:
        if dimensions == 3:
            return None
        axis, angle = sp.Matrix([0, 0, 1]), symbols.value(rows_of(joint.orientation)[0][0])
    elif dimensions == 2 and not isinstance(degrees, tuple) and degrees != 0.0:
        count, rest = quarters(radians(degrees))
        axis, angle = sp.Matrix([0, 0, 1]), count * sp.pi / 2 + symbols.number(rest)
    elif degrees not in (0.0, (0.0, 0.0, 0.0)):
        return None
    for primitive, coordinate in zip(primitives, q, strict=False):  # a spin has four
        if primitive.kind == "prismatic":
            continue
        along = sp.Matrix([int(part != 0) for part in primitive.axis])
        if not _simple(primitive) or (any(axis) and along != axis):
            return None
        sign = sum(symbols.number(part) for part in direction(primitive.axis))
        axis, angle = along, angle + sign * coordinate
    return axis, angle


def _simple(primitive: Primitive) -> bool:
    """Whether each entry of a primitive's rotation has at most one sine or cosine, as for prismatic
    primitives and rotations about coordinate axes.
    """
    along = sum(part != 0.0 for part in primitive.axis) == 1
    return primitive.kind == "prismatic" or (primitive.kind == "revolute" and along)


def _entries(name: str, rotation: Expr, relative_omega: Expr, ledger: Ledger) -> Expr:
    """A rotation by symbols for its entries, whose rates are those of Q' = Q [ω]x."""
    symbols = sp.Matrix(3, 3, lambda i, j: real(f"R__{name}__{'xyz'[i]}{'xyz'[j]}"))
    symbols = symbols.applyfunc(
        lambda s: rotation[_position(s)] if rotation[_position(s)].is_Atom else s
    )
    for i in range(3):
        for j in range(3):
            if symbols[i, j] != rotation[i, j]:
                ledger.define(symbols[i, j], rotation[i, j])
    rates = symbols * hat(relative_omega)
    for i in range(3):
        for j in range(3):
            if symbols[i, j] != rotation[i, j]:
                ledger.rates[symbols[i, j]] = rates[i, j]
    return symbols


def _position(symbol: Expr) -> tuple[int, int]:
    row, column = symbol.name[-2:]
    return "xyz".index(row), "xyz".index(column)


def about(axis: Expr, angle: Expr) -> Expr:
    """The rotation about a unit vector: n nᵀ + cos (1 - n nᵀ) + sin [n]x.

    1 - n_x² is n_y² + n_z², of which nothing cancels where n is nearly x.
    """
    along = axis * axis.T
    x, y, z = (along[i, i] for i in range(3))
    across = sp.diag(y + z, x + z, x + y) + sp.diag(x, y, z) - along
    return along + sp.cos(angle) * across + sp.sin(angle) * hat(axis)


def hat(a: Expr) -> Expr:
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
