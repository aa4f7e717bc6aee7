"""Free-body diagrams: Newton and Euler with unknown joint forces (handout (12)-(17))."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.derivation.handout.kinematics import Kinematics
from eomgen.derivation.handout.symbols import Vec, add, cross, rotate, scale
from eomgen.derivation.joint_loads import joint_loads, mechanism_over
from eomgen.derivation.symbols import Expr
from eomgen.scene.effects.base import JointLoad, Load

Wrench = tuple[Vec, Expr]
"""Force in world axes at the centre of mass, and torque about z."""


@dataclass(frozen=True)
class FreeBodies:
    """The wrenches on each body besides its joints', and the free-body equations (left, right).

    `gravity` and `applied` are the wrenches of the effects; `equations` are three a body: x, y and
    torque about the centre of mass, with the joint forces f_j as unknowns. `motor` is the torque at
    each body's own joint, on the body. It is a symbol defined in `efforts` if it depends on the
    motion.
    """

    gravity: tuple[Wrench, ...]
    applied: tuple[Wrench, ...]
    motor: tuple[Expr, ...]
    efforts: dict[Expr, Expr]
    equations: tuple[tuple[Expr, Expr], ...]
    potential_energy: Expr


def draw_free_bodies(kin: Kinematics) -> FreeBodies:
    """Write m ẍ = Σ f and I ψ̈ = Σ r × f for every body.

    The joint force f_j acts on the parent at r_parent, and -f_j on the child at r_child.
    """
    model, symbols = kin.model, kin.symbols
    mechanism: Any = mechanism_over(model, symbols, symbols.y)
    loads = [load for effect in model.effects for load in effect.loads(mechanism)]
    forces = [load for load in loads if isinstance(load, Load)]
    at_joints = [load for load in loads if isinstance(load, JointLoad)]
    torques, efforts = joint_loads(model, symbols, at_joints)
    motor = tuple(torques.get(last, sp.Integer(0)) for last in model.angle_index)
    still = (sp.Integer(0),) * len(model.bodies)
    gravity = _wrenches(kin, (f for f in forces if f.kind == "gravity"), still)
    applied = _wrenches(kin, (f for f in forces if f.kind == "applied"), motor)
    equations = []
    for k, body in enumerate(model.bodies):
        force, torque = add(gravity[k][0], applied[k][0]), gravity[k][1] + applied[k][1]
        if body.joint.holds:
            reaction = scale(-1, symbols.force[k])
            force = add(force, reaction)
            torque += cross(kin.arm_child[k], reaction)
        for c, child in enumerate(model.bodies):
            if child.parent == k:
                force = add(force, symbols.force[c])
                torque += cross(kin.arm_parent[c], symbols.force[c])
        (x, y), turning = kin.inertial[k]
        equations += [(x, force[0]), (y, force[1]), (turning, torque)]
    potential = sum((e.potential_energy(mechanism) for e in model.effects), sp.Integer(0))
    return FreeBodies(gravity, applied, motor, efforts, tuple(equations), potential)


def _wrenches(kin: Kinematics, loads: Iterable[Load], motor: Sequence[Expr]) -> tuple[Wrench, ...]:
    model = kin.model
    forces = {body.name: (sp.Integer(0), sp.Integer(0)) for body in model.bodies}
    torques = {body.name: torque for body, torque in zip(model.bodies, motor, strict=True)}
    angles = {body.name: kin.angle[k] for k, body in enumerate(model.bodies)}
    for k, body in enumerate(model.bodies):  # (35): +τ on the child, -τ on the parent
        if body.parent >= 0:
            torques[model.bodies[body.parent].name] -= motor[k]
    for load in loads:
        force, at = (load.force[0], load.force[1]), (load.at[0], load.at[1])
        forces[load.body] = add(forces[load.body], force)
        torques[load.body] += cross(rotate(at, angles[load.body]), force)
        torques[load.body] += sum(load.torque, sp.Integer(0))
    return tuple((forces[body.name], torques[body.name]) for body in model.bodies)
