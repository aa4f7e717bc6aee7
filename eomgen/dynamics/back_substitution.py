"""Back substitution of the orthogonal elimination: accelerations from root to leaf.

Equation numbers are those of `orthogonal`.
"""

from collections.abc import Mapping, Sequence

from eomgen.dynamics.articulated import along, with_component
from eomgen.dynamics.kinematics import Link
from eomgen.dynamics.rows import Eliminated, Taken, undo_rotations
from eomgen.dynamics.vectors import Vec, add, cross, dot, named, zeros
from eomgen.scalars.protocol import Scalar, Scalars


def outwards(
    links: Sequence[Link], found: Sequence[Eliminated], nv: int, scalars: Scalars
) -> list[Scalar]:
    """v̇ (nv,), root to leaf: rotate the residuals back, then solve (2) for each axis."""
    zero = scalars.number(0.0)
    result = [zero] * nv
    residuals: dict[int, Scalar] = {}
    reached: list[tuple[Vec, Vec]] = []
    for link, eliminated in zip(links, found, strict=True):
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent >= 0:
            base_angular, base_linear = reached[link.parent]
            angular = link.rotation.into(base_angular)
            linear = link.rotation.into(add(base_linear, cross(base_angular, link.arm)))
        for row in (*eliminated.empty, *(eliminated.rows if link.parent < 0 else ())):
            residuals[row.index] = -row.right
        undo_rotations(eliminated.rotations, residuals)
        for taken in reversed(eliminated.axes):
            motion = taken.axis
            residuals[taken.pivot] = taken.left
            undo_rotations((*taken.gathered, *taken.rotations), residuals)
            before = along(motion, angular, linear)
            if taken.rotor >= 0:
                result[taken.velocity] = residuals[taken.rotor]
                value = before + residuals[taken.rotor]
            else:
                value = _value(taken, residuals, angular, linear, zero)
                result[taken.velocity] = value - before
            angular, linear = with_component(motion, angular, linear, value)
            undo_rotations(taken.before, residuals)
        angular = named(angular, f"alpha_{link.name}", scalars)
        reached.append((angular, named(linear, f"delta_{link.name}", scalars)))
    return result


def _value(
    taken: Taken, residuals: Mapping[int, Scalar], angular: Vec, linear: Vec, zero: Scalar
) -> Scalar:
    """Equation (2): the acceleration along an axis from rows that contain it, if the others are
    known. Several rows are averaged with weights x² / noise: a row counts by how much of the
    axis it contains beside its rounding error, not by its mass.
    """
    above, below = zero, zero
    for row in taken.rows:
        x = along(taken.axis, row.angular, row.linear)
        clear = with_component(taken.axis, row.angular, row.linear, zero)
        known = dot(clear[0], angular) + dot(clear[1], linear)
        held = row.right + residuals[row.index] - known
        if len(taken.rows) == 1:
            return held / x
        share = x / row.noise
        above, below = above + share * held, below + share * x
    return above / below
