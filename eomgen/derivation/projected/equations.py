"""D'Alembert's principle over the partial velocities: M v̇ + V + G = F.

The partial velocity of a body for v_j is its velocity for v_j = 1 and all other velocities 0
(Kane). Constraint forces do no work in partial velocities. Row j is the power of all bodies'
inertial forces and loads in them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.derivation.joint_loads import joint_loads, mechanism_over
from eomgen.derivation.linkage import about, inertia_of
from eomgen.derivation.projected.constraints import Constraint, MotionSymbols
from eomgen.derivation.projected.ledger import Ledger
from eomgen.derivation.rewriting import gathered
from eomgen.derivation.symbols import Expr, Symbols
from eomgen.model.model import Model
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints.base import WithRotor

ROTATIONS = ("R__", "k__", "W__")
"""Prefixes of names of rotation entries, which are not substituted."""
SLACK = 1.5
"""How many times as long as the shortest form the entries of M, V, G, F may be."""


@dataclass(frozen=True)
class Motion:
    """One body's motion in its own axes, over coordinates and velocities and what is defined.

    `partial_omegas` and `partial_velocities` are Kane's partial velocities by index in v: of
    rotation and of the centre of mass. `omega` is the angular velocity, `alpha` and `acceleration`
    what v alone makes of the accelerations, at v̇ = 0; `gravity` is the acceleration of gravity.
    """

    partial_omegas: Mapping[int, Expr]
    partial_velocities: Mapping[int, Expr]
    omega: Expr
    alpha: Expr
    acceleration: Expr
    gravity: Expr


@dataclass(frozen=True)
class Inertia:
    """Mass, and the inertia about the centre of mass in body axes."""

    mass: Expr
    moments: Expr


@dataclass(frozen=True)
class Loads:
    """The loads: forces in world axes with their points and torques, and generalised forces by
    index in v.

    `uniform` is the acceleration of gravity in world axes, if it is the same for all bodies. Then
    `gravity` is empty.
    """

    uniform: Expr
    gravity: tuple[tuple[int, Expr, Expr, Expr], ...]
    applied: tuple[tuple[int, Expr, Expr, Expr], ...]
    motors: Mapping[int, Expr]


@dataclass(frozen=True)
class Balance:
    """M v̇ + V + G = F."""

    M: Expr
    V: Expr
    G: Expr
    F: Expr


def inertias(model: Model, symbols: Symbols) -> tuple[Inertia, ...]:
    """Mass and inertia of every body; in the plane the moment about z alone is one."""
    return tuple(Inertia(symbols.value(b.mass), inertia_of(b, symbols)) for b in model.bodies)


def loads(model: Model, symbols: Symbols, bodies: tuple[Inertia, ...], ledger: Ledger) -> Loads:
    """The loads of all effects on bodies and joints; those at joints that depend on the motion get
    definitions.
    """
    mechanism: Any = mechanism_over(model, symbols)
    given = [load for effect in model.effects for load in effect.loads(mechanism)]
    at_joints = [load for load in given if isinstance(load, JointLoad)]
    motors, definitions = joint_loads(model, symbols, at_joints)
    ledger.definitions.update(definitions)

    def forces(kind: str) -> tuple[tuple[int, Expr, Expr, Expr], ...]:
        return tuple(
            (
                mechanism.bodies.index(load.body),
                _spatial(load.at),
                _spatial(load.force),
                _moment(load.torque),
            )
            for load in given
            if isinstance(load, Load) and load.kind == kind and any((*load.force, *load.torque))
        )

    gravity = forces("gravity")
    uniform = _uniform(gravity, bodies)
    return Loads(uniform, () if any(uniform) else gravity, forces("applied"), motors)


def _spatial(vector: tuple[Expr, ...]) -> Expr:
    return sp.Matrix([*vector, *([0] * (3 - len(vector)))])


def _moment(torque: tuple[Expr, ...]) -> Expr:
    """A torque with three components; in the plane it is about z."""
    return sp.Matrix([*([0] * (3 - len(torque))), *torque])


def _uniform(forces: tuple[tuple[int, Expr, Expr, Expr], ...], bodies: tuple[Inertia, ...]) -> Expr:
    """The acceleration that gravity gives all bodies, if it is the same for all; else 0."""
    none = sp.zeros(3, 1)
    if len(forces) != sum(body.mass != 0 for body in bodies) or not forces:
        return none
    k, _, force, _ = forces[0]
    shared = (force / bodies[k].mass).applyfunc(sp.cancel)
    same = all(
        not any(at) and not any((f - bodies[k].mass * shared).applyfunc(sp.expand))
        for k, at, f, _ in forces
    )
    return shared if same else none


def body_motions(
    model: Model,
    constraints: tuple[Constraint, ...],
    uniform: Expr,
    world: "World",
    ledger: Ledger,
    symbols: Symbols,
) -> tuple[Motion, ...]:
    """Every body's motion from its parent's, joint by joint; long expressions get names."""
    still = dict.fromkeys(symbols.a, sp.Integer(0))
    rest = sp.zeros(3, 1)
    ground = Motion({}, {}, omega=rest, alpha=rest, acceleration=rest, gravity=uniform)
    found: list[Motion] = []

    starts = zip(model.bodies, model.first_velocity, constraints, strict=True)
    for k, (body, first, c) in enumerate(starts):
        name = body.name
        parent = found[body.parent] if body.parent >= 0 else ground
        own = range(first, first + len(body.velocities))
        partial_omegas, partial_velocities = _partials(c, parent, own, name, ledger, symbols)
        given = still | dict(zip(c.parent.omega, parent.omega, strict=True))
        given |= dict(zip(c.parent.alpha, parent.alpha, strict=True))
        given |= dict(zip(c.parent.acceleration, parent.acceleration, strict=True))
        omega = ledger.vector("omega", name, ledger.short(c.omega.xreplace(given)))
        alpha = ledger.vector("alpha", name, ledger.short(c.alpha.xreplace(given)))
        given |= dict(zip(c.own.omega, omega, strict=True))
        given |= dict(zip(c.own.alpha, alpha, strict=True))
        acceleration = ledger.short(c.acceleration.xreplace(given))
        if world.axis_angle(k) is None:
            gravity = ledger.short(c.rotation.T * (c.axes.T * parent.gravity))
        else:
            gravity = world.rotation(k).T * uniform
        found.append(
            Motion(
                partial_omegas,
                partial_velocities,
                omega,
                alpha,
                ledger.vector("a", name, acceleration),
                ledger.vector("g", name, gravity),
            )
        )
    return tuple(found)


def _partials(
    c: Constraint, parent: Motion, own: Iterable[int], name: str, ledger: Ledger, symbols: Symbols
) -> tuple[dict[int, Expr], dict[int, Expr]]:
    """The partial velocities of a body, by velocity: those of its parent's motion and its own."""
    omegas: dict[int, Expr] = {}
    velocities: dict[int, Expr] = {}
    none = sp.zeros(3, 1)
    for j in dict.fromkeys((*parent.partial_omegas, *parent.partial_velocities, *own)):
        unit = {v: sp.Integer(int(i == j)) for i, v in enumerate(symbols.v)}
        moving = parent.partial_omegas.get(j, none), parent.partial_velocities.get(j, none)
        given, of = unit | _by(c.parent, *moving), symbols.v[j].name
        omega = ledger.vector(f"turn__{of}", name, ledger.short(c.omega.xreplace(given)))
        given |= dict(zip(c.own.omega, omega, strict=True))
        velocity = ledger.vector(f"move__{of}", name, ledger.short(c.velocity.xreplace(given)))
        if any(omega):
            omegas[j] = omega
        if any(velocity):
            velocities[j] = velocity
    return omegas, velocities


