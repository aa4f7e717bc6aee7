"""The exact derivatives of forward dynamics, ∂v̇/∂q and ∂v̇/∂v, by articulated bodies.

In `sensitivity` a small motion along axis j changes what the axes that j carries feel by a motion,
of which I ψ'' + B ψ' is the force, and adds a wrench on the parent of j, S x* F. Here that is
solved for accelerations in place of forces: the subtree is moved by ψ'' beside the acceleration a
of its parent, and of its articulated inertia I^A and its articulated drag B^A

    p = S x* F + I^A ψ'' + B^A ψ'

is the wrench that is passed to the parent of j, inwards by the pivots of the articulated-body
algorithm. Outwards each axis k of the subtree of j follows by ẍ_k = -Ũ_k · a - β_k · ψ', all other
axes by -Ũ_k · a; with Ũ = I^A S / d of its pivot d, and β = Sᵀ B^A / d. The derivatives by velocity
have ψ' + S' and S in place of ψ'' and ψ', and no S x* F.

Vectors of all links are in world axes about one point of their tree, so that nothing is moved
from link to link. A branch beside the path from j to the root takes part as one: how each of its
axes follows the link that carries the branch is computed once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from eomgen.dynamics.tree.articulated import ArticulatedInertia, Pivot, articulate_links
from eomgen.dynamics.tree.forces import Wrench, carried, inertial
from eomgen.dynamics.tree.kinematics import MotionAxis, TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, Twist
from eomgen.dynamics.tree.sensitivity import columns_of, drag_of, turned_force
from eomgen.dynamics.tree.vectors import (
    AXES,
    Mat,
    Vec,
    add,
    cross,
    dot,
    plus,
    replaced,
    scale,
    sub,
    times,
    transposed,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars

UNITS = 12
"""Columns beyond a link for which it is as cheap to compute its response to six unit wrenches."""
Spatial = tuple[Vec, Vec]
"""Angular part or moment, linear part or force."""


@dataclass(frozen=True)
class _Axis:
    """An axis in world axes about the point of its tree: index i, S, S / d, I^A S, -Ũ and -β."""

    i: int
    motion: Spatial
    share: Spatial
    force: Spatial
    back: Spatial
    drag: Vec


class ForwardSlopes:
    """The derivatives at a motion that the accelerations `accelerating` belong to."""

    def __init__(
        self,
        kinematics: TreeKinematics,
        twists: Sequence[Twist],
        accelerating: Sequence[Acceleration],
        base: Vec,
        nv: int,
        scalars: Scalars,
    ) -> None:
        self.kinematics, self.twists, self.scalars, self.nv = kinematics, twists, scalars, nv
        self.links = kinematics.links
        count = range(len(self.links))
        self.pivots, self.left = articulate_links(self.links, count, scalars)
        self.columns = [
            columns_of(kinematics, k, twists, accelerating, base, scalars) for k in count
        ]
        self.forces = carried(kinematics, inertial(kinematics, accelerating, scalars))
        self.places = {i: (k, n) for k in count for n, (_, i) in enumerate(self.links[k].free)}
        self.reach = self._reaches()
        self.unit_shares: dict[int, Scalar] = {}
        self.axes, self.drags = self._articulated()
        self._following: dict[tuple[int, int, int], Spatial] = {}
        self.children: list[list[int]] = [[] for _ in self.links]
        for k, link in enumerate(self.links):
            if link.parent >= 0:
                self.children[link.parent].append(k)

    def columns_by(self, i: int) -> tuple[list[Scalar], list[Scalar]]:
        """∂v̇ by a small motion along axis i, and by its velocity."""
        k, n = self.places[i]
        own = self.columns[k][n]
        held = turned_force(own.axis, self.forces[k])
        by_position = self._column(k, _as_pair(own.second), own.first.angular, held)
        return by_position, self._column(k, _as_pair(own.both), own.axis.angular, None)

    def by_force(self, i: int) -> list[Scalar]:
        """∂v̇ by a force along axis i: a column of M⁻¹."""
        found, path = self._nothing(), self._path(self.places[i][0])
        stem = -1 if self.stem >= 0 and path[0] in self._path(self.stem) else self.stem
        nothing = zeros(self.scalars), zeros(self.scalars)
        self._carried([-1, *path], nothing, found, stem, pushed=i)
        return found

    def _column(self, k: int, jump: Spatial, turn: Vec, held: Wrench | None) -> list[Scalar]:
        found, w = self._nothing(), self.kinematics.to_world(k, turn)
        push = _times(self.left[k], jump)
        if held is not None:
            push = _plus(push, (held.moment, held.force))
        p = _plus(self._outside(k, push), _drag(self.drags[k], w))
        a = self._carried(self._path(k), p, found, self.stem)
        stack = [(k, _plus(a, self._outside(k, jump, motion=True)))]
        while stack:
            m, a = stack.pop()
            for axis in reversed(self.axes[m]):
                x = found[axis.i] = _dot(axis.back, a) + dot(axis.drag, w)
                a = _more(a, x, axis.motion)
            stack += [(child, a) for child in self.children[m]]
        return found

    def _nothing(self) -> list[Scalar]:
        return [self.scalars.number(0.0)] * self.nv

    def _path(self, k: int) -> list[int]:
        """The links from k to the root."""
        path = [k]
        while (above := self.links[path[-1]].parent) >= 0:
            path.append(above)
        return path

    def _carried(
        self, path: list[int], p: Spatial, found: list[Scalar], stem: int, pushed: int = -1
    ) -> Spatial:
        """The acceleration of the link that carries path[0], under a wrench p of this one; enters
        those of all axes that path[0] does not carry. A force of 1 acts along the axis `pushed`.
        From the link `stem` to the root `stem_rows` are used; -1 for none.
        """
        shares, carriers = dict[int, Scalar](), path[1:]
        while carriers and carriers[0] != stem:
            for axis in self.axes[carriers[0]]:
                shares[axis.i] = share = _dot(axis.share, p)
                if axis.i == pushed:
                    shares[axis.i] = share = share - self.unit_shares[axis.i]
                p = _less(p, share, axis.force)
            carriers = carriers[1:]
        a = zeros(self.scalars), zeros(self.scalars)
        if carriers:
            for axis, row in self.stem_rows:
                x = found[axis.i] = _dot(row, p)
                a = _more(a, x, axis.motion)
            self._branches(stem, path, a, found)
        for m in reversed(path[1 : len(path) - len(carriers)]):
            for axis in reversed(self.axes[m]):
                x = found[axis.i] = _dot(axis.back, a) - shares[axis.i]
                a = _more(a, x, axis.motion)
            self._branches(m, path, a, found)
        return a

    def _branches(self, m: int, path: list[int], a: Spatial, found: list[Scalar]) -> None:
        """The axes that link m carries beside the path."""
        for child in self.children[m]:
            if child not in path:
                for k in self._all(child):
                    for n, axis in enumerate(self.axes[k]):
                        found[axis.i] = _dot(self._follows(k, n, m), a)

    @cached_property
    def stem(self) -> int:
        """The link whose response to a wrench on it is computed once, for all axes beyond it; -1 if
        there is none for which that is cheaper. Nothing branches before it.
        """
        best, found, axes = 0, -1, 0
        roots = [k for k, link in enumerate(self.links) if link.parent < 0]
        k = roots[0] if len(roots) == 1 else -1
        while k >= 0:
            axes += len(self.axes[k])
            beyond = sum(len(self.axes[m]) for m in self._all(k)) - len(self.axes[k])
            if (saved := axes * (2 * beyond - UNITS)) > best:
                best, found = saved, k
            k = self.children[k][0] if len(self.children[k]) == 1 else -1
        return found

    @cached_property
    def stem_rows(self) -> list[tuple[_Axis, Spatial]]:
        """Each axis that carries or is of the stem, and the row by which it follows a wrench."""
        zero, one = self.scalars.number(0.0), self.scalars.number(1.0)
        path, columns = self._path(self.stem), []
        for unit in range(6):
            parts = [one if i == unit else zero for i in range(6)]
            found = self._nothing()
            p = (parts[0], parts[1], parts[2]), (parts[3], parts[4], parts[5])
            self._carried([-1, *path], p, found, stem=-1)  # -1: a child without axes
            columns.append(found)
        rows = []
        for m in reversed(path):
            for axis in reversed(self.axes[m]):
                row = [column[axis.i] for column in columns]
                rows.append((axis, ((row[0], row[1], row[2]), (row[3], row[4], row[5]))))
        return rows

    def _all(self, k: int) -> Iterator[int]:
        yield k
        for child in self.children[k]:
            yield from self._all(child)

    def _follows(self, k: int, n: int, m: int) -> Spatial:
        """How axis n of link k follows an acceleration of link m, which carries it."""
        key = (k, n, m)
        if key not in self._following:
            if self.links[k].parent == m:
                row, beyond = self.axes[k][n].back, self.axes[k][n + 1 :]
            else:
                inner = k
                while self.links[inner].parent != m:
                    inner = self.links[inner].parent
                row, beyond = self._follows(k, n, inner), self.axes[inner]
            for axis in beyond:
                row = _more(row, _dot(axis.motion, row), axis.back)
            self._following[key] = row
        return self._following[key]

    def _outside(self, k: int, x: Spatial, *, motion: bool = False) -> Spatial:
        """A wrench or a motion at link k, in its axes, in world axes about the tree's point."""
        first, second = (self.kinematics.to_world(k, part) for part in x)
        if motion:
            return first, add(second, cross(self.reach[k], first))
        return add(first, cross(self.reach[k], second)), second

    def _reaches(self) -> list[Vec]:
        """The origin of each link from the point of its tree: that of its first link with mass."""
        links, nothing = self.links, zeros(self.scalars)
        found: dict[int, Vec] = {}
        for k, link in enumerate(links):
            if link.parent in found:
                arm = self.kinematics.to_world(link.parent, link.arm)
                found[k] = add(found[link.parent], arm)
            elif not self.scalars.is_zero(link.rigid.mass):
                found[k] = nothing
                while links[k].parent >= 0:
                    outer = links[k].parent
                    found[outer] = sub(found[k], self.kinematics.to_world(outer, links[k].arm))
                    k = outer
        return [found.get(k, nothing) for k in range(len(links))]

    def _articulated(self) -> tuple[list[list[_Axis]], list[tuple[Mat, Mat]]]:
        """All axes, and B^A of each link after its own axes: its parts for moments and forces."""
        axes: list[list[_Axis]] = [[] for _ in self.links]
        drags = [self._own_drag(k) for k in range(len(self.links))]
        nothing, one = zeros(self.scalars), self.scalars.number(1.0)
        for k in reversed(range(len(self.links))):
            link = self.links[k]
            moments, forces = drags[k]
            for (axis, i), pivot in zip(link.free, self.pivots[k], strict=True):
                s = (axis.direction, nothing) if axis.angular else (nothing, axis.direction)
                motion = self._outside(k, s, motion=True)
                column = self._outside(k, _column_of(axis, pivot, self.scalars))
                pull = add(
                    times(transposed(moments), motion[0]), times(transposed(forces), motion[1])
                )
                moments = _less_outer(moments, column[0], pull)
                forces = _less_outer(forces, column[1], pull)
                self.unit_shares[i] = one / pivot.d
                share, drag = _by(motion, pivot.d), _opposite(_by((pull, pull), pivot.d))[0]
                force = scale(pivot.d, column[0]), scale(pivot.d, column[1])
                axes[k].append(_Axis(i, motion, share, force, _opposite(column), drag))
            drags[k] = moments, forces
            if link.parent >= 0:
                outer = drags[link.parent]
                drags[link.parent] = plus(outer[0], moments), plus(outer[1], forces)
        return axes, drags

    def _own_drag(self, k: int) -> tuple[Mat, Mat]:
        """B of a link's own mass, in world axes about the tree's point."""
        kinematics, reach = self.kinematics, self.reach[k]
        momentum, matrix = drag_of(self.links[k], self.twists[k], self.scalars)
        two = self.scalars.number(2.0)
        eye = [tuple(two if i == j else two - two for i in AXES) for j in AXES]
        moments, forces = [], []
        p = kinematics.to_world(k, momentum)
        for axis in eye:
            w = kinematics.from_world(k, (axis[0], axis[1], axis[2]))
            force = cross((axis[0], axis[1], axis[2]), p)
            moment = kinematics.to_world(k, times(matrix, w))
            moments.append(add(moment, cross(reach, force)))
            forces.append(force)
        return (
            transposed((moments[0], moments[1], moments[2])),
            transposed((forces[0], forces[1], forces[2])),
        )


