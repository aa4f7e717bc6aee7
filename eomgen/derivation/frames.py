"""The mechanism as a chain of frames with one joint primitive each, over symbols.

The frame of a body has the body's axes and its origin at the body's joint. A joint with several
primitives has a frame without mass for each but the last. A weld or a locked joint has a fixed one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.linkage import (
    fixed_angle,
    fixed_axes,
    inertia_of,
    primitive_motion,
    quaternion_scale,
    vector,
)
from eomgen.derivation.mechanism import NamingMechanism, Notes
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbols import Expr, real
from eomgen.model.bodies import JointIndex
from eomgen.model.model import Model
from eomgen.scene.joints.base import WithRotor

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
        if model.dimensions == 2:
            angle = fixed_angle(joint, symbols)
        offset = vector(joint.r_parent, symbols)
        centre = -vector(joint.r_child, symbols)
        if isinstance(joint, WithRotor):
            armature = symbols.value(joint.reflected_inertia)
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
        turned, slid, axis = sp.eye(3), ORIGIN, ORIGIN
        if primitive is not None:
            scale = real(f"k_{joint.name}")
            turned, slid, axis = primitive_motion(primitive, q, scale, symbols)
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
                inertia=inertia_of(body, symbols) if final else sp.zeros(3, 3),
                defined=((real(f"k_{joint.name}"), quaternion_scale(q)),) if ball else (),
            )
        )
        parent, rotation, offset, angle = len(found) - 1, sp.eye(3), ORIGIN, sp.Integer(0)
    return parent