def _by(moving: MotionSymbols, partial_omega: Expr, partial_velocity: Expr) -> dict[Expr, Expr]:
    pairs = (
        *zip(moving.omega, partial_omega, strict=True),
        *zip(moving.velocity, partial_velocity, strict=True),
    )
    return {symbol: e for symbol, e in pairs if symbol != 0}


class World:
    """Rotations from a body's axes to the world's, or to those of an ancestor."""

    def __init__(self, model: Model, constraints: tuple[Constraint, ...], ledger: Ledger) -> None:
        self._model, self._constraints, self._ledger = model, constraints, ledger
        self._known: dict[tuple[int, int], Expr] = {}

    def rotation(self, body: int, base: int = -1) -> Expr:
        """Axes of `body` in those of `base`, -1 the world."""
        if body == base:
            return sp.eye(3)
        if (body, base) not in self._known:
            self._known[body, base] = self._rotation(body, base)
        return self._known[body, base]

    def axis_angle(self, body: int, base: int = -1) -> tuple[Expr, Expr] | None:
        """Coordinate axis and angle between two bodies, if all joints between rotate about one
        axis.
        """
        axis, angle = sp.zeros(3, 1), sp.Integer(0)
        while body != base:
            axis_angle = self._constraints[body].axis_angle
            if axis_angle is None or (any(axis) and any(axis_angle[0]) and axis_angle[0] != axis):
                return None
            axis, angle = (axis_angle[0] if any(axis_angle[0]) else axis), axis_angle[1] + angle
            body = self._model.bodies[body].parent
        return axis, angle

    def _rotation(self, body: int, base: int) -> Expr:
        axis_angle = self.axis_angle(body, base)
        if axis_angle is not None:
            return about(*axis_angle) if any(axis_angle[0]) else sp.eye(3)
        c, parent = self._constraints[body], self._model.bodies[body].parent
        whole = self.rotation(parent, base) * (c.axes * c.rotation)
        if parent == base and c.axes == sp.eye(3):
            return whole
        name = self._model.bodies[body].name
        where = f"{name}__{self._model.bodies[base].name}" if base >= 0 else name
        return sp.Matrix(
            3,
            3,
            lambda i, j: self._ledger.named(
                f"W__{where}__{'xyz'[i]}{'xyz'[j]}", self._ledger.short(whole[i, j])
            ),
        )


