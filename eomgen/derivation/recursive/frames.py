"""What a linkage is made of: frames with their moves, and the bodies mounted on them."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eomgen.derivation.recursive.vectors import Scalar, Symmetric, Vec, add, plus

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rigid:
    """Mass, first moment m c and inertia about the frame's origin, in the frame's axes."""

    mass: Scalar
    first: Vec
    inertia: Symmetric


def joined(a: Rigid, b: Rigid) -> Rigid:
    """Two bodies about the same origin as one."""
    return Rigid(a.mass + b.mass, add(a.first, b.first), plus(a.inertia, b.inertia))


@dataclass(frozen=True)
class Frame:
    """A frame and its move against frame `parent` (-1 the world).

    `offset` is its origin at zero from the parent's, in the parent's axes; the columns of `fixed`
    are its axes at zero in the parent's; the move goes about or along coordinate axis `axis` of
    its own, a turn by `lead` more than its coordinate. In the plane `angle` is that of its axes at
    zero in the parent's. `q` and `v` index its coordinates and velocities.
    `armature` is the inertia of a motor's rotor on the coordinate. A `driven` move is given.
    """

    name: str
    parent: int
    offset: Vec
    fixed: Array
    kind: Literal["turn", "slide", "spin"]
    axis: int
    angle: float
    lead: float
    q: tuple[int, ...]
    v: tuple[int, ...]
    armature: Scalar
    rigid: Rigid
    driven: bool


@dataclass(frozen=True)
class Mount:
    """Where a body sits: its frame (-1 the world), its axes and centre of mass in that frame.

    In the plane `angle` is that of its axes, whole turns included.

    `joint` is the joint's point on the body from the body's centre of mass, in body axes.
    """

    frame: int
    axes: Array
    angle: float
    at: Vec
    joint: Vec
    mass: Scalar
    inertia: Symmetric


@dataclass(frozen=True)
class Linkage:
    """Frames, parents first, and the mount of every body of the model."""

    frames: tuple[Frame, ...]
    mounts: tuple[Mount, ...]
    planar: bool


def turn_matrix(k: int, angle: float) -> Array:
    """The rotation by `angle` about coordinate axis k."""
    return turn_of(k, math.cos(angle), math.sin(angle))


def turn_of(k: int, c: float, s: float) -> Array:
    """The rotation about coordinate axis k by the angle of cosine c and sine s."""
    i, j = (k + 1) % 3, (k + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix
