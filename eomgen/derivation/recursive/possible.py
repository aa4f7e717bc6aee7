"""Which accelerations the frames of a tree can have at all, by its shape."""

from collections.abc import Sequence

from eomgen.derivation.recursive.instant import Axis, Link
from eomgen.derivation.recursive.rows import Column
from eomgen.derivation.recursive.vectors import AXES, Scalars, Vec, cross, unit


def possible(links: Sequence[Link], scalars: Scalars) -> list[set[Column]]:
    """For each link its angular accelerations, and those of its origin, that are not 0 whatever the
    velocities do: what nothing on the way from the world can give is not there.
    """
    found: list[set[Column]] = []
    for link in links:
        columns = {column_of(axis) for axis, _ in link.free}
        if link.parent >= 0:
            base = found[link.parent]
            for angular, j in base | moved(base, link.arm, scalars):
                columns |= _parts(angular, link.turn.into(unit(j, scalars)), scalars)
        found.append(columns)
    return found


def moved(columns: set[Column], at: Vec, scalars: Scalars) -> set[Column]:
    """The accelerations that turning gives a point."""
    found: set[Column] = set()
    for angular, j in columns:
        if angular:
            found |= _parts(False, cross(unit(j, scalars), at), scalars)
    return found


def column_of(axis: Axis) -> Column:
    """The acceleration along a coordinate axis of motion."""
    assert axis.unit is not None  # as all are in the frames' own axes
    return axis.angular, axis.unit


def _parts(angular: bool, way: Vec, scalars: Scalars) -> set[Column]:
    return {(angular, j) for j in AXES if not scalars.is_zero(way[j])}
