"""The linear complementarity problem of contact forces, which push and never pull."""

import numpy as np

from eomgen.run.problem import FloatArray

ROUNDING = 1e-10
"""Values below this, relative to the largest offset or force, count as zero."""

CONSISTENT = 1e-6
"""Largest acceleration left by a redundant set of contacts, relative to the largest offset."""


def complementary(matrix: FloatArray, offset: FloatArray) -> FloatArray | None:
    """Return f (n,) with 0 <= f, 0 <= a = matrix f + offset, f_i a_i = 0; None if none is found.

    Murty's least-index principal pivoting or, if that cycles, Lemke's method: Cottle, Pang, Stone,
    The Linear Complementarity Problem, sections 4.2 and 4.4. The systems of the former are solved
    by least squares of least norm, so that redundant contacts, such as the four corners of a box on
    the ground, share the load evenly.
    """
    scale = np.abs(offset).max(initial=0.0)
    if not (offset < 0).any():
        return np.zeros(len(offset))
    if not (np.isfinite(scale) and np.isfinite(matrix).all()):
        return None
    acts = offset < 0
    for _ in range(4 * len(offset) + 4):
        forces = np.zeros(len(offset))
        forces[acts] = _least(matrix[np.ix_(acts, acts)], -offset[acts])
        left = matrix @ forces + offset
        pulls = acts & (forces < -ROUNDING * np.abs(forces).max())
        closes = ~acts & (left < -ROUNDING * scale)
        wrong = np.flatnonzero(pulls | closes)
        if not wrong.size:
            if np.abs(left[acts]).max(initial=0.0) <= CONSISTENT * scale:
                return np.maximum(forces, 0.0)
            break
        acts[wrong[0]] = not acts[wrong[0]]
    return _lemke(matrix, offset, scale)


def _least(matrix: FloatArray, wanted: FloatArray) -> FloatArray:
    """The solution of matrix x = wanted of least norm, by least squares if there is none."""
    if len(wanted) == 1 and matrix[0, 0]:
        return np.asarray(wanted / matrix[0])
    return np.asarray(np.linalg.lstsq(matrix, wanted, rcond=ROUNDING)[0])


def _lemke(matrix: FloatArray, offset: FloatArray, scale: float) -> FloatArray | None:
    """Lemke's method: an artificial variable gives a feasible basis and is then eliminated."""
    n = len(offset)
    # Columns: a (0 … n-1), f (n … 2n-1), the artificial one, the right-hand side.
    table = np.column_stack([np.eye(n), -matrix, -np.ones(n), offset])
    basis = list(range(n))
    entering, row = 2 * n, int(np.argmin(offset))
    for _ in range(20 * n + 20):
        table[row] /= table[row, entering]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, entering], table[row])
        leaving, basis[row] = basis[row], entering
        if leaving == 2 * n:
            forces = np.zeros(2 * n + 1)
            forces[basis] = table[:, -1]
            found = np.maximum(forces[n : 2 * n], 0.0)
            holds = (matrix @ found + offset >= -CONSISTENT * scale).all()
            return found if holds else None
        entering = leaving + n if leaving < n else leaving - n
        column = table[:, entering]
        rows = np.flatnonzero(column > ROUNDING * np.abs(column).max())
        if not rows.size:
            return None  # a ray: there is no solution
        ratios = table[rows, -1] / column[rows]
        least = rows[ratios <= ratios.min() + ROUNDING * scale]
        # The artificial variable first, or the method cycles at degenerate vertices.
        row = next((int(i) for i in least if basis[i] == 2 * n), int(least[0]))
    return None
