"""The joints as constraints on the poses of bodies, differentiated twice by SymPy.

Vectors have three components in the axes of the body they belong to; ' is the derivative of
components. A point that is fixed in axes turning at ω moves by r' + ω x r.

    joint's axes   world_R_joint = world_R_parent E
    rotation       world_R_child = world_R_joint Q(q)
    constraint     x_child + r_child = x_parent + r_parent + E s(q)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.linkage import (
    fixed_angle,
    fixed_axes,
    hat,
    primitive_motion,
    quaternion_rates,
    quaternion_scale,
    rate,
    vector,
)
from eomgen.derivation.projected.ledger import Ledger, triple
from eomgen.derivation.symbols import Expr, Symbols, real
from eomgen.model.model import Body, Model
from eomgen.scalars.exact import direction
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
        r_parent, arm = vector(joint.r_parent, symbols), vector(joint.r_child, symbols)
    primitives = joint.primitives(model.dimensions)
    rotation, relative_omega, slide = _relative_motion(body.name, primitives, q, v, symbols, ledger)
    if primitives and not all(_simple(primitive) for primitive in primitives):
        rotation = _entries(body.name, rotation, relative_omega, ledger)
    inward, back = axes.T, rotation.T
    reach = inward * r_parent + slide
    base = inward * parent.omega

    def in_joint(r: Expr) -> Expr:
        return rate(r, ledger.rates) + base.cross(r)

    def in_child(r: Expr) -> Expr:
        return rate(r, ledger.rates) + own.omega.cross(r)

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
        own, spin, scale = q[:1], v[:1], sp.S.One
        if primitive.kind == "spherical":
            own, spin = q[:4], v[:3]
            scale = ledger.define(real(f"k__{name}"), quaternion_scale(own))
            ledger.rates.update(zip(own, quaternion_rates(own, spin), strict=True))
        else:
            ledger.rates[own[0]] = spin[0]
        rotated_by, moved, axis = primitive_motion(primitive, own, scale, symbols)
        if primitive.kind == "prismatic":
            slide += rotation * moved
        else:
            turning = axis * spin[0] if primitive.kind == "revolute" else sp.Matrix(spin)
            rotation, relative_omega = (
                rotation * rotated_by,
                rotated_by.T * relative_omega + turning,
            )
        q, v = q[len(own) :], v[len(spin) :]
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
        axis, angle = sp.Matrix([0, 0, 1]), fixed_angle(joint, symbols)
    elif dimensions == 2 and not isinstance(degrees, tuple) and degrees != 0.0:
        axis, angle = sp.Matrix([0, 0, 1]), fixed_angle(joint, symbols)
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
