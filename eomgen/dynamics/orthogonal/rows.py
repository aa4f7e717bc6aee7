"""Weighted rows of least squares over a frame's accelerations, and their Givens rotations.

Take a row a of weight w with 1 in a column, and a row b of weight v with x there. With
d = w + v x², c = w / d and s = v x / d they become

    p = c a + s b  of weight d,    r = b - x a  of weight v c,                             (1)

and r has 0 in that column: a Givens rotation without its square root (Gentleman 1973; a "fast
Givens" rotation). The inverse takes the new rows' residuals to the old ones',

    a = p - s r,    b = x p + c r,                                                         (2)

and forces f on a and g on b transform as f a + g b = (f + x g) p + (c g - s f) r.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import count

from eomgen.dynamics.tree.kinematics import Link, MotionAxis
from eomgen.dynamics.tree.vectors import AXES, Vec, add, cross, replaced, unit, zeros
from eomgen.scalars.protocol import Scalar, Scalars

TINY = 1e-200
"""The weight of an empty row, and the least of any. It never counts beside another weight."""
UNKNOWN = 1e100
"""The noise of an empty row: it carries no information."""

Column = tuple[bool, int]
"""A component of x = (α, a): whether it is angular, and its coordinate axis."""


@dataclass(frozen=True)
class Row:
    """The row angular · α + linear · a = right, with its weight ρ² and its force φ.

    `index` identifies its residual. `noise` is the squared rounding error of the row, relative to
    that of a body's own row. It is 1 but for rows that began empty: these are other rows divided by
    what may be a small entry, and so is their rounding error.
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
    """The rotation (1) of a row with entry x against a pivot row with entry 1."""

    pivot: int
    row: int
    x: Scalar
    s: Scalar
    c: Scalar


@dataclass(frozen=True)
class Sum:
    """Several rows x · unknown = right and a row of that unknown alone, added to one row, `pivot`.

    `before` is the right-hand side of that row before. `rows` are (index, x, right) of the others.
    """

    pivot: Row
    before: Scalar
    rows: tuple[tuple[int, Scalar, Scalar], ...]


Steps = list[GivensRotation | Sum]


@dataclass(frozen=True)
class EliminatedAxis:
    """The elimination of a motion axis.

    velocity   index of its velocity in v
    rows       the rows that determine its acceleration: the one that contained it, or all that were
               gathered
    pivot      index of the pivot row; `residual` is its final residual φ / ρ²
    rotor      index of the row of the motor's rotor, -1 if there is none
    rotations  rotations that cleared the axis from the other rows; before them those that
               `gathered` the pivot row, and `before` these the ones since the previous axis
    """

    axis: MotionAxis
    velocity: int
    rows: tuple[Row, ...]
    pivot: int
    residual: Scalar
    rotations: tuple[GivensRotation | Sum, ...]
    rotor: int
    gathered: tuple[GivensRotation | Sum, ...] = ()
    before: tuple[GivensRotation | Sum, ...] = ()


@dataclass(frozen=True)
class EliminatedLink:
    """The elimination of a link: its axes in order, the rotations after the last axis, the rows
    that are passed to the parent, and the rows that are empty now.
    """

    axes: tuple[EliminatedAxis, ...]
    rotations: tuple[GivensRotation | Sum, ...]
    rows: tuple[Row, ...]
    empty: tuple[Row, ...]


class Rows:
    """Makes rows, each with its own index, and rotates them."""

    def __init__(self, scalars: Scalars) -> None:
        self.scalars = scalars
        self._indices = count()
        numbers = (0.0, 1.0, TINY, UNKNOWN)
        self.zero, self.one, self.tiny, self.unknown = map(scalars.number, numbers)

    def make(self, weight: Scalar, angular: Vec, linear: Vec, right: Scalar, force: Scalar) -> Row:
        """A row of a body or a rotor."""
        return Row(next(self._indices), weight, angular, linear, right, force, self.one)

    def empty(self, column: Column) -> Row:
        """A row of negligible weight with 1 in one column and right-hand side 0."""
        angular, axis = column
        one, zero = unit(axis, self.scalars), zeros(self.scalars)
        units = (one, zero) if angular else (zero, one)
        return replace(self.make(self.tiny, *units, self.zero, self.zero), noise=self.unknown)

    def of(self, columns: Collection[Column], row: Row) -> Row:
        """A row with the entries outside `columns` set to 0: those accelerations are always 0."""
        a, b = row.angular, row.linear
        x, y, z = (a[j] if (True, j) in columns else self.zero for j in AXES)
        p, q, r = (b[j] if (False, j) in columns else self.zero for j in AXES)
        return replace(row, angular=(x, y, z), linear=(p, q, r))

    def is_empty(self, row: Row) -> bool:
        """Whether all entries of a row are 0."""
        return all(self.scalars.is_zero(x) for x in (*row.angular, *row.linear))

    def folded(
        self,
        own: dict[int, Row],
        rows: Sequence[Row],
        order: Sequence[int],
        rotations: Steps,
        *,
        angular: bool,
    ) -> tuple[dict[int, Row], list[Row]]:
        """Rotate `rows` against the link's own rows until only those contain the accelerations of
        `order`, as a triangle: the `angular` ones, or else the linear ones.
        """
        own, rows = dict(own), list(rows)
        for j in order:
            first = pivot = own.get(j) or self.empty((angular, j))
            last = angular and j == order[-1] and j in own
            if last and all(self._has_only(j, row) for row in (pivot, *rows)):
                pivot, rows = self._summed(pivot, rows, j, rotations)
            for n, row in enumerate(rows):
                pivot, rows[n] = self.rotated(
                    pivot, row, (angular, j), rotations, own=pivot is first
                )
            own[j] = pivot
        return own, rows

    def _has_only(self, j: int, row: Row) -> bool:
        """Whether a row contains no acceleration but angular acceleration j. The row of a rotor may
        contain those of the parent too.
        """
        return self.is_empty(replace(row, angular=replaced(row.angular, j, self.zero)))

    def _summed(
        self, pivot: Row, rows: Sequence[Row], j: int, rotations: Steps
    ) -> tuple[Row, list[Row]]:
        """Add the rows with angular acceleration j to its pivot row; return the others too."""
        is_zero = self.scalars.is_zero
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
        """The rotation (1): `pivot` has 1 in a column, `row` has x there, and then 0. `own` says
        that the pivot row is still a body's own.
        """
        angular, j = column
        x = (row.angular if angular else row.linear)[j]
        if self.scalars.is_zero(x):
            return pivot, row
        q = row.weight * x
        d = pivot.weight + q * x
        s, c = q / d, pivot.weight / d
        rotations.append(GivensRotation(pivot.index, row.index, x, s, c))

        def mixed(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
            # c a + s b = a + s (b - x a). The second form is shorter, but less accurate for a
            # large a. In a link's own rows a is not large. If a or b is 0 it saves nothing.
            rest = b - x * a
            short = own and not self.scalars.is_zero(a) and not self.scalars.is_zero(b)
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
            noise = c * (c * noise) + s * (s * row.noise)
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
    """Equation (2): change residuals after the rotations into those before them, in place."""
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
    """A row about a point, as a row about the origin; the point is at `offset` from that."""
    return replace(row, angular=add(row.angular, cross(offset, row.linear)))


def in_parent_axes(link: Link, row: Row) -> Row:
    """A row in a link's axes, in its parent's axes."""
    return replace(
        row, angular=link.rotation.out(row.angular), linear=link.rotation.out(row.linear)
    )
