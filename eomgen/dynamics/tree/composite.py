"""The mass matrix by the composite-rigid-body algorithm, and its LᵀDL factors.

Both use the sparsity of the tree (Featherstone 2008, chapter 6): entry (i, j) is 0 unless one of
the velocities i and j carries the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.forces import Wrench, at_parent
from eomgen.dynamics.tree.frames import Rigid, joined
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.rotations import Rotation
from eomgen.dynamics.tree.vectors import (
    ENTRIES,
    Vec,
    add,
    cross,
    dot,
    scale,
    symmetric,
    times,
)
from eomgen.scalars.protocol import Scalar, Scalars

Entries = Mapping[tuple[int, int], Scalar]
"""Entries (i, j) of a symmetric matrix over the tree of velocities, where j carries i or j = i."""


def composite_bodies(kinematics: TreeKinematics, scalars: Scalars) -> tuple[Rigid, ...]:
    """The composite-rigid-body inertia of each frame's subtree (Featherstone 2008, 6.2)."""
    sums = [link.rigid for link in kinematics.links]
    planar = bool(kinematics.angles)
    for k in reversed(range(len(sums))):
        link = kinematics.links[k]
        if link.parent >= 0:
            there = shifted(link.rotation, link.arm, sums[k], scalars, planar=planar)
            sums[link.parent] = joined(sums[link.parent], there)
    return tuple(sums)


def shifted(rotation: Rotation, r: Vec, body: Rigid, scalars: Scalars, *, planar: bool) -> Rigid:
    """A rigid-body inertia at the parent's origin, in the parent's axes: h' = h + m r and
    J' = J + (r·h + r·h') 1 - r h'ᵀ - h rᵀ (parallel-axis theorem, without squares of r).
    """
    h = rotation.out(body.first_moment)
    J = rotation.out_symmetric(body.inertia)
    moved = add(h, scale(body.mass, r))
    both = [r[i] * (h[i] + moved[i]) for i in range(3)]
    if planar:
        zero = scalars.number(0.0)
        entries = [zero, zero, J[2][2] + (both[0] + both[1]), zero, zero, zero]
        return Rigid(body.mass, moved, symmetric(entries))
    diagonal = [both[1] + both[2], both[0] + both[2], both[0] + both[1]]
    off = [-(r[i] * moved[j] + h[i] * r[j]) for i, j in ENTRIES[3:]]
    more = zip(ENTRIES, [*diagonal, *off], strict=True)
    entries = [J[i][j] + x for (i, j), x in more]
    return Rigid(body.mass, moved, symmetric(entries))


def force_to_move(body: Rigid, angular: Vec, linear: Vec) -> Wrench:
    """I a: the wrench that gives a rigid body an acceleration, from rest."""
    momentum = add(scale(body.mass, linear), cross(angular, body.first_moment))
    return Wrench(add(times(body.inertia, angular), cross(body.first_moment, linear)), momentum)


def mass_entries(kinematics: TreeKinematics, scalars: Scalars) -> Entries:
    """M_ij = s_jᵀ I s_i at and below the diagonal, where the tree's shape allows it not to be 0.
    Rows and columns of driven velocities are left out. kg m², kg m or kg.
    """
    bodies = composite_bodies(kinematics, scalars)
    zero = scalars.number(0.0)
    nothing = (zero, zero, zero)
    entries: dict[tuple[int, int], Scalar] = {}
    for k, link in enumerate(kinematics.links):
        for n, (axis, i) in enumerate(link.free):
            angular, linear = (
                (axis.direction, nothing) if axis.angular else (nothing, axis.direction)
            )
            force = force_to_move(bodies[k], angular, linear)
            for other, j in link.free[: n + 1]:
                entries[i, j] = dot(other.direction, force.moment if other.angular else force.force)
            entries[i, i] = entries[i, i] + link.armature
            above, inner = k, force
            while kinematics.links[above].parent >= 0:
                inner = at_parent(kinematics.links[above], inner)
                above = kinematics.links[above].parent
                outer = kinematics.links[above]
                for other, j in outer.free:
                    part = inner.moment if other.angular else inner.force
                    entries[i, j] = dot(other.direction, part)
    return entries


