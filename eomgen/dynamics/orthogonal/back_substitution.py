"""Back substitution of the orthogonal elimination: accelerations from root to leaf.

Equation numbers are those of `orthogonal`.
"""

from collections.abc import Mapping, Sequence

from eomgen.dynamics.orthogonal.rows import EliminatedAxis, EliminatedLink, undo_rotations
from eomgen.dynamics.tree import articulated
from eomgen.dynamics.tree.articulated import Pivot, along, with_component
from eomgen.dynamics.tree.kinematics import Link
from eomgen.dynamics.tree.motion import outward
from eomgen.dynamics.tree.vectors import Vec, dot, named, zeros
from eomgen.scalars.protocol import Scalar, Scalars


def outwards(
    links: Sequence[Link],
    found: Sequence[EliminatedLink | tuple[Pivot, ...]],
    shares: Sequence[Scalar],
    scalars: Scalars,
) -> list[Scalar]:
    """v̇ (nv,), root to leaf: rotate the residuals back, then solve (2) for each axis. Links that
    were eliminated as articulated bodies have pivots, and `shares` as in `articulated`.
    """
    zero = scalars.number(0.0)
    result = [zero] * len(shares)
    residuals: dict[int, Scalar] = {}
    reached: list[tuple[Vec, Vec]] = []
    for link, eliminated in zip(links, found, strict=True):
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent >= 0:
            angular, linear = outward(link, *reached[link.parent])
        if not isinstance(eliminated, EliminatedLink):
            motion = articulated.outwards(link, eliminated, (angular, linear), shares, result)
            reached.append(motion)
            continue
        for row in (*eliminated.empty, *(eliminated.rows if link.parent < 0 else ())):
            residuals[row.index] = -row.right
        undo_rotations(eliminated.rotations, residuals)
        for axis in reversed(eliminated.axes):
            along_axis = axis.axis
            residuals[axis.pivot] = axis.residual
            undo_rotations((*axis.gathered, *axis.rotations), residuals)
            before = along(along_axis, angular, linear)
            if axis.rotor >= 0:
                result[axis.velocity] = residuals[axis.rotor]
                value = before + residuals[axis.rotor]
            else:
                value = _value(axis, residuals, angular, linear, zero)
                result[axis.velocity] = value - before
            angular, linear = with_component(along_axis, angular, linear, value)
            undo_rotations(axis.before, residuals)
        angular = named(angular, f"alpha_{link.name}", scalars)
        reached.append((angular, named(linear, f"delta_{link.name}", scalars)))
    return result


def _value(
    axis: EliminatedAxis, residuals: Mapping[int, Scalar], angular: Vec, linear: Vec, zero: Scalar
) -> Scalar:
    """Equation (2): the acceleration along an axis from rows that contain it, if the others are
    known. Several rows are averaged with weights x² / noise: a row counts by how much of the
    axis it contains beside its rounding error, not by its mass.
    """
    above, below = zero, zero
    for row in axis.rows:
        x = along(axis.axis, row.angular, row.linear)
        clear = with_component(axis.axis, row.angular, row.linear, zero)
        known = dot(clear[0], angular) + dot(clear[1], linear)
        held = row.right + residuals[row.index] - known
        if len(axis.rows) == 1:
            return held / x
        share = x / row.noise
        above, below = above + share * held, below + share * x
    return above / below
