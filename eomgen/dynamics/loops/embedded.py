"""Articulated bodies with loops: each cluster is eliminated as one joint; the cost is linear.

Local constraint embedding (A. Jain, "Multibody graph transformations and analysis", Nonlinear
Dynamics 67 (2012) 2779-2797 and 68 (2012) 153-170). A cluster moves relative to its base along
columns of motion T. With I the articulated-body inertias of its frames and all that they carry
outside of the cluster,

    D = Tᵀ I T,    U = Σ I T,    I_base += Σ I - U P Uᵀ

with all sums at the base's origin: the elimination of one joint. P solves the cluster's equation,
see `cluster_joint`: D⁻¹ where T has the columns of independent velocities, v = N v_i. The
accelerations γ at v̇_i = 0 are added to those at v̇ = 0, to which the recursion is relative.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from eomgen.dynamics.loops.cluster_joint import Equation, Joint, without
from eomgen.dynamics.loops.cluster_motion import (
    carried,
    composite,
    motions,
    needed,
    power,
    rotors,
)
from eomgen.dynamics.loops.clusters import Cluster
from eomgen.dynamics.loops.constraints import Symmetric as Factored
from eomgen.dynamics.loops.constraints import factored
from eomgen.dynamics.tree.articulated import (
    ArticulatedInertia,
    Pivot,
    inwards,
    joined,
    moved_to_parent,
    outwards,
    pivots_of,
    rigid_body_inertia,
)
from eomgen.dynamics.tree.forces import Wrench, at_parent, total
from eomgen.dynamics.tree.kinematics import Link, TreeKinematics
from eomgen.dynamics.tree.motion import Motion, outward, with_rate
from eomgen.dynamics.tree.vectors import (
    add,
    dot,
    scale,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True, eq=False)
class Articulated:
    """The eliminated joints: pivots of frames outside of clusters, and clusters by their first
    frame.
    """

    pivots: Sequence[tuple[Pivot, ...]]
    joints: dict[int, Joint]
    inside: frozenset[int]


Columns = Sequence[tuple[int, Sequence[Scalar]]]
"""Velocities along which clusters are solved, each with its column (nv,) of motion."""
Solver = Callable[[Cluster, Sequence[int], Factored], Equation]
"""Makes the equation of a cluster, with its velocities and the factors of D."""


def articulate(
    kinematics: TreeKinematics,
    clusters: Sequence[Cluster],
    columns: Columns,
    solver: Solver,
    names: Sequence[str],
    scalars: Scalars,
) -> Articulated:
    """The inward sweep over inertias; `names` are those of all velocities."""
    links, zero = kinematics.links, scalars.number(0.0)
    sums = [rigid_body_inertia(link, zero) for link in links]
    pivots: list[tuple[Pivot, ...]] = [()] * len(links)
    joints: dict[int, Joint] = {}
    first = {cluster.frames[0]: cluster for cluster in clusters}
    inside = frozenset(k for cluster in clusters for k in cluster.frames)
    for k in reversed(range(len(links))):
        if k in first:
            joints[k] = _joint(links, first[k], sums, columns, solver, names, scalars)
        if k in inside:
            continue
        link = links[k]
        pivots[k], p = pivots_of(link, sums[k], scalars)
        if link.parent >= 0:
            sums[link.parent] = joined(sums[link.parent], moved_to_parent(link, p, scalars))
    return Articulated(pivots, joints, inside)


def _joint(
    links: Sequence[Link],
    cluster: Cluster,
    sums: list[ArticulatedInertia],
    basis: Columns,
    solver: Solver,
    names: Sequence[str],
    scalars: Scalars,
) -> Joint:
    """A cluster as a joint; what remains of its inertia is added to that of the base in `sums`."""
    own = {i for k in cluster.frames for _, i in links[k].free}
    chosen = [(i, column) for i, column in basis if i in own]
    velocities = tuple(i for i, _ in chosen)
    columns = [motions(links, cluster, column, scalars) for _, column in chosen]
    inertias = {k: sums[k] for k in cluster.frames}
    wrenches = [{k: needed(inertias[k], column[k]) for k in cluster.frames} for column in columns]
    matrix = [
        [
            power(cluster, columns[a], wrenches[b], scalars)
            + rotors(links, cluster, chosen[a][1], chosen[b][1], scalars)
            for b in range(a + 1)
        ]
        for a in range(len(chosen))
    ]
    factors = factored(matrix, [names[i] for i in velocities], scalars)
    equation = solver(cluster, velocities, factors)
    at_base: list[Wrench] = []
    if cluster.base >= 0:
        at_base = [carried(links, cluster, wrench, scalars) for wrench in wrenches]
        left = without(composite(links, cluster, inertias, scalars), at_base, equation)
        sums[cluster.base] = joined(sums[cluster.base], left)
    return Joint(cluster, velocities, columns, inertias, at_base, equation)


@dataclass(frozen=True, eq=False)
class Response:
    """v̇ (nv,), and the right side of each cluster's equation, by its first frame."""

    accelerations: list[Scalar]
    rights: dict[int, list[Scalar]]


