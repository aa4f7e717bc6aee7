"""Wrenches, from the leaves to the root: loads on bodies, and inverse dynamics.

The sums are the inward sweep of the recursive Newton-Euler algorithm (Featherstone 2008, 5.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import Link, TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, inertial_force
from eomgen.dynamics.tree.vectors import (
    Vec,
    add,
    constant,
    cross,
    dot,
    scale,
    sub,
    times,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True)
class Wrench:
    """A force with its moment: moment about a frame's origin (N m) and force (N), link's axes."""

    moment: Vec
    force: Vec


@dataclass(frozen=True)
class PointForce:
    """A force (N) at a point of a body and a torque (N m), in world axes.

    `at` is the point from the centre of mass, in body axes, m. `in_body` has force and torque in
    body axes, if the scene gives them in those.
    """

    body: int
    at: Vec
    force: Vec
    torque: Vec
    in_body: tuple[Vec, Vec] | None = None


def no_wrench(scalars: Scalars) -> Wrench:
    """The zero wrench."""
    return Wrench(zeros(scalars), zeros(scalars))


def total(a: Wrench, b: Wrench) -> Wrench:
    """a + b."""
    return Wrench(add(a.moment, b.moment), add(a.force, b.force))


def less(a: Wrench, b: Wrench) -> Wrench:
    """a - b."""
    return Wrench(sub(a.moment, b.moment), sub(a.force, b.force))


def at_parent(link: Link, f: Wrench) -> Wrench:
    """A wrench at a link's origin, as one at its parent's origin, in the parent's axes."""
    force = link.rotation.out(f.force)
    return Wrench(add(link.rotation.out(f.moment), cross(link.arm, force)), force)


def moved_to(point: Vec, f: Wrench) -> Wrench:
    """A wrench at the origin, as one at a point."""
    return Wrench(sub(f.moment, cross(point, f.force)), f.force)


def wrenches(
    linkage: Linkage,
    kinematics: TreeKinematics,
    loads: Sequence[PointForce],
    scalars: Scalars,
    about: Sequence[Vec] | None = None,
) -> tuple[Wrench, ...]:
    """The sum of the loads on each frame, in the link's axes. Moments are about the frames'
    origins, or about the points `about`, given in the frames' own axes.
    """
    found = [no_wrench(scalars)] * len(kinematics.links)
    for load in loads:
        mount = linkage.mounts[load.body]
        if mount.frame >= 0:
            at = mount.at if about is None else sub(mount.at, about[mount.frame])
            axes = constant(mount.axes, scalars)
            at = add(at, times(axes, load.at))
            if load.in_body is not None:
                force, torque = (times(axes, part) for part in load.in_body)
                moment = kinematics.of_frame(mount.frame, add(torque, cross(at, force)))
                wrench = Wrench(moment, kinematics.of_frame(mount.frame, force))
            else:
                force = kinematics.from_world(mount.frame, load.force)
                arm = kinematics.of_frame(mount.frame, at)
                torque = kinematics.from_world(mount.frame, load.torque)
                wrench = Wrench(add(torque, cross(arm, force)), force)
            found[mount.frame] = total(found[mount.frame], wrench)
    return tuple(found)


def on_frames(
    links: Sequence[Link], found: Sequence[Wrench], tau: Sequence[Scalar], scalars: Scalars
) -> tuple[list[Wrench], list[Scalar]]:
    """The wrenches together with the torques of revolute axes, as moments on child and parent; and
    what is left of `tau`.
    """
    wrenches, left = list(found), list(tau)
    for k, link in enumerate(links):
        for axis, i in link.free:
            if not axis.angular or scalars.is_zero(tau[i]):
                continue
            moment = scale(tau[i], axis.direction)
            wrenches[k] = total(wrenches[k], Wrench(moment, zeros(scalars)))
            if link.parent >= 0:
                back = Wrench(link.rotation.out(moment), zeros(scalars))
                wrenches[link.parent] = less(wrenches[link.parent], back)
            left[i] = scalars.number(0.0)
    return wrenches, left


def inertial(
    kinematics: TreeKinematics, frame_accelerations: Sequence[Acceleration], scalars: Scalars
) -> tuple[Wrench, ...]:
    """The wrench that accelerates each frame's own mass (Newton and Euler)."""
    return tuple(
        Wrench(*inertial_force(link, a, scalars))
        for link, a in zip(kinematics.links, frame_accelerations, strict=True)
    )


def carried(kinematics: TreeKinematics, forces: Sequence[Wrench]) -> tuple[Wrench, ...]:
    """For each frame the sum of the wrenches on its subtree, at its origin."""
    sums = list(forces)
    for k in reversed(range(len(sums))):
        link = kinematics.links[k]
        if link.parent >= 0:
            sums[link.parent] = total(sums[link.parent], at_parent(link, sums[k]))
    return tuple(sums)


def generalised(kinematics: TreeKinematics, sums: Sequence[Wrench], nv: int) -> list[Scalar]:
    """Sᵀ f: the generalised forces (nv,) of the subtrees' wrenches, in the order of v."""
    parts: list[Scalar] = [None] * nv
    for link, f in zip(kinematics.links, sums, strict=True):
        for axis, i in zip(link.axes, link.v, strict=True):
            parts[i] = dot(axis.direction, f.moment if axis.angular else f.force)
    return parts


def rotor_forces(
    kinematics: TreeKinematics, vd: Sequence[Scalar], nv: int, scalars: Scalars
) -> list[Scalar]:
    """Generalised forces (nv,) that accelerate the motors' rotors."""
    parts = [scalars.number(0.0)] * nv
    for link in kinematics.links:
        for i in link.v:
            parts[i] = link.armature * vd[i]
    return parts
