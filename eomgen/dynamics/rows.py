"""Weighted rows about a frame's accelerations, and their rotations against each other.

A row of weight w and one of weight v with 1 and x in a column become, with d = w + v x²,
c = w / d and s = v x / d,

    p = c a + s b  of weight d,    r = b - x a  of weight v c        (Gentleman 1973),

of which r has nothing there: a Givens rotation without its square root. Backwards, from what the
new rows leave at some accelerations follows what the old ones leave, a = p - s r, b = x p + c r.
So do forces f and g on them: f a + g b = (f + x g) p + (c g - s f) r.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import count

from eomgen.dynamics.kinematics import Link, MotionAxis
from eomgen.dynamics.vectors import AXES, Vec, add, cross, unit, zeros
from eomgen.scalars.protocol import Scalar, Scalars

TINY = 1e-200
"""The weight of an empty row, and the least of any: so small that it never counts."""
UNKNOWN = 1e100
"""The noise of an empty row, which says nothing."""

Column = tuple[bool, int]
"""Whether an acceleration is angular, and its axis."""


@dataclass(frozen=True)
class Row:
    """angular · α + linear · a = right, times weight, and a force on that sum; `index` names its
    residual.

    `noise` is what rounding leaves of it, squared, in parts of what it leaves of a body's own row.
    A row that began as an empty one is that of others over what little they may hold of its axis,
    and has their rounding over that, too. Of all others it counts as 1.
    """

    index: int
    weight: Scalar
    angular: Vec
    linear: Vec
    right: Scalar
    force: Scalar
    noise: Scalar


@dataclass(frozen=True)
class GivensRotation:
    """A rotation of a row against a pivot row that has 1 where it has x."""

    pivot: int
    row: int
    x: Scalar
    s: Scalar
    c: Scalar


@dataclass(frozen=True)
class Sum:
    """Rows x · unknown = right put together at once with a row of that unknown alone, whose right
    side was `before`, to `pivot`.
    """

    pivot: Row
    before: Scalar
    rows: tuple[tuple[int, Scalar, Scalar], ...]


Steps = list[GivensRotation | Sum]


@dataclass(frozen=True)
class Taken:
    """An axis of motion that was eliminated.

    rows    what it is found from: the one row that held it, or all before they were gathered
    pivot   the index of that which held it at last, and its residual at the end, `left`
    rotations
            the rotations that cleared it; before those the ones that `gathered` the rows, and
            before those the ones since the last axis
    rotor   the index of its motor's row, -1 if it has none
    """

    axis: MotionAxis
    velocity: int
    rows: tuple[Row, ...]
    pivot: int
    left: Scalar
    rotations: tuple[GivensRotation | Sum, ...]
    rotor: int
    gathered: tuple[GivensRotation | Sum, ...] = ()
    before: tuple[GivensRotation | Sum, ...] = ()


@dataclass(frozen=True)
class Eliminated:
    """A link after its axes are: these in the order taken, rotations after them, rows that remain
    for the parent, and those that hold nothing more.
    """

    axes: tuple[Taken, ...]
    rotations: tuple[GivensRotation | Sum, ...]
    rows: tuple[Row, ...]
    empty: tuple[Row, ...]


class Rows:
    """Makes and rotates rows; each has an index of its own."""

    def __init__(self, scalars: Scalars) -> None:
        self._scalars = scalars
        self._indices = count()
        numbers = (0.0, 1.0, TINY, UNKNOWN)
        self.zero, self.one, self.tiny, self.unknown = map(scalars.number, numbers)

    def make(self, weight: Scalar, angular: Vec, linear: Vec, right: Scalar, force: Scalar) -> Row:
        """A row."""
        return Row(next(self._indices), weight, angular, linear, right, force, self.one)

    def empty(self, column: Column) -> Row:
        """One that holds one acceleration, and of which nothing is asked."""
        angular, axis = column
        one, zero = unit(axis, self._scalars), zeros(self._scalars)
        units = (one, zero) if angular else (zero, one)
        return replace(self.make(self.tiny, *units, self.zero, self.zero), noise=self.unknown)

    def of(self, columns: Collection[Column], row: Row) -> Row:
        """A row where only some accelerations can be other than nothing."""
        a, b = row.angular, row.linear
        x, y, z = (a[j] if (True, j) in columns else self.zero for j in AXES)
        p, q, r = (b[j] if (False, j) in columns else self.zero for j in AXES)
        return replace(row, angular=(x, y, z), linear=(p, q, r))

    def is_empty(self, row: Row) -> bool:
        """Whether a row holds nothing any more."""
        return all(self._scalars.is_zero(x) for x in (*row.angular, *row.linear))

    def folded(
        self,
        own: dict[int, Row],
        rows: Sequence[Row],
        order: Sequence[int],
        rotations: Steps,
        *,
        angular: bool,
    ) -> tuple[dict[int, Row], list[Row]]:
        """Rotate rows against the link's own until those alone hold the linear, or else the angular
        accelerations, as a triangle in their order.
        """
        own, rows = dict(own), list(rows)
        for j in order:
            first = pivot = own.get(j) or self.empty((angular, j))
            if angular and j == order[-1] and j in own:
                pivot, rows = self._summed(pivot, rows, j, rotations)
            for n, row in enumerate(rows):
                pivot, rows[n] = self.rotated(
                    pivot, row, (angular, j), rotations, own=pivot is first
                )
            own[j] = pivot
        return own, rows

    def _summed(
        self, pivot: Row, rows: Sequence[Row], j: int, rotations: Steps
    ) -> tuple[Row, list[Row]]:
        """A pivot row about one angular acceleration with all rows about that, and the others."""
        is_zero = self._scalars.is_zero
        weight, right, force = pivot.weight, pivot.weight * pivot.right, pivot.force
        found, others = [], []
        for row in rows:
            x = row.angular[j]
            if is_zero(x):
                others.append(row)
                continue
            q = row.weight * x
            weight, right = weight + q * x, right + q * row.right
            force = force + x * row.force
            found.append((row.index, x, row.right))
        if not found:
            return pivot, list(rows)
        summed = replace(pivot, weight=weight, right=right / weight, force=force)
        rotations.append(Sum(summed, pivot.right, tuple(found)))
        return summed, others

    def rotated(
        self,
        pivot: Row,
        row: Row,
        column: Column,
        rotations: Steps,
        *,
        own: bool = False,
    ) -> tuple[Row, Row]:
        """A pivot row, 1 in a column, and a row that has x there and then nothing; `own` if the
        pivot row is a body's own yet.
        """
        angular, j = column
        x = (row.angular if angular else row.linear)[j]
        if self._scalars.is_zero(x):
            return pivot, row
        q = row.weight * x
        d = pivot.weight + q * x
        s, c = q / d, pivot.weight / d
        rotations.append(GivensRotation(pivot.index, row.index, x, s, c))

        def mixed(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
            # c a + s b is a + s (b - x a), too, and shorter, but not as good if a is large: in a
            # link's own rows it is not, nor longer if a or b is nothing.
            rest = b - x * a
            short = own and not self._scalars.is_zero(a) and not self._scalars.is_zero(b)
            return (a + s * rest if short else c * a + s * b), rest

        def both(a: Vec, b: Vec, clear: bool) -> tuple[Vec, Vec]:
            pairs = [mixed(*pair) for pair in zip(a, b, strict=True)]
            if clear:
                pairs[j] = (self.one, self.zero)
            (p, f), (q, g), (r, h) = pairs
            return (p, q, r), (f, g, h)

        alpha, left_alpha = both(pivot.angular, row.angular, angular)
        a, left_a = both(pivot.linear, row.linear, not angular)
        right, left_right = mixed(pivot.right, row.right)
        force, left_force = pivot.force + x * row.force, c * row.force - s * pivot.force
        noise, left_noise = pivot.noise, row.noise
        if noise is not self.one:
            left_noise = left_noise + x * x * noise
            noise = c * c * noise + s * s * row.noise
        return (
            Row(pivot.index, d, alpha, a, right, force, noise),
            Row(
                row.index,
                row.weight * c,
                left_alpha,
                left_a,
                left_right,
                left_force,
                left_noise,
            ),
        )


def undo_rotations(rotations: Sequence[GivensRotation | Sum], residuals: dict[int, Scalar]) -> None:
    """What rows leave before rotations, from what they leave after them."""
    for rotation in reversed(rotations):
        if isinstance(rotation, Sum):
            value = rotation.pivot.right + residuals[rotation.pivot.index]
            for index, x, right in rotation.rows:
                residuals[index] = x * value - right
            residuals[rotation.pivot.index] = value - rotation.before
            continue
        a, b = residuals[rotation.pivot], residuals[rotation.row]
        residuals[rotation.pivot] = a - rotation.s * b
        residuals[rotation.row] = rotation.x * a + rotation.c * b


def shifted(row: Row, offset: Vec) -> Row:
    """A row about a point as one about the origin that the point lies `offset` from."""
    return replace(row, angular=add(row.angular, cross(offset, row.linear)))


def in_parent_axes(link: Link, row: Row) -> Row:
    """A row of a link in its parent's axes."""
    return replace(
        row, angular=link.rotation.out(row.angular), linear=link.rotation.out(row.linear)
    )
