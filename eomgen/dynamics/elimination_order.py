"""Which accelerations the frames of a tree can have at all, and the order to eliminate them in."""

from collections.abc import Sequence

from eomgen.dynamics.kinematics import Link, MotionAxis
from eomgen.dynamics.rows import Column, Row
from eomgen.dynamics.vectors import AXES, Vec, cross, unit
from eomgen.scalars.protocol import Scalars


def nonzero_columns(links: Sequence[Link], scalars: Scalars) -> list[set[Column]]:
    """For each link its angular accelerations, and those of its origin, that are not 0 whatever the
    velocities do: what nothing on the way from the world can give is not there.
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
    """The accelerations that turning gives a point."""
    found: set[Column] = set()
    for angular, j in columns:
        if angular:
            found |= _parts(False, cross(unit(j, scalars), at), scalars)
    return found


def rotation_order(link: Link, planar: bool, along: int | None) -> tuple[int, ...]:
    """The axes to turn about, in the order to eliminate them in, that of the link last, or that
    `along` the arm of what it carries.
    """
    if planar:
        return (2,)
    units = [axis.unit for axis, _ in link.free if axis.angular and axis.unit is not None]
    last = along if along is not None else units[-1] if units else 2
    return ((last + 1) % 3, (last + 2) % 3, last)


def translation_order(
    link: Link, arm: Vec, rows: Sequence[Row], planar: bool, scalars: Scalars
) -> tuple[int, ...]:
    """The axes to move along, that of the link last. Before it those that rows of few axes hold,
    which so stay what they are, and that of an arm.
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
    """The acceleration along a coordinate axis of motion."""
    assert axis.unit is not None  # as all are in the frames' own axes
    return axis.angular, axis.unit


def _parts(angular: bool, vector: Vec, scalars: Scalars) -> set[Column]:
    return {(angular, j) for j in AXES if not scalars.is_zero(vector[j])}
