"""The mechanism as a chain of frames with one joint primitive each, over symbols.

The frame of a body has the body's axes and its origin at the body's joint. A joint with several
primitives has a frame without mass for each but the last. A weld or a locked joint has a fixed one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.mechanism import NamingMechanism, Notes
from eomgen.derivation.projected.constraints import about, fixed_axes, of_quaternion
from eomgen.derivation.projected.symbols import real
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr
from eomgen.language.formula import Formula
from eomgen.model.model import Body, JointIndex, Model
from eomgen.model.orientation import rows_of
from eomgen.scalars.exact import direction, quarters, radians
from eomgen.scene.joints.base import Primitive, WithRotor

ORIGIN = sp.zeros(3, 1)


@dataclass(frozen=True)
class Frame:
    """One frame; vectors have three components, in the plane the last of them 0.

    name      that of the joint, with the number of the primitive unless it is the last
    body      index of the body that it carries, -1 for none
    parent    index of the parent's frame, -1 for the world
    kind      of the joint primitive: "revolute", "prismatic", "spherical" or "fixed"
    angle     of the rotation, in the plane
    axis      unit vector of a revolute or prismatic primitive, in the frame's own axes
    rotation  R, from the frame's own axes to the parent's
    offset    r, from the parent's origin to its own, in the parent's axes
    q, v      its coordinates and velocities; `given` if their motion is prescribed
    a         the time derivatives of v
    tau       names of its velocities, for the generalised forces on them
    armature  reflected inertia of a motor's rotor
    mass, centre, inertia  of its body: inertia about the centre of mass
    defined   a symbol in the rotation by a quaternion, and what it stands for
    """

    name: str
    joint: str
    body: int
    parent: int
    kind: str
    angle: Expr
    axis: Expr
    rotation: Expr
    offset: Expr
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    given: bool
    armature: Expr
    mass: Expr
    centre: Expr
    inertia: Expr
    defined: tuple[Definition, ...] = ()

    @property
    def free(self) -> bool:
        """Whether its velocities are unknown."""
        return self.kind != "fixed" and not self.given


def frames_of(model: Model) -> tuple[Frame, ...]:
    """All frames, parents first."""
    found: list[Frame] = []
    last: list[int] = []
    symbols = NamingMechanism(model, Notes())
    locked = dict(model.locked)
    for k, index in enumerate(model.joint_indices):
        last.append(_add(found, last, k, index, model, symbols, locked))
    return tuple(found)


def _add(
    found: list[Frame],
    last: Sequence[int],
    k: int,
    index: JointIndex,
    model: Model,
    symbols: NamingMechanism,
    locked: dict[str, float],
) -> int:
    body, joint = index.body, index.body.joint
    parent = last[body.parent] if body.parent >= 0 else -1
    rotation, offset, centre = sp.eye(3), ORIGIN, ORIGIN
    armature = angle = sp.Integer(0)
    if joint.holds:
        rotation = fixed_axes(joint, symbols)
        if model.dimensions == 2 and joint.orientation is not None:
            angle = symbols.value(rows_of(joint.orientation)[0][0])
        elif model.dimensions == 2:
            count, rest = quarters(radians(joint.orientation_deg))
            angle = count * sp.pi / 2 + symbols.number(rest)
        offset = _vector(joint.r_parent, symbols)
        centre = -_vector(joint.r_child, symbols)
        if isinstance(joint, WithRotor):
            armature = joint.reflected_inertia(symbols.value)
    if parent >= 0:
        offset = offset + found[parent].centre
    primitives = joint.primitives(model.dimensions)
    nv = len(model.velocities)
    for i, primitive in enumerate(primitives or (None,)):
        final = i >= len(primitives) - 1
        ball = primitive is not None and primitive.kind == "spherical"
        positions = body.positions[body.plain :] if ball else body.positions[i : i + 1]
        velocities = body.velocities[body.plain :] if ball else body.velocities[i : i + 1]
        held = [locked[c.name] for c in positions if c.name in locked]
        q = tuple(sp.Float(x) for x in held) or tuple(real(c.name) for c in positions)
        turned, slid, axis = _motion(primitive, q, joint.name, symbols)
        v = index.spin if ball else index.v[i : i + 1]
        turns = primitive is not None and primitive.kind == "revolute"
        found.append(
            Frame(
                name=joint.name if final else f"{joint.name}_{i + 1}",
                joint=joint.name,
                body=k if final else -1,
                parent=parent,
                kind="fixed" if held or primitive is None else primitive.kind,
                angle=angle + (axis[2] * q[0] if turns else 0),
                axis=axis,
                rotation=rotation * turned,
                offset=offset + rotation * slid,
                q=() if held else q,
                v=() if held else tuple(real(c.name) for c in velocities),
                a=() if held else tuple(real(c.acceleration) for c in velocities),
                given=bool(v) and v[0] >= nv and not held,
                armature=armature,
                mass=symbols.value(body.mass) if final else sp.Integer(0),
                centre=centre if final else ORIGIN,
                inertia=_inertia(body, symbols) if final else sp.zeros(3, 3),
                defined=((real(f"k_{joint.name}"), _scale(q)),) if ball else (),
            )
        )
        parent, rotation, offset, angle = len(found) - 1, sp.eye(3), ORIGIN, sp.Integer(0)
    return parent


def _motion(
    primitive: Primitive | None, q: Sequence[Expr], joint: str, symbols: NamingMechanism
) -> tuple[Expr, Expr, Expr]:
    """Rotation, displacement and axis of a joint primitive at its coordinates."""
    if primitive is None:
        return sp.eye(3), ORIGIN, ORIGIN
    if primitive.kind == "spherical":
        return of_quaternion(q, real(f"k_{joint}")), ORIGIN, ORIGIN
    axis = sp.Matrix([symbols.number(part) for part in direction(primitive.axis)])
    if primitive.kind == "prismatic":
        return sp.eye(3), axis * q[0], axis
    return about(axis, q[0]), ORIGIN, axis


def _scale(q: Sequence[Expr]) -> Expr:
    """2/|q|², by which a quaternion of any length gives a rotation."""
    return 2 / sum(x**2 for x in q)


def _vector(parts: tuple[Formula, ...], symbols: NamingMechanism) -> Expr:
    x, y, *z = (symbols.value(part) for part in parts)
    return sp.Matrix([x, y, *(z or [0])])


def _inertia(body: Body, symbols: NamingMechanism) -> Expr:
    entries = [symbols.value(entry) for entry in body.inertia_com]
    if len(entries) == 1:
        return sp.diag(0, 0, entries[0])
    xx, yy, zz, xy, xz, yz = entries
    return sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
