"""The elimination of one motion axis of a link from the rows that contain it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from eomgen.dynamics.orthogonal.elimination_order import column_of
from eomgen.dynamics.orthogonal.rows import (
    Column,
    EliminatedAxis,
    GivensRotation,
    Row,
    Rows,
    Steps,
    Sum,
    shifted,
)
from eomgen.dynamics.tree.articulated import along, with_component
from eomgen.dynamics.tree.forces import Wrench, no_wrench
from eomgen.dynamics.tree.kinematics import Link, MotionAxis
from eomgen.dynamics.tree.vectors import Vec, scale, sub
from eomgen.scalars.protocol import Scalar


class Others(NamedTuple):
    """The rows beside a pivot row: those `kept` in a triangle, by column, and the `free` ones."""

    kept: dict[Column, Row]
    free: list[Row]


def eliminate_free_axis(
    rows: Rows,
    link: Link,
    axis: tuple[MotionAxis, int],
    held: bool,
    others: Others,
    term: Wrench,
    tau: Sequence[Scalar],
) -> tuple[EliminatedAxis, Others, Wrench]:
    """Choose the pivot row of a motion axis, and eliminate the axis from the other rows."""
    first, sources, others, gathered = _pivot_row(rows, axis[0], held, others)
    # The rows of rotors of several axes contain all of these.
    early = len(link.free) > 1 and not rows.scalars.is_zero(link.armature)
    one, others, left = _eliminate_axis(
        rows, link, axis, first, others, term, tau[axis[1]], early=early
    )
    return replace(one, rows=sources, gathered=gathered), others, left


def eliminate_aligned_rotation(
    rows: Rows,
    link: Link,
    axis: tuple[MotionAxis, int],
    every: Others,
    at: Vec,
) -> tuple[EliminatedAxis, Others]:
    """Eliminate the rotation about the arm from the rows about the arm's end `at`.

    The heaviest rows do not contain it. Rows with other arms, rotated against them first, would
    bring it in, and rounding would not remove it.
    """
    first, nothing = every.kept.pop(column_of(axis[0])), no_wrench(rows.scalars)
    # The forces along this axis are all on its own row.
    one, others, _ = _eliminate_axis(rows, link, axis, first, every, nothing, rows.zero, early=True)
    return replace(one, rows=(shifted(first, at),)), others


def _pivot_row(
    rows: Rows, motion: MotionAxis, held: bool, every: Others
) -> tuple[Row, tuple[Row, ...], Others, tuple[GivensRotation | Sum, ...]]:
    """The pivot row of a motion axis, and the rows from which its acceleration is found.

    If the link has inertia along the axis (`held`), the pivot is the triangle's own row; else a
    row that contains the axis alone, or one gathered from all rows that contain it.
    """
    column = column_of(motion)
    kept, free, rotations = dict(every.kept), list(every.free), Steps()
    if held:
        first = kept.pop(column)
        return first, (first,), Others(kept, free), ()
    single = rows.empty(column)
    for n, row in enumerate(free):
        parts = zip((*row.angular, *row.linear), (*single.angular, *single.linear), strict=True)
        if all(rows.scalars.is_zero(a - b) for a, b in parts):
            return row, (row,), Others(kept, [*free[:n], *free[n + 1 :]]), ()
    angular = column[0]
    sources = tuple(
        row
        for row in (*free, *reversed(kept.values()))
        if not rows.scalars.is_zero((row.angular if angular else row.linear)[column[1]])
    )
    for n, row in enumerate(free):
        single, free[n] = rows.rotated(single, row, column, rotations)
    for key in reversed(kept):
        single, kept[key] = rows.rotated(single, kept[key], column, rotations)
    return single, sources or (single,), Others(kept, free), tuple(rotations)


def _eliminate_axis(
    rows: Rows,
    link: Link,
    axis: tuple[MotionAxis, int],
    first: Row,
    others: Others,
    term: Wrench,
    tau: Scalar,
    *,
    early: bool = False,
) -> tuple[EliminatedAxis, Others, Wrench]:
    """Rotate the pivot row `first` against all others until it alone contains a motion axis.

    It is rotated against the free rows first, or if `early` against the kept ones, which then
    stay a triangle. A rotor is one more row, with weight `armature`: the joint's acceleration.
    """
    s, (motion, i) = rows.scalars, axis
    column = column_of(motion)
    kept, free, rotations = dict(others.kept), list(others.free), Steps()

    def with_free(pivot: Row) -> Row:
        for n, row in enumerate(free):
            pivot, free[n] = rows.rotated(pivot, row, column, rotations)
        return pivot

    pivot = first if early else with_free(first)
    for key in reversed(kept):
        pivot, kept[key] = rows.rotated(pivot, kept[key], column, rotations)
    pivot = with_free(pivot) if early else pivot
    rotor, pushed, back = -1, along(motion, term.moment, term.force), rows.zero
    if s.is_zero(link.armature):
        pushed, back = pushed + tau, -tau
    pivot = replace(pivot, force=pivot.force + pushed)
    moment = sub(term.moment, scale(pushed, pivot.angular))
    push = sub(term.force, scale(pushed, pivot.linear))
    if not s.is_zero(link.armature):
        # The joint's acceleration is the frame's less the parent's.
        empty = rows.empty(column)
        row = rows.make(link.armature, empty.angular, empty.linear, back, tau)
        rotor = row.index
        pivot, row = rows.rotated(pivot, row, column, rotations)
        minus = with_component(motion, row.angular, row.linear, -rows.one)
        free.append(replace(row, angular=minus[0], linear=minus[1]))
    pivot = replace(pivot, weight=s.named(pivot.weight, f"pivot_{link.name}"))
    share = pivot.force / pivot.weight
    left = Wrench(*with_component(motion, moment, push, back))
    one = EliminatedAxis(motion, i, (first,), first.index, share, tuple(rotations), rotor)
    return one, Others(kept, free), left
