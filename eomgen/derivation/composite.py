"""M and the bias force of a large mechanism with constraints, frame by frame.

Featherstone, "Rigid Body Dynamics Algorithms" (2008), tables 5.1 and 6.2: outwards velocities and
the accelerations at v̇ = 0, inwards their forces and the inertias of all that hangs on a frame.
"""

from collections.abc import Iterator

import sympy as sp

from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.linkage import Frame, Linkage
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
)
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model

ABOUT = (
    "M and h_0 = V + G - F of the tree come from two algorithms that fit on one page for any "
    "tree: R. "
    "Featherstone, Rigid Body Dynamics Algorithms (2008), tables 5.1 and 6.2. Here they are with "
    "the "
    "bodies, joints and constants of this mechanism."
)
BIAS = (
    "a is the acceleration of a frame where dv/dt = 0; the world accelerates by minus g, which "
    "stands for gravity. n is the force that a frame and all that hangs on it need for it, and "
    "h_0 consists of "
    "its parts h along the joint's own motions, less the joints' own loads."
)
MASS = (
    "I^c is the inertia of a frame and all that hangs on it as one rigid body, and U the force "
    "that "
    "a unit acceleration of a joint needs, carried to the frames before it. Along the motions of "
    "these joints it is a block of M, named by both frames; the blocks above the diagonal are "
    "those below it, transposed, and all others are 0."
)


def composite_steps(linkage: Linkage, effects: tuple[DerivedEffect, ...]) -> Iterator[Step]:
    """The steps to M and h."""
    r = Recursion(linkage, effects)
    yield from frame_steps(r, f"{ABOUT}\n\n{VECTORS[r.size]}{FRAMES}")
    order = range(len(r.frames))
    yield outward_step(r)
    lines = [line for k in reversed(order) for line in _bias(r, k)]
    yield Step("algorithm", "Inwards: the bias force", BIAS, tuple(lines))
    lines = [line for k in reversed(order) for line in _mass(r, k)]
    yield Step("algorithm", "Inwards: the mass matrix M", MASS, tuple(lines))


def outward_step(r: Recursion) -> Step:
    """Velocities of all frames, and accelerations where v̇ = 0."""
    order = range(len(r.frames))
    lines = [line for k in order for line in (*velocities(r, k), *_acceleration(r, k))]
    title = "Outwards: velocities and accelerations"
    return Step("algorithm", title, outward_words(r), tuple(lines))


def solved_algorithm(model: Model) -> Step:
    """dv/dt of a tree from M and h_0."""
    n = len(model.velocities)
    mass, bias = sp.MatrixSymbol("M", n, n), sp.MatrixSymbol("h_0", n, 1)
    rates = sp.Matrix([real(c.acceleration) for c in model.velocities])
    line = Equation(rates, sp.MatMul(-1, sp.Inverse(mass), bias))
    return Step("solution", "Solved", "The equations are M dv/dt + h_0 = 0.", (line,))


def _acceleration(r: Recursion, k: int) -> Iterator[Equation]:
    """a of a frame where v̇ = 0."""
    frame = r.frames[k]
    base = sp.MatrixSymbol("a_world", r.size, 1)
    if k == 0:
        yield Equation(base, falling(r))
    above = r.vector("a", r.frames[frame.parent]) if frame.parent >= 0 else base
    reached = sp.MatAdd(sp.MatMul(r.matrix("X", frame), above), r.vector("zeta", frame))
    yield Equation(r.vector("a", frame), reached)


def _bias(r: Recursion, k: int) -> Iterator[Equation]:
    frame = r.frames[k]
    terms = [r.vector("p", frame)]
    if frame.body >= 0:
        terms.insert(0, sp.MatMul(r.matrix("I", frame), r.vector("a", frame)))
    terms += [sp.MatMul(r.matrix("X", x).T, r.vector("n", x)) for x in r.children(k)]
    yield Equation(r.vector("n", frame), total(terms, r.size))
    if frame.free:
        along = sp.MatMul(subspace_of(r, frame).T, r.vector("n", frame))
        tau = joint_force(r, frame)
        left = sp.MatAdd(along, sp.ImmutableMatrix(-tau)) if any(tau) else along
        yield Equation(r.joint("h", frame), left)


def _mass(r: Recursion, k: int) -> Iterator[Equation]:
    frame = r.frames[k]
    whole = r.matrix("I^c", frame)
    parts = [r.matrix("I", frame)] if frame.body >= 0 else []
    for child in r.children(k):
        x = r.matrix("X", child)
        parts.append(sp.MatMul(x.T, r.matrix("I^c", child), x))
    yield Equation(whole, total(parts, r.size, r.size))
    if not frame.free:
        return
    n = len(frame.v)
    force = _force(r, frame, frame)
    yield Equation(force, sp.MatMul(whole, subspace_of(r, frame)))
    own = sp.MatMul(subspace_of(r, frame).T, force)
    if frame.armature != 0:
        own = sp.MatAdd(own, sp.ImmutableMatrix(frame.armature * sp.eye(n)))
    yield Equation(block(frame, frame), own)
    inner = frame
    while inner.parent >= 0:
        outer = r.frames[inner.parent]
        carried = _force(r, frame, outer)
        yield Equation(carried, sp.MatMul(r.matrix("X", inner).T, force))
        if moves(outer) and outer.free:
            yield Equation(block(outer, frame), sp.MatMul(subspace_of(r, outer).T, carried))
        inner, force = outer, carried


def _force(r: Recursion, frame: Frame, at: Frame) -> Expr:
    """U of a frame's joint, at the origin of a frame before it."""
    name = frame.name if at is frame else f"{frame.name},{at.name}"
    return sp.MatrixSymbol(f"U_{name}", r.size, len(frame.v))


def block(row: Frame, column: Frame) -> Expr:
    """The symbol of a block of M."""
    return sp.MatrixSymbol(f"M_{row.name},{column.name}", len(row.v), len(column.v))
