"""Kinematics of a tree at coordinates q: the pose of every frame, in its own axes or the world's.

In its own axes a frame moves about a coordinate axis. A third of every matrix is then zero, but
matrices must be rotated from frame to frame. In the world's axes nothing is rotated, but motion
axes point anywhere; in the plane they still point along z. All algorithms take either.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from eomgen.dynamics.tree.frames import Frame, Linkage, Rigid, turned
from eomgen.dynamics.tree.rotations import (
    IdentityRotation,
    Rotation,
    axis_rotation,
    both,
    cosine_and_sine,
    fixed_rotation,
    from_quaternion,
)
from eomgen.dynamics.tree.vectors import (
    AXES,
    Mat,
    Vec,
    add,
    scale,
    times,
    transposed,
    unit,
)
from eomgen.scalars.exact import ZERO, Real, quarters, total
from eomgen.scalars.protocol import Scalar, Scalars

Axes = Literal["own", "world"]


@dataclass(frozen=True)
class Angle:
    """The angle of a planar frame's axes from the world's, rad: a moving part and a fixed one.

    Angles add, which needs one sine and cosine and no product of matrices. The fixed part is exact,
    so that quarter turns can be taken out of it: no double is a right angle.
    """

    moving: Scalar
    fixed: Real

    def and_more(self, angle: Real, scalars: Scalars) -> Scalar:
        """The whole angle plus a fixed one, rad."""
        return self.moving + scalars.number(total(self.fixed, angle))

    def matrix(self, scalars: Scalars) -> Mat:
        """From the frame's axes to the world's."""
        count, rest = quarters(self.fixed)
        c, s = cosine_and_sine(self.moving + scalars.number(rest), count, scalars)
        zero, one = scalars.number(0.0), scalars.number(1.0)
        return ((c, -s, zero), (s, c, zero), (zero, zero, one))


@dataclass(frozen=True)
class MotionAxis:
    """One column of a joint motion subspace S (see `scene.joints.base`): angular or linear.

    `unit` is k where `direction` is the k-th coordinate direction for every q; else None.
    """

    angular: bool
    direction: Vec
    unit: int | None


@dataclass(frozen=True)
class Link:
    """A frame at coordinates q.

    rotation  from its axes to the parent's
    arm       its origin from the parent's origin, in the parent's axes, m
    axes, v   columns of S in its own axes, and the index in v of the velocity of each
    armature  reflected inertia of a motor's rotor, kg m² or kg
    driven    whether its motion is prescribed and not solved for
    """

    name: str
    parent: int
    rotation: Rotation
    arm: Vec
    axes: tuple[MotionAxis, ...]
    v: tuple[int, ...]
    armature: Scalar
    rigid: Rigid
    driven: bool

    @property
    def free(self) -> tuple[tuple[MotionAxis, int], ...]:
        """The motion axes whose velocities are states, each with its index in v."""
        return () if self.driven else tuple(zip(self.axes, self.v, strict=True))


@dataclass(frozen=True)
class TreeKinematics:
    """All links at coordinates q, parents before children.

    world   for each link the rotation matrix from its frame's own axes to the world's
    angles  in the plane: the frames' angles from the world's x axis
    axes    the axes that the links are written in: their own, or the world's
    """

    links: tuple[Link, ...]
    world: tuple[Mat, ...]
    angles: tuple[Angle, ...]
    axes: Axes

    def to_world(self, k: int, a: Vec) -> Vec:
        """A vector of link k in world axes; link -1 is the world."""
        return a if k < 0 or self.axes == "world" else times(self.world[k], a)

    def from_world(self, k: int, a: Vec) -> Vec:
        """A vector of world axes in those of link k."""
        return a if k < 0 or self.axes == "world" else times(transposed(self.world[k]), a)

    def of_frame(self, k: int, a: Vec) -> Vec:
        """A vector of frame k's own axes in those of link k."""
        return times(self.world[k], a) if k >= 0 and self.axes == "world" else a

    def in_frame(self, k: int, a: Vec) -> Vec:
        """A vector of link k in frame k's own axes."""
        return times(transposed(self.world[k]), a) if k >= 0 and self.axes == "world" else a


def tree_kinematics(
    linkage: Linkage, q: Sequence[Scalar], axes: Axes, scalars: Scalars
) -> TreeKinematics:
    """The links of a linkage at coordinates `q`."""
    eye = (unit(0, scalars), unit(1, scalars), unit(2, scalars))
    links: list[Link] = []
    world: list[Mat] = []
    angles: list[Angle] = []
    for frame in linkage.frames:
        fixed = still_rotation(frame, scalars)
        rotation, arm = fixed, frame.offset
        directions: tuple[MotionAxis, ...] = (
            MotionAxis(frame.kind == "revolute", eye[frame.axis], frame.axis),
        )
        if frame.kind == "fixed":
            directions = ()
        elif frame.kind == "spherical":
            rotation = both(fixed, from_quaternion([q[i] for i in frame.q], scalars))
            directions = tuple(MotionAxis(True, eye[k], k) for k in AXES)
        elif frame.kind == "revolute":
            count, lead = quarters(frame.lead)
            angle = q[frame.q[0]] + scalars.number(lead)
            rotation = both(fixed, axis_rotation(frame.axis, angle, count, scalars))
        else:
            arm = add(arm, fixed.out(scale(q[frame.q[0]], eye[frame.axis])))
        base = world[frame.parent] if frame.parent >= 0 else eye
        if linkage.planar:
            angles.append(_angle(frame, angles, q, scalars))
            world.append(angles[-1].matrix(scalars))
        else:
            world.append(rotation.after(base))
        rigid = frame.rigid
        if axes == "world":
            rotation, arm = IdentityRotation(), times(base, arm)
            directions = tuple(_rotated(axis, world[-1], linkage.planar) for axis in directions)
            rigid = turned(rigid, world[-1])
        links.append(
            Link(
                frame.name,
                frame.parent,
                rotation,
                arm,
                directions,
                frame.v,
                frame.armature,
                rigid,
                frame.driven,
            )
        )
    return TreeKinematics(tuple(links), tuple(world), tuple(angles), axes)


def still_rotation(frame: Frame, scalars: Scalars) -> Rotation:
    """The rotation from a frame's axes at q = 0 to its parent's."""
    fixed = fixed_rotation(frame.fixed, scalars)
    return both(fixed, frame.held) if frame.kind == "fixed" else fixed


def _angle(frame: Frame, angles: Sequence[Angle], q: Sequence[Scalar], scalars: Scalars) -> Angle:
    """A planar frame's angle, by that of its parent."""
    base = angles[frame.parent] if frame.parent >= 0 else Angle(scalars.number(0.0), ZERO)
    fixed = total(base.fixed, frame.angle)
    if frame.kind == "fixed":
        return Angle(base.moving + frame.turn, fixed)
    if frame.kind != "revolute":
        return Angle(base.moving, fixed)
    return Angle(scalars.named(base.moving + q[frame.q[0]], f"angle_{frame.name}"), fixed)


def _rotated(axis: MotionAxis, world: Mat, planar: bool) -> MotionAxis:
    """A frame's own axis in world axes: in the plane z stays z."""
    if planar and axis.unit == 2:
        return axis
    assert axis.unit is not None
    column = (world[0][axis.unit], world[1][axis.unit], world[2][axis.unit])
    return MotionAxis(axis.angular, column, None)