def _column_of(axis: MotionAxis, pivot: Pivot, scalars: Scalars) -> Spatial:
    """Ũ = I^A S / d in the link's axes."""
    if not pivot.absolute:
        return pivot.u, pivot.w
    assert axis.unit is not None
    one = scalars.number(1.0)
    if axis.angular:
        return replaced(pivot.u, axis.unit, one), pivot.w
    return pivot.u, replaced(pivot.w, axis.unit, one)


def _times(p: ArticulatedInertia, x: Spatial) -> Spatial:
    return (
        add(times(p.J, x[0]), times(p.G, x[1])),
        add(times(transposed(p.G), x[0]), times(p.H, x[1])),
    )


def _drag(matrices: tuple[Mat, Mat], w: Vec) -> Spatial:
    return times(matrices[0], w), times(matrices[1], w)


def _as_pair(x: Twist) -> Spatial:
    return x.angular, x.linear


def _plus(a: Spatial, b: Spatial) -> Spatial:
    return add(a[0], b[0]), add(a[1], b[1])


def _less(a: Spatial, k: Scalar, b: Spatial) -> Spatial:
    return sub(a[0], scale(k, b[0])), sub(a[1], scale(k, b[1]))


def _more(a: Spatial, k: Scalar, b: Spatial) -> Spatial:
    return add(a[0], scale(k, b[0])), add(a[1], scale(k, b[1]))


def _by(a: Spatial, d: Scalar) -> Spatial:
    first, second = ((x[0] / d, x[1] / d, x[2] / d) for x in a)
    return first, second


def _opposite(a: Spatial) -> Spatial:
    first, second = ((-x[0], -x[1], -x[2]) for x in a)
    return first, second


def _dot(a: Spatial, b: Spatial) -> Scalar:
    return dot(a[0], b[0]) + dot(a[1], b[1])


def _less_outer(m: Mat, a: Vec, b: Vec) -> Mat:
    x, y, z = (sub(row, scale(k, b)) for row, k in zip(m, a, strict=True))
    return (x, y, z)
