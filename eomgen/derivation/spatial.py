"""Matrix expressions of the recursive algorithm: spatial vectors (Featherstone 2008, chapter 2).

A motion is [ω; v] and a force [n; f], six components, at the origin of a frame in its axes; in the
plane three, [ω_z; v_x; v_y] and [n_z; f_x; f_y].
"""

import sympy as sp

from eomgen.derivation.rotations import hat
from eomgen.derivation.symbols import Expr

PLANAR = (2, 3, 4)
"""The components of a spatial vector that a planar one has."""


class MotionCross(sp.MatrixExpr):  # type: ignore[misc]
    """v × m of two motions, or of a motion and each column of m."""

    @property
    def shape(self) -> tuple[int, int]:
        """That of m."""
        return (self.args[0].rows, self.args[1].cols)


class ForceCross(sp.MatrixExpr):  # type: ignore[misc]
    """v ×* f of a motion and a force: the dual of v ×, minus its transpose."""

    @property
    def shape(self) -> tuple[int, int]:
        """That of f."""
        return (self.args[0].rows, 1)


def cut(matrix: Expr, dimensions: int) -> Expr:
    """A spatial vector or matrix, in the plane its part in the plane."""
    if dimensions == 3:
        return matrix
    columns = PLANAR if matrix.cols == 6 else range(matrix.cols)
    return matrix.extract(list(PLANAR), list(columns))


def motion_transform(rotation: Expr, offset: Expr) -> Expr:
    """X, from the parent's frame to this: [Rᵀ 0; -Rᵀ r× Rᵀ]."""
    back = rotation.T
    return sp.Matrix(sp.BlockMatrix([[back, sp.zeros(3)], [-back * hat(offset), back]]))


def rigid_inertia(mass: Expr, centre: Expr, inertia: Expr) -> Expr:
    """The spatial inertia at the frame's origin: [J, m c×; -m c×, m 1]."""
    moved = inertia + mass * (centre.dot(centre) * sp.eye(3) - centre * centre.T)
    h = hat(mass * centre)
    return sp.Matrix(sp.BlockMatrix([[moved, h], [-h, mass * sp.eye(3)]]))


def motion_subspace(kind: str, axis: Expr) -> Expr:
    """S: the axes of a joint primitive as columns."""
    if kind == "spherical":
        return sp.Matrix.vstack(sp.eye(3), sp.zeros(3))
    parts = (axis, sp.zeros(3, 1)) if kind == "revolute" else (sp.zeros(3, 1), axis)
    return sp.Matrix.vstack(*parts)
