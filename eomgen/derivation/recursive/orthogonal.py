"""Forward dynamics by orthogonal elimination: no digit is lost where heavy bodies hang on light.

By Gauss's principle of least constraint the accelerations are those with the least

    ½ Σ w (c · x - f)² - t · x,                  x = (α, a) of the frames,

with a row c · x = f of weight w for each component of each body's Newton's and Euler's equations:
the mass, a_centre = force / mass; the principal parts of the inertia, α = moment / inertia. The
mass matrix and articulated inertias are this sum's normal equations. They square its condition,
and a light body vanishes beside a heavy one; rows of their own weight do not. So rows are rotated
against each other until one alone holds the acceleration along a free axis, from the leaves to the
root: the QR factors of least squares over the tree of frames, by rotations without square roots
(Gentleman 1973; Golub & Van Loan 5.1.13 of the 3rd edition). Weights are only added, or multiplied
by ratios below 1, and each row is good to rounding of its own size.

Outwards no acceleration is substituted, which could cancel, but the rows' residuals are rotated
back: what is left of the first rows times their weights are the forces, small where the rows are
light. Rows that are all pivots have the residual that t leaves. An axis of a frame without inertia
begins with an empty row of no weight to speak of.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

from eomgen.derivation.recursive.articulated import along, with_component
from eomgen.derivation.recursive.forces import Force, at_parent, total
from eomgen.derivation.recursive.frames import Linkage
from eomgen.derivation.recursive.instant import Axis, Instant, Link
from eomgen.derivation.recursive.motion import Acceleration, moment_about_centre
from eomgen.derivation.recursive.vectors import (
    AXES,
    Scalar,
    Scalars,
    Symmetric,
    Vec,
    add,
    congruent,
    constant,
    cross,
    dot,
    named,
    plus,
    replaced,
    scale,
    sub,
    symmetric,
    times,
    unit,
    zeros,
)

TINY = 1e-200
"""The weight of an empty row, and the least of any: so small that it never counts."""
SLIGHT = 1e-16
"""The least share of a diagonal entry that a pivot of an inertia matrix keeps."""


@dataclass(frozen=True)
class Solid:
    """What a frame carries as one body: mass, centre and inertia about it, in the frame's axes."""

    mass: Scalar
    centre: Vec
    inertia: Symmetric


@dataclass(frozen=True)
class Row:
    """angular · α + linear · a = right, times weight; `index` names its residual."""

    index: int
    weight: Scalar
    angular: Vec
    linear: Vec
    right: Scalar


@dataclass(frozen=True)
class Turn:
    """A rotation of a row against a pivot row that has 1 where it has x."""

    pivot: int
    row: int
    x: Scalar
    s: Scalar
    c: Scalar


@dataclass(frozen=True)
class Sum:
    """Rows of one unknown, alone in the pivot row too, put together at once: x times it is right."""

    pivot: Row
    rows: tuple[tuple[int, Scalar, Scalar], ...]


@dataclass(frozen=True)
class Taken:
    """An axis of motion that was eliminated: its row before, the residual of that at the end, and
    the rotations between. `rotor` is the index of its motor's row, -1 if it has none.
    """

    axis: Axis
    velocity: int
    row: Row
    left: Scalar
    turns: tuple[Turn | Sum, ...]
    rotor: int
    before: tuple[Turn | Sum, ...] = ()


@dataclass(frozen=True)
class Eliminated:
    """A link after its axes are: rotations before, axes in the order taken, rows that remain for
    the parent, and those that hold nothing more.
    """

    turns: tuple[Turn | Sum, ...]
    axes: tuple[Taken, ...]
    rows: tuple[Row, ...]
    empty: tuple[Row, ...]


def solids(linkage: Linkage, scalars: Scalars) -> tuple[Solid | None, ...]:
    """What each frame carries, if anything; bodies welded together as one, without cancellation."""
    found: list[Solid | None] = [None] * len(linkage.frames)
    for mount in linkage.mounts:
        inertia = mount.inertia
        if not linkage.planar:
            inertia = congruent(constant(mount.axes, scalars), inertia)
        empty = all(scalars.is_zero(x) for x in (mount.mass, *(inertia[i][i] for i in AXES)))
        if mount.frame >= 0 and not empty:
            one, other = Solid(mount.mass, mount.at, inertia), found[mount.frame]
            found[mount.frame] = one if other is None else _welded(other, one, scalars)
    return tuple(found)


