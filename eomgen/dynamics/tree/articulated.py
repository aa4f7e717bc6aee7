"""The articulated-body algorithm (Featherstone 2008, chapter 7): one sweep inwards, one outwards.

The wrench that accelerates a subtree at its frame's origin, by α and a, is

    n = J α + G a + p_n,    f = Gᵀ α + H a + p_f,

with the articulated-body inertia [J G; Gᵀ H] and the bias force p. Here accelerations are relative
to those of the mechanism with v̇ = 0, so that p contains forces only. Eliminating the acceleration
along one motion axis s (a column of S) leaves the same form, with

    I' = I - I s (sᵀ I s)⁻¹ sᵀ I.

If s is a coordinate axis, row and column of I' are zero there. The acceleration that is then solved
for is the frame's own, and the parent's is subtracted. A driven axis is not eliminated: its
acceleration is part of the reference, and the whole inertia is passed to the parent.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.forces import Wrench, at_parent, total
from eomgen.dynamics.tree.kinematics import Link, MotionAxis, TreeKinematics
from eomgen.dynamics.tree.motion import outward, with_rate
from eomgen.dynamics.tree.vectors import (
    AXES,
    ENTRIES,
    Mat,
    Symmetric,
    Vec,
    add,
    cross,
    dot,
    named,
    plus,
    replaced,
    scale,
    skew,
    symmetric,
    times,
    transposed,
)
from eomgen.scalars.protocol import Scalar, Scalars


@dataclass(frozen=True)
class ArticulatedInertia:
    """J (kg m²), G (kg m) and H (kg) of a subtree, at its frame's origin."""

    J: Symmetric
    G: Mat
    H: Symmetric


@dataclass(frozen=True)
class Pivot:
    """One elimination: the pivot d = sᵀ I s, and the column I s / d (moment u, force w).

    `absolute` if the acceleration that it solves for is the frame's, not the joint's.
    """

    d: Scalar
    u: Vec
    w: Vec
    absolute: bool


Pivots = tuple[tuple[Pivot, ...], ...]
"""The pivots of every link, in the order of its motion axes."""


def articulate(kinematics: TreeKinematics, scalars: Scalars) -> Pivots:
    """The inward sweep over inertias: eliminate every free motion axis, leaves first."""
    links = kinematics.links
    return articulate_links(links, range(len(links)), scalars)[0]


def articulate_links(
    links: Sequence[Link], which: Collection[int], scalars: Scalars
) -> tuple[Pivots, list[ArticulatedInertia]]:
    """The same for some links, and the inertia that is left of each at its frame's origin."""
    sums = [rigid_body_inertia(link, scalars.number(0.0)) for link in links]
    pivots: list[tuple[Pivot, ...]] = [()] * len(links)
    for k in sorted(which, reverse=True):
        link = links[k]
        pivots[k], sums[k] = pivots_of(link, sums[k], scalars)
        if link.parent in which:
            sums[link.parent] = joined(sums[link.parent], moved_to_parent(link, sums[k], scalars))
    return tuple(pivots), sums


def pivots_of(
    link: Link, p: ArticulatedInertia, scalars: Scalars
) -> tuple[tuple[Pivot, ...], ArticulatedInertia]:
    """The pivots of a link's free motion axes, and what is left of its inertia without them."""
    found = []
    for axis, _ in link.free:
        pivot, p = eliminated(p, axis, link, scalars)
        found.append(pivot)
    return tuple(found), p


def respond(
    kinematics: TreeKinematics,
    pivots: Pivots,
    forces: Sequence[Wrench],
    tau: Sequence[Scalar],
    scalars: Scalars,
) -> list[Scalar]:
    """v̇ (nv,) under generalised forces `tau` (nv,) and the wrenches -`forces` on the frames."""
    shares = _inwards(kinematics, pivots, forces, tau)
    return _outwards(kinematics, pivots, shares, scalars)


