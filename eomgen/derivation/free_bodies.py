"""Each body drawn free: Newton and Euler with unknown joint forces (handout (12)-(17))."""

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.kinematics import Kinematics
from eomgen.derivation.symbols import Expr, Symbols, Vec, add, cross, rotate, scale
from eomgen.effects.base import Load
from eomgen.joints import Free
from eomgen.language.formula import Formula
from eomgen.model import Model

Wrench = tuple[Vec, Expr]
"""Force in world axes at the centre of mass, and torque about z."""


class SymbolicMechanism:
    """The model as effects see it, over SymPy expressions."""

    def __init__(self, model: Model, symbols: Symbols) -> None:
        self._symbols = symbols
        self._joints = {body.joint.name: body.joint for body in model.bodies}
        self.bodies = tuple(body.name for body in model.bodies)

    def mass(self, body: str) -> Expr:
        """Mass symbol of a body."""
        return self._symbols.mass[self.bodies.index(body)]

    def height(self, body: str) -> Expr:
        """World y symbol of a body."""
        return self._symbols.y[self.bodies.index(body)]

    def sides(self, joint: str) -> tuple[str, str]:
        """Parent and child of a joint."""
        return (self._joints[joint].parent, self._joints[joint].child)

    def value(self, formula: Formula) -> Expr:
        """A quantity over parameter symbols."""
        return self._symbols.value(formula)

    def input(self, name: str) -> Expr:
        """Symbol of an input."""
        return self._symbols.inputs[name]


@dataclass(frozen=True)
class FreeBodies:
    """What acts on each body besides its joints, and the free-body equations as (left, right).

    `gravity` and `applied` are the wrenches of the effects; `equations` are three a body: x, y and
    torque about the centre of mass, with the joint forces f_j as unknowns.
    """

    gravity: tuple[Wrench, ...]
    applied: tuple[Wrench, ...]
    equations: tuple[tuple[Expr, Expr], ...]
    potential_energy: Expr


def draw_free_bodies(model: Model, symbols: Symbols, kinematics: Kinematics) -> FreeBodies:
    """Write m ẍ = Σ f and I ψ̈ = Σ r × f for every body.

    The joint force f_j acts on the parent at r_parent, and -f_j on the child at r_child.
    """
    mechanism = SymbolicMechanism(model, symbols)
    loads = [load for effect in model.effects for load in effect.loads(mechanism)]
    gravity = _wrenches(model, kinematics, (load for load in loads if load.kind == "gravity"))
    applied = _wrenches(model, kinematics, (load for load in loads if load.kind == "applied"))
    equations = []
    for k, body in enumerate(model.bodies):
        force, torque = add(gravity[k][0], applied[k][0]), gravity[k][1] + applied[k][1]
        if not isinstance(body.joint, Free):
            reaction = scale(-1, symbols.force[k])
            force = add(force, reaction)
            torque += cross(kinematics.arm_child[k], reaction)
        for c, child in enumerate(model.bodies):
            if child.parent == k:
                force = add(force, symbols.force[c])
                torque += cross(kinematics.arm_parent[c], symbols.force[c])
        equations += [
            (symbols.mass[k] * symbols.xdd[k], force[0]),
            (symbols.mass[k] * symbols.ydd[k], force[1]),
            (symbols.inertia[k] * kinematics.alpha[k], torque),
        ]
    potential = sum((e.potential_energy(mechanism) for e in model.effects), sp.Integer(0))
    return FreeBodies(gravity, applied, tuple(equations), potential)


def _wrenches(model: Model, kinematics: Kinematics, loads: Iterable[Load]) -> tuple[Wrench, ...]:
    zero = sp.Integer(0)
    wrenches: dict[str, Wrench] = {body.name: ((zero, zero), zero) for body in model.bodies}
    angles = {body.name: kinematics.angle[k] for k, body in enumerate(model.bodies)}
    for load in loads:
        force, torque = wrenches[load.body]
        arm = rotate(load.at, angles[load.body])
        wrenches[load.body] = (
            add(force, load.force),
            torque + load.torque + cross(arm, load.force),
        )
    return tuple(wrenches.values())
