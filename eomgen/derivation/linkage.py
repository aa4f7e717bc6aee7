"""A mechanism as a chain of frames with one joint primitive each, over symbols.

All derivations read the mechanism here; they differ in the symbols that they take for quantities,
and in how they go on from joints to bodies.

The frame of a body has the body's axes and its origin at the body's joint. A joint with several
primitives has a frame without mass for each but the last. A weld or a locked joint has a fixed one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import sympy as sp

from eomgen.derivation.mechanism import NamingMechanism, Notes
from eomgen.derivation.rotations import about, of_quaternion, quaternion_scale
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr, real
from eomgen.language.formula import Formula
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.model.orientation import rows_of, turns_of
from eomgen.scalars.exact import Real, direction, orientation, quarters, radians
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Primitive, WithRotor

ORIGIN = sp.zeros(3, 1)


class Quantities(Protocol):
    """The symbols of quantities and of fixed numbers."""

    def value(self, formula: Formula) -> Expr:
        """A quantity."""

    def number(self, value: Real) -> Expr:
        """A number."""


@dataclass(frozen=True)
class Frame:
    """One frame; vectors have three components, in the plane the last of them 0.

    name      that of the joint, with the number of the primitive unless it is the last
    body      index of the body that it carries, -1 for none
    parent    index of the parent's frame, -1 for the world
    kind      of the joint primitive: "revolute", "prismatic", "spherical" or "fixed"
    start     r_parent: from the centre of mass of the parent's body to the joint; 0 in later frames
    axes      E, of the joint in the parent's at q = 0; 1 in later frames
    turned    Q(q), the rotation by the primitive
    slid      s(q), the displacement by the primitive, in axes of the joint
    axis      unit vector of a revolute or prismatic primitive, in the frame's own axes
    angle     of the whole rotation, in the plane
    rotation  R = E Q, from the frame's own axes to the parent's
    offset    r, from the parent's origin to its own, in the parent's axes
    q, v      its coordinates and velocities; `given` if their motion is prescribed
    a         the time derivatives of v
    armature  reflected inertia of a motor's rotor
    defined   a symbol in the rotation by a quaternion, and what it stands for
    above     the centre of mass of the parent's body, from the parent's origin
    mass, centre, inertia  of its body: inertia about the centre of mass
    """

    name: str
    joint: str
    parent: int
    kind: str
    turned: Expr
    slid: Expr
    axis: Expr
    angle: Expr
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    given: bool
    armature: Expr
    defined: tuple[Definition, ...]
    start: Expr = field(default_factory=lambda: ORIGIN)
    axes: Expr = field(default_factory=lambda: sp.eye(3))
    above: Expr = field(default_factory=lambda: ORIGIN)
    body: int = -1
    mass: Expr = sp.S.Zero
    centre: Expr = field(default_factory=lambda: ORIGIN)
    inertia: Expr = field(default_factory=lambda: sp.zeros(3))

    @property
    def free(self) -> bool:
        """Whether its velocities are unknown."""
        return self.kind != "fixed" and not self.given

    @property
    def spin(self) -> Expr:
        """The angular velocity on the parent, in the frame's own axes."""
        if self.kind == "revolute":
            return self.axis * self.v[0]
        return sp.Matrix(self.v) if self.kind == "spherical" else ORIGIN

    @cached_property
    def rotation(self) -> Expr:
        """R."""
        return self.axes * self.turned

    @cached_property
    def offset(self) -> Expr:
        """r."""
        return self.start + self.above + self.axes * self.slid


@dataclass(frozen=True)
class Linkage:
    """A model by its frames, parents first."""

    model: Model
    frames: tuple[Frame, ...]

    @cached_property
    def bodies(self) -> tuple[Frame, ...]:
        """The frame of each body."""
        return tuple(frame for frame in self.frames if frame.body >= 0)

    @cached_property
    def joints(self) -> tuple[tuple[Frame, ...], ...]:
        """The frames of each body's joint."""
        names = [body.joint.name for body in self.model.bodies]
        return tuple(tuple(f for f in self.frames if f.joint == name) for name in names)

    def name(self, frame: Frame) -> str:
        """The body that a frame carries; without one its own name."""
        return self.model.bodies[frame.body].name if frame.body >= 0 else frame.name


def linkage_of(model: Model, quantities: Quantities | None = None) -> Linkage:
    """The frames of a model, by default over the names of its scene."""
    quantities = quantities or NamingMechanism(model, Notes())
    found: list[Frame] = []
    last: list[int] = []
    for k, body in enumerate(model.bodies):
        parent = last[body.parent] if body.parent >= 0 else -1
        frames = [*_primitives(model, body, quantities)]
        for i, frame in enumerate(frames, len(found)):
            found.append(replace(frame, parent=i - 1 if frame is not frames[0] else parent))
        first = len(found) - len(frames)
        found[first] = _held(found[first], body.joint, found, quantities, model.dimensions)
        last.append(len(found) - 1)
        found[-1] = replace(
            found[-1],
            name=body.joint.name,
            body=k,
            mass=quantities.value(body.mass),
            inertia=_inertia_of(body, quantities),
            centre=-_vector(body.joint.r_child, quantities) if body.joint.holds else ORIGIN,
        )
    return Linkage(model, tuple(found))


