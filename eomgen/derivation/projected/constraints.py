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

from eomgen.derivation.definitions import Ledger, triple
from eomgen.derivation.linkage import Frame, Linkage
from eomgen.derivation.rotations import hat, quaternion_rates, rate
from eomgen.derivation.symbols import Expr, Symbols, real


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


def state_joints(linkage: Linkage, symbols: Symbols, ledger: Ledger) -> tuple[Constraint, ...]:
    """State every joint's constraint and differentiate it; long rotations get definitions."""
    found: list[Constraint] = []
    at_rest = MotionSymbols(*(sp.zeros(3, 1) for _ in range(4)))
    ledger.rates.update(zip(symbols.v, symbols.a, strict=True))
    for body, joint in zip(linkage.model.bodies, linkage.joints, strict=True):
        parent = found[body.parent].own if body.parent >= 0 else at_rest
        own = MotionSymbols(*(triple(word, body.name) for word in ("omega", "u", "alpha", "a")))
        ledger.rates.update(zip(own.omega, own.alpha, strict=True))
        planar = linkage.model.dimensions == 2
        found.append(_differentiated(body.name, joint, parent, own, ledger, planar=planar))
    return tuple(found)


def _differentiated(
    name: str,
    joint: Sequence[Frame],
    parent: MotionSymbols,
    own: MotionSymbols,
    ledger: Ledger,
    *,
    planar: bool,
) -> Constraint:
    rotation, relative_omega, slide = _relative_motion(name, joint, ledger)
    if not all(_simple(frame) for frame in joint):
        rotation = _entries(name, rotation, relative_omega, ledger)
    axes, arm = joint[0].axes, -joint[-1].centre
    inward, back = axes.T, rotation.T
    reach = inward * joint[0].start + slide
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
        axis_angle=_axis_angle_of(joint, planar=planar),
        parent=parent,
        own=own,
        omega=omega,
        velocity=back * (inward * parent.velocity + moved) - in_child(arm),
        alpha=rate(omega, ledger.rates),
        acceleration=back * (inward * parent.acceleration + in_joint(moved))
        - in_child(in_child(arm)),
    )


def _relative_motion(name: str, joint: Sequence[Frame], ledger: Ledger) -> tuple[Expr, Expr, Expr]:
    """Rotation, angular velocity in the rotated axes, and displacement by all primitives of a
    joint; also registers q'.
    """
    rotation, relative_omega, slide = sp.eye(3), sp.zeros(3, 1), sp.zeros(3, 1)
    for frame in joint:
        turned = frame.turned
        if frame.kind == "spherical":
            ((scale, value),) = frame.defined
            turned = turned.xreplace({scale: ledger.define(real(f"k__{name}"), value)})
            ledger.rates.update(zip(frame.q, quaternion_rates(frame.q, frame.v), strict=True))
        else:
            ledger.rates.update(zip(frame.q, frame.v, strict=True))
        slide += rotation * frame.slid
        rotation, relative_omega = rotation * turned, turned.T * relative_omega + frame.spin
    return rotation, relative_omega, slide


def _axis_angle_of(joint: Sequence[Frame], *, planar: bool) -> tuple[Expr, Expr] | None:
    """Coordinate axis and angle of a joint whose rotations are all about one axis; angle 0 if none.

    Angles about one axis add, also over several joints.
    """
    axis, angle = sp.zeros(3, 1), sp.Integer(0)
    if planar:
        angle = sum((frame.angle for frame in joint), angle)
        return (sp.Matrix([0, 0, 1]) if angle != 0 else axis), angle
    if joint[0].axes != sp.eye(3):
        return None
    for frame in joint:
        if frame.kind not in ("revolute", "spherical"):
            continue
        along = frame.axis.applyfunc(lambda part: int(part != 0))
        if not _simple(frame) or (any(axis) and along != axis):
            return None
        axis, angle = along, angle + sum(frame.axis) * frame.q[0]
    return axis, angle


def _simple(frame: Frame) -> bool:
    """Whether each entry of a frame's rotation has at most one sine or cosine, as where it slides
    or turns about a coordinate axis.
    """
    along = sum(part != 0 for part in frame.axis) == 1
    return frame.kind in ("prismatic", "fixed") or (frame.kind == "revolute" and along)


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