def balance(
    model: Model,
    symbols: Symbols,
    bodies: tuple[Inertia, ...],
    motions: tuple[Motion, ...],
    applied_loads: Loads,
    world: World,
    ledger: Ledger,
) -> Balance:
    """Collect M, V, G and F."""
    n = len(symbols.v)
    M, V, G, F = sp.zeros(n, n), sp.zeros(n, 1), sp.zeros(n, 1), sp.zeros(n, 1)
    floating = translational_velocities(model)
    for body, motion in zip(bodies, motions, strict=True):
        inertial = body.mass * motion.acceleration
        torque = body.moments * motion.alpha
        torque += motion.omega.cross(body.moments * motion.omega)
        weight = body.mass * motion.gravity
        for i, partial_velocity in motion.partial_velocities.items():
            V[i] += partial_velocity.dot(inertial)
            # The partial velocities of a floating tree's translation are the world's unit vectors.
            G[i] -= (
                body.mass * applied_loads.uniform[floating[i]]
                if i in floating
                else partial_velocity.dot(weight)
            )
            for j, other in motion.partial_velocities.items():
                both = i in floating and j in floating
                M[i, j] += body.mass * (int(i == j) if both else partial_velocity.dot(other))
        for i, partial_omega in motion.partial_omegas.items():
            V[i] += partial_omega.dot(torque)
            for j, other in motion.partial_omegas.items():
                M[i, j] += partial_omega.dot(body.moments * other)
    for j, armature in armatures(model, symbols).items():
        M[j, j] += armature
    for load in applied_loads.gravity:
        for i, part in generalised(model, motions, world, load).items():
            G[i] -= part
    for load in applied_loads.applied:
        for i, part in generalised(model, motions, world, load).items():
            F[i] += part
    for j, force in applied_loads.motors.items():
        F[j] += force

    def short(matrix: Expr) -> Expr:
        return matrix.applyfunc(lambda e: _written_out(e, ledger))

    for i in range(n):
        for j in range(i + 1):
            M[i, j] = M[j, i] = _written_out(M[i, j], ledger)
    return Balance(M, short(V), short(G), short(F))


def _written_out(entry: Expr, ledger: Ledger) -> Expr:
    """An entry of the balance with definitions substituted, unless that makes it too long."""
    whole = entry
    while True:
        motions = {
            s: ledger.definitions[s]
            for s in whole.free_symbols
            if s in ledger.definitions and not s.name.startswith(ROTATIONS)
        }
        if not motions:
            break
        whole = whole.xreplace(motions)
        if sp.count_ops(whole) > ledger.longest:
            return ledger.short(entry)
    return gathered(whole, ledger.fixed, slack=SLACK)


def generalised(
    model: Model, motions: Sequence[Motion], world: World, load: tuple[int, Expr, Expr, Expr]
) -> dict[int, Expr]:
    """The generalised forces of a force at a point of a body and a torque (world axes), by index
    in v.
    """
    k, at, outside, beside = load
    motion, floating = motions[k], translational_velocities(model)
    force = world.rotation(k).T * outside
    torque = at.cross(force) + world.rotation(k).T * beside
    found: dict[int, Expr] = {}
    for i, partial_velocity in motion.partial_velocities.items():
        found[i] = outside[floating[i]] if i in floating else partial_velocity.dot(force)
    for i, partial_omega in motion.partial_omegas.items():
        found[i] = found.get(i, sp.Integer(0)) + partial_omega.dot(torque)
    return found


def armatures(model: Model, symbols: Symbols) -> dict[int, Expr]:
    """The inertia of motors' rotors, by velocity."""
    found: dict[int, Expr] = {}
    for body, first in zip(model.bodies, model.first_velocity, strict=True):
        if isinstance(body.joint, WithRotor):
            inertia = symbols.value(body.joint.reflected_inertia)
            if inertia != 0:
                found |= {first + i: inertia for i in range(len(body.velocities))}
    return found


def translational_velocities(model: Model) -> dict[int, int]:
    """The translational velocities of floating trees, with the world axis of each."""
    return {
        first + i: i
        for body, first in zip(model.bodies, model.first_velocity, strict=True)
        if not body.joint.holds
        for i in range(model.dimensions)
    }