def _welded(a: Solid, b: Solid, scalars: Scalars) -> Solid:
    """Two as one: I = I_a + I_b + (m_a m_b / m) (r² 1 - r rᵀ) with r between the centres."""
    if scalars.is_zero(b.mass) or scalars.is_zero(a.mass):
        heavy = a if scalars.is_zero(b.mass) else b
        return replace(heavy, inertia=plus(a.inertia, b.inertia))
    mass = a.mass + b.mass
    share = b.mass / mass
    x, y, z = way = sub(b.centre, a.centre)
    k = a.mass * share
    xx, yy, zz = k * x * x, k * y * y, k * z * z
    off = (-(k * x * y), -(k * x * z), -(k * y * z))
    more = symmetric([yy + zz, xx + zz, xx + yy, *off])
    inertia = plus(plus(a.inertia, b.inertia), more)
    return Solid(mass, add(a.centre, scale(share, way)), inertia)


def heaviest(linkage: Linkage) -> tuple[int, ...]:
    """For each frame which of its children carries more mass than it and any other has; else -1.

    The linkage is one over floats.
    """
    whole = [float(frame.rigid.mass) for frame in linkage.frames]
    most, found = list(whole), [-1] * len(whole)
    for k in reversed(range(len(whole))):
        parent = linkage.frames[k].parent
        if parent >= 0:
            whole[parent] += whole[k]
            if whole[k] > most[parent]:
                most[parent], found[parent] = whole[k], k
    return tuple(found)


