"""Kane's and Lagrange's equations of any mechanism as algorithms, frame by frame.

P_k is the matrix of the partial velocities of frame k, so that its motion is P_k v and what joints
with prescribed motion add. With H_k = I_k v_k both methods are a sum over the bodies:

    Kane      M = Σ PᵀI P,    h_0 = Σ Pᵀ(I a + v ×* H - f)
    Lagrange  M = Σ PᵀI P,    V = d/dt ∂T/∂v - ∂T/∂q where dv/dt = 0,    G = ∂U/∂q

with ∂T/∂v = Σ PᵀH and ∂T/∂q = Σ DᵀH, where D is the derivative of a frame's motion by the
coordinates. Ṗ and D follow from those of the parent: X' = -(S q') × X.
"""

from collections.abc import Iterator

import sympy as sp

from eomgen.derivation.composite import outward_step
from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.lagrange import HAMEL
from eomgen.derivation.linkage import Frame, Linkage
from eomgen.derivation.recursion import (
    FRAMES,
    VECTORS,
    Recursion,
    falling,
    frame_steps,
    joint_force,
    moves,
    subspace_of,
    total,
    velocities,
    wrench,
)
from eomgen.derivation.rotations import hat
from eomgen.derivation.spatial import MotionCross
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr

BY_KANE = (
    "Kane's equations for any tree: forces and inertia of all bodies, in the motions that each "
    "velocity makes. Here they are with the bodies, joints and constants of this mechanism."
)
BY_LAGRANGE = (
    "Lagrange's equations for any tree, d/dt ∂T/∂v - ∂T/∂q + ∂U/∂q = Q, with the energies of all "
    "bodies as sums and their derivatives frame by frame. Here they are with the bodies, joints "
    "and constants of this mechanism."
)
PARTIAL = (
    "P has a column for each velocity in v: the motion of a frame while this velocity is 1 and all "
    "others are 0. E picks the velocities of a frame's own joint out of v."
)
POWER = (
    "The joints' forces do no work in the partial velocities. What is left is the power of inertia "
    "and loads: M dv/dt + h_0 = 0 with h_0 = V + G - F. a is the acceleration where dv/dt = 0, and "
    "gravity is in it."
)
DERIVED = (
    "T = ½ Σ vᵀH is the kinetic energy, with the momentum H = I v of each body. E picks the "
    "velocities of a frame's own joint out of v. P is the derivative of a frame's motion by the "
    "velocities, N that of P by the time, and D that of the motion by the coordinates. σ is the "
    "derivative of the motion by the time where dv/dt = 0."
)
ENERGY = (
    "p_v = ∂T/∂v are the generalised momenta. M is the matrix of the second derivatives of T, V is "
    "d/dt ∂T/∂v - ∂T/∂q where dv/dt = 0, G is ∂U/∂q with the potential energy U of gravity, and F "
    "is the power of the loads f and of the joints' own loads at unit velocity. γ is the "
    "acceleration of gravity in axes of a frame. The equations are M dv/dt + h_0 = 0."
)


def kane_steps(linkage: Linkage, effects: tuple[DerivedEffect, ...]) -> Iterator[Step]:
    """The steps to M and h_0 in partial velocities."""
    r = Recursion(linkage, effects)
    yield from frame_steps(r, f"{BY_KANE}\n\n{VECTORS[r.size]}{FRAMES}")
    yield outward_step(r)
    yield Step("algorithm", "Partial velocities", PARTIAL, tuple(_partial(r, f) for f in r.frames))
    needed = []
    for frame in r.frames:
        terms = [r.vector("p", frame)]
        if frame.body >= 0:
            terms.insert(0, sp.MatMul(r.matrix("I", frame), r.vector("a", frame)))
        needed.append(sp.MatMul(_all(r, "P", frame).T, total(terms, r.size)))
    needed += [sp.MatMul(-1, x) for x in _own_loads(r)]
    n = len(r.model.velocities)
    bias = Equation(sp.MatrixSymbol("h_0", n, 1), total(needed, n))
    yield Step("algorithm", "Power of inertia and loads", POWER, (_mass(r), bias))


def lagrange_steps(linkage: Linkage, effects: tuple[DerivedEffect, ...]) -> Iterator[Step]:
    """The steps to M and h_0 from the energies."""
    r = Recursion(linkage, effects)
    yield from frame_steps(r, f"{BY_LAGRANGE}\n\n{VECTORS[r.size]}{FRAMES}")
    lines = [line for k in range(len(r.frames)) for line in _derivatives(r, k)]
    yield Step("algorithm", "The energies and their derivatives", DERIVED, tuple(lines))
    words = ENERGY + (HAMEL if any(len(f.v) > 1 for f in r.frames) else "")
    if r.still:
        words += " The scene leaves the velocity forces out: V is 0."
    yield Step("algorithm", "Lagrange's equations", words, tuple(_lagrange(r)))


def _all(r: Recursion, letter: str, frame: Frame) -> Expr:
    """A matrix with a column for each velocity."""
    return sp.MatrixSymbol(f"{letter}_{frame.name}", r.size, len(r.model.velocities))


def _pick(r: Recursion, frame: Frame) -> Expr:
    """E of a frame."""
    return sp.MatrixSymbol(f"E_{frame.name}", len(frame.v), len(r.model.velocities))


def _carried(r: Recursion, letter: str, frame: Frame) -> list[Expr]:
    """X times a matrix of the parent."""
    if frame.parent < 0:
        return []
    return [sp.MatMul(r.matrix("X", frame), _all(r, letter, r.frames[frame.parent]))]


