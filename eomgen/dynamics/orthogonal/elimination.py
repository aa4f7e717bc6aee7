"""Forward dynamics by orthogonal elimination: O(n), without loss of digits at any ratio of masses.

By Gauss's principle of least constraint (1829) the true accelerations z = v̇ minimise

    ½ Σ ρ² (c · x - s)² - t · x                                                            (1)

over all z. Here x = (α, a) are the angular and linear accelerations of the frames, linear in z.
Each component of each body's Newton-Euler equations is a row (c | s) with a weight ρ²: three with
the mass, a_centre = s, and three with the pivots of the inertia matrix. t holds the applied forces.

The mass matrix and the articulated-body inertias are the normal equations of (1). They square its
condition number: beside a heavy body a light one is lost in rounding. So the rows are never
multiplied out. They are eliminated by Givens rotations (`rows`) from the leaves to the root: the QR
factorisation of a least-squares problem whose sparsity is the tree (Golub & Van Loan, Matrix
Computations, 5.2 and 5.3). The square-root information filter is the same elimination (Bierman,
Factorization Methods for Discrete Sequential Estimation, 1977; Rodriguez 1987 for multibody trees).

Leaf to root, for each link:

1. Collect its own rows (`_own_rows`) and the rows that its children left, in the link's axes
   (`in_parent_axes`).
2. Rotate them to triangular form about one point (`Rows.folded`): first the columns of a, then
   those of α. The point is the joint of the heaviest child. An arm that is zero there stays zero.
3. For each free motion axis, rotate the rows against each other until only one contains the
   acceleration along that axis (`axis_elimination`): the pivot row (ρ, u | s). Keep it.
4. Pass the other rows on to the parent: at most five for one degree of freedom in space, two in
   the plane.

Each row carries a force φ, with t = Σ φ c, and the forces rotate with the rows. A sum t passed
inwards would act, by its rounding error, on light bodies beside the heavy one that takes it.

Root to leaf (`back_substitution`), with u and s in parts of ρ and x the other accelerations:

    α = s + r - u · x,    r = φ / ρ²                                                       (2)

The sum in (2) could cancel where rotations have made u large. So the residuals r = c · x - s are
rotated back (`undo_rotations`), and (2) is applied to the rows that contained α before they were
rotated. The residuals of a body's own rows, times their weights, are the forces of its
joints on it: small where the body is light. An axis along which a body has no inertia of its own is
found from its neighbours' rows.

The order of elimination is fixed when the program is recorded, from the scene's masses
(`solids.ranked`) and the tree's shape (`elimination_order`).

Two losses remain. One is where an inertia is a small part of mass times arm squared. The other is
where a heavy tip is in line with all joints, to less than the rounding of sines and cosines.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

from eomgen.dynamics.orthogonal.aligned_axes import align_axes
from eomgen.dynamics.orthogonal.axis_elimination import (
    Others,
    eliminate_aligned_rotation,
    eliminate_free_axis,
)
from eomgen.dynamics.orthogonal.back_substitution import outwards
from eomgen.dynamics.orthogonal.elimination_order import (
    column_of,
    nonzero_columns,
    point_columns,
    rotation_order,
    translation_order,
)
from eomgen.dynamics.orthogonal.inertia_rows import SLIGHT, inertia_rows
from eomgen.dynamics.orthogonal.mixed import ArticulatedPart
from eomgen.dynamics.orthogonal.rows import (
    Column,
    EliminatedLink,
    Row,
    Rows,
    Steps,
    in_parent_axes,
    shifted,
)
from eomgen.dynamics.tree.forces import (
    Wrench,
    at_parent,
    moved_to,
    on_frames,
    total,
)
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, moment_about_centre
from eomgen.dynamics.tree.solids import Ranks, Solid
from eomgen.dynamics.tree.vectors import (
    AXES,
    Vec,
    add,
    replaced,
    sub,
    times,
    unit,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars


class Elimination:
    """The elimination of (1) over the links of a tree, in their own axes.

    `carried` are the bodies on the frames; wrenches act about their centres of mass. Links in
    `plain`, which has all that are carried by one of them, are eliminated as articulated bodies.
    """

    def __init__(
        self,
        kinematics: TreeKinematics,
        carried: Sequence[Solid | None],
        ranks: Ranks,
        scalars: Scalars,
        plain: Collection[int] = (),
    ) -> None:
        if plain:
            ranks = ranks.without(plain)
        self._aligned = align_axes(kinematics.links, carried, ranks, scalars)
        self._links, self._solids = self._aligned.links, self._aligned.carried
        self._carried, self._ranks = carried, ranks
        self._scalars = scalars
        self._planar = bool(kinematics.angles)
        self._rows = Rows(scalars)
        self._columns = nonzero_columns(self._links, scalars)
        self._plain = ArticulatedPart(self._links, plain, scalars)

    def respond(
        self,
        frame_accelerations: Sequence[Acceleration],
        wrenches: Sequence[Wrench],
        tau: Sequence[Scalar],
    ) -> list[Scalar]:
        """v̇ (nv,) under wrenches about the centres, in the frames' axes, and generalised forces
        `tau` (nv,). `frame_accelerations` are the accelerations of the frames at v̇ = 0.
        """
        wrenches, tau = on_frames(self._links, *self._aligned.into(wrenches, tau), self._scalars)
        rows: list[list[tuple[Row, int]]] = [[] for _ in self._links]
        found: list[EliminatedLink | None] = []
        part, shares = self._plain, list(tau)
        sums = part.biases(frame_accelerations, wrenches, [*map(self._centre, range(len(rows)))])
        for k in reversed(range(len(self._links))):
            link = self._links[k]
            if k in part.which:
                found.append(None)
                p = part.inwards(k, sums, tau, shares)
                if p is not None:
                    self._pass_on(k, *part.handed_over(k, p, self._rows), rows, wrenches)
                continue
            own, left = self._own_rows(k, frame_accelerations[k], wrenches[k])
            eliminated, passed = self._eliminate_link(k, own, rows[k], left, tau)
            found.append(eliminated)
            if link.parent >= 0:
                self._pass_on(k, eliminated.rows, passed, rows, wrenches)
        solved = [eliminated or part.pivots[k] for k, eliminated in enumerate(reversed(found))]
        return self._aligned.out(outwards(self._links, solved, shares, self._scalars))

    # Inwards.

    def _pass_on(
        self,
        k: int,
        left: Sequence[Row],
        wrench: Wrench,
        rows: list[list[tuple[Row, int]]],
        wrenches: list[Wrench],
    ) -> None:
        """Pass the rows and the wrench that are left of a link on to its parent."""
        link = self._links[k]
        rows[link.parent] += [(in_parent_axes(link, row), k) for row in left]
        more = moved_to(self._centre(link.parent), at_parent(link, wrench))
        wrenches[link.parent] = total(wrenches[link.parent], more)

    def _centre(self, k: int) -> Vec:
        """The centre of mass of the link's own bodies; its origin if it has none."""
        solid = self._solids[k]
        return zeros(self._scalars) if solid is None else solid.centre

    def _own_rows(
        self, k: int, a: Acceleration, wrench: Wrench
    ) -> tuple[tuple[dict[int, Row], dict[int, Row]], Wrench]:
        """The Newton-Euler rows of a link's own mass, by coordinate axis: linear ones about its
        centre, and angular ones. Also the part of the wrench along axes without inertia, about the
        link's origin.
        """
        s, zero, solid, own = self._scalars, zeros(self._scalars), self._solids[k], self._carried[k]
        linear, angular = dict[int, Row](), dict[int, Row]()
        moment = list(wrench.moment)

        def row(weight: Scalar, angular: Vec, linear: Vec, right: Scalar, force: Scalar) -> Row:
            # Forces on a dominant body take fewer operations as a part of its acceleration.
            if self._ranks.dominant[k]:
                right, force = right + force / weight, self._rows.zero
            return self._rows.make(weight, angular, linear, right, force)

        if solid is not None and own is not None:
            into = self._aligned.rotations[k].into
            centre = into(add(a.linear, times(a.field, own.centre)))
            if not s.is_zero(solid.mass):
                m = s.call("max", solid.mass, self._rows.tiny)
                for j in AXES[: 2 if self._planar else 3]:
                    linear[j] = row(m, zero, unit(j, s), -centre[j], wrench.force[j])
            y = [-x for x in into(moment_about_centre(own.inertia, a, s))]
            order = rotation_order(self._links[k], self._planar, self._aligned.along[k])
            for i, d, u in inertia_rows(solid.inertia, order, y, moment, self._bounded_pivot, s):
                angular[i] = row(d, u, zero, y[i] / d, moment[i])
        # Where there is a row, its φ takes the force.
        for j in linear:
            wrench = replace(wrench, force=replaced(wrench.force, j, self._rows.zero))
        for j in angular:
            moment[j] = self._rows.zero
        left = replace(wrench, moment=(moment[0], moment[1], moment[2]))
        return (linear, angular), moved_to(sub(zero, self._centre(k)), left)

    def _bounded_pivot(self, pivot: Scalar, entry: Scalar) -> Scalar:
        floor = self._rows.tiny if pivot is entry else self._scalars.number(SLIGHT) * entry
        return self._scalars.call("max", pivot, floor)

    def _eliminate_link(
        self,
        k: int,
        own: tuple[dict[int, Row], dict[int, Row]],
        rows: Sequence[tuple[Row, int]],
        term: Wrench,
        tau: Sequence[Scalar],
    ) -> tuple[EliminatedLink, Wrench]:
        """Eliminate a link's free motion axes from its own rows and those of its children.

        own   linear and angular rows of the link, by coordinate axis
        rows  rows left by the children, each with the child's index
        term  the wrench that no row takes, about the origin; returned with what is left of it
        """
        s, link = self._scalars, self._links[k]
        # About the heaviest child's joint, where its rows have no arm to be rounded.
        heaviest = self._ranks.heaviest[k]
        at = self._links[heaviest].arm if heaviest >= 0 else self._centre(k)
        columns = self._columns[k]
        about = columns | point_columns(columns, at, s)
        linear, angular, loose = self._rows_about(k, own, rows, at, about)
        along = self._aligned.along[k]
        translations = translation_order(link, at, loose, self._planar, s)
        order = rotation_order(link, self._planar, along)
        axes, rotations, taken = list(reversed(link.free)), Steps(), []
        if along is not None and along in angular:
            axes.sort(key=lambda axis: -order.index(column_of(axis[0])[1]))
            kept = {(False, j): linear[j] for j in translations if j in linear}
            kept |= {(True, j): angular[j] for j in order if j in angular}
            every = Others(kept, loose)
            one, (kept, loose) = eliminate_aligned_rotation(
                self._rows, link, axes.pop(0), every, at
            )
            taken.append(one)
            linear = {j: row for (spins, j), row in kept.items() if not spins}
            angular = {j: row for (spins, j), row in kept.items() if spins}
            about = about - {(True, along)}
        orders = (
            [j for j in translations if (False, j) in about],
            [j for j in order if (True, j) in about],
        )
        linear, angular, loose = self._triangular(linear, angular, loose, orders, rotations)
        kept = {(False, j): shifted(linear[j], at) for j in orders[0] if j in linear}
        kept |= {(True, j): angular[j] for j in orders[1] if j in angular}
        kept = {column: self._rows.of(columns, row) for column, row in kept.items()}
        free = [row for row in loose if not self._rows.is_empty(row)]
        free = [self._rows.of(columns, shifted(row, at)) for row in free]
        # Rows of angular accelerations alone come first, and stay free of linear ones.
        free.sort(key=lambda row: not all(s.is_zero(x) for x in row.linear))
        others = Others(kept, free)
        for axis in axes:
            held = axis[0].unit in own[axis[0].angular]
            one, others, term = eliminate_free_axis(self._rows, link, axis, held, others, term, tau)
            taken.append(replace(one, before=tuple(rotations)))
            rotations.clear()
        rest = [*others.kept.values(), *others.free]
        empty = tuple(row for row in (*loose, *rest) if self._rows.is_empty(row))
        holding = tuple(row for row in rest if not self._rows.is_empty(row))
        return EliminatedLink(tuple(taken), tuple(rotations), holding, empty), term

    def _rows_about(
        self,
        k: int,
        own: tuple[dict[int, Row], dict[int, Row]],
        rows: Sequence[tuple[Row, int]],
        at: Vec,
        about: Collection[Column],
    ) -> tuple[dict[int, Row], dict[int, Row], list[Row]]:
        """A link's linear and angular rows and those of its children, about a point of it."""
        s, centre = self._scalars, self._centre(k)
        linear = {
            j: self._rows.of(about, shifted(row, sub(centre, at))) for j, row in own[0].items()
        }
        angular = {j: self._rows.of(about, row) for j, row in own[1].items()}
        loose = [self._rows.of(about, shifted(row, self._arm(n, at))) for row, n in rows]
        # Rows without an arm come first. They keep no arm, even if there are more than columns.
        loose.sort(key=lambda row: not all(s.is_zero(x) for x in row.angular))
        return linear, angular, loose

    def _triangular(
        self,
        linear: dict[int, Row],
        angular: dict[int, Row],
        loose: list[Row],
        orders: tuple[list[int], list[int]],
        rotations: Steps,
    ) -> tuple[dict[int, Row], dict[int, Row], list[Row]]:
        """Rotate rows about one point to triangular form, unless there are few of them.

        linear, angular  rows of the triangle, by coordinate axis; returned with those added
        loose            the other rows; returned with what is left of them
        orders           axes of the columns of a and of α, in the order of elimination; rows of the
                         triangle on other axes become loose
        """
        loose = [
            *loose,
            *(row for j, row in linear.items() if j not in orders[0]),
            *(row for j, row in angular.items() if j not in orders[1]),
        ]
        linear = {j: row for j, row in linear.items() if j in orders[0]}
        angular = {j: row for j, row in angular.items() if j in orders[1]}
        if not linear and len(loose) + len(angular) <= len(orders[0]) + len(orders[1]):
            return linear, angular, loose
        linear, loose = self._rows.folded(linear, loose, orders[0], rotations, angular=False)
        count = sum(not self._rows.is_empty(row) for row in loose)
        if angular or count > len(orders[1]):
            angular, loose = self._rows.folded(angular, loose, orders[1], rotations, angular=True)
        return linear, angular, loose

    def _arm(self, k: int, at: Vec) -> Vec:
        """The arm of link k from the point `at`, the joint of the heaviest child."""
        between = self._aligned.between.get(k)
        return sub(self._links[k].arm, at) if between is None else between
