"""What the recursions of a derivation have in common: frames, velocities, and loads on them.

Spatial vectors, with a mechanism's own bodies, joints and constants, as in Featherstone, "Rigid
Body Dynamics Algorithms" (2008), chapters 2 and 4.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import DerivedEffect
from eomgen.derivation.linkage import Frame, Linkage
from eomgen.derivation.mechanism import AXES, NamingMechanism, Notes, rotation_symbols
from eomgen.derivation.rotations import hat
from eomgen.derivation.spatial import (
    ForceCross,
    MotionCross,
    cut,
    motion_subspace,
    motion_transform,
    rigid_inertia,
)
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model
from eomgen.scene.effects.base import JointLoad, Load
from eomgen.scene.joints.base import WORLD

VECTORS = {
    3: "A motion is a column of ω_z, v_x, v_y and a force one of n_z, f_x, f_y",
    6: "A motion is a column of ω and v, a force one of n and f, six components each",
}
"""What spatial vectors are, by their components."""
FRAMES = (
    ", at the origin of a frame and in its axes. A frame moves on its "
    "parent by one joint primitive, with the motion subspace S; a joint with several "
    "primitives is a chain of frames, all but the last without mass. R turns axes of the "
    "frame into the parent's, r runs from the parent's origin to its own, X takes motions "
    "from the parent to the frame, and its transpose takes forces back. The matrix of r × is "
    "written r^×. I is the inertia of the frame's own body at the frame's origin, × the cross "
    "product of two motions, and ×* that of a motion and a force."
)
KINDS = ("gravity", "applied")


@dataclass(frozen=True)
class Recursion:
    """The mechanism as the recursion reads it."""

    linkage: Linkage
    effects: tuple[DerivedEffect, ...]

    @property
    def model(self) -> Model:
        """Its model."""
        return self.linkage.model

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Its frames, parents first."""
        return self.linkage.frames

    @property
    def size(self) -> int:
        """Components of a spatial vector."""
        return 6 if self.model.dimensions == 3 else 3

    @property
    def still(self) -> bool:
        """Whether the scene leaves the velocity forces out."""
        return "velocity_forces" in self.model.leave_out

    def vector(self, letter: str, frame: Frame) -> Expr:
        """A spatial vector of a frame."""
        return sp.MatrixSymbol(f"{letter}_{frame.name}", self.size, 1)

    def matrix(self, letter: str, frame: Frame) -> Expr:
        """A spatial matrix of a frame."""
        return sp.MatrixSymbol(f"{letter}_{frame.name}", self.size, self.size)

    def joint(self, letter: str, frame: Frame, columns: int = 1) -> Expr:
        """A vector or matrix over the velocities of a frame's joint."""
        return sp.MatrixSymbol(f"{letter}_{frame.name}", len(frame.v), columns)

    def rate(self, frame: Frame, order: int = 1) -> Expr:
        """The velocities of a frame's joint, or their derivatives."""
        symbols = frame.v if order == 1 else frame.a
        if len(symbols) == 1:
            return sp.MatrixSymbol(symbols[0].name, 1, 1)
        return self.joint(dotted("omega", order - 1), frame)

    def children(self, k: int) -> list[Frame]:
        """The frames on frame k."""
        return [frame for frame in self.frames if frame.parent == k]


def frame_steps(r: Recursion, words: str) -> Iterator[Step]:
    """What the algorithm is, and the constants of each frame."""
    yield Step("algorithm", "The algorithm", words, ())
    for k, frame in enumerate(r.frames):
        title = f"Frame `{frame.name}`: {_kind(r, k)}"
        yield Step("algorithm", title, "", tuple(_constants(r, frame)))


def _kind(r: Recursion, k: int) -> str:
    frame = r.frames[k]
    above = f"`{r.frames[frame.parent].name}`" if frame.parent >= 0 else f"the {WORLD}"
    carries = f", carries `{r.linkage.name(frame)}`" if frame.body >= 0 else ", without mass"
    moved = {
        "revolute": "turns about", "prismatic": "slides along", "spherical": "turns freely",
        "fixed": "fixed",
    }[frame.kind]  # fmt: skip
    axis = ""
    if frame.kind in ("revolute", "prismatic"):
        axis = " " + _direction(frame.axis)
    prescribed = " as prescribed" if frame.given else ""
    return f"{moved}{axis}{prescribed} on {above}{carries}"