def _partial(r: Recursion, frame: Frame) -> Equation:
    terms = _carried(r, "P", frame)
    if frame.free:
        terms.append(sp.MatMul(subspace_of(r, frame), _pick(r, frame)))
    return Equation(_all(r, "P", frame), total(terms, r.size, len(r.model.velocities)))


def _mass(r: Recursion) -> Equation:
    """M as the sum over the bodies, and what rotors add."""
    n = len(r.model.velocities)
    terms = []
    for frame in r.frames:
        if frame.body >= 0:
            P = _all(r, "P", frame)
            terms.append(sp.MatMul(P.T, r.matrix("I", frame), P))
    terms += [
        sp.MatMul(frame.armature, _pick(r, frame).T, _pick(r, frame))
        for frame in r.frames
        if frame.free and frame.armature != 0
    ]
    return Equation(sp.MatrixSymbol("M", n, n), total(terms, n, n))


def _own_loads(r: Recursion) -> Iterator[Expr]:
    """The loads along the joints' own coordinates, over all velocities."""
    for frame in r.frames:
        if frame.free and any(tau := joint_force(r, frame)):
            yield sp.MatMul(_pick(r, frame).T, tau)


def _derivatives(r: Recursion, k: int) -> Iterator[Equation]:
    """v, H, P, and unless the scene leaves velocity forces out N, D and σ of a frame."""
    frame, n = r.frames[k], len(r.model.velocities)
    kept = [line for line in velocities(r, k) if line.left.name.partition("_")[0] != "p"]
    yield from (line for line in kept if not r.still or line.left.name.partition("_")[0] != "zeta")
    if frame.body >= 0:
        inertia = r.matrix("I", frame)
        yield Equation(r.vector("H", frame), sp.MatMul(inertia, r.vector("v", frame)))
    yield _partial(r, frame)
    if r.still:
        return
    moving, turned = _carried(r, "N", frame), _carried(r, "D", frame)
    if frame.parent >= 0 and moves(frame):
        own = sp.MatMul(subspace_of(r, frame), r.rate(frame))
        (across,) = _carried(r, "P", frame)
        moving.append(sp.MatMul(-1, MotionCross(own, across)))
        if frame.free:
            above = sp.MatMul(r.matrix("X", frame), r.vector("v", r.frames[frame.parent]))
            alone = sp.MatMul(subspace_of(r, frame), _pick(r, frame))
            turned.append(MotionCross(above, alone))
    yield Equation(_all(r, "N", frame), total(moving, r.size, n))
    yield Equation(_all(r, "D", frame), total(turned, r.size, n))
    reached = [r.vector("zeta", frame)]
    if frame.parent >= 0:
        above = r.vector("sigma", r.frames[frame.parent])
        reached.insert(0, sp.MatMul(r.matrix("X", frame), above))
    yield Equation(r.vector("sigma", frame), total(reached, r.size))


def _lagrange(r: Recursion) -> Iterator[Equation]:
    n = len(r.model.velocities)
    column = [sp.MatrixSymbol(x, n, 1) for x in ("p_v", "V", "G", "F", "h_0")]
    momenta, V, G, F, bias = column
    bodies = [frame for frame in r.frames if frame.body >= 0]
    yield _mass(r)
    P = [_all(r, "P", frame) for frame in bodies]
    H = [r.vector("H", frame) for frame in bodies]
    yield Equation(momenta, total([sp.MatMul(p.T, h) for p, h in zip(P, H, strict=True)], n))
    yield Equation(V, total([] if r.still else list(_velocity_terms(r, bodies, momenta)), n))
    world = sp.MatrixSymbol("gamma_world", r.size, 1)
    yield Equation(world, -falling(r))
    for frame in r.frames:
        above = r.vector("gamma", r.frames[frame.parent]) if frame.parent >= 0 else world
        yield Equation(r.vector("gamma", frame), sp.MatMul(r.matrix("X", frame), above))
    weights = [
        sp.MatMul(-1, p.T, r.matrix("I", frame), r.vector("gamma", frame))
        for p, frame in zip(P, bodies, strict=True)
    ]
    yield Equation(G, total(weights, n))
    loads = [
        sp.MatMul(p.T, r.vector("f", frame))
        for p, frame in zip(P, bodies, strict=True)
        if wrench(r, frame)
    ]
    yield Equation(F, total([*loads, *_own_loads(r)], n))
    yield Equation(bias, sp.MatAdd(V, G, sp.MatMul(-1, F)))


def _velocity_terms(r: Recursion, bodies: list[Frame], momenta: Expr) -> Iterator[Expr]:
    """The terms of d/dt ∂T/∂v - ∂T/∂q where dv/dt = 0."""
    for frame in bodies:
        rest = sp.MatAdd(_all(r, "N", frame), sp.MatMul(-1, _all(r, "D", frame)))
        yield sp.MatMul(rest.T, r.vector("H", frame))
        accelerated = sp.MatMul(r.matrix("I", frame), r.vector("sigma", frame))
        yield sp.MatMul(_all(r, "P", frame).T, accelerated)
    for frame in r.frames:
        if frame.free and len(frame.v) > 1:
            turning = sp.ImmutableMatrix(hat(sp.Matrix(frame.v)))
            yield sp.MatMul(_pick(r, frame).T, turning, _pick(r, frame), momenta)
