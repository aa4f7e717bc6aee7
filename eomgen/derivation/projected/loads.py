"""The loads on a tree, and their generalised forces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.derivation.joint_loads import joint_loads, mechanism_over
from eomgen.derivation.linkage import Frame
from eomgen.derivation.projected.tree import Tree
from eomgen.derivation.symbols import Expr
from eomgen.scene.effects.base import JointLoad, Load


@dataclass(frozen=True)
class BodyLoad:
    """A force at a point of body `body`, and a torque, in world axes; the point `at` in its own."""

    body: int
    at: Expr
    force: Expr
    torque: Expr

    def about_centre(self, tree: Tree) -> tuple[Expr, Expr]:
        """Force, and moment about the centre of mass, in axes of the body."""
        back = tree.rotation(self.body).T
        force = back * self.force
        return force, self.at.cross(force) + back * self.torque


@dataclass(frozen=True)
class Loads:
    """The loads on bodies, and generalised forces at joints by index in v.

    `uniform` is the acceleration of gravity in world axes, if it is the same for all bodies. Then
    `gravity` is empty.
    """

    uniform: Expr
    gravity: tuple[BodyLoad, ...]
    applied: tuple[BodyLoad, ...]
    motors: Mapping[int, Expr]


def loads_of(tree: Tree) -> Loads:
    """The loads of all effects on bodies and joints; those at joints that depend on the motion get
    definitions.
    """
    model = tree.model
    mechanism: Any = mechanism_over(model, tree.symbols)
    given = [load for effect in model.effects for load in effect.loads(mechanism)]
    at_joints = [load for load in given if isinstance(load, JointLoad)]
    motors, definitions = joint_loads(model, tree.symbols, at_joints)
    tree.ledger.definitions.update(definitions)

    def forces(kind: str) -> tuple[BodyLoad, ...]:
        return tuple(
            BodyLoad(
                mechanism.bodies.index(load.body),
                _spatial(load.at),
                _spatial(load.force),
                _moment(load.torque),
            )
            for load in given
            if isinstance(load, Load) and load.kind == kind and any((*load.force, *load.torque))
        )

    gravity = forces("gravity")
    uniform = _uniform(gravity, tree.bodies)
    return Loads(uniform, () if any(uniform) else gravity, forces("applied"), motors)


def _spatial(vector: tuple[Expr, ...]) -> Expr:
    return sp.Matrix([*vector, *([0] * (3 - len(vector)))])


def _moment(torque: tuple[Expr, ...]) -> Expr:
    """A torque with three components; in the plane it is about z."""
    return sp.Matrix([*([0] * (3 - len(torque))), *torque])


def _uniform(forces: tuple[BodyLoad, ...], bodies: Sequence[Frame]) -> Expr:
    """The acceleration that gravity gives all bodies, if it is the same for all; else 0."""
    none = sp.zeros(3, 1)
    if len(forces) != sum(body.mass != 0 for body in bodies) or not forces:
        return none
    first = forces[0]
    shared = (first.force / bodies[first.body].mass).applyfunc(sp.cancel)
    same = all(
        not any(load.at)
        and not any((load.force - bodies[load.body].mass * shared).applyfunc(sp.expand))
        for load in forces
    )
    return shared if same else none