def full(entries: Entries, nv: int, scalars: Scalars) -> list[Scalar]:
    """The full matrix (nv, nv), row by row."""
    zero = scalars.number(0.0)
    return [
        entries.get((max(i, j), min(i, j)), entries.get((min(i, j), max(i, j)), zero))
        for i in range(nv)
        for j in range(nv)
    ]


def ancestors(kinematics: TreeKinematics) -> tuple[tuple[int, ...], ...]:
    """For each free velocity the free velocities that carry it, nearest first, without itself."""
    found: dict[int, tuple[int, ...]] = {}
    reached: list[tuple[int, ...]] = []  # of each link, its own with those above
    for link in kinematics.links:
        above = reached[link.parent] if link.parent >= 0 else ()
        for _, i in link.free:
            found[i] = above
            above = (i, *above)
        reached.append(above)
    return tuple(found[i] for i in sorted(found))


@dataclass(frozen=True)
class Factors:
    """M = Lᵀ D L with unit lower triangular L, as sparse as M (Featherstone 2008, 6.5).

    d      the diagonal of D, (nv,)
    lower  the entries of L below the diagonal
    above  of each velocity its ancestors, or those that it is coupled to otherwise
    order  in which they are eliminated, each before those above it
    """

    d: tuple[Scalar, ...]
    lower: Entries
    above: tuple[tuple[int, ...], ...]
    order: tuple[int, ...]


def factorised(
    entries: Entries,
    above: tuple[tuple[int, ...], ...],
    names: Sequence[str],
    scalars: Scalars,
    order: Sequence[int] = (),
) -> Factors:
    """Factor M from the leaves to the root, or another matrix in a given order, with what fills in
    among those `above`. M needs no fill-in; neither needs pivoting if it is positive definite.
    """
    work = dict(entries)
    lower: dict[tuple[int, int], Scalar] = {}
    order = order or _from_leaves(above)
    zero = scalars.number(0.0)
    for k in order:
        for i in above[k]:
            work.setdefault((k, i), zero)
    for k in order:
        d = work[k, k] = scalars.named(work[k, k], f"pivot_{names[k]}")
        for i in above[k]:
            lower[k, i] = work[k, i] / d
        for n, i in enumerate(above[k]):
            for j in above[k][n:]:
                work[i, j] = work[i, j] - lower[k, i] * work[k, j]
    return Factors(tuple(work[k, k] for k in range(len(above))), lower, above, tuple(order))


def _from_leaves(above: tuple[tuple[int, ...], ...]) -> list[int]:
    return sorted(range(len(above)), key=lambda i: len(above[i]), reverse=True)


def solved(factors: Factors, right: Sequence[Scalar]) -> list[Scalar]:
    """Solve M x = right, (nv,), by Lᵀ D L."""
    x, order = list(right), factors.order
    for k in order:
        for i in factors.above[k]:
            x[i] = x[i] - factors.lower[k, i] * x[k]
    for k in reversed(order):
        x[k] = x[k] / factors.d[k]
        for i in factors.above[k]:
            x[k] = x[k] - factors.lower[k, i] * x[i]
    return x


def inverse(matrix: Sequence[Sequence[Scalar]], scalars: Scalars) -> list[list[Scalar]]:
    """The inverse of a small positive definite matrix, by the same factors."""
    n = range(len(matrix))
    entries = {(i, j): matrix[i][j] for i in n for j in range(i + 1)}
    above = tuple(tuple(reversed(range(i))) for i in n)
    factors = factorised(entries, above, [str(i) for i in n], scalars)
    zero, one = scalars.number(0.0), scalars.number(1.0)
    columns = [solved(factors, [one if i == j else zero for i in n]) for j in n]
    return [[columns[min(i, j)][max(i, j)] for j in n] for i in n]
