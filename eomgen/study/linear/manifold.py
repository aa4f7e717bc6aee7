"""Small deviations that keep the constraints of a mechanism.

Displacements keep those of positions, velocities keep all. A wheel that rolls may be displaced
sideways, to a motion beside the one that is linearised, but may not move sideways (Neimark and
Fufaev, Dynamics of Nonholonomic Systems, 1972).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eomgen.base.errors import RunError
from eomgen.run.problem import FloatArray
from eomgen.run.projection import jacobian_of
from eomgen.run.tangents import tangents

NEWTON, MET = 30, 1e-14
"""Most steps of Newton's method, and the residual that is rounding."""
LEAST = 1e-9
"""A pivot relative to the largest that is 0."""
STEP = 1e-3
"""Step of differences of sixth order, rad or m."""


class Manifold(NamedTuple):
    """Deviations that keep the constraints: all follow from the independent ones, T (n, k).

    independent  indices (k,) of these; rows `independent` of T are the unit matrix
    """

    T: FloatArray
    independent: NDArray[np.intp]


def is_constrained(module: Any) -> bool:
    """Whether states of a module may be off its constraints."""
    return bool(getattr(module, "CONSTRAINTS", ())) and not getattr(module, "FOLLOWING", ())


def directions(module: Any, y: FloatArray, p: Any, u: Any, free: NDArray[np.intp]) -> FloatArray:
    """The projection (nf, nf) of the `free` displacements, three for a quaternion, onto those that
    lead along motions: a wheel is displaced as it rolls.
    """
    jacobian = jacobian_of(module)(0.0, y, p, u)[:, free]
    return np.asarray(np.eye(len(free)) - np.linalg.pinv(jacobian, rcond=LEAST) @ jacobian)


def returned(module: Any, y: FloatArray, p: Any, u: Any, free: NDArray[np.intp]) -> FloatArray:
    """The state moved onto the constraints by its `free` displacements, the nearest by least
    squares. Raises `RunError` if they cannot be met.
    """
    nq = len(module.POSITIONS)
    for _ in range(NEWTON):
        off = module.constraint_residuals(0.0, y, p, u)
        if np.abs(off).max() <= MET:
            return y
        jacobian = jacobian_of(module)(0.0, y, p, u)
        step = np.zeros(jacobian.shape[1])
        step[free] = -np.linalg.lstsq(jacobian[:, free], off, rcond=LEAST)[0]
        y = y.copy()
        y[:nq] += tangents(y[:nq], module.QUATERNIONS) @ step
        for indices in map(list, module.QUATERNIONS):
            y[indices] /= np.linalg.norm(y[indices])
    if np.abs(off).max() <= 1e3 * MET:
        return y
    raise RunError(
        "equilibrium: the constraints cannot be met there; start elsewhere, or hold fewer "
        "coordinates"
    )


def manifold(module: Any, y: FloatArray, p: Any, u: Any) -> Manifold:
    """The deviations of the state, three for a quaternion, that keep the constraints at `y`.

    Raises `RunError` in a singular position.
    """
    jacobian = jacobian_of(module)(0.0, y, p, u)
    nv, nx = jacobian.shape[1], len(y) - len(module.POSITIONS) - jacobian.shape[1]
    alone = getattr(module, "VELOCITY_CONSTRAINTS", ())
    rows = [i for i, name in enumerate(module.CONSTRAINTS) if name not in alone]
    others = [i for i, name in enumerate(module.CONSTRAINTS) if name in alone]
    dependent = _pivots(jacobian, (rows, others))
    displaced, paths = _solutions(jacobian[rows], dependent[: len(rows)])
    moving, speeds = _solutions(jacobian, dependent)
    bent = np.zeros_like(paths)  # velocities that follow from displacements of a motion
    slopes = _slopes(module, y, p, u) @ paths
    bent[dependent] = -np.linalg.solve(jacobian[:, dependent], slopes)
    zero, k, n = np.zeros, len(displaced), len(moving)
    T = np.block(
        [
            [paths, zero((nv, n)), zero((nv, nx))],
            [bent, speeds, zero((nv, nx))],
            [zero((nx, k)), zero((nx, n)), np.eye(nx)],
        ]
    )
    kept = [*displaced, *(nv + j for j in moving), *range(2 * nv, 2 * nv + nx)]
    return Manifold(T, np.array(kept, dtype=np.intp))


def _solutions(jacobian: FloatArray, dependent: list[int]) -> tuple[list[int], FloatArray]:
    """The columns that are independent, and the directions x with J x = 0 along each, (nv, k)."""
    count = jacobian.shape[1]
    independent = [j for j in range(count) if j not in dependent]
    found = np.zeros((count, len(independent)))
    found[independent] = np.eye(len(independent))
    found[dependent] = -np.linalg.solve(jacobian[:, dependent], jacobian[:, independent])
    return independent, found


def _pivots(jacobian: FloatArray, parts: Sequence[list[int]]) -> list[int]:
    """The columns of complete pivoting, those of the dependent velocities; one part of the rows
    after another.
    """
    work, found = jacobian.copy(), list[int]()
    largest = float(np.abs(work).max())
    for part in parts:
        rows = list(part)
        while rows:
            sizes = np.abs(work[rows])
            a, j = np.unravel_index(int(sizes.argmax()), sizes.shape)
            if sizes[a, j] <= LEAST * largest:
                raise RunError(
                    "linearise: the constraints depend on each other at this state, as at a dead "
                    "point; take another"
                )
            i = rows.pop(int(a))
            found.append(int(j))
            factors = work[:, j] / work[i, j]
            factors[i] = 0.0
            work -= np.outer(factors, work[i])
    return found


def _slopes(module: Any, y: FloatArray, p: Any, u: Any) -> FloatArray:
    """Derivatives of the rates of the constraints by displacements, (nc, nv); 0 at rest."""
    nq = len(module.POSITIONS)
    basis = tangents(y[:nq], module.QUATERNIONS)

    def rates(step: FloatArray) -> FloatArray:
        there = y.copy()
        there[:nq] += step
        return np.asarray(module.constraint_rates(0.0, there, p, u))

    columns = [
        sum(c * (rates(n * STEP * way) - rates(-n * STEP * way)) for n, c in enumerate(_SIXTH, 1))
        / STEP
        for way in basis.T
    ]
    return np.array(columns).T


_SIXTH = (3 / 4, -3 / 20, 1 / 60)
"""Central differences of order 6."""
