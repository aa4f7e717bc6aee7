"""D'Alembert's principle over the partial velocities: M v̇ + V + G = F.

The partial velocity of a body for v_j is its velocity for v_j = 1 and all other velocities 0
(Kane). Constraint forces do no work in partial velocities. Row j is the power of all bodies'
inertial forces and loads in them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.definitions import TURNS, Ledger
from eomgen.derivation.projected.loads import BodyLoad, Loads
from eomgen.derivation.projected.tree import Tree
from eomgen.derivation.rewriting import gathered
from eomgen.derivation.symbols import Expr
from eomgen.derivation.terms import Terms

ROTATIONS = (*TURNS, "W__")
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


def body_motions(tree: Tree, uniform: Expr) -> tuple[Motion, ...]:
    """Every body's motion from its parent's, joint by joint; long expressions get names. `uniform`
    is the acceleration of uniform gravity, in world axes.
    """
    rest = sp.zeros(3, 1)
    ground = Motion({}, {}, omega=rest, alpha=rest, acceleration=rest, gravity=uniform)
    still = dict.fromkeys(tree.symbols.a, sp.Integer(0))
    ledger, found = tree.ledger, list[Motion]()
    for k, (body, c) in enumerate(zip(tree.model.bodies, tree.constraints, strict=True)):
        name, parent = body.name, found[body.parent] if body.parent >= 0 else ground
        partial_omegas, partial_velocities = _partial_motions(tree, k, parent)
        given = still | _values(c.parent.omega, parent.omega)
        given |= _values(c.parent.alpha, parent.alpha)
        given |= _values(c.parent.acceleration, parent.acceleration)
        omega = ledger.vector("omega", name, ledger.short(c.omega.xreplace(given)))
        alpha = ledger.vector("alpha", name, ledger.short(c.alpha.xreplace(given)))
        given |= _values(c.own.omega, omega) | _values(c.own.alpha, alpha)
        acceleration = ledger.short(c.acceleration.xreplace(given))
        if tree.axis_angle(k) is None:
            gravity = ledger.short(c.rotation.T * (c.axes.T * parent.gravity))
        else:
            gravity = tree.rotation(k).T * uniform
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


def _partial_motions(tree: Tree, k: int, parent: Motion) -> tuple[dict[int, Expr], dict[int, Expr]]:
    """The partial velocities of a body, of rotation and of its centre of mass."""
    c, body, v = tree.constraints[k], tree.model.bodies[k], tree.symbols.v
    ledger, none = tree.ledger, sp.zeros(3, 1)
    omegas: dict[int, Expr] = {}
    velocities: dict[int, Expr] = {}
    first = tree.model.first_velocity[k]
    own = range(first, first + len(body.velocities))
    for j in dict.fromkeys((*parent.partial_omegas, *parent.partial_velocities, *own)):
        given = {x: sp.Integer(int(i == j)) for i, x in enumerate(v)}
        given |= _values(c.parent.omega, parent.partial_omegas.get(j, none))
        given |= _values(c.parent.velocity, parent.partial_velocities.get(j, none))
        omega = ledger.short(c.omega.xreplace(given))
        omega = ledger.vector(f"turn__{v[j].name}", body.name, omega)
        given |= _values(c.own.omega, omega)
        velocity = ledger.short(c.velocity.xreplace(given))
        velocity = ledger.vector(f"move__{v[j].name}", body.name, velocity)
        if any(omega):
            omegas[j] = omega
        if any(velocity):
            velocities[j] = velocity
    return omegas, velocities


def _values(symbols: Expr, vector: Expr) -> dict[Expr, Expr]:
    """The components of a vector by their symbols; those of the world have none."""
    return {symbol: e for symbol, e in zip(symbols, vector, strict=True) if symbol != 0}


def balance(tree: Tree, motions: Sequence[Motion], loads: Loads) -> Terms:
    """Collect M, V, G and F."""
    ledger, floating = tree.ledger, tree.translational
    n = len(tree.symbols.v)
    M, V, G, F = sp.zeros(n, n), sp.zeros(n, 1), sp.zeros(n, 1), sp.zeros(n, 1)
    for body, motion in zip(tree.bodies, motions, strict=True):
        inertial = body.mass * motion.acceleration
        torque = body.inertia * motion.alpha
        torque += motion.omega.cross(body.inertia * motion.omega)
        weight = body.mass * motion.gravity
        for i, partial_velocity in motion.partial_velocities.items():
            V[i] += partial_velocity.dot(inertial)
            # The partial velocities of a floating tree's translation are the world's unit vectors.
            G[i] -= (
                body.mass * loads.uniform[floating[i]]
                if i in floating
                else partial_velocity.dot(weight)
            )
            for j, other in motion.partial_velocities.items():
                both = i in floating and j in floating
                M[i, j] += body.mass * (int(i == j) if both else partial_velocity.dot(other))
        for i, partial_omega in motion.partial_omegas.items():
            V[i] += partial_omega.dot(torque)
            for j, other in motion.partial_omegas.items():
                M[i, j] += partial_omega.dot(body.inertia * other)
    for j, armature in tree.armatures.items():
        M[j, j] += armature
    for load in loads.gravity:
        for i, part in generalised(tree, motions, load).items():
            G[i] -= part
    for load in loads.applied:
        for i, part in generalised(tree, motions, load).items():
            F[i] += part
    for j, force in loads.motors.items():
        F[j] += force

    def short(matrix: Expr) -> Expr:
        return matrix.applyfunc(lambda e: _written_out(e, ledger))

    for i in range(n):
        for j in range(i + 1):
            M[i, j] = M[j, i] = _written_out(M[i, j], ledger)
    return Terms(M, short(V), short(G), short(F))


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


def generalised(tree: Tree, motions: Sequence[Motion], load: BodyLoad) -> dict[int, Expr]:
    """The generalised forces of a load on a body, by index in v."""
    motion, floating = motions[load.body], tree.translational
    force, torque = load.about_centre(tree)
    found: dict[int, Expr] = {}
    for i, partial_velocity in motion.partial_velocities.items():
        found[i] = load.force[floating[i]] if i in floating else partial_velocity.dot(force)
    for i, partial_omega in motion.partial_omegas.items():
        found[i] = found.get(i, sp.Integer(0)) + partial_omega.dot(torque)
    return found
