"""Joint forces and dependent accelerations eliminated: M q̈ + V + G = F (handout (24)-(36))."""

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.handout.free_bodies import FreeBodies, Wrench
from eomgen.derivation.handout.kinematics import Kinematics
from eomgen.derivation.handout.symbols import (
    Vec,
    add,
    cross,
    scale,
)
from eomgen.derivation.rewriting import tidy
from eomgen.derivation.symbols import Expr
from eomgen.derivation.terms import Terms
from eomgen.model.model import Model


@dataclass(frozen=True)
class Tree:
    """The bodies of one tree: its root, whether that is free, and all bodies, parents first."""

    root: int
    floating: bool
    bodies: tuple[int, ...]


def trees(model: Model) -> tuple[Tree, ...]:
    """The trees of a model, in the order of their roots."""
    members: dict[int, list[int]] = {}
    for k, root in enumerate(model.roots):
        members.setdefault(root, []).append(k)
    return tuple(
        Tree(root, not model.bodies[root].joint.holds, tuple(bodies))
        for root, bodies in members.items()
    )


def subtree(model: Model, k: int) -> tuple[int, ...]:
    """A body and all that hangs on it, in the order of the bodies."""
    found = {k}
    for i, body in enumerate(model.bodies):
        if body.parent in found:
            found.add(i)
    return tuple(sorted(found))


def joint_forces(model: Model, residuals: Sequence[Vec]) -> dict[int, Vec]:
    """Force f_j of each revolute joint on its parent, from m ẍ - f of the bodies on one side of it.

    For a floating tree it is the inner side, as in (14), (15), where f_j follows from body A: all
    bodies inside the joint accelerate by the forces on them and f_j. For a tree on the world it is
    the outer side, which the unknown force of the ground does not act on.
    """
    forces: dict[int, Vec] = {}
    for tree in trees(model):
        for k in tree.bodies:
            if not model.bodies[k].joint.holds:
                continue
            outer = subtree(model, k)
            total: Vec = (sp.Integer(0), sp.Integer(0))
            if tree.floating:
                for i in (i for i in tree.bodies if i not in outer):
                    total = add(total, residuals[i])
            else:
                for i in outer:
                    total = add(total, scale(-1, residuals[i]))
            forces[k] = total
    return forces


def collect(kin: Kinematics, free_bodies: FreeBodies) -> Terms:
    """Eliminate f_j and the dependent accelerations, and collect (24), one row a coordinate: for a
    floating tree the sum of all forces (x, y), and for every body its torque about its own centre
    of mass.
    """
    model, symbols = kin.model, kin.symbols
    # In the bodies' own angles and rates, expanding does not break up terms such as (θ̇ + φ̇)².
    # (22) and (23) are substituted from the leaves to the root.
    inward, outward = kin.inward, kin.outward
    rows = [row.xreplace(inward) for row in rows_without_forces(kin, kin.inertial)]
    for k in reversed(range(len(model.bodies))):
        if model.bodies[k].joint.holds:
            ddx, ddy = (e.xreplace(inward) for e in kin.acceleration[k])
            rows = [row.xreplace({symbols.xdd[k]: ddx, symbols.ydd[k]: ddy}) for row in rows]
    rows = [sp.expand(row) for row in rows]
    unknowns = (*symbols.xdd, *symbols.ydd, *symbols.alpha)
    still = dict.fromkeys(unknowns, sp.Integer(0))
    velocity = sp.Matrix([row.xreplace(still).xreplace(outward) for row in rows])
    slopes = {z: outward[z] for z in unknowns if any(row.has(z) for row in rows)}
    mass = sp.zeros(len(rows), len(symbols.a))
    for i, row in enumerate(rows):
        for z, over in slopes.items():
            slope = sp.diff(row, z).xreplace(outward)
            for j, a in enumerate(symbols.a):
                mass[i, j] += slope * over.coeff(a)
    gravity = -sp.Matrix(rows_without_forces(kin, free_bodies.gravity))
    applied = sp.Matrix(rows_without_forces(kin, free_bodies.applied))
    return Terms(mass, velocity, gravity, applied)


def rows_without_forces(kin: Kinematics, wrenches: Sequence[Wrench]) -> list[Expr]:
    """The rows that the elimination gives for one wrench on each body, one for each coordinate.

    The elimination is linear, so inertia, gravity and applied forces pass through it one by one.
    """
    model = kin.model
    forces = joint_forces(model, [force for force, _ in wrenches])
    floating = {tree.root: tree for tree in trees(model) if tree.floating}
    rows: list[Expr] = []
    for k in range(len(model.bodies)):  # in the order of the coordinates, whatever their tree
        if k in floating:
            total: Vec = (sp.Integer(0), sp.Integer(0))
            for i in floating[k].bodies:
                total = add(total, wrenches[i][0])
            rows += total
        row = wrenches[k][1]
        if k in forces:
            row += cross(kin.arm_child[k], forces[k])
        for c, child in enumerate(model.bodies):
            if child.parent == k:
                row -= cross(kin.arm_parent[c], forces[c])
        rows.append(row)
    return rows


def body_rows(kin: Kinematics, rows: Expr) -> Expr:
    """The rows of (24) as equations of virtual work, one for each body.

    To each torque row of a floating tree the moment of the total force is added, with the arm from
    the body's centre of mass to the joint of the rest of the tree. The row is then the virtual work
    of a rotation of this body, which carries everything outside it along. Rows of trees on the
    world are this already.
    """
    model, result = kin.model, sp.Matrix(rows)
    for tree in trees(model):
        if not tree.floating:
            continue
        y = model.angle_index[tree.root] - 1
        x = y - 1
        for k in tree.bodies:
            arm: Vec = (sp.Integer(0), sp.Integer(0))
            if k != tree.root:
                arm = add(arm, scale(-1, kin.arm_child[k]))
            for c, child in enumerate(model.bodies):
                if child.parent == k:
                    arm = add(arm, kin.arm_parent[c])
            angle_row = model.angle_index[k]
            for j in range(result.cols):
                result[angle_row, j] += cross(arm, (result[x, j], result[y, j]))
    return result


def symmetric(kin: Kinematics, rows: Expr) -> Expr:
    """The rows of (24) as generalised forces: ½ q̇ᵀ M q̇ is the kinetic energy.

    The coordinate of a joint rotates its whole subtree, so its row is the sum of the subtree's.
    """
    model = kin.model
    work = body_rows(kin, rows).applyfunc(lambda e: tidy(e.xreplace(kin.inward)))
    result = sp.Matrix(work)
    for k, i in enumerate(model.angle_index):
        for j in range(work.cols):
            result[i, j] = sum(work[model.angle_index[b], j] for b in subtree(model, k))
    return result.xreplace(kin.outward)