def _primitives(model: Model, body: Body, quantities: Quantities) -> Iterator[Frame]:
    """A frame for each primitive of a body's joint, one that is fixed without any."""
    joint, locked, states = body.joint, dict(model.locked), {c.name for c in model.velocities}
    armature = sp.S.Zero
    if joint.holds and isinstance(joint, WithRotor):
        armature = quantities.value(joint.reflected_inertia)
    for i, primitive in enumerate(joint.primitives(model.dimensions) or (None,)):
        ball = primitive is not None and primitive.kind == "spherical"
        own = slice(body.plain, None) if ball else slice(i, i + 1)
        positions, velocities = body.positions[own], body.velocities[own]
        held = [locked[c.name] for c in positions if c.name in locked]
        q = tuple(sp.Float(x) for x in held) or tuple(real(c.name) for c in positions)
        scale = real(f"k_{joint.name}")
        turned, slid, axis = sp.eye(3), ORIGIN, ORIGIN
        if primitive is not None:
            turned, slid, axis = _motion(primitive, q, scale, quantities)
        turns = primitive is not None and primitive.kind == "revolute"
        yield Frame(
            name=f"{joint.name}_{i + 1}",
            joint=joint.name,
            parent=-1,
            kind="fixed" if held or primitive is None else primitive.kind,
            turned=turned,
            slid=slid,
            axis=axis,
            angle=axis[2] * q[0] if turns else sp.S.Zero,
            q=() if held else q,
            v=() if held else tuple(real(c.name) for c in velocities),
            a=() if held else tuple(real(c.acceleration) for c in velocities),
            given=bool(velocities) and velocities[0].name not in states and not held,
            armature=armature,
            defined=((scale, quaternion_scale(q)),) if ball else (),
        )


def _motion(
    primitive: Primitive, q: Sequence[Expr], scale: Expr, quantities: Quantities
) -> tuple[Expr, Expr, Expr]:
    """Rotation, displacement and axis of a joint primitive at its coordinates; `scale` is that of
    a quaternion.
    """
    if primitive.kind == "spherical":
        return of_quaternion(q, scale), ORIGIN, ORIGIN
    axis = sp.Matrix([quantities.number(part) for part in direction(primitive.axis)])
    if primitive.kind == "prismatic":
        return sp.eye(3), axis * q[0], axis
    return about(axis, q[0]), ORIGIN, axis


def _held(
    frame: Frame, joint: Joint, found: Sequence[Frame], quantities: Quantities, dimensions: int
) -> Frame:
    """The first frame of a joint where its parent holds it."""
    above = found[frame.parent].centre if frame.parent >= 0 else ORIGIN
    if not joint.holds:
        return replace(frame, above=above)
    turn = _fixed_angle(joint, quantities) if dimensions == 2 else sp.S.Zero
    return replace(
        frame,
        start=_vector(joint.r_parent, quantities),
        axes=_fixed_axes(joint, quantities),
        angle=turn + frame.angle,
        above=above,
    )


def _fixed_axes(joint: Joint, quantities: Quantities) -> Expr:
    """The axes of a joint at q = 0 in its parent's, by numbers or by formulas of parameters."""
    if joint.orientation is None:
        fixed = orientation(joint.orientation_deg)
        return sp.Matrix([[quantities.number(entry) for entry in row] for row in fixed])
    rows = rows_of(joint.orientation)
    if len(rows) == 3:
        return sp.Matrix([[quantities.value(part) for part in row] for row in rows])
    if len(rows[0]) == 4:
        q = [quantities.value(part) for part in rows[0]]
        return of_quaternion(q, quaternion_scale(q))
    axes = sp.eye(3)
    for k, turn in turns_of(rows[0]):
        if isinstance(turn, tuple):
            axes = axes * sp.Matrix([[quantities.number(x) for x in row] for row in turn])
        else:
            axes = axes * about(sp.Matrix([int(i == k) for i in range(3)]), quantities.value(turn))
    return axes


def _fixed_angle(joint: Joint, quantities: Quantities) -> Expr:
    """The angle of a joint's axes at q = 0 from its parent's, in the plane."""
    if joint.orientation is not None:
        return quantities.value(rows_of(joint.orientation)[0][0])
    count, rest = quarters(radians(joint.orientation_deg))
    return count * sp.pi / 2 + quantities.number(rest)


def _vector(parts: tuple[Formula, ...], quantities: Quantities) -> Expr:
    """A vector with two or three components as one with three."""
    x, y, *z = (quantities.value(part) for part in parts)
    return sp.Matrix([x, y, *(z or [0])])


def _inertia_of(body: Body, quantities: Quantities) -> Expr:
    """Inertia about the centre of mass, body axes; in the plane only about z."""
    entries = [quantities.value(entry) for entry in body.inertia_com]
    if len(entries) == 1:
        return sp.diag(0, 0, entries[0])
    xx, yy, zz, xy, xz, yz = entries
    return sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
