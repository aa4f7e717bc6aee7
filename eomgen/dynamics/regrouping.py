"""Inertial parameters regrouped along the tree, so that fewer of them are not 0.

Mass on the axis of a revolute joint moves alike whether it belongs to the joint's child or to its
parent. So a body's mass, its first moment along the axis, and one of its two moments of inertia
across the axis can be counted to the parent, each as that of a distribution on the axis. A
prismatic joint does not rotate its child, whose inertia about the frame's origin can be counted to
the parent; a ball joint shares the mass with its parent. What can be counted to the world is left
out. M, V and G stay the same, wrenches on frames do not (base parameters: Khalil and Kleinfinger
1987, Gautier and Khalil 1990). All sums depend on parameters alone.

Of the two moments across an axis the smaller one is moved. What is left is then positive, and the
two parts have the same sign in every sum.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.tree.composite import shifted
from eomgen.dynamics.tree.frames import Frame, Linkage, Rigid, joined
from eomgen.dynamics.tree.kinematics import Axes, TreeKinematics, still_rotation, tree_kinematics
from eomgen.dynamics.tree.linkage import make_linkage
from eomgen.dynamics.tree.vectors import (
    ENTRIES,
    Symmetric,
    no_matrix,
    replaced,
    sub,
    symmetric,
    zeros,
)
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.protocol import Scalar, Scalars


class RegroupedDynamics(Dynamics):
    """Dynamics with regrouped inertias where generalised forces are computed."""

    @cached_property
    def inertias(self) -> TreeKinematics:
        """Regrouped where that spares inverse dynamics operations."""
        return self._of(self._regrouped(sparing=True), self.axes)

    @cached_property
    def weights(self) -> TreeKinematics:
        """Regrouped altogether."""
        return self._of(self._all_regrouped, self.axes)

    @cached_property
    def inertias_in_world(self) -> TreeKinematics:
        """Regrouped altogether, since sums over subtrees have most entries in any case."""
        return self.weights if self.axes == "world" else self._of(self._all_regrouped, "world")

    @cached_property
    def _all_regrouped(self) -> Linkage:
        return self._regrouped(sparing=False)

    @cached_property
    def _at_defaults(self) -> Linkage:
        return make_linkage(self.model, self.model.defaults, FloatScalars())

    def _regrouped(self, *, sparing: bool) -> Linkage:
        return regrouped(self.linkage, self._at_defaults, self.scalars, sparing=sparing)

    def _of(self, linkage: Linkage, axes: Axes) -> TreeKinematics:
        return tree_kinematics(linkage, self.q, axes, self.scalars)


def regrouped(linkage: Linkage, values: Linkage, scalars: Scalars, *, sparing: bool) -> Linkage:
    """A linkage with regrouped inertias. `values` is the same linkage over floats, whose moments
    say which ones are smaller.

    If `sparing`, a part moves only where that spares inverse dynamics operations: what the child
    has no more must not cost more at the parent, where entries were 0.
    """
    floats = FloatScalars()
    found, at_values = ([frame.rigid for frame in x.frames] for x in (linkage, values))
    for k, frame in reversed([*enumerate(linkage.frames)]):
        across = [(frame.axis + 1) % 3, (frame.axis + 2) % 3]
        smaller = min(across, key=lambda i: at_values[k].inertia[i][i])
        parts = _parts(frame, found[k], smaller, scalars)
        for part, value in zip(parts, _parts(frame, at_values[k], smaller, floats), strict=True):
            if frame.parent < 0 or not sparing or _spares(linkage, found, k, part, scalars):
                _move(linkage, found, k, part, scalars)
                _move(values, at_values, k, value, floats)
    frames = zip(linkage.frames, found, strict=True)
    return replace(linkage, frames=tuple(replace(frame, rigid=rigid) for frame, rigid in frames))


def _move(linkage: Linkage, rigids: list[Rigid], k: int, part: Rigid, scalars: Scalars) -> None:
    """Count a part of frame k's inertia to its parent, or to the world."""
    frame = linkage.frames[k]
    rigids[k] = _less(rigids[k], part)
    if frame.parent >= 0:
        there = _at_parent(linkage, frame, part, scalars)
        rigids[frame.parent] = joined(rigids[frame.parent], there)


def _spares(
    linkage: Linkage, rigids: Sequence[Rigid], k: int, part: Rigid, scalars: Scalars
) -> bool:
    """Whether inverse dynamics takes no more operations after `_move`."""
    frame = linkage.frames[k]
    own, parent = rigids[k], rigids[frame.parent]
    moved = (_less(own, part), joined(parent, _at_parent(linkage, frame, part, scalars)))
    before, after = (sum(_work(rigid, scalars) for rigid in x) for x in ((own, parent), moved))
    return after <= before


def _at_parent(linkage: Linkage, frame: Frame, part: Rigid, scalars: Scalars) -> Rigid:
    rotation = still_rotation(frame, scalars)
    return shifted(rotation, frame.offset, part, scalars, planar=linkage.planar)


def _parts(frame: Frame, rigid: Rigid, smaller: int, scalars: Scalars) -> Iterator[Rigid]:
    """The parts of a frame's inertia that its parent may have, in the frame's axes."""
    zero, nothing, none = scalars.number(0.0), zeros(scalars), no_matrix(scalars)
    if frame.kind == "fixed":
        yield rigid
        return
    if frame.kind == "prismatic":
        yield Rigid(zero, nothing, rigid.inertia)
        return
    yield Rigid(rigid.mass, nothing, none)
    if frame.kind == "revolute":
        k, across = frame.axis, rigid.inertia[smaller][smaller]
        yield Rigid(zero, replaced(nothing, k, rigid.first_moment[k]), none)
        moments: list[Scalar] = [zero if i == k else across for i in range(3)]
        yield Rigid(zero, nothing, symmetric([*moments, zero, zero, zero]))


def _less(a: Rigid, b: Rigid) -> Rigid:
    """a - b."""
    J: Symmetric = symmetric([a.inertia[i][j] - b.inertia[i][j] for i, j in ENTRIES])
    return Rigid(a.mass - b.mass, sub(a.first_moment, b.first_moment), J)


def _work(rigid: Rigid, scalars: Scalars) -> int:
    """About how many operations inverse dynamics takes for the entries of an inertia."""
    h = sum(not scalars.is_zero(x) for x in rigid.first_moment)
    diagonal = sum(not scalars.is_zero(rigid.inertia[i][i]) for i in range(3))
    off = sum(not scalars.is_zero(rigid.inertia[i][j]) for i, j in ENTRIES[3:])
    return 6 * (not scalars.is_zero(rigid.mass)) + 10 * h + 4 * diagonal + 7 * off
