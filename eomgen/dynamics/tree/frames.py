"""What a linkage is made of: frames with their joint primitives, and the bodies mounted on them."""

from dataclasses import dataclass, field
from typing import Literal

from eomgen.dynamics.tree.rotations import IdentityRotation, Rotation
from eomgen.dynamics.tree.vectors import Mat, Symmetric, Vec, add, congruent, plus, times
from eomgen.scalars.exact import Matrix, Real
from eomgen.scalars.protocol import Scalar


@dataclass(frozen=True)
class Rigid:
    """Mass (kg), first moment m c (kg m) and inertia (kg m²) about the frame's origin, in the
    frame's axes: the ten numbers of a rigid-body inertia (Featherstone 2008, 2.13).
    """

    mass: Scalar
    first_moment: Vec
    inertia: Symmetric


def joined(a: Rigid, b: Rigid) -> Rigid:
    """The sum of two rigid-body inertias about the same origin."""
    return Rigid(a.mass + b.mass, add(a.first_moment, b.first_moment), plus(a.inertia, b.inertia))


def turned(body: Rigid, axes: Mat) -> Rigid:
    """A rigid-body inertia in other axes: `axes` are from its own to those."""
    first = times(axes, body.first_moment)
    return Rigid(body.mass, first, congruent(axes, body.inertia))


@dataclass(frozen=True)
class Frame:
    """A frame, and the joint primitive between it and frame `parent` (-1 is the world).

    offset    its origin at q = 0 from the parent's origin, in the parent's axes, m
    fixed     rotation at q = 0: the columns are its axes in the parent's axes, exact
    kind      of the primitive, and `axis` the coordinate axis that it is about or along; "fixed" is
              a frame that does not move in its parent's, rotated by formulas of parameters
    angle     in the plane: the angle of `fixed`, rad, exact
    lead      the angle of a revolute primitive at q = 0, rad, exact
    q, v      indices of its coordinates and velocities
    armature  reflected inertia of a motor's rotor, kg m² or kg
    rigid     inertia of the bodies on it
    driven    whether its motion is prescribed
    held      of a fixed frame, the rotation after `fixed` that parameters give; in the plane also
              its angle `turn`, rad
    """

    name: str
    parent: int
    offset: Vec
    fixed: Matrix
    kind: Literal["revolute", "prismatic", "spherical", "fixed"]
    axis: int
    angle: Real
    lead: Real
    q: tuple[int, ...]
    v: tuple[int, ...]
    armature: Scalar
    rigid: Rigid
    driven: bool
    held: Rotation = field(default_factory=IdentityRotation)
    turn: Scalar = 0.0


@dataclass(frozen=True)
class Mount:
    """A body on its frame (-1 is the world): its axes and its centre of mass `at`, in that frame.

    angle    in the plane: the angle of its axes, rad, whole turns included
    joint    its joint's point from the centre of mass, in body axes, m
    inertia  about the centre of mass, in body axes, kg m²
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
    """The frames of a model, parents before children, and the mount of every body."""

    frames: tuple[Frame, ...]
    mounts: tuple[Mount, ...]
    planar: bool
