"""Kinematics of the bodies: the joint constraint, differentiated twice (handout (18)-(23))."""

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from eomgen.derivation.handout.symbols import (
    BodySymbols,
    Vec,
    add,
    over_bodies,
    over_coordinates,
    rotate,
    scale,
)
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.rotations import rate
from eomgen.derivation.symbols import Expr
from eomgen.model.model import Model


@dataclass(frozen=True)
class Kinematics:
    """The motion of every body of a model in terms of its parent's.

    `angle`, `omega`, `alpha` are sums of coordinates, velocities and accelerations along the path
    to the world. `position` is (21), x_B = x_A + r_A - r_B, with x_A the parent's own symbol;
    `velocity` and `acceleration` are its derivatives (22), (23). `arm_parent` and `arm_child` are
    r_A and r_B in world axes (18), (19).
    """

    model: Model
    symbols: BodySymbols
    angle: tuple[Expr, ...]
    omega: tuple[Expr, ...]
    alpha: tuple[Expr, ...]
    arm_parent: tuple[Vec, ...]
    arm_child: tuple[Vec, ...]
    position: tuple[Vec, ...]
    velocity: tuple[Vec, ...]
    acceleration: tuple[Vec, ...]

    @property
    def inertial(self) -> tuple[tuple[Vec, Expr], ...]:
        """m ẍ and I ψ̈ of every body."""
        s = self.symbols
        forces = [(m * x, m * y) for m, x, y in zip(s.mass, s.xdd, s.ydd, strict=True)]
        torques = [i * alpha for i, alpha in zip(s.inertia, self.alpha, strict=True)]
        return tuple(zip(forces, torques, strict=True))

    @cached_property
    def inward(self) -> dict[Expr, Expr]:
        """Coordinates and their derivatives by those of the bodies."""
        return over_bodies(self.model, self.symbols)

    @cached_property
    def outward(self) -> dict[Expr, Expr]:
        """The inverse."""
        return over_coordinates(self.model, self.symbols)


def differentiate_joints(model: Model, symbols: BodySymbols) -> Kinematics:
    """State each joint's constraint, and differentiate it twice."""
    rates: dict[Expr, Expr] = {}
    for orders in ((symbols.q, symbols.v, symbols.a), (symbols.x, symbols.xd, symbols.xdd),
                   (symbols.y, symbols.yd, symbols.ydd)):  # fmt: skip
        rates |= zip((*orders[0], *orders[1]), (*orders[1], *orders[2]), strict=True)
    angles: list[Expr] = []
    arms: list[tuple[Vec, Vec]] = []
    positions: list[Vec] = []
    for body, joint in zip(model.bodies, linkage_of(model, symbols).joints, strict=True):
        base, above = sp.S.Zero, (sp.S.Zero, sp.S.Zero)
        if body.parent >= 0:
            base, above = angles[body.parent], (symbols.x[body.parent], symbols.y[body.parent])
        angles.append(base + sum(frame.angle for frame in joint))
        x, y, _ = sum((frame.slid for frame in joint), sp.zeros(3, 1))
        r_parent = rotate(tuple(joint[0].start[:2]), base)
        r_child = rotate(tuple(-joint[-1].centre[:2, :]), angles[-1])
        arms.append((r_parent, r_child))
        positions.append(add((x, y), add(above, add(r_parent, scale(-1, r_child)))))
    omegas = [rate(angle, rates) for angle in angles]
    velocities = [_rates(r, rates) for r in positions]
    return Kinematics(
        model,
        symbols,
        angle=tuple(angles),
        omega=tuple(omegas),
        alpha=tuple(rate(omega, rates) for omega in omegas),
        arm_parent=tuple(arm for arm, _ in arms),
        arm_child=tuple(arm for _, arm in arms),
        position=tuple(positions),
        velocity=tuple(velocities),
        acceleration=tuple(_rates(v, rates) for v in velocities),
    )


def _rates(vector: Vec, rates: dict[Expr, Expr]) -> Vec:
    return rate(vector[0], rates), rate(vector[1], rates)
