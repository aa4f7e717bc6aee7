"""Articulated bodies with loops: each cluster is eliminated as one joint; the cost is linear.

Local constraint embedding (A. Jain, "Multibody graph transformations and analysis", Nonlinear
Dynamics 67 (2012) 2779-2797 and 68 (2012) 153-170). A cluster moves relative to its base by its
independent velocities, v = N v_i. With T the columns of motion of its frames for unit v_i, and I
the articulated-body inertias of the frames with all that they carry outside of the cluster,

    D = Tᵀ I T,    U = Σ I T,    I_base += Σ I - U D⁻¹ Uᵀ

with all sums at the base's origin: the elimination of one joint with columns T. The accelerations γ
at v̇_i = 0 are added to those at v̇ = 0, to which the recursion's accelerations are relative.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.dynamics.articulated import (
    ArticulatedInertia,
    Pivot,
    along,
    eliminated,
    joined,
    moved_to_parent,
    rigid_body_inertia,
    with_component,
)
from eomgen.dynamics.clusters import Cluster
from eomgen.dynamics.constraints import Symmetric as Factored
from eomgen.dynamics.constraints import factored
from eomgen.dynamics.forces import Wrench, at_parent, no_wrench, total
from eomgen.dynamics.kinematics import Link, TreeKinematics
from eomgen.dynamics.vectors import (
    AXES,
    ENTRIES,
    Vec,
    add,
    cross,
    dot,
    scale,
    symmetric,
    times,
    transposed,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars

Motion = tuple[Vec, Vec]
"""An angular and a linear velocity or acceleration of a frame, at its origin."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A cluster as a joint.

    independent  the velocities that remain, indices in v
    columns      for each of them the motion of each frame of the cluster, relative to the base
    inertias     of these frames, with all that they carry outside of the cluster
    at_base      U: the wrench of each column at the base
    factors      of D
    """

    cluster: Cluster
    independent: tuple[int, ...]
    columns: Sequence[dict[int, Motion]]
    inertias: dict[int, ArticulatedInertia]
    at_base: Sequence[Wrench]
    factors: Factored


@dataclass(frozen=True, eq=False)
class Articulated:
    """The eliminated joints: pivots of frames outside of clusters, and clusters by their first
    frame.
    """

    pivots: Sequence[tuple[Pivot, ...]]
    joints: dict[int, Joint]
    inside: frozenset[int]


def articulate(
    kinematics: TreeKinematics,
    clusters: Sequence[Cluster],
    basis: Sequence[tuple[int, Sequence[Scalar]]],
    names: Sequence[str],
    scalars: Scalars,
) -> Articulated:
    """The inward sweep over inertias. `basis` are the independent velocities with their columns
    (nv,) of N; `names` those of all velocities.
    """
    links, zero = kinematics.links, scalars.number(0.0)
    sums = [rigid_body_inertia(link, zero) for link in links]
    pivots: list[tuple[Pivot, ...]] = [()] * len(links)
    joints: dict[int, Joint] = {}
    first = {cluster.frames[0]: cluster for cluster in clusters}
    inside = frozenset(k for cluster in clusters for k in cluster.frames)
    for k in reversed(range(len(links))):
        if k in first:
            joints[k] = _joint(links, first[k], sums, basis, names, scalars)
        if k in inside:
            continue
        link, p = links[k], sums[k]
        found = []
        for axis, _ in link.free:
            pivot, p = eliminated(p, axis, link, scalars)
            found.append(pivot)
        pivots[k] = tuple(found)
        if link.parent >= 0:
            sums[link.parent] = joined(sums[link.parent], moved_to_parent(link, p, scalars))
    return Articulated(pivots, joints, inside)


def _joint(
    links: Sequence[Link],
    cluster: Cluster,
    sums: list[ArticulatedInertia],
    basis: Sequence[tuple[int, Sequence[Scalar]]],
    names: Sequence[str],
    scalars: Scalars,
) -> Joint:
    """A cluster as a joint; what remains of its inertia is added to that of the base in `sums`."""
    own = {i for k in cluster.frames for _, i in links[k].free}
    chosen = [(i, column) for i, column in basis if i in own]
    columns = [motions(links, cluster, column, scalars) for _, column in chosen]
    inertias = {k: sums[k] for k in cluster.frames}
    wrenches = [{k: needed(inertias[k], column[k]) for k in cluster.frames} for column in columns]
    matrix = []
    for a, (_, one) in enumerate(chosen):
        row = []
        for b in range(a + 1):
            whole = _power(cluster, columns[a], wrenches[b], scalars)
            row.append(whole + _rotors(links, cluster, one, chosen[b][1], scalars))
        matrix.append(row)
    factors = factored(matrix, [names[i] for i, _ in chosen], scalars)
    at_base: list[Wrench] = []
    if cluster.base >= 0:
        at_base = [carried(links, cluster, wrench, scalars) for wrench in wrenches]
        whole = _composite(links, cluster, inertias, scalars)
        left = _without(whole, at_base, factors, scalars)
        sums[cluster.base] = joined(sums[cluster.base], left)
    return Joint(cluster, tuple(i for i, _ in chosen), columns, inertias, at_base, factors)


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
                more = scale(v[i], axis.direction)
                angular = add(angular, more) if axis.angular else angular
                linear = linear if axis.angular else add(linear, more)
        found[k] = angular, linear
    return found


def outward(link: Link, angular: Vec, linear: Vec) -> Motion:
    """The motion of a frame that is fixed to its parent."""
    return link.rotation.into(angular), link.rotation.into(add(linear, cross(angular, link.arm)))


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


def _composite(
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


def _without(
    p: ArticulatedInertia, columns: Sequence[Wrench], factors: Factored, scalars: Scalars
) -> ArticulatedInertia:
    """I - U D⁻¹ Uᵀ, one column of L⁻¹ Uᵀ after the other."""
    rows = [[*u.moment, *u.force] for u in columns]
    for i, row in enumerate(factors.lower):
        for j, entry in row.items():
            rows[i] = [a - entry * b for a, b in zip(rows[i], rows[j], strict=True)]
    J, G, H = p.J, p.G, p.H
    for u, d in zip(rows, factors.d, strict=True):
        w = [x / d for x in u]
        J = symmetric([J[i][j] - w[i] * u[j] for i, j in ENTRIES])
        H = symmetric([H[i][j] - w[3 + i] * u[3 + j] for i, j in ENTRIES])
        a, b, c = (
            (G[i][0] - w[i] * u[3], G[i][1] - w[i] * u[4], G[i][2] - w[i] * u[5]) for i in AXES
        )
        G = (a, b, c)
    return ArticulatedInertia(J, G, H)


def _power(
    cluster: Cluster, motion: dict[int, Motion], force: dict[int, Wrench], scalars: Scalars
) -> Scalar:
    """The sum of the powers of wrenches on the frames of a cluster."""
    whole: Scalar | None = None
    for k in cluster.frames:
        (angular, linear), f = motion[k], force[k]
        part = dot(angular, f.moment) + dot(linear, f.force)
        whole = part if whole is None else whole + part
    return scalars.number(0.0) if whole is None else whole


def _rotors(
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


def respond(
    kinematics: TreeKinematics,
    eliminated_joints: Articulated,
    basis: Sequence[tuple[int, Sequence[Scalar]]],
    forces: Sequence[Wrench],
    tau: Sequence[Scalar],
    bend: Sequence[Scalar],
    scalars: Scalars,
) -> list[Scalar]:
    """v̇ (nv,) under generalised forces `tau` (nv,) and the wrenches -`forces` on the frames, with
    the accelerations `bend` γ (nv,) of the dependent velocities.
    """
    links, found = kinematics.links, eliminated_joints
    column = dict(basis)
    sums, shares = list(forces), list(tau)
    parts: dict[int, list[Scalar]] = {}
    for k in reversed(range(len(links))):
        if k in found.joints:
            joint = found.joints[k]
            parts[k] = _cluster_inwards(links, joint, column, sums, tau, bend, scalars)
        if k in found.inside:
            continue
        link, p = links[k], sums[k]
        for (axis, i), pivot in zip(link.free, found.pivots[k], strict=True):
            left = tau[i] - along(axis, p.moment, p.force)
            shares[i] = left / pivot.d
            p = Wrench(add(p.moment, scale(left, pivot.u)), add(p.force, scale(left, pivot.w)))
            if pivot.absolute:
                p = Wrench(*with_component(axis, p.moment, p.force, tau[i]))
        if link.parent >= 0:
            sums[link.parent] = total(sums[link.parent], at_parent(link, p))
    return _outwards(links, found, column, parts, shares, bend, scalars)


def _cluster_inwards(
    links: Sequence[Link],
    joint: Joint,
    column: dict[int, Sequence[Scalar]],
    sums: list[Wrench],
    tau: Sequence[Scalar],
    bend: Sequence[Scalar],
    scalars: Scalars,
) -> list[Scalar]:
    """The forces that are left for each independent velocity of a cluster; its wrench is added to
    that of the base in `sums`.
    """
    cluster = joint.cluster
    drift = motions(links, cluster, bend, scalars)
    biased = {k: total(sums[k], needed(joint.inertias[k], drift[k])) for k in cluster.frames}
    left = []
    for i, motion in zip(joint.independent, joint.columns, strict=True):
        own = column[i]
        force = scalars.number(0.0)
        for k in cluster.frames:
            for _, j in links[k].free:
                if not scalars.is_zero(own[j]):
                    force = force + own[j] * (tau[j] - links[k].armature * bend[j])
        left.append(force - _power(cluster, motion, biased, scalars))
    if cluster.base >= 0:
        whole = carried(links, cluster, biased, scalars)
        for share, u in zip(joint.factors.solved(left), joint.at_base, strict=True):
            whole = Wrench(
                add(whole.moment, scale(share, u.moment)), add(whole.force, scale(share, u.force))
            )
        sums[cluster.base] = total(sums[cluster.base], whole)
    return left


def _outwards(
    links: Sequence[Link],
    found: Articulated,
    column: dict[int, Sequence[Scalar]],
    parts: dict[int, list[Scalar]],
    shares: Sequence[Scalar],
    bend: Sequence[Scalar],
    scalars: Scalars,
) -> list[Scalar]:
    """The outward sweep: v̇, each from the acceleration of the parent's frame or the base."""
    result = list(shares)
    reached: list[Motion] = []
    for k, link in enumerate(links):
        if k in found.joints:
            _solve_cluster(links, found.joints[k], column, parts[k], bend, reached, result, scalars)
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent >= 0:
            angular, linear = outward(link, *reached[link.parent])
        if k in found.inside:
            for axis, i in link.free:
                more = scale(result[i], axis.direction)
                angular = add(angular, more) if axis.angular else angular
                linear = linear if axis.angular else add(linear, more)
            reached.append((angular, linear))
            continue
        for (axis, i), pivot in reversed(list(zip(link.free, found.pivots[k], strict=True))):
            value = shares[i] - (dot(pivot.u, angular) + dot(pivot.w, linear))
            if pivot.absolute:
                result[i] = value - along(axis, angular, linear)
                angular, linear = with_component(axis, angular, linear, value)
            else:
                result[i] = value
                more = scale(value, axis.direction)
                angular = add(angular, more) if axis.angular else angular
                linear = linear if axis.angular else add(linear, more)
        reached.append((angular, linear))
    return result


def _solve_cluster(
    links: Sequence[Link],
    joint: Joint,
    column: dict[int, Sequence[Scalar]],
    left: Sequence[Scalar],
    bend: Sequence[Scalar],
    reached: Sequence[Motion],
    result: list[Scalar],
    scalars: Scalars,
) -> None:
    """Enter the accelerations of a cluster into `result`."""
    right = list(left)
    if joint.cluster.base >= 0:
        angular, linear = reached[joint.cluster.base]
        right = [
            x - (dot(u.moment, angular) + dot(u.force, linear))
            for x, u in zip(right, joint.at_base, strict=True)
        ]
    solution = joint.factors.solved(right)
    for k in joint.cluster.frames:
        for _, j in links[k].free:
            whole = bend[j]
            for i, a in zip(joint.independent, solution, strict=True):
                if not scalars.is_zero(column[i][j]):
                    whole = whole + column[i][j] * a
            result[j] = whole