class Elimination:
    """One sweep over the frames of an instant in its own axes.

    `solids` are what the frames carry, about whose centres `wrenches` act; `heaviest` names for
    each link the child that carries most, -1 where that is the link itself.
    """

    def __init__(
        self,
        instant: Instant,
        carried: Sequence[Solid | None],
        heaviest: Sequence[int],
        scalars: Scalars,
    ) -> None:
        self._links = instant.links
        self._solids, self._heaviest = carried, heaviest
        self._scalars = scalars
        self._planar = bool(instant.angles)
        self._indices = count()
        self._zero, self._one, self._tiny = (scalars.number(x) for x in (0.0, 1.0, TINY))

    def respond(
        self, moving: Sequence[Acceleration], wrenches: Sequence[Force], tau: Sequence[Scalar]
    ) -> list[Scalar]:
        """The v̇ under wrenches about the centres and `tau` on the velocities, where `moving` are
        the accelerations at v̇ = 0.
        """
        zero = zeros(self._scalars)
        rows: list[list[tuple[Row, Vec]]] = [[] for _ in self._links]
        terms = [Force(zero, zero) for _ in self._links]
        found: list[Eliminated] = []
        for k in reversed(range(len(self._links))):
            link = self._links[k]
            own, term = self._own_rows(k, moving[k], wrenches[k])
            terms[k] = total(terms[k], term)
            eliminated, passed = self._eliminated(k, own, rows[k], terms[k], tau)
            found.append(eliminated)
            if link.parent >= 0:
                rows[link.parent] += [(_turned(link, row), link.arm) for row in eliminated.rows]
                terms[link.parent] = total(terms[link.parent], at_parent(link, passed))
        return self._outwards(found[::-1], len(tau))

    # Inwards.

    def _row(self, weight: Scalar, angular: Vec, linear: Vec, right: Scalar) -> Row:
        return Row(next(self._indices), weight, angular, linear, right)

    def _empty_row(self, axis: int, *, angular: bool) -> Row:
        one, zero = unit(axis, self._scalars), zeros(self._scalars)
        return self._row(self._tiny, *((one, zero) if angular else (zero, one)), self._zero)

    def _own_rows(
        self, k: int, a: Acceleration, wrench: Force
    ) -> tuple[tuple[dict[int, Row], dict[int, Row]], Force]:
        """Rows of a link's own mass, by axis: linear about its centre, and angular; and the part of
        the wrench that no inertia takes.
        """
        s, zero, solid = self._scalars, zeros(self._scalars), self._solids[k]
        if solid is None:
            return ({}, {}), wrench
        linear, angular, left, moment = {}, {}, zero, zero
        way = add(a.linear, times(a.field, solid.centre))
        light = self._heaviest[k] >= 0
        if light or s.is_zero(solid.mass):
            left = wrench.force
        if not s.is_zero(solid.mass):
            m = s.call("max", solid.mass, self._tiny)
            for j in self._axes():
                right = -way[j] if light else wrench.force[j] / m - way[j]
                linear[j] = self._row(m, zero, unit(j, s), right)
        turning = moment_about_centre(solid.inertia, a, s)
        if light:
            moment = wrench.moment
            y = [-x for x in turning]
        else:
            y = list(sub(wrench.moment, turning))
        work = [list(row) for row in solid.inertia]
        order = self._turns_of(self._links[k])
        for n, i in enumerate(order):
            if s.is_zero(solid.inertia[i][i]):
                if not light:
                    moment = replaced(moment, i, y[i])
                continue
            d = self._pivot_of(work[i][i], solid.inertia[i][i])
            entries = unit(i, s)
            for j in order[n + 1 :]:
                part = work[i][j] / d
                entries = replaced(entries, j, part)
                y[j] = y[j] - part * y[i]
                for h in order[n + 1 :]:
                    work[j][h] = work[j][h] - part * work[i][h]
            angular[i] = self._row(d, entries, zero, y[i] / d)
        moved = add(moment, cross(solid.centre, left))
        return (linear, angular), Force(moved, left)

    def _pivot_of(self, pivot: Scalar, entry: Scalar) -> Scalar:
        floor = self._tiny if pivot is entry else self._scalars.number(SLIGHT) * entry
        return self._scalars.call("max", pivot, floor)

    def _axes(self) -> tuple[int, ...]:
        return (0, 1) if self._planar else (0, 1, 2)

    def _turns_of(self, link: Link) -> tuple[int, ...]:
        """The axes to turn about, that of the link last."""
        if self._planar:
            return (2,)
        units = [axis.unit for axis, _ in link.free if axis.angular and axis.unit is not None]
        last = units[-1] if units else 2
        return ((last + 1) % 3, (last + 2) % 3, last)

    def _slides_of(self, link: Link, arm: Vec) -> tuple[int, ...]:
        """The axes to move along, that of the link last, or that of an arm."""
        ways = [j for j in AXES if not self._scalars.is_zero(arm[j])]
        last = next((axis.unit for axis, _ in link.free if not axis.angular), None)
        if last is None:
            last = ways[0] if len(ways) == 1 else 2
        return tuple(j for j in ((last + 1) % 3, (last + 2) % 3, last) if j in self._axes())

    def _eliminated(
        self,
        k: int,
        own: tuple[dict[int, Row], dict[int, Row]],
        rows: Sequence[tuple[Row, Vec]],
        term: Force,
        tau: Sequence[Scalar],
    ) -> tuple[Eliminated, Force]:
        """Take a link's free axes out of the rows of all that it carries, each about a point."""
        s, link, solid = self._scalars, self._links[k], self._solids[k]
        # Where the heaviest rows have no arm, light ones keep theirs.
        heaviest = self._heaviest[k]
        at = self._links[heaviest].arm if heaviest >= 0 else zeros(s)
        if heaviest < 0 and solid is not None:
            at = solid.centre
        linear, angular = dict(own[0]), dict(own[1])
        if solid is not None:
            linear = {j: _shifted(row, sub(solid.centre, at)) for j, row in linear.items()}
        loose = [_shifted(row, sub(arm, at)) for row, arm in rows]
        turns: list[Turn | Sum] = []
        orders = (self._slides_of(link, at), self._turns_of(link))
        room = len(orders[0]) + len(orders[1])
        folded = bool(linear) or len(loose) + len(angular) > room
        if folded:
            linear, loose = self._folded(linear, loose, orders[0], turns, angular=False)
            holding = sum(not self._is_empty(row) for row in loose)
            if angular or holding > len(orders[1]):
                angular, loose = self._folded(angular, loose, orders[1], turns, angular=True)
        kept = {(False, j): _shifted(linear[j], at) for j in orders[0] if j in linear}
        kept |= {(True, j): angular[j] for j in orders[1] if j in angular}
        free = [_shifted(row, at) for row in loose if not self._is_empty(row)]
        # Rows of angular accelerations alone first, which so stay what they are.
        free.sort(key=lambda row: not all(s.is_zero(x) for x in row.linear))
        empty = [row for row in loose if self._is_empty(row)]
        taken = []
        for axis, i in reversed(link.free):
            held = axis.unit in own[axis.angular]
            first, kept, free, before = self._first(axis, held, kept, free)
            one, kept, free, term = self._taken(link, (axis, i), first, kept, free, term, tau[i])
            taken.append(replace(one, before=before))
        rest = [*kept.values(), *free]
        holding_rows = [row for row in rest if not self._is_empty(row)]
        empty += [row for row in rest if self._is_empty(row)]
        return Eliminated(tuple(turns), tuple(taken), tuple(holding_rows), tuple(empty)), term

    def _is_empty(self, row: Row) -> bool:
        return all(self._scalars.is_zero(x) for x in (*row.angular, *row.linear))

    def _folded(
        self,
        own: dict[int, Row],
        rows: Sequence[Row],
        order: Sequence[int],
        turns: list[Turn | Sum],
        *,
        angular: bool,
    ) -> tuple[dict[int, Row], list[Row]]:
        """Rotate rows against the link's own until those alone hold the linear, or else the angular
        accelerations, as a triangle in their order.
        """
        own, rows = dict(own), list(rows)
        for j in order:
            first = pivot = own.get(j) or self._empty_row(j, angular=angular)
            if angular and j == order[-1] and j in own:
                pivot, rows = self._summed(pivot, rows, j, turns)
            for n, row in enumerate(rows):
                pivot, rows[n] = self._rotated(pivot, row, angular, j, turns, own=pivot is first)
            own[j] = pivot
        return own, rows

    def _summed(
        self, pivot: Row, rows: Sequence[Row], j: int, turns: list[Turn | Sum]
    ) -> tuple[Row, list[Row]]:
        """A pivot row about one angular acceleration with all rows about that, and the others."""
        is_zero = self._scalars.is_zero
        weight, right, found, others = pivot.weight, pivot.weight * pivot.right, [], []
        for row in rows:
            x = row.angular[j]
            if is_zero(x):
                others.append(row)
                continue
            q = row.weight * x
            weight, right = weight + q * x, right + q * row.right
            found.append((row.index, x, row.right))
        if not found:
            return pivot, list(rows)
        pivot = replace(pivot, weight=weight, right=right / weight)
        turns.append(Sum(pivot, tuple(found)))
        return pivot, others

    def _first(
        self, way: Axis, held: bool, kept: dict[tuple[bool, int], Row], free: list[Row]
    ) -> tuple[Row, dict[tuple[bool, int], Row], list[Row], tuple[Turn | Sum, ...]]:
        """The row that an axis is found from: one that holds it alone, as there is where a link has
        inertia against it; else what can be gathered of it from all.
        """
        assert way.unit is not None
        kept, turns = dict(kept), []  # type: ignore[var-annotated]
        if held:
            return kept.pop((way.angular, way.unit)), kept, free, ()
        single = self._empty_row(way.unit, angular=way.angular)
        for n, row in enumerate(free):
            parts = zip((*row.angular, *row.linear), (*single.angular, *single.linear), strict=True)
            if all(self._scalars.is_zero(a - b) for a, b in parts):
                return row, kept, [*free[:n], *free[n + 1 :]], ()
        free = list(free)
        for n, row in enumerate(free):
            single, free[n] = self._rotated(single, row, way.angular, way.unit, turns)
        for key in reversed(kept):
            single, kept[key] = self._rotated(single, kept[key], way.angular, way.unit, turns)
        return single, kept, free, tuple(turns)

    def _taken(
        self,
        link: Link,
        axis: tuple[Axis, int],
        first: Row,
        kept: dict[tuple[bool, int], Row],
        free: Sequence[Row],
        term: Force,
        tau: Scalar,
    ) -> tuple[Taken, dict[tuple[bool, int], Row], list[Row], Force]:
        """Rotate one row until it alone holds an axis of motion."""
        s, (way, i) = self._scalars, axis
        assert way.unit is not None
        pivot, kept, free, turns = first, dict(kept), list(free), []  # type: ignore[var-annotated]
        for n, row in enumerate(free):
            pivot, free[n] = self._rotated(pivot, row, way.angular, way.unit, turns)
        for key in reversed(kept):
            pivot, kept[key] = self._rotated(pivot, kept[key], way.angular, way.unit, turns)
        carried = along(way, term.moment, term.force)
        force, rotor, parents = carried + tau, -1, -tau
        if not s.is_zero(link.armature):
            # Its row is that of the joint's acceleration, the frame's less the parent's.
            row = replace(self._empty_row(way.unit, angular=way.angular), weight=link.armature)
            pivot, row = self._rotated(pivot, row, way.angular, way.unit, turns)
            minus = with_component(way, row.angular, row.linear, -self._one)
            free.append(replace(row, angular=minus[0], linear=minus[1]))
            # Of what pushes the frame the rotor's share, and of tau the frame's, minus.
            rotor, parents = row.index, turns[-1].s * carried - turns[-1].c * tau
        pivot = replace(pivot, weight=s.named(pivot.weight, f"pivot_{link.name}"))
        share = force / pivot.weight
        moment = sub(term.moment, scale(force, pivot.angular))
        push = sub(term.force, scale(force, pivot.linear))
        passed = Force(*with_component(way, moment, push, parents))
        return Taken(way, i, first, share, tuple(turns), rotor), kept, free, passed

    def _rotated(
        self,
        pivot: Row,
        row: Row,
        angular: bool,
        j: int,
        turns: list[Turn | Sum],
        *,
        own: bool = False,
    ) -> tuple[Row, Row]:
        """A pivot row, 1 in a column, and a row that has x there and then nothing; `own` if the
        pivot row is a body's own yet.
        """
        x = (row.angular if angular else row.linear)[j]
        if self._scalars.is_zero(x):
            return pivot, row
        q = row.weight * x
        d = pivot.weight + q * x
        s, c = q / d, pivot.weight / d
        turns.append(Turn(pivot.index, row.index, x, s, c))

        def mixed(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
            # c a + s b is a + s (b - x a), too, and shorter, but not as good if a is large: in a
            # link's own rows it is not, nor longer if a or b is nothing.
            rest = b - x * a
            short = own and not self._scalars.is_zero(a) and not self._scalars.is_zero(b)
            return (a + s * rest if short else c * a + s * b), rest

        def both(a: Vec, b: Vec, clear: bool) -> tuple[Vec, Vec]:
            pairs = [mixed(*pair) for pair in zip(a, b, strict=True)]
            if clear:
                pairs[j] = (self._one, self._zero)
            (p, f), (q, g), (r, h) = pairs
            return (p, q, r), (f, g, h)

        turn, left_turn = both(pivot.angular, row.angular, angular)
        move, left_move = both(pivot.linear, row.linear, not angular)
        right, left_right = mixed(pivot.right, row.right)
        return (
            Row(pivot.index, d, turn, move, right),
            Row(row.index, row.weight * c, left_turn, left_move, left_right),
        )

    # Outwards.

    def _outwards(self, found: Sequence[Eliminated], nv: int) -> list[Scalar]:
        """Residuals from the world outwards, and from them the accelerations."""
        scalars = self._scalars
        result = [self._zero] * nv
        residuals: dict[int, Scalar] = {}
        reached: list[tuple[Vec, Vec]] = []
        for link, eliminated in zip(self._links, found, strict=True):
            angular, linear = zeros(scalars), zeros(scalars)
            if link.parent >= 0:
                base_angular, base_linear = reached[link.parent]
                angular = link.turn.into(base_angular)
                linear = link.turn.into(add(base_linear, cross(base_angular, link.arm)))
            for row in (*eliminated.empty, *(eliminated.rows if link.parent < 0 else ())):
                residuals[row.index] = -row.right
            for taken in reversed(eliminated.axes):
                row, way = taken.row, taken.axis
                residuals[row.index] = taken.left
                _turned_back(taken.turns, residuals)
                before = along(way, angular, linear)
                if taken.rotor >= 0:
                    result[taken.velocity] = residuals[taken.rotor]
                    value = before + residuals[taken.rotor]
                else:
                    clear = with_component(way, row.angular, row.linear, self._zero)
                    value = row.right + residuals[row.index]
                    value = value - (dot(clear[0], angular) + dot(clear[1], linear))
                    result[taken.velocity] = value - before
                angular, linear = with_component(way, angular, linear, value)
                _turned_back(taken.before, residuals)
            _turned_back(eliminated.turns, residuals)
            angular = named(angular, f"alpha_{link.name}", scalars)
            reached.append((angular, named(linear, f"delta_{link.name}", scalars)))
        return result


def _turned_back(turns: Sequence[Turn | Sum], residuals: dict[int, Scalar]) -> None:
    for turn in reversed(turns):
        if isinstance(turn, Sum):
            value = turn.pivot.right + residuals[turn.pivot.index]
            for index, x, right in turn.rows:
                residuals[index] = x * value - right
            continue
        a, b = residuals[turn.pivot], residuals[turn.row]
        residuals[turn.pivot] = a - turn.s * b
        residuals[turn.row] = turn.x * a + turn.c * b


def _shifted(row: Row, way: Vec) -> Row:
    """A row about a point as one about the origin that the point lies `way` from."""
    return replace(row, angular=add(row.angular, cross(way, row.linear)))


def _turned(link: Link, row: Row) -> Row:
    """A row of a link in its parent's axes."""
    return replace(row, angular=link.turn.out(row.angular), linear=link.turn.out(row.linear))
