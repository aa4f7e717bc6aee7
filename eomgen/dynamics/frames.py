"""What a linkage is made of: frames with their joint primitives, and the bodies mounted on them."""

from dataclasses import dataclass
from typing import Literal

from eomgen.dynamics.vectors import Symmetric, Vec, add, plus
from eomgen.scalars.exact import Matrix, Real
from eomgen.scalars.protocol import Scalar


@dataclass(frozen=True)
class Rigid:
    """Mass, first moment m c and inertia about the frame's origin, in the frame's axes."""

    mass: Scalar
    first_moment: Vec
    inertia: Symmetric


def joined(a: Rigid, b: Rigid) -> Rigid:
    """Two bodies about the same origin as one."""
    return Rigid(a.mass + b.mass, add(a.first_moment, b.first_moment), plus(a.inertia, b.inertia))


@dataclass(frozen=True)
class Frame:
    """A frame and its joint primitive against frame `parent` (-1 the world).

    `offset` is its origin at zero from the parent's, in the parent's axes; the columns of `fixed`
    are its axes at zero in the parent's; the move goes about or along coordinate axis `axis` of
    its own, a turn by `lead` more than its coordinate. In the plane `angle` is that of its axes at
    zero in the parent's. All three are exact. `q` and `v` index its coordinates and velocities.
    `armature` is the inertia of a motor's rotor on the coordinate. A `driven` move is given.
    """

    name: str
    parent: int
    offset: Vec
    fixed: Matrix
    kind: Literal["revolute", "prismatic", "spherical"]
    axis: int
    angle: Real
    lead: Real
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
    axes: Matrix
    angle: Real
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
