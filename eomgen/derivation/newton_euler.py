"""Newton's and Euler's equations of a small tree, and its joints' forces eliminated.

In axes of each body, with f and n the force and the torque that a body exerts through its joint on
its parent, at the joint, and f', n' those of the bodies that it carries:

    m a = m g - f + Σ f' + loads,    I α + ω × I ω = -n - r × f + Σ (n' + r' × f') + loads

From the last body to the first these give f and n. Along the joint's own motion it transmits only
what its motor does, which leaves one equation for each velocity.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.identity import identical
from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.derivation.projected.steps import (
    PARTS,
    PARTS_ARE,
    named_parts,
    read_step,
    still_symbols,
)
from eomgen.derivation.rotations import rate
from eomgen.derivation.steps import Pairs, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.derivation.terms import terms_steps

MOST = 1200
"""The operations of the equations up to which they are written out."""
FREE_BODIES = (
    "f and n of a joint are the force and the torque that its child exerts on its parent, at the "
    "joint and in axes of the child; on the child itself they act in reverse. Newton's equation "
    "for the centre of mass and Euler's for the rotation, in axes of each body:"
)
FORCES = (
    "The last body's equations have no other unknown forces. Solved for them they go into those of "
    "the body before, and so on to the first."
)
ROWS = (
    "Along its own motion a joint transmits no more than its motor does. This is one equation for "
    "each velocity:"
)
COLLECTED = (
    "With forces and motions put in, and all but the loads on one side, this is M dv/dt + V + G = "
    "F; first the mass matrix,"
)


@dataclass(frozen=True)
class JointForces:
    """What follows from Newton's and Euler's equations.

    balances  m a and I α + ω × I ω of each body, and what they are equal to
    forces    f and n of each joint, from the last to the first
    rows      for each velocity, in the order of v, the power of f and n in its motion, and what
              the joint transmits there
    """

    balances: Pairs
    forces: Pairs
    rows: Pairs


def joint_forces(equations: ProjectedEquations) -> JointForces:
    """The equations of all bodies, and the joints' forces, over motions that have symbols."""
    s, model = equations.symbols, equations.model
    still = still_symbols(equations)
    plane = model.dimensions == 2
    rows: list[tuple[Expr, Expr]] = [(sp.S.Zero, sp.S.Zero)] * len(s.v)
    balances: list[Pairs] = []
    forces: Pairs = []
    rotors = equations.tree.armatures
    pulls: dict[int, list[tuple[Expr, Expr]]] = {}
    for k in reversed(range(len(model.bodies))):
        body, c, own = model.bodies[k], equations.constraints[k], equations.tree.bodies[k]
        omega, alpha, a = (
            x.xreplace(still) for x in (c.own.omega, c.own.alpha, c.own.acceleration)
        )
        load, moment = _loads(equations, k)
        for force, torque in pulls.get(k, []):
            load, moment = load + force, moment + torque
        weight = own.mass * equations.motions[k].gravity
        turned = own.inertia * alpha + omega.cross(own.inertia * omega)
        name = body.joint.name
        f = sp.Matrix([real(f"f_{name},{x}") for x in "xyz"])
        n = sp.Matrix([real(f"n_{name},{x}") for x in "xyz"])
        if plane:
            f[2] = n[0] = n[1] = sp.S.Zero
        if not body.joint.holds:
            f, n = sp.zeros(3, 1), sp.zeros(3, 1)
        lines = [
            *zip(own.mass * a, weight - f + load, strict=True),
            *zip(turned, moment - n - c.arm.cross(f), strict=True),
        ]
        balances.insert(0, [x for x in lines if x != (0, 0)])
        exerted = weight - own.mass * a + load
        across = moment - c.arm.cross(f) - turned
        if body.joint.holds:
            forces += [x for x in zip(f, exerted, strict=True) if x[0] != 0]
            forces += [x for x in zip(n, across, strict=True) if x[0] != 0]
        else:
            f, n = exerted, across
        for j, (slide, turn) in _motions(equations, k).items():
            kept = equations.loads.motors.get(j, sp.S.Zero) - rotors.get(j, 0) * s.a[j]
            rows[j] = (slide.dot(f) + turn.dot(n), -kept)
        if body.parent >= 0:
            whole = c.axes * c.rotation
            force = whole * f
            pull = (force, whole * n + (c.axes * c.reach).cross(force))
            pulls.setdefault(body.parent, []).append(pull)
    return JointForces([x for pairs in balances for x in pairs], forces, rows)


def _loads(equations: ProjectedEquations, k: int) -> tuple[Expr, Expr]:
    """Force and moment about the centre of mass of all loads on a body, in its axes."""
    force, moment = sp.zeros(3, 1), sp.zeros(3, 1)
    for load in (*equations.loads.gravity, *equations.loads.applied):
        if load.body == k:
            pull, turn = load.about_centre(equations.tree)
            force, moment = force + pull, moment + turn
    return force, moment


def _motions(equations: ProjectedEquations, k: int) -> dict[int, tuple[Expr, Expr]]:
    """Velocity of a joint's point and angular velocity, relative to the parent and in the child's
    axes, for each velocity of the joint.
    """
    c, s, model = equations.constraints[k], equations.symbols, equations.model
    at_rest = {x: sp.S.Zero for m in (c.parent,) for x in (*m.omega, *m.velocity) if x != 0}
    first, found = model.first_velocity[k], {}
    sliding = c.rotation.T * _rate(equations, c.reach)
    for j in range(first, first + len(model.bodies[k].velocities)):
        unit = {v: sp.Integer(int(i == j)) for i, v in enumerate(s.v)} | at_rest
        found[j] = sliding.xreplace(unit), c.relative_omega.xreplace(unit)
    return found


def _rate(equations: ProjectedEquations, vector: Expr) -> Expr:
    """The derivative of components by the time."""
    return rate(vector, equations.ledger.rates)


def has_named_accelerations(equations: ProjectedEquations) -> bool:
    """Whether in M v̇ + V + G = F α or a of a body are what is left of them where v̇ = 0."""
    own, terms = _accelerations(equations), equations.balance
    needed = named_parts(equations, terms.whole)
    return any(symbol in own for symbol, _ in needed)


def _accelerations(equations: ProjectedEquations) -> set[Expr]:
    """The symbols of α and a of all bodies."""
    both = [(c.own.alpha, c.own.acceleration) for c in equations.constraints]
    return {x for pair in both for vector in pair for x in vector}


def newton_euler_steps(equations: ProjectedEquations) -> list[Step] | None:
    """The steps to M v̇ + V + G = F through the joints' forces; None if they are too long."""
    if has_named_accelerations(equations):
        return None
    found = joint_forces(equations)
    pairs = (*found.balances, *found.forces, *found.rows)
    if sum(sp.count_ops(x) for pair in pairs for x in pair) > MOST:
        return None
    _check(equations, found)
    return [*_steps(equations, found)]


def _check(equations: ProjectedEquations, found: JointForces) -> None:
    """Raise `ArithmeticError` if the rows are not those of M v̇ + V + G = F."""
    s, terms = equations.symbols, equations.balance
    definitions = [*equations.ledger.definitions.items(), *found.forces]
    definitions += [(symbol, sp.Float(float(x))) for x, symbol in s.numbers.items()]
    for c in equations.constraints:
        for own, value in (
            (c.own.omega, c.omega),
            (c.own.velocity, c.velocity),
            (c.own.alpha, c.alpha),
            (c.own.acceleration, c.acceleration),
        ):
            definitions += zip(own, value, strict=True)
    whole = terms.M * sp.Matrix(s.a) + terms.V + terms.G - terms.F
    pairs = [(right - left, x) for (left, right), x in zip(found.rows, whole, strict=True)]
    if not identical(pairs, definitions):
        name = equations.model.name
        raise ArithmeticError(f"Newton's and Euler's equations of {name} are not those of the tree")


def _steps(equations: ProjectedEquations, found: JointForces) -> Iterator[Step]:
    def step(title: str, words: str, pairs: Pairs) -> Step:
        told = Step.of("balance", title, words, pairs)
        return read_step(equations, told, moving=title != PARTS)

    terms = equations.balance
    own = dict.fromkeys(_accelerations(equations), sp.S.Zero)
    whole = [x.xreplace(own) for pair in (*found.balances, *found.rows) for x in pair]
    if named := named_parts(equations, [*whole, *terms.whole]):
        yield step(PARTS, PARTS_ARE, named)
    yield step("Newton's and Euler's equations", FREE_BODIES, found.balances)
    if found.forces:
        yield step("The joints' forces, from the last body to the first", FORCES, found.forces)
        yield step("Along the joints' own motions", ROWS, found.rows)
    for told in terms_steps("Collected", COLLECTED, terms):
        yield read_step(equations, told)
