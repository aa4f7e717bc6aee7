"""Kinematics of the bodies: the joint constraint, differentiated twice (handout (18)-(23))."""

from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.symbols import Expr, Symbols, Vec, add, rotate, scale
from eomgen.model.model import Model
from eomgen.scene.joints import Joint


@dataclass(frozen=True)
class Kinematics:
    """The motion of every body in terms of its parent's.

    `angle`, `omega`, `alpha` are sums of coordinates, velocities and accelerations along the path
    to the world. `position` is (21), x_B = x_A + r_A - r_B, with x_A the parent's own symbol;
    `velocity` and `acceleration` are its derivatives (22), (23). `arm_parent` and `arm_child` are
    r_A and r_B in world axes (18), (19).
    """

    angle: tuple[Expr, ...]
    omega: tuple[Expr, ...]
    alpha: tuple[Expr, ...]
    arm_parent: tuple[Vec, ...]
    arm_child: tuple[Vec, ...]
    position: tuple[Vec, ...]
    velocity: tuple[Vec, ...]
    acceleration: tuple[Vec, ...]


def differentiate_joints(model: Model, symbols: Symbols) -> Kinematics:
    """State each joint's constraint as functions of time and let SymPy differentiate it twice."""
    t = sp.Symbol("t", real=True)
    moving = dict.fromkeys((*symbols.q, *symbols.x, *symbols.y))
    functions = {s: sp.Function(f"{s.name}__of_t", real=True)(t) for s in moving}
    rates = {
        **dict(zip(symbols.q, zip(symbols.v, symbols.a, strict=True), strict=True)),
        **dict(zip(symbols.x, zip(symbols.xd, symbols.xdd, strict=True), strict=True)),
        **dict(zip(symbols.y, zip(symbols.yd, symbols.ydd, strict=True), strict=True)),
    }

    def at_an_instant(expression: Expr) -> Expr:
        """Functions of time and their derivatives as plain symbols, highest derivative first."""
        for order in (2, 1):
            expression = expression.xreplace(
                {sp.Derivative(f, (t, order)): rates[s][order - 1] for s, f in functions.items()}
            )
        return expression.xreplace({f: s for s, f in functions.items()})

    angles: list[Expr] = []
    arms_parent: list[Vec] = []
    arms_child: list[Vec] = []
    positions: list[Vec] = []
    zero = sp.Integer(0)
    for body, last in zip(model.bodies, model.angle_index, strict=True):
        q = [functions[s] for s in symbols.q[last + 1 - len(body.positions) : last + 1]]
        base = angles[body.parent] if body.parent >= 0 else zero
        angle = base + q[-1]
        if not body.joint.holds:
            r_parent, r_child, position = (zero, zero), (zero, zero), (q[0], q[1])
        else:
            parent = (zero, zero)
            if body.parent >= 0:
                parent = (functions[symbols.x[body.parent]], functions[symbols.y[body.parent]])
            r_parent = rotate(_vector(symbols, body.joint, "r_parent"), base)
            r_child = rotate(_vector(symbols, body.joint, "r_child"), angle)
            position = add(parent, add(r_parent, scale(-1, r_child)))
        angles.append(angle)
        arms_parent.append(r_parent)
        arms_child.append(r_child)
        positions.append(position)

    def derivative(order: int) -> tuple[Vec, ...]:
        return tuple(
            (at_an_instant(sp.diff(x, t, order)), at_an_instant(sp.diff(y, t, order)))
            for x, y in positions
        )

    def instant(vectors: list[Vec]) -> tuple[Vec, ...]:
        return tuple((at_an_instant(x), at_an_instant(y)) for x, y in vectors)

    return Kinematics(
        angle=tuple(at_an_instant(angle) for angle in angles),
        omega=tuple(at_an_instant(sp.diff(angle, t)) for angle in angles),
        alpha=tuple(at_an_instant(sp.diff(angle, t, 2)) for angle in angles),
        arm_parent=instant(arms_parent),
        arm_child=instant(arms_child),
        position=instant(positions),
        velocity=derivative(1),
        acceleration=derivative(2),
    )


def _vector(symbols: Symbols, joint: Joint, field: str) -> Vec:
    x, y = getattr(joint, field)
    return (symbols.value(x), symbols.value(y))