def respond(
    kinematics: TreeKinematics,
    found: Articulated,
    columns: Columns,
    forces: Sequence[Wrench],
    tau: Sequence[Scalar],
    bend: Sequence[Scalar],
    scalars: Scalars,
    *,
    still: bool = False,
) -> Response:
    """The response to generalised forces `tau` (nv,) and the wrenches -`forces` on the frames, with
    the accelerations `bend` γ (nv,) of dependent velocities; `still` if it is a change of the
    velocities by impulses.
    """
    links, column = kinematics.links, dict(columns)
    sums, shares = list(forces), list(tau)
    parts: dict[int, list[Scalar]] = {}
    for k in reversed(range(len(links))):
        if k in found.joints:
            joint = found.joints[k]
            parts[k] = _cluster_inwards(links, joint, column, sums, tau, bend, scalars, still)
        if k in found.inside:
            continue
        link, p = links[k], inwards(links[k], found.pivots[k], sums[k], tau, shares)
        if link.parent >= 0:
            sums[link.parent] = total(sums[link.parent], at_parent(link, p))
    return _outwards(links, found, column, parts, shares, bend, scalars, still)


def _cluster_inwards(
    links: Sequence[Link],
    joint: Joint,
    column: dict[int, Sequence[Scalar]],
    sums: list[Wrench],
    tau: Sequence[Scalar],
    bend: Sequence[Scalar],
    scalars: Scalars,
    still: bool,
) -> list[Scalar]:
    """The forces that are left for each velocity of a cluster; its wrench is added to
    that of the base in `sums`.
    """
    cluster = joint.cluster
    drift = motions(links, cluster, bend, scalars)
    biased = {k: total(sums[k], needed(joint.inertias[k], drift[k])) for k in cluster.frames}
    left = []
    for i, motion in zip(joint.velocities, joint.columns, strict=True):
        own = column[i]
        force = scalars.number(0.0)
        for k in cluster.frames:
            for _, j in links[k].free:
                if not scalars.is_zero(own[j]):
                    force = force + own[j] * (tau[j] - links[k].armature * bend[j])
        left.append(force - power(cluster, motion, biased, scalars))
    if cluster.base >= 0:
        whole = carried(links, cluster, biased, scalars)
        for share, u in zip(joint.equation.solved(left, still=still), joint.at_base, strict=True):
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
    still: bool,
) -> Response:
    """The outward sweep: v̇, each from the acceleration of the parent's frame or the base."""
    result, rights = list(shares), dict[int, list[Scalar]]()
    reached: list[Motion] = []
    for k, link in enumerate(links):
        if k in found.joints:
            joint = found.joints[k]
            right = _right(joint, parts[k], reached)
            rights[k] = right
            _enter(
                links,
                joint,
                column,
                joint.equation.solved(right, still=still),
                bend,
                result,
                scalars,
            )
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent >= 0:
            angular, linear = outward(link, *reached[link.parent])
        if k in found.inside:
            for axis, i in link.free:
                angular, linear = with_rate(axis, result[i], angular, linear)
            reached.append((angular, linear))
            continue
        reached.append(outwards(link, found.pivots[k], (angular, linear), shares, result))
    return Response(result, rights)


def _right(joint: Joint, left: Sequence[Scalar], reached: Sequence[Motion]) -> list[Scalar]:
    """The right side of a cluster's equation, with the acceleration of its base."""
    if joint.cluster.base < 0:
        return list(left)
    angular, linear = reached[joint.cluster.base]
    return [
        x - (dot(u.moment, angular) + dot(u.force, linear))
        for x, u in zip(left, joint.at_base, strict=True)
    ]


def _enter(
    links: Sequence[Link],
    joint: Joint,
    column: dict[int, Sequence[Scalar]],
    solution: Sequence[Scalar],
    bend: Sequence[Scalar],
    result: list[Scalar],
    scalars: Scalars,
) -> None:
    """Enter the accelerations of a cluster into `result`."""
    for k in joint.cluster.frames:
        for _, j in links[k].free:
            whole = bend[j]
            for i, a in zip(joint.velocities, solution, strict=True):
                if not scalars.is_zero(column[i][j]):
                    whole = whole + column[i][j] * a
            result[j] = whole
