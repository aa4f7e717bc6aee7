"""Motions, wrenches and inertias of the frames of a cluster, relative to its base."""

from collections.abc import Sequence

from eomgen.dynamics.loops.clusters import Cluster
from eomgen.dynamics.tree.articulated import ArticulatedInertia, joined, moved_to_parent
from eomgen.dynamics.tree.forces import Wrench, at_parent, no_wrench, total
from eomgen.dynamics.tree.kinematics import Link
from eomgen.dynamics.tree.motion import Motion, outward, with_rate
from eomgen.dynamics.tree.vectors import add, dot, times, transposed, zeros
from eomgen.scalars.protocol import Scalar, Scalars


def motions(
    links: Sequence[Link], cluster: Cluster, v: Sequence[Scalar], scalars: Scalars
) -> dict[int, Motion]:
    """The motion of each frame of a cluster at velocities v (nv,), with the base at rest."""
    found: dict[int, Motion] = {}
    for k in cluster.frames:
        link = links[k]
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent in found:
            angular, linear = outward(link, *found[link.parent])
        for axis, i in link.free:
            if not scalars.is_zero(v[i]):
                angular, linear = with_rate(axis, v[i], angular, linear)
        found[k] = angular, linear
    return found


def needed(p: ArticulatedInertia, motion: Motion) -> Wrench:
    """The wrench that gives an inertia an acceleration."""
    angular, linear = motion
    return Wrench(
        add(times(p.J, angular), times(p.G, linear)),
        add(times(transposed(p.G), angular), times(p.H, linear)),
    )


def carried(
    links: Sequence[Link], cluster: Cluster, forces: dict[int, Wrench], scalars: Scalars
) -> Wrench:
    """The sum of wrenches on the frames of a cluster, at the base's origin."""
    sums, whole = dict(forces), no_wrench(scalars)
    for k in reversed(cluster.frames):
        link = links[k]
        there = at_parent(link, sums[k])
        if link.parent in sums:
            sums[link.parent] = total(sums[link.parent], there)
        else:
            whole = total(whole, there)
    return whole


def composite(
    links: Sequence[Link],
    cluster: Cluster,
    inertias: dict[int, ArticulatedInertia],
    scalars: Scalars,
) -> ArticulatedInertia:
    """The sum of the inertias, at the base's origin."""
    sums, whole = dict(inertias), None
    for k in reversed(cluster.frames):
        link = links[k]
        there = moved_to_parent(link, sums[k], scalars)
        if link.parent in sums:
            sums[link.parent] = joined(sums[link.parent], there)
        else:
            whole = there if whole is None else joined(whole, there)
    assert whole is not None, "a cluster has a frame on its base"
    return whole


def power(
    cluster: Cluster, motion: dict[int, Motion], force: dict[int, Wrench], scalars: Scalars
) -> Scalar:
    """The sum of the powers of wrenches on the frames of a cluster."""
    whole: Scalar | None = None
    for k in cluster.frames:
        (angular, linear), f = motion[k], force[k]
        part = dot(angular, f.moment) + dot(linear, f.force)
        whole = part if whole is None else whole + part
    return scalars.number(0.0) if whole is None else whole


def rotors(
    links: Sequence[Link],
    cluster: Cluster,
    a: Sequence[Scalar],
    b: Sequence[Scalar],
    scalars: Scalars,
) -> Scalar:
    """aᵀ A b with the armatures A of a cluster's joints."""
    whole = scalars.number(0.0)
    for k in cluster.frames:
        for _, i in links[k].free:
            whole = whole + links[k].armature * (a[i] * b[i])
    return whole