def _direction(axis: Expr) -> str:
    for letter, part in zip(AXES, axis, strict=True):
        if abs(part) == 1:
            return letter if part > 0 else f"-{letter}"
    return "[" + ", ".join(f"{float(part):.4g}" for part in axis) + "]"


def _constants(r: Recursion, frame: Frame) -> Iterator[Equation]:
    plane, size = r.size == 3, r.model.dimensions
    transform = motion_transform(frame.rotation, frame.offset)
    if plane:
        inertia = rigid_inertia(frame.mass, frame.centre, frame.inertia)
        yield Equation(r.matrix("X", frame), cut(transform, size))
        if frame.free or frame.given:
            subspace = cut(motion_subspace(frame.kind, frame.axis), size)
            yield Equation(sp.MatrixSymbol(f"S_{frame.name}", 3, 1), subspace)
        if frame.body >= 0:
            yield Equation(r.matrix("I", frame), cut(inertia, size))
        return
    rotation = sp.MatrixSymbol(f"R_{frame.name}", 3, 3)
    yield from (Equation(symbol, value) for symbol, value in frame.defined)
    turns = frame.rotation != sp.eye(3)
    yield Equation(rotation, frame.rotation if turns else sp.Identity(3))
    yield Equation(sp.MatrixSymbol(f"r_{frame.name}", 3, 1), _column(frame.offset))
    lever = sp.MatrixSymbol(f"r^×_{frame.name}", 3, 3)
    nothing = sp.ZeroMatrix(3, 3)
    moved = sp.MatMul(-1, rotation.T, lever) if any(frame.offset) else nothing
    transform = sp.BlockMatrix([[rotation.T, nothing], [moved, rotation.T]])
    yield Equation(r.matrix("X", frame), transform)
    if moves(frame):
        subspace = motion_subspace(frame.kind, frame.axis)
        name = sp.MatrixSymbol(f"S_{frame.name}", *subspace.shape)
        blocks = sp.BlockMatrix([[sp.Identity(3)], [nothing]])
        yield Equation(name, _column(subspace) if subspace.cols == 1 else blocks)
    if frame.body >= 0:
        yield from _inertia(r, frame)


def _inertia(r: Recursion, frame: Frame) -> Iterator[Equation]:
    """Mass, centre of mass and inertia about it, and with them the spatial inertia."""
    mass, about = real(f"m_{frame.name}"), sp.MatrixSymbol(f"J_{frame.name}", 3, 3)
    yield Equation(mass, frame.mass)
    yield Equation(about, frame.inertia)
    upper, lower = about, sp.MatMul(mass, sp.Identity(3))
    corner, other = sp.ZeroMatrix(3, 3), sp.ZeroMatrix(3, 3)
    if any(frame.centre):
        yield Equation(sp.MatrixSymbol(f"c_{frame.name}", 3, 1), _column(frame.centre))
        lever = sp.MatrixSymbol(f"c^×_{frame.name}", 3, 3)
        upper = sp.MatAdd(about, sp.MatMul(mass, lever, lever.T))
        corner, other = sp.MatMul(mass, lever), sp.MatMul(mass, lever.T)
    yield Equation(r.matrix("I", frame), sp.BlockMatrix([[upper, corner], [other, lower]]))


def _column(vector: Expr) -> Expr:
    """A column written as a row, transposed."""
    return sp.Transpose(sp.ImmutableMatrix(vector.T))


def outward_words(r: Recursion) -> str:
    """What the velocities of the frames are, in words."""
    words = (
        "v is the velocity of a frame, ζ what the velocities alone make of its acceleration, and p "
        "the force that would leave its body without acceleration: of inertia, less the loads f of "
        "the effects, whose components are named with the effects."
    )
    if r.still:
        words += " The scene leaves the velocity forces out: ζ and the inertial part of p are 0."
    return words


def subspace_of(r: Recursion, frame: Frame) -> Expr:
    """S of a frame."""
    return sp.MatrixSymbol(f"S_{frame.name}", r.size, len(frame.v))


def moves(frame: Frame) -> bool:
    """Whether a frame moves on its parent."""
    return frame.kind != "fixed"


