"""Where bodies are in the world and how they move, for effects that use it."""

from collections.abc import Collection, Sequence

import sympy as sp

from eomgen.derivation.projected.symbols import real
from eomgen.derivation.steps import Definition, Equation
from eomgen.derivation.symbols import Expr
from eomgen.model.model import Model
from eomgen.telling.frames import Frame
from eomgen.telling.mechanism import (
    AXES,
    crossed,
    omega_symbols,
    position_symbols,
    rotation_symbols,
    turned,
    velocity_symbols,
)


def poses(
    model: Model, frames: Sequence[Frame], bodies: Collection[str]
) -> tuple[list[Definition], list[Equation]]:
    """Pose and motion in the world of each of these bodies, with the frames between it and the
    world: as definitions in order, and as equations to be read.
    """
    needed: set[int] = set()
    for k, frame in enumerate(frames):
        if frame.body >= 0 and model.bodies[frame.body].name in bodies:
            while k >= 0:
                needed.add(k)
                k = frames[k].parent
    definitions: list[Definition] = []
    equations: list[Equation] = []
    for k in sorted(needed):
        pairs, lines = _pose(model, frames, k)
        definitions += pairs
        equations += lines
    return definitions, equations


def frame_name(model: Model, frame: Frame) -> str:
    """The body that a frame carries; without one its own name."""
    return model.bodies[frame.body].name if frame.body >= 0 else frame.name


def _pose(
    model: Model, frames: Sequence[Frame], k: int
) -> tuple[list[Definition], list[Equation]]:
    size, frame = model.dimensions, frames[k]
    name = frame_name(model, frame)
    zero = (sp.Integer(0),) * size
    base: Expr = sp.eye(size)
    base_omega: tuple[Expr, ...] = zero[:1] if size == 2 else zero
    origin, speed = zero, zero
    parent = frames[frame.parent] if frame.parent >= 0 else None
    if parent is not None:
        above = frame_name(model, parent)
        base, base_omega = rotation_symbols(above, size), omega_symbols(above, size)
        origin = tuple(real(f"o_{parent.name},{axis}") for axis in AXES[:size])
        speed = tuple(real(f"odot_{parent.name},{axis}") for axis in AXES[:size])
    definitions: list[Definition] = []
    equations: list[Equation] = []

    def define(symbols: Sequence[Expr], values: Sequence[Expr]) -> None:
        pairs = [(s, v) for s, v in zip(symbols, values, strict=True) if s != v]
        definitions.extend(pairs)
        if len(pairs) == 1:
            equations.append(Equation(*pairs[0]))
        elif pairs:
            left, right = zip(*pairs, strict=True)
            equations.append(Equation(sp.Matrix(left), sp.Matrix(right)))

    _define_rotation(model, frames, k, definitions, equations)
    rotation, omega = rotation_symbols(name, size), omega_symbols(name, size)
    spin = _spin(frame, rotation, size)
    define(omega, [a + b for a, b in zip(base_omega, spin, strict=True)])
    own = tuple(real(f"o_{frame.name},{axis}") for axis in AXES[:size])
    own_speed = tuple(real(f"odot_{frame.name},{axis}") for axis in AXES[:size])
    reach = turned(base, list(frame.offset)[:size])
    define(own, [a + b for a, b in zip(origin, reach, strict=True)])
    arm = [a - b for a, b in zip(own, origin, strict=True)] if parent is not None else list(own)
    carried = crossed(base_omega, arm) if parent is not None else zero
    slide = zero
    if frame.kind == "prismatic":
        slide = turned(rotation, [part * frame.v[0] for part in list(frame.axis)[:size]])
    define(own_speed, [a + b + c for a, b, c in zip(speed, carried, slide, strict=True)])
    if frame.body >= 0:
        place, moving = position_symbols(name, size), velocity_symbols(name, size)
        centre = turned(rotation, list(frame.centre)[:size])
        define(place, [a + b for a, b in zip(own, centre, strict=True)])
        lever = [a - b for a, b in zip(place, own, strict=True)]
        more = crossed(omega, lever) if any(frame.centre) else zero
        define(moving, [a + b for a, b in zip(own_speed, more, strict=True)])
    return definitions, equations


def _define_rotation(
    model: Model,
    frames: Sequence[Frame],
    k: int,
    definitions: list[Definition],
    equations: list[Equation],
) -> None:
    """The angle of a planar frame, or the rotation matrix of one in space."""
    frame, size = frames[k], model.dimensions
    name = frame_name(model, frame)
    above = frame_name(model, frames[frame.parent]) if frame.parent >= 0 else ""
    if size == 2:
        base = real(f"psi_{above}") if above else sp.Integer(0)
        pair = real(f"psi_{name}"), base + frame.angle
        definitions.append(pair)
        equations.append(Equation(*pair))
        return
    entries = rotation_symbols(name, size)
    whole = (rotation_symbols(above, size) if above else sp.eye(3)) * frame.rotation
    definitions.extend(zip(entries, whole, strict=True))
    shown = sp.ImmutableMatrix(frame.rotation)
    if above and frame.rotation == sp.eye(3):
        right: Expr = sp.MatrixSymbol(f"W_{above}", 3, 3)
    elif above:
        right = sp.MatMul(sp.MatrixSymbol(f"W_{above}", 3, 3), sp.MatrixSymbol(f"R_{name}", 3, 3))
        equations.append(Equation(sp.MatrixSymbol(f"R_{name}", 3, 3), shown))
    else:
        right = shown
    equations.append(Equation(sp.MatrixSymbol(f"W_{name}", 3, 3), right))


def _spin(frame: Frame, rotation: Expr, size: int) -> tuple[Expr, ...]:
    """The frame's angular velocity relative to its parent, in world axes."""
    zero = (sp.Integer(0),) * (1 if size == 2 else 3)
    if frame.kind == "revolute":
        if size == 2:
            return (frame.axis[2] * frame.v[0],)
        return turned(rotation, [part * frame.v[0] for part in frame.axis])
    return turned(rotation, frame.v) if frame.kind == "spherical" else zero
