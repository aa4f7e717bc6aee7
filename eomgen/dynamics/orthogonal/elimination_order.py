"""Columns that can be other than 0 in the rows of a link, and the order of their elimination.

A column is a component of x = (α, a), see `orthogonal`. Columns that are 0 at every state are left
out. The order keeps rows with few entries as they are, which saves operations.
"""

from collections.abc import Sequence

from eomgen.dynamics.orthogonal.rows import Column, Row
from eomgen.dynamics.tree.kinematics import Link, MotionAxis
from eomgen.dynamics.tree.vectors import AXES, Vec, cross, unit
from eomgen.scalars.protocol import Scalars


def nonzero_columns(links: Sequence[Link], scalars: Scalars) -> list[set[Column]]:
    """For each link the components of its angular acceleration and of its origin's acceleration
    that some joint between the world and it can cause.
    """
    found: list[set[Column]] = []
    for link in links:
        columns = {column_of(axis) for axis, _ in link.free}
        if link.parent >= 0:
            base = found[link.parent]
            for angular, j in base | point_columns(base, link.arm, scalars):
                columns |= _parts(angular, link.rotation.into(unit(j, scalars)), scalars)
        found.append(columns)
    return found


def point_columns(columns: set[Column], at: Vec, scalars: Scalars) -> set[Column]:
    """The linear accelerations of a point `at` that angular ones cause, α x at."""
    found: set[Column] = set()
    for angular, j in columns:
        if angular:
            found |= _parts(False, cross(unit(j, scalars), at), scalars)
    return found


def rotation_order(link: Link, planar: bool, along: int | None) -> tuple[int, ...]:
    """Angular columns in the order of elimination. Last comes the link's own axis, or the one
    `along` the arm of the heaviest child.
    """
    if planar:
        return (2,)
    units = [axis.unit for axis, _ in link.free if axis.angular and axis.unit is not None]
    last = along if along is not None else units[-1] if units else 2
    return ((last + 1) % 3, (last + 2) % 3, last)


def translation_order(
    link: Link, arm: Vec, rows: Sequence[Row], planar: bool, scalars: Scalars
) -> tuple[int, ...]:
    """Linear columns in the order of elimination. Last comes the link's own axis; before it those
    of rows with few linear entries, and that of the arm.
    """
    present = [
        [j for j in AXES if not scalars.is_zero(vector[j])]
        for vector in (arm, *(r.linear for r in rows))
    ]
    own = next((axis.unit for axis, _ in link.free if not axis.angular), None)
    last = present[0][0] if len(present[0]) == 1 else 2

    def late(j: int) -> tuple[bool, int, int]:
        held = [len(vector) for vector in present[1:] if j in vector]
        return j == own, -min(held, default=4), len(held)

    order = ((last + 1) % 3, (last + 2) % 3, last)
    return tuple(sorted((j for j in order if not planar or j < 2), key=late))


def column_of(axis: MotionAxis) -> Column:
    """The column of a motion axis; it is a coordinate axis in the frame's own axes."""
    assert axis.unit is not None  # as all are in the frames' own axes
    return axis.angular, axis.unit


def _parts(angular: bool, vector: Vec, scalars: Scalars) -> set[Column]:
    return {(angular, j) for j in AXES if not scalars.is_zero(vector[j])}