def _inwards(
    kinematics: TreeKinematics, pivots: Pivots, forces: Sequence[Wrench], tau: Sequence[Scalar]
) -> list[Scalar]:
    """The inward sweep over forces: (tau - sᵀ p) / d for each velocity."""
    links, sums = kinematics.links, list(forces)
    shares = list(tau)
    for k in reversed(range(len(links))):
        link, p = links[k], inwards(links[k], pivots[k], sums[k], tau, shares)
        if link.parent >= 0:
            sums[link.parent] = total(sums[link.parent], at_parent(link, p))
    return shares


def inwards(
    link: Link,
    pivots: Sequence[Pivot],
    p: Wrench,
    tau: Sequence[Scalar],
    shares: list[Scalar],
) -> Wrench:
    """The wrench of a link on its parent, from that of its subtree; enters (tau - sᵀ p) / d of each
    of its axes into `shares`.
    """
    for (axis, i), pivot in zip(link.free, pivots, strict=True):
        left = tau[i] - along(axis, p.moment, p.force)
        shares[i] = left / pivot.d
        p = Wrench(add(p.moment, scale(left, pivot.u)), add(p.force, scale(left, pivot.w)))
        if pivot.absolute:
            # Along a free axis the joint transmits tau only.
            p = Wrench(*with_component(axis, p.moment, p.force, tau[i]))
    return p


def outwards(
    link: Link,
    pivots: Sequence[Pivot],
    motion: tuple[Vec, Vec],
    shares: Sequence[Scalar],
    result: list[Scalar],
) -> tuple[Vec, Vec]:
    """The acceleration of a link, from that of a frame fixed to its parent; enters v̇ of each of
    its axes into `result`.
    """
    angular, linear = motion
    for (axis, i), pivot in reversed(list(zip(link.free, pivots, strict=True))):
        value = shares[i] - (dot(pivot.u, angular) + dot(pivot.w, linear))
        if pivot.absolute:
            result[i] = value - along(axis, angular, linear)
            angular, linear = with_component(axis, angular, linear, value)
        else:
            result[i] = value
            angular, linear = with_rate(axis, value, angular, linear)
    return angular, linear


def _outwards(
    kinematics: TreeKinematics, pivots: Pivots, shares: Sequence[Scalar], scalars: Scalars
) -> list[Scalar]:
    """The outward sweep: v̇, each from the acceleration of the parent's frame."""
    zero = scalars.number(0.0)
    nothing = (zero, zero, zero)
    result = list(shares)
    reached: list[tuple[Vec, Vec]] = []
    for k, link in enumerate(kinematics.links):
        angular, linear = nothing, nothing
        if link.parent >= 0:
            angular, linear = outward(link, *reached[link.parent])
        angular, linear = outwards(link, pivots[k], (angular, linear), shares, result)
        angular = named(angular, f"alpha_{link.name}", scalars)
        reached.append((angular, named(linear, f"delta_{link.name}", scalars)))
    return result


def along(axis: MotionAxis, angular: Vec, linear: Vec) -> Scalar:
    """The component of a motion or a wrench along a motion axis."""
    part = angular if axis.angular else linear
    return dot(axis.direction, part) if axis.unit is None else part[axis.unit]


def with_component(axis: MotionAxis, angular: Vec, linear: Vec, value: Scalar) -> tuple[Vec, Vec]:
    """A motion or a wrench with another component along a coordinate axis."""
    assert axis.unit is not None
    if axis.angular:
        return replaced(angular, axis.unit, value), linear
    return angular, replaced(linear, axis.unit, value)


def rigid_body_inertia(link: Link, zero: Scalar) -> ArticulatedInertia:
    """The spatial inertia of a link's own mass, at the frame's origin."""
    m = link.rigid.mass
    mass = ((m, zero, zero), (zero, m, zero), (zero, zero, m))
    return ArticulatedInertia(link.rigid.inertia, skew(link.rigid.first_moment, zero), mass)