def velocities(r: Recursion, k: int) -> Iterator[Equation]:
    """v, ζ, f and p of a frame."""
    frame = r.frames[k]
    v, own = r.vector("v", frame), None
    if moves(frame):
        own = sp.MatMul(subspace_of(r, frame), r.rate(frame))
        if len(frame.v) > 1:
            yield Equation(r.rate(frame), sp.Matrix(frame.v))
    terms = [own] if own is not None else []
    if frame.parent >= 0:
        terms.insert(0, sp.MatMul(r.matrix("X", frame), r.vector("v", r.frames[frame.parent])))
    yield Equation(v, total(terms, r.size))
    c = []
    if own is not None and frame.parent >= 0 and not r.still:
        c.append(MotionCross(v, own))
    if frame.given:
        c.append(sp.MatMul(subspace_of(r, frame), r.rate(frame, 2)))
    yield Equation(r.vector("zeta", frame), total(c, r.size))
    loads = wrench(r, frame)
    if loads:
        yield Equation(r.vector("f", frame), total(loads, r.size))
    bias = []
    if frame.body >= 0 and not r.still:
        bias.append(ForceCross(v, sp.MatMul(r.matrix("I", frame), v)))
    if loads:
        bias.append(sp.MatMul(-1, r.vector("f", frame)))
    yield Equation(r.vector("p", frame), total(bias, r.size))


def total(terms: Sequence[Expr], rows: int, columns: int = 1) -> Expr:
    """A sum of matrices; 0 without terms."""
    if not terms:
        return sp.ZeroMatrix(rows, columns)
    return terms[0] if len(terms) == 1 else sp.MatAdd(*terms)


def wrench(r: Recursion, frame: Frame, kinds: Sequence[str] = KINDS) -> list[Expr]:
    """The loads on a frame's body as spatial forces at its origin, in its axes."""
    if frame.body < 0:
        return []
    name, size = r.linkage.name(frame), r.model.dimensions
    found: list[Expr] = []
    for derived in r.effects:
        if derived.falls:
            continue
        for load in derived.loads:
            if isinstance(load, Load) and load.body == name and load.kind in kinds:
                found += _one_wrench(load, frame, name, size)
    return found


def _one_wrench(load: Load, frame: Frame, name: str, size: int) -> list[Expr]:
    arm = frame.centre + sp.Matrix([*load.at, *([0] * (3 - size))])
    if size == 2:
        own = sp.Matrix([*(rotation_symbols(name, 2).T * sp.Matrix(load.force)), 0])
        moment = arm.cross(own)[2] + (load.torque[0] if load.torque else 0)
        return [sp.ImmutableMatrix([moment, own[0], own[1]])]
    back = sp.MatrixSymbol(f"W_{name}", 3, 3).T
    force = sp.MatMul(back, sp.ImmutableMatrix(load.force))
    moments = []
    if any(load.force) and any(arm):
        moments.append(sp.MatMul(sp.ImmutableMatrix(hat(arm)), force))
    if any(load.torque):
        moments.append(sp.MatMul(back, sp.ImmutableMatrix(load.torque)))
    lower = force if any(load.force) else sp.ZeroMatrix(3, 1)
    return [sp.BlockMatrix([[total(moments, 3)], [lower]])]


def joint_force(r: Recursion, frame: Frame) -> Expr:
    """The loads along a frame's own coordinates."""
    parts = [sp.Integer(0)] * len(frame.v)
    start = [f.name for f in r.frames if f.joint == frame.joint].index(frame.name)
    for derived in r.effects:
        for load in derived.loads:
            if isinstance(load, JointLoad) and load.joint == frame.joint:
                i = load.coordinate - start
                if 0 <= i < len(parts):
                    parts[i] = parts[i] + load.force
    return sp.ImmutableMatrix(parts)


def falling(r: Recursion) -> Expr:
    """Minus the acceleration of uniform gravity, a spatial vector."""
    mechanism: Any = NamingMechanism(r.model, Notes())
    fall = sp.zeros(r.model.dimensions, 1)
    for derived in r.effects:
        if derived.falls:
            fall -= sp.Matrix(derived.effect.acceleration(mechanism))
    return sp.Matrix([0] * (r.size - r.model.dimensions) + list(fall))
