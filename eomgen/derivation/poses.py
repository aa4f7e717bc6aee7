"""Where bodies are in the world and how they move, for effects that use it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.linkage import Frame, Linkage
from eomgen.derivation.mechanism import (
    AXES,
    crossed,
    omega_symbols,
    position_symbols,
    rotation_symbols,
    turned,
    velocity_symbols,
)
from eomgen.derivation.steps import Definition, Equation
from eomgen.derivation.symbols import Expr, real


def poses(linkage: Linkage, bodies: Collection[str]) -> tuple[list[Definition], list[Equation]]:
    """Pose and motion in the world of each of these bodies, with the frames between it and the
    world: as definitions in order, and as equations to be read.
    """
    needed: set[int] = set()
    for k, frame in enumerate(linkage.frames):
        if frame.body >= 0 and linkage.name(frame) in bodies:
            while k >= 0:
                needed.add(k)
                k = linkage.frames[k].parent
    collected = _Collected([], [], {})
    for k in sorted(needed):
        _pose(linkage, k, collected)
    return collected.definitions, collected.equations


@dataclass
class _Collected:
    """What has been collected: definitions, equations, and what needs no name of its own."""

    definitions: list[Definition]
    equations: list[Equation]
    short: dict[Expr, Expr]

    def define(self, symbols: Sequence[Expr], values: Sequence[Expr], *, always: bool) -> None:
        """Define symbols; where their values are plain these take their place, unless `always`."""
        values = [value.xreplace(self.short) for value in values]
        if not always and all(value.is_Atom for value in values):
            self.short.update(zip(symbols, values, strict=True))
            return
        pairs = [(s, v) for s, v in zip(symbols, values, strict=True) if s != v]
        self.definitions.extend(pairs)
        if len(pairs) == 1:
            self.equations.append(Equation(*pairs[0]))
        elif pairs:
            left, right = zip(*pairs, strict=True)
            self.equations.append(Equation(sp.Matrix(left), sp.Matrix(right)))


def _pose(linkage: Linkage, k: int, collected: _Collected) -> None:
    frames, size = linkage.frames, linkage.model.dimensions
    frame = frames[k]
    name = linkage.name(frame)
    zero = (sp.Integer(0),) * size
    base: Expr = sp.eye(size)
    base_omega: tuple[Expr, ...] = zero[:1] if size == 2 else zero
    origin, speed = zero, zero
    parent = frames[frame.parent] if frame.parent >= 0 else None
    if parent is not None:
        above = linkage.name(parent)
        base, base_omega = rotation_symbols(above, size), omega_symbols(above, size)
        origin = tuple(real(f"o_{parent.name},{axis}") for axis in AXES[:size])
        speed = tuple(real(dotted(f"o_{parent.name},{axis}")) for axis in AXES[:size])
    named = frame.body >= 0
    _define_rotation(linkage, k, collected)
    rotation, omega = rotation_symbols(name, size), omega_symbols(name, size)
    spin = _spin(frame, rotation, size)
    collected.define(omega, [a + b for a, b in zip(base_omega, spin, strict=True)], always=named)
    own = tuple(real(f"o_{frame.name},{axis}") for axis in AXES[:size])
    own_speed = tuple(real(dotted(f"o_{frame.name},{axis}")) for axis in AXES[:size])
    reach = turned(base, list(frame.offset)[:size])
    collected.define(own, [a + b for a, b in zip(origin, reach, strict=True)], always=False)
    arm = [a - b for a, b in zip(own, origin, strict=True)] if parent is not None else list(own)
    carried = crossed(base_omega, arm) if parent is not None else zero
    slide = zero
    if frame.kind == "prismatic":
        slide = turned(rotation, [part * frame.v[0] for part in list(frame.axis)[:size]])
    total = [a + b + c for a, b, c in zip(speed, carried, slide, strict=True)]
    collected.define(own_speed, total, always=False)
    if frame.body >= 0:
        place, moving = position_symbols(name, size), velocity_symbols(name, size)
        centre = turned(rotation, list(frame.centre)[:size])
        collected.define(place, [a + b for a, b in zip(own, centre, strict=True)], always=True)
        lever = [a - b for a, b in zip(place, own, strict=True)]
        more = crossed(omega, lever) if any(frame.centre) else zero
        collected.define(moving, [a + b for a, b in zip(own_speed, more, strict=True)], always=True)


def _define_rotation(linkage: Linkage, k: int, collected: _Collected) -> None:
    """The angle of a planar frame, or the rotation matrix of one in space."""
    frames, size = linkage.frames, linkage.model.dimensions
    frame = frames[k]
    name, named = linkage.name(frame), frame.body >= 0
    above = linkage.name(frames[frame.parent]) if frame.parent >= 0 else ""
    if size == 2:
        base = real(f"psi_{above}") if above else sp.Integer(0)
        collected.define((real(f"psi_{name}"),), (base + frame.angle,), always=named)
        return
    for symbol, value in frame.defined:
        collected.define((symbol,), (value,), always=True)
    entries = rotation_symbols(name, size)
    base = rotation_symbols(above, size).xreplace(collected.short) if above else sp.eye(3)
    if not named and frame.rotation == sp.eye(3):
        collected.short.update(zip(entries, base, strict=True))
        return
    collected.definitions.extend(zip(entries, base * frame.rotation, strict=True))
    matrix = sp.MatrixSymbol(f"W_{name}", 3, 3)
    if base == sp.eye(3) or frame.rotation == sp.eye(3):
        collected.equations.append(Equation(matrix, base * frame.rotation))
        return
    own = sp.MatrixSymbol(f"R_{frame.name}", 3, 3)
    collected.equations.append(Equation(own, sp.ImmutableMatrix(frame.rotation)))
    whole = sp.MatrixSymbol(f"W_{above}", 3, 3)
    shared = base == rotation_symbols(above, size)
    collected.equations.append(Equation(matrix, sp.MatMul(whole if shared else base, own)))


def _spin(frame: Frame, rotation: Expr, size: int) -> tuple[Expr, ...]:
    """The frame's angular velocity relative to its parent, in world axes."""
    zero = (sp.Integer(0),) * (1 if size == 2 else 3)
    if frame.kind == "revolute":
        if size == 2:
            return (frame.axis[2] * frame.v[0],)
        return turned(rotation, [part * frame.v[0] for part in frame.axis])
    return turned(rotation, frame.v) if frame.kind == "spherical" else zero
