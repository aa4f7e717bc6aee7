"""Constraints in Gauss's least-squares problem: their rows first, then masses by weight.

By Gauss's principle the accelerations minimise (1) of `orthogonal`, Σ ρ² (c · x - s)² / 2 - t · v̇,
among those with J v̇ + β = 0. The rows of J are eliminated first, as if their weights were infinite:

    J Q = [L 0],    v̇ = γ + N w,    γ = -Q₁ L⁻¹ β,    N = Q₂

with Q = [Q₁ Q₂] orthogonal, a product of Givens rotations, and L triangular. Then the rows of the
bodies over w, heaviest first, make a triangle R (Golub & Van Loan, Matrix Computations, 6.2.3; row
order by Cox and Higham 1998). Neither M nor J M⁻¹ Jᵀ is formed, so no digits are lost where light
bodies close the loops of heavy ones. Q exists wherever J has full rank, at dead points too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from eomgen.dynamics.loops.cluster_motion import motions
from eomgen.dynamics.loops.clusters import Cluster
from eomgen.dynamics.loops.constraints import inner, relative
from eomgen.dynamics.loops.freedoms import Freedoms
from eomgen.dynamics.orthogonal.inertia_rows import SLIGHT, inertia_rows
from eomgen.dynamics.tree.forces import Wrench
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.dynamics.tree.motion import Acceleration, moment_about_centre
from eomgen.dynamics.tree.solids import Solid
from eomgen.dynamics.tree.vectors import AXES, Vec, add, cross, dot, times, unit, zeros
from eomgen.scalars.protocol import Scalar, Scalars

TINY = 1e-150
"""Added to the first of two numbers that are rotated: the rotation exists where both are 0."""


@dataclass(frozen=True)
class BodyRow:
    """ρ (angular · α + linear · a_centre) = ρ s of a frame's solid; `order` is ρ² of the scene's
    own parameters.
    """

    order: float
    root: Scalar
    frame: int
    angular: Vec
    linear: Vec
    right: Scalar


Rates = Sequence[Acceleration]
Wrenches = Sequence[Wrench]


class LeastConstraint(Freedoms):
    """The constraints of a mechanism at a state.

    solids   bodies on each frame as one, in the frames' axes; `scene` are those of the scene's own
             parameters
    applied  frames' accelerations at v̇ = 0, wrenches about the centres, and generalised forces
             with further ones
    beyond   the generalised forces besides the effects that v̇ takes
    fall     (nv,), the accelerations of trees on a free joint by uniform gravity
    """

    def __init__(
        self,
        d: MechanismState,
        solids: Sequence[Solid | None],
        scene: Sequence[Solid | None],
        applied: Callable[[Sequence[Scalar] | None], tuple[Rates, Wrenches, list[Scalar]]],
        beyond: Callable[[Sequence[Scalar]], list[Scalar]],
        fall: Sequence[Scalar],
        scales: Sequence[float],
    ) -> None:
        self._scales = list(map(d.scalars.number, scales))
        super().__init__(d, fall)
        self._solids, self._scene, self._applied = solids, scene, applied
        self._beyond = beyond
        self._everything = Cluster(-1, tuple(range(len(d.kinematics.links))))

    # The rows of constraints.

    @cached_property
    def _scaled_rows(self) -> list[list[Scalar]]:
        """J S."""
        s = self._scalars
        return [
            [x if s.is_zero(x) else x * k for x, k in zip(row, self._scales, strict=True)]
            for row in self._rows
        ]

    @cached_property
    def _triangle(self) -> tuple[list[list[Scalar]], list[list[Scalar]], list[int]]:
        """J Q, the columns of Q, and the column in which each row has its pivot."""
        s, nv = self._scalars, self._d.nv
        rows = [list(row) for row in self._scaled_rows]
        Q = [[x * self._scales[j] for x in unit_column(j, nv, s)] for j in range(nv)]
        pivots: list[int] = []
        for i, row in enumerate(rows):
            there = [j for j in range(nv) if j not in pivots and not s.is_zero(row[j])]
            first, *others = there
            for j in others:
                c, t, length = rotation(row[first], row[j], s)
                row[first], row[j] = length, self._zero
                for other in rows[i + 1 :]:
                    other[first], other[j] = rotated(c, t, other[first], other[j], s)
                pairs = [rotated(c, t, a, b, s) for a, b in zip(Q[first], Q[j], strict=True)]
                Q[first], Q[j] = [a for a, _ in pairs], [b for _, b in pairs]
            pivots.append(first)
        return rows, Q, pivots

    def dependents(self, along: Sequence[Scalar]) -> list[Scalar]:
        """The least velocities (nv,) with J v = -`along`."""
        rows, Q, pivots = self._triangle
        found: list[Scalar] = []
        total = [self._zero] * self._d.nv
        for i, (row, pivot) in enumerate(zip(rows, pivots, strict=True)):
            left = -along[i]
            for j, x in zip(pivots, found, strict=False):
                if not self._scalars.is_zero(row[j]):
                    left = left - row[j] * x
            found.append(left / row[pivot])
            total = added(total, found[i], Q[pivot], self._scalars)
        return total

    @cached_property
    def _basis(self) -> list[list[Scalar]]:
        """The columns (nv,) of N."""
        _, Q, pivots = self._triangle
        return [column for j, column in enumerate(Q) if j not in pivots]

    def margins(self) -> list[Scalar]:
        """What of each row is at right angles to those before it, by the rows of its kind, squared:
        0 in a singular position.
        """
        rows, _, pivots = self._triangle
        squares = [inner(row, row, self._scalars) for row in self._scaled_rows]
        own = [row[j] * row[j] for row, j in zip(rows, pivots, strict=True)]
        return relative(self._d, own, squares)

    def multipliers(self) -> list[Scalar]:
        """λ of the rows under the effects, N or N m: Lᵀ λ = Q₁ᵀ (M v̇ + h - F)."""
        rows, Q, pivots = self._triangle
        over = self._beyond(self.forward(None))
        found = [inner(Q[j], over, self._scalars) for j in pivots]
        for i in reversed(range(len(rows))):
            found[i] = found[i] / rows[i][pivots[i]]
            for k in range(i):
                if not self._scalars.is_zero(rows[i][pivots[k]]):
                    found[k] = found[k] - rows[i][pivots[k]] * found[i]
        return found

    # The rows of bodies.

    def forward(self, tau: Sequence[Scalar] | None) -> list[Scalar]:
        """v̇ under the effects and generalised forces `tau`."""
        frames, wrenches, forces = self._applied(tau)
        found = self._least(self._bend, frames, wrenches, forces)
        rates = zip(found, self._fall, self._d.model.velocities, strict=True)
        return [self._scalars.named(a + b, c.acceleration) for a, b, c in rates]

    def response(self, impulse: Sequence[Scalar]) -> list[Scalar]:
        """The change of the velocities by generalised impulses; the constraints stay met."""
        nothing = [self._zero] * self._d.nv
        return self._least(nothing, (), (), impulse)

    def _least(
        self, bend: Sequence[Scalar], frames: Rates, wrenches: Wrenches, tau: Sequence[Scalar]
    ) -> list[Scalar]:
        """γ + N w for γ = `bend`, frames' accelerations at v̇ = 0, wrenches about the centres and
        generalised forces; no `frames` and `wrenches` where velocities change at once.
        """
        s, N = self._scalars, self._basis
        links = self._d.kinematics.links
        columns = [motions(links, self._everything, column, s) for column in N]
        drift = motions(links, self._everything, bend, s)
        force = [inner(column, tau, s) for column in N]
        rows: list[tuple[float, list[Scalar], Scalar]] = []
        for k, solid in enumerate(self._solids):
            wrench = wrenches[k] if wrenches else None
            own, left = self._own_rows(k, frames[k] if frames else None, wrench)
            centre = zeros(s) if solid is None else solid.centre
            for row in own:
                entries = [row.root * _along(row, column[k], centre) for column in columns]
                off = row.right - _along(row, drift[k], centre)
                rows.append((row.order, entries, row.root * off))
            if left is not None:
                for n, column in enumerate(columns):
                    angular, linear = column[k]
                    at_centre = add(linear, cross(angular, centre))
                    power = dot(angular, left.moment) + dot(at_centre, left.force)
                    force[n] = force[n] + power
        for link in links:
            for _, i in link.free:
                if not s.is_zero(link.armature):
                    root = s.call("sqrt", link.armature)
                    entries = [root * column[i] for column in N]
                    rows.append((0.0, entries, root * -bend[i]))
        rows.sort(key=lambda row: -row[0])
        w = solved([(entries, right) for _, entries, right in rows], force, s)
        found = list(bend)
        for x, freedom in zip(w, N, strict=True):
            found = added(found, x, freedom, s)
        return found

    def _own_rows(
        self, k: int, a: Acceleration | None, wrench: Wrench | None
    ) -> tuple[list[BodyRow], Wrench | None]:
        """The Newton-Euler rows of the solid of frame k, and the part of the wrench about its
        centre along axes without inertia.
        """
        s, zero, solid, scene = self._scalars, zeros(self._scalars), self._solids[k], self._scene[k]
        if solid is None or scene is None:
            return [], wrench
        planar = self._d.dimensions == 2
        found = []
        nothing = Wrench(zero, zero)
        moment, force = list((wrench or nothing).moment), (wrench or nothing).force
        at, y = zero, [self._zero] * 3
        if a is not None:
            at = add(a.linear, times(a.field, solid.centre))
            y = [-x for x in moment_about_centre(solid.inertia, a, s)]
        if not s.is_zero(solid.mass):
            root = s.call("sqrt", solid.mass)
            for j in AXES[: 2 if planar else 3]:
                right = force[j] / solid.mass - at[j]
                found.append(BodyRow(scene.mass, root, k, zero, unit(j, s), right))
            force = zero
        size = dot(scene.centre, scene.centre) or 1.0
        order = [2] if planar else sorted(AXES, key=lambda i: -float(scene.inertia[i][i]))
        for i, d, entries in inertia_rows(solid.inertia, order, y, moment, self._bounded, s):
            root, right = s.call("sqrt", d), (y[i] + moment[i]) / d
            weight = float(scene.inertia[i][i]) / size
            found.append(BodyRow(weight, root, k, entries, zero, right))
            moment[i] = self._zero
        left = Wrench((moment[0], moment[1], moment[2]), force)
        return found, left

    def _bounded(self, pivot: Scalar, entry: Scalar) -> Scalar:
        s = self._scalars
        return s.call("max", pivot, s.number(SLIGHT) * entry)


def _along(row: BodyRow, motion: tuple[Vec, Vec], centre: Vec) -> Scalar:
    angular, linear = motion
    return dot(row.angular, angular) + dot(row.linear, add(linear, cross(angular, centre)))


def unit_column(j: int, nv: int, scalars: Scalars) -> list[Scalar]:
    """The column j of the identity."""
    return [scalars.number(float(i == j)) for i in range(nv)]


def added(
    total: Sequence[Scalar], x: Scalar, column: Sequence[Scalar], scalars: Scalars
) -> list[Scalar]:
    """`total` + x `column`."""
    pairs = zip(total, column, strict=True)
    return [a if scalars.is_zero(b) else a + x * b for a, b in pairs]


def rotation(a: Scalar, b: Scalar, scalars: Scalars) -> tuple[Scalar, Scalar, Scalar]:
    """c, s and r with c a + s b = r and c b - s a = 0: a Givens rotation."""
    a = a + scalars.number(TINY)
    r = scalars.call("sqrt", a * a + b * b)
    return a / r, b / r, r


def rotated(c: Scalar, s: Scalar, a: Scalar, b: Scalar, scalars: Scalars) -> tuple[Scalar, Scalar]:
    """c a + s b and c b - s a."""
    if scalars.is_zero(a) and scalars.is_zero(b):
        return a, b
    if scalars.is_zero(b):
        return c * a, -(s * a)
    if scalars.is_zero(a):
        return s * b, c * b
    return c * a + s * b, c * b - s * a


def solved(
    rows: Sequence[tuple[list[Scalar], Scalar]], force: Sequence[Scalar], scalars: Scalars
) -> list[Scalar]:
    """The w that minimise Σ (row · w - right)² / 2 - force · w, with the rows taken in order."""
    count = len(force)
    triangle: list[tuple[list[Scalar], Scalar] | None] = [None] * count
    for given, right in rows:
        row = list(given)
        for j in range(count):
            if scalars.is_zero(row[j]):
                continue
            kept = triangle[j]
            if kept is None:
                triangle[j] = row, right
                break
            top, value = list(kept[0]), kept[1]
            c, s, top_j = rotation(top[j], row[j], scalars)
            for k in range(j + 1, count):
                top[k], row[k] = rotated(c, s, top[k], row[k], scalars)
            value, right = rotated(c, s, value, right, scalars)
            top[j], row[j] = top_j, scalars.number(0.0)
            triangle[j] = top, value
    kept_rows = [row for row in triangle if row is not None]
    assert len(kept_rows) == count, "some motion moves no mass"
    pushed = list(force)
    for j, (row, _) in enumerate(kept_rows):
        pushed[j] = pushed[j] / row[j]
        for k in range(j + 1, count):
            if not scalars.is_zero(row[k]):
                pushed[k] = pushed[k] - row[k] * pushed[j]
    found = [value + push for (_, value), push in zip(kept_rows, pushed, strict=True)]
    for j in reversed(range(count)):
        row = kept_rows[j][0]
        for k in range(j + 1, count):
            if not scalars.is_zero(row[k]):
                found[j] = found[j] - row[k] * found[k]
        found[j] = found[j] / row[j]
    return found
