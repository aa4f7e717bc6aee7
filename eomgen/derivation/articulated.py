"""The articulated-body algorithm with a mechanism's own bodies, joints and constants.

Featherstone, "Rigid Body Dynamics Algorithms" (2008), table 7.1: outwards the velocities, inwards
the articulated-body inertias and bias forces, outwards the accelerations. The cost is linear in the
number of bodies, so any mechanism can be derived.
"""

from collections.abc import Iterator

import sympy as sp

from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.linkage import Linkage
from eomgen.derivation.recursion import (
    FRAMES,
    VECTORS,
    Recursion,
    falling,
    frame_steps,
    joint_force,
    moves,
    outward_words,
    subspace_of,
    total,
    velocities,
    wrench,
)
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr

ABOUT = (
    "The algorithm fits on one page for any tree: R. Featherstone, Rigid Body Dynamics Algorithms "
    "(2008), table 7.1. Here it is with the bodies, joints and constants of this mechanism."
)
PIVOTS = (
    " D is a number for one degree of freedom, and a matrix of three rows for a ball. It is "
    "positive for positive masses, so no division can fail."
)


def recursive_steps(linkage: Linkage, effects: tuple[DerivedEffect, ...]) -> Iterator[Step]:
    """The steps of the algorithm, frame by frame."""
    r = Recursion(linkage, effects)
    yield from frame_steps(r, f"{ABOUT}\n\n{VECTORS[r.size]}{FRAMES}{PIVOTS}")
    order = range(len(r.frames))
    lines = [line for k in order for line in velocities(r, k)]
    yield Step("algorithm", "Outwards: velocities and bias forces", outward_words(r), tuple(lines))
    words = (
        "From the leaves to the root. I^A is the inertia that a frame seems to have with all that "
        "hangs on it, p^A the force on it that would leave it without acceleration. What is left "
        "of both after the frame's own joint has given way, I^a and p^a, goes to the parent."
    )
    lines = [line for k in reversed(order) for line in _articulated(r, k)]
    yield Step("algorithm", "Inwards: articulated-body inertias", words, tuple(lines))
    words = (
        "From the root to the leaves: the joint's acceleration follows from the forces and from "
        "the parent's acceleration a'. The world accelerates by minus g, which stands for gravity."
    )
    lines = [line for k in order for line in _accelerations(r, k)]
    yield Step("algorithm", "Outwards: accelerations", words, tuple(lines))
    yield _applied(r)


def _applied(r: Recursion) -> Step:
    """F of M v̇ + V + G = F, term by term."""
    lines: list[Equation] = []
    loaded: set[int] = set()
    for k in reversed(range(len(r.frames))):
        frame = r.frames[k]
        applied = wrench(r, frame, ["applied"])
        terms = [r.vector("f", frame)] if applied else []
        if len(applied) < len(wrench(r, frame)):  # a weight that is given as a load
            terms = [total(applied, r.size)] if applied else []
        for i, child in enumerate(r.frames):
            if child.parent == k and i in loaded:
                terms.append(sp.MatMul(r.matrix("X", child).T, r.vector("Phi", child)))
        force: list[Expr] = [tau] if moves(frame) and any(tau := joint_force(r, frame)) else []
        if terms:
            loaded.add(k)
            lines.append(Equation(r.vector("Phi", frame), total(terms, r.size)))
            if moves(frame):
                force.append(sp.MatMul(subspace_of(r, frame).T, r.vector("Phi", frame)))
        if frame.free:
            lines.append(Equation(r.joint("F", frame), total(force, len(frame.v))))
    words = (
        "The same F as in M dv/dt + V + G = F, joint by joint; M, V and G do not depend on it. Φ "
        "is the sum of the loads f on a frame and on all that hangs on it, moved to its origin; "
        "F is its part along the joint's motion, plus the joint's own loads."
    )
    return Step("variant", "Applied forces, term by term", words, tuple(lines))


def _articulated(r: Recursion, k: int) -> Iterator[Equation]:
    frame, size = r.frames[k], r.size
    whole, bias = r.matrix("I^A", frame), r.vector("p^A", frame)
    inertias = [r.matrix("I", frame)] if frame.body >= 0 else []
    forces = [r.vector("p", frame)]
    for child in r.children(k):
        x = r.matrix("X", child)
        inertias.append(sp.MatMul(x.T, r.matrix("I^a", child), x))
        forces.append(sp.MatMul(x.T, r.vector("p^a", child)))
    yield Equation(whole, total(inertias, size, size))
    yield Equation(bias, total(forces, size))
    handed = (r.matrix("I^a", frame), r.vector("p^a", frame))
    c = r.vector("zeta", frame)
    if not frame.free:
        if frame.parent >= 0:
            yield Equation(handed[0], whole)
            yield Equation(handed[1], sp.MatAdd(bias, sp.MatMul(whole, c)))
        return
    n = len(frame.v)
    subspace, column = subspace_of(r, frame), sp.MatrixSymbol(f"U_{frame.name}", size, n)
    pivot, left = r.joint("D", frame, n), r.joint("u", frame)
    yield Equation(column, sp.MatMul(whole, subspace))
    along = sp.MatMul(subspace.T, column)
    if frame.armature != 0:
        along = sp.MatAdd(along, sp.ImmutableMatrix(frame.armature * sp.eye(n)))
    yield Equation(pivot, along)
    pull = sp.MatMul(-1, subspace.T, bias)
    tau = joint_force(r, frame)
    yield Equation(left, sp.MatAdd(tau, pull) if any(tau) else pull)
    if frame.parent >= 0:
        taken = sp.MatMul(-1, column, sp.Inverse(pivot), column.T)
        yield Equation(handed[0], sp.MatAdd(whole, taken))
        given = sp.MatMul(column, sp.Inverse(pivot), left)
        yield Equation(handed[1], sp.MatAdd(bias, sp.MatMul(handed[0], c), given))


def _accelerations(r: Recursion, k: int) -> Iterator[Equation]:
    frame = r.frames[k]
    before, after = r.vector("a'", frame), r.vector("a", frame)
    base = sp.MatrixSymbol("a_world", r.size, 1)
    if k == 0:
        yield Equation(base, falling(r))
    above = r.vector("a", r.frames[frame.parent]) if frame.parent >= 0 else base
    c = r.vector("zeta", frame)
    reached = sp.MatAdd(sp.MatMul(r.matrix("X", frame), above), c)
    if not frame.free:
        yield Equation(after, reached)
        return
    yield Equation(before, reached)
    column = sp.MatrixSymbol(f"U_{frame.name}", r.size, len(frame.v))
    rest = sp.MatAdd(r.joint("u", frame), sp.MatMul(-1, column.T, before))
    rate = r.rate(frame, 2)
    yield Equation(rate, sp.MatMul(sp.Inverse(r.joint("D", frame, len(frame.v))), rest))
    if len(frame.a) > 1:
        yield Equation(sp.Matrix(frame.a), rate)
    if r.children(k):
        yield Equation(after, sp.MatAdd(before, sp.MatMul(subspace_of(r, frame), rate)))
