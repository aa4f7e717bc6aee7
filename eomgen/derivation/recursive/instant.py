"""The frames at an instant: where each is in its parent, in its own axes or in the world's.

In its own axes a frame moves about a coordinate axis, which makes a third of every matrix zero, but
matrices must be turned from frame to frame. In the world's axes nothing is turned, but axes point
anywhere; in the plane they still point along z. All algorithms take either.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from eomgen.derivation.recursive.frames import Frame, Linkage, Rigid
from eomgen.derivation.recursive.rotations import (
    AxisTurn,
    Both,
    Rotation,
    Turned,
    Unturned,
    axis_turn,
    from_quaternion,
)
from eomgen.derivation.recursive.vectors import (
    AXES,
    Mat,
    Scalar,
    Scalars,
    Vec,
    add,
    congruent,
    constant,
    product,
    scale,
    times,
    transposed,
    unit,
)

Axes = Literal["own", "world"]


@dataclass(frozen=True)
class Axis:
    """A direction of motion that one velocity stands for.

    `unit` is k where `direction` is the k-th coordinate direction at every instant; else None.
    """

    angular: bool
    direction: Vec
    unit: int | None


@dataclass(frozen=True)
class Link:
    """A frame at an instant.

    `turn` leads from its axes to the parent's; `arm` is its origin from the parent's, in the
    parent's axes; `axes` are its motions in its own axes, the velocity v[i] times each. A `driven`
    motion is given and not solved for.
    """

    name: str
    parent: int
    turn: Rotation
    arm: Vec
    axes: tuple[Axis, ...]
    v: tuple[int, ...]
    armature: Scalar
    rigid: Rigid
    driven: bool

    @property
    def free(self) -> tuple[tuple[Axis, int], ...]:
        """The axes whose velocities are states, each with the index of that."""
        return () if self.driven else tuple(zip(self.axes, self.v, strict=True))


@dataclass(frozen=True)
class Instant:
    """All links, and for each the matrix from its frame's own axes to the world's.

    `axes` says in which the links are written. In the plane `angles` are the frames' own from the
    world's x axis.
    """

    links: tuple[Link, ...]
    world: tuple[Mat, ...]
    angles: tuple[Scalar, ...]
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


def at_instant(linkage: Linkage, q: Sequence[Scalar], axes: Axes, scalars: Scalars) -> Instant:
    """The links of a linkage at coordinates `q`."""
    eye = (unit(0, scalars), unit(1, scalars), unit(2, scalars))
    links: list[Link] = []
    world: list[Mat] = []
    angles: list[Scalar] = []
    for frame in linkage.frames:
        fixed = _fixed(frame, scalars)
        turn, arm = fixed, frame.offset
        directions: tuple[Axis, ...] = (Axis(frame.kind == "turn", eye[frame.axis], frame.axis),)
        if frame.kind == "spin":
            turn = _both(fixed, from_quaternion([q[i] for i in frame.q], scalars))
            directions = tuple(Axis(True, eye[k], k) for k in AXES)
        elif frame.kind == "turn":
            angle = q[frame.q[0]] + scalars.number(frame.lead)
            turn = _both(fixed, axis_turn(frame.axis, angle, scalars))
        else:
            arm = add(arm, fixed.out(scale(q[frame.q[0]], eye[frame.axis])))
        base = world[frame.parent] if frame.parent >= 0 else eye
        if linkage.planar:
            angles.append(_angle(frame, fixed, angles, q, scalars))
            world.append(_in_plane(angles[-1], scalars))
        else:
            world.append(turn.after(base))
        rigid = frame.rigid
        if axes == "world":
            turn, arm = Unturned(), times(base, arm)
            directions = tuple(_turned(axis, world[-1], linkage.planar) for axis in directions)
            first = times(world[-1], rigid.first)
            rigid = Rigid(rigid.mass, first, congruent(world[-1], rigid.inertia))
        links.append(
            Link(
                frame.name,
                frame.parent,
                turn,
                arm,
                directions,
                frame.v,
                frame.armature,
                rigid,
                frame.driven,
            )
        )
    return Instant(tuple(links), tuple(world), tuple(angles), axes)


def _fixed(frame: Frame, scalars: Scalars) -> Rotation:
    """The fixed rotation, as a turn about one axis where it is one."""
    if np.array_equal(frame.fixed, np.eye(3)):
        return Unturned()
    for k in AXES:
        if frame.fixed[k, k] == 1.0:
            i, j = (k + 1) % 3, (k + 2) % 3
            doubles = float(frame.fixed[i, i]), float(frame.fixed[j, i])
            c, s = map(scalars.number, doubles)
            if scalars.exact and all(doubles):
                length = scalars.call("sqrt", c * c + s * s)
                c, s = c / length, s / length
            return AxisTurn(k, c, s, scalars.number(2.0) * c)
    return Turned(_orthogonal(constant(frame.fixed, scalars), scalars))


def _orthogonal(matrix: Mat, scalars: Scalars) -> Mat:
    """The rotation that a matrix of doubles is rounded from: heavy things on light ones show what
    is none. Newton's steps R (3 - Rᵀ R) / 2 (Higham, Functions of Matrices, 8.3) bring 32 and 64
    digits.
    """
    half, three = scalars.number(0.5), scalars.number(3.0)
    for _ in range(2 * scalars.exact):
        a, b, c = product(transposed(matrix), matrix)
        rest = (
            (half * (three - a[0]), -(half * a[1]), -(half * a[2])),
            (-(half * b[0]), half * (three - b[1]), -(half * b[2])),
            (-(half * c[0]), -(half * c[1]), half * (three - c[2])),
        )
        matrix = product(matrix, rest)
    return matrix


def _both(fixed: Rotation, moving: Rotation) -> Rotation:
    return moving if isinstance(fixed, Unturned) else Both(fixed, moving)


def _angle(
    frame: Frame, fixed: Rotation, angles: list[Scalar], q: Sequence[Scalar], scalars: Scalars
) -> Scalar:
    """In the plane angles add up: one sine and cosine of a sum, and no product of matrices."""
    angle = angles[frame.parent] if frame.parent >= 0 else scalars.number(0.0)
    own = scalars.number(frame.angle)
    if scalars.exact and frame.angle:
        # No double is a right angle.
        x, y, _ = fixed.into(transposed(_in_plane(own, scalars))[0])
        own = own - scalars.call("atan2", y, x)
    angle = angle + own
    if frame.kind != "turn":
        return angle
    return scalars.named(angle + q[frame.q[0]], f"angle_{frame.name}")


def _in_plane(angle: Scalar, scalars: Scalars) -> Mat:
    zero, one = scalars.number(0.0), scalars.number(1.0)
    c, s = scalars.call("cos", angle), scalars.call("sin", angle)
    return ((c, -s, zero), (s, c, zero), (zero, zero, one))


def _turned(axis: Axis, world: Mat, planar: bool) -> Axis:
    """A frame's own axis in world axes: in the plane z stays z."""
    if planar and axis.unit == 2:
        return axis
    assert axis.unit is not None
    column = (world[0][axis.unit], world[1][axis.unit], world[2][axis.unit])
    return Axis(axis.angular, column, None)