def joined(a: ArticulatedInertia, b: ArticulatedInertia) -> ArticulatedInertia:
    """a + b."""
    return ArticulatedInertia(plus(a.J, b.J), plus(a.G, b.G), plus(a.H, b.H))


def moved_to_parent(link: Link, p: ArticulatedInertia, scalars: Scalars) -> ArticulatedInertia:
    """The same inertia at the parent's origin, in its axes: G' = G + [r]x H and
    J' = J - G [r]x + [r]x G'ᵀ, six entries of it.
    """
    r = link.arm
    J, G, H = (
        link.rotation.out_symmetric(p.J),
        link.rotation.out_matrix(p.G),
        link.rotation.out_symmetric(p.H),
    )
    columns = [cross(r, (H[0][j], H[1][j], H[2][j])) for j in AXES]
    moved = plus(G, transposed((columns[0], columns[1], columns[2])))
    old, new = [cross(r, row) for row in G], [cross(r, row) for row in moved]
    empty = [all(scalars.is_zero(x) for x in row) for row in G]

    def entry(i: int, j: int) -> Scalar:
        if empty[j] and not empty[i]:
            i, j = j, i
        return J[i][j] + (old[i][j] + new[j][i])

    return ArticulatedInertia(symmetric([entry(i, j) for i, j in ENTRIES]), moved, H)


def inertia_along(p: ArticulatedInertia, axis: MotionAxis) -> Scalar:
    """The inertia along a motion axis: sᵀ I s."""
    z = axis.direction
    return dot(z, times(p.J if axis.angular else p.H, z))


def eliminated(
    p: ArticulatedInertia, axis: MotionAxis, link: Link, scalars: Scalars
) -> tuple[Pivot, ArticulatedInertia]:
    """Eliminate one motion axis from an articulated-body inertia."""
    k = axis.unit
    if k is not None:
        moment = p.J[k] if axis.angular else (p.G[0][k], p.G[1][k], p.G[2][k])
        force = p.G[k] if axis.angular else p.H[k]
        d = p.J[k][k] if axis.angular else p.H[k][k]
    else:
        z = axis.direction
        moment = times(p.J, z) if axis.angular else times(p.G, z)
        force = times(transposed(p.G), z) if axis.angular else times(p.H, z)
        d = dot(z, moment if axis.angular else force)
    d = scalars.named(d + link.armature, f"pivot_{link.name}")
    zero = scalars.number(0.0)
    absolute = k is not None and scalars.is_zero(link.armature)
    if absolute:
        moment, force = with_component(axis, moment, force, zero)
    u = (moment[0] / d, moment[1] / d, moment[2] / d)
    w = (force[0] / d, force[1] / d, force[2] / d)
    J = symmetric([p.J[i][j] - u[i] * moment[j] for i, j in ENTRIES])
    H = symmetric([p.H[i][j] - w[i] * force[j] for i, j in ENTRIES])
    G = _less_outer(p.G, u, force)
    if absolute:
        J, G, H = _without(J, G, H, axis, zero)
    return Pivot(d, u, w, absolute), ArticulatedInertia(J, G, H)


def _less_outer(g: Mat, u: Vec, f: Vec) -> Mat:
    """g - u fᵀ."""
    a, b, c = ((g[i][0] - u[i] * f[0], g[i][1] - u[i] * f[1], g[i][2] - u[i] * f[2]) for i in AXES)
    return (a, b, c)


def _without(
    J: Symmetric, G: Mat, H: Symmetric, axis: MotionAxis, zero: Scalar
) -> tuple[Symmetric, Mat, Symmetric]:
    """Row and column of an eliminated coordinate axis, which are zero by construction."""
    k = axis.unit

    def cleared(m: Mat, rows: bool, columns: bool) -> Mat:
        a, b, c = (
            tuple(zero if (rows and i == k) or (columns and j == k) else m[i][j] for j in AXES)
            for i in AXES
        )
        return ((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2]))

    if axis.angular:
        return cleared(J, True, True), cleared(G, True, False), H
    return J, cleared(G, False, True), cleared(H, True, True)
