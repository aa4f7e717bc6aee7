"""The angular rows of a solid: its inertia as a sum of squares."""

from collections.abc import Callable, Iterator, Sequence

from eomgen.dynamics.tree.vectors import Mat, Vec, replaced, unit
from eomgen.scalars.protocol import Scalar, Scalars

SLIGHT = 1e-16
"""A pivot of an inertia matrix is at least this part of its diagonal entry."""


def inertia_rows(
    inertia: Mat,
    order: Sequence[int],
    right: list[Scalar],
    moment: list[Scalar],
    bounded: Callable[[Scalar, Scalar], Scalar],
    scalars: Scalars,
) -> Iterator[tuple[int, Scalar, Vec]]:
    """The rows u of I = Σ d u uᵀ with triangular u (Cholesky's factors without roots), by
    coordinate axes in an order; each with its axis and its weight d. Axes without inertia have
    none.

    right, moment  by axis; with a row they become those of its u: the right-hand side of d u · α,
                   and the part of the moment along it
    bounded        a pivot that is not too small beside the entry of I, the other argument
    """
    work = [list(row) for row in inertia]
    for n, i in enumerate(order):
        if scalars.is_zero(inertia[i][i]):
            continue
        d, u = bounded(work[i][i], inertia[i][i]), unit(i, scalars)
        for j in order[n + 1 :]:
            part = work[i][j] / d
            u = replaced(u, j, part)
            right[j], moment[j] = right[j] - part * right[i], moment[j] - part * moment[i]
            for h in order[n + 1 :]:
                work[j][h] = work[j][h] - part * work[i][h]
        yield i, d, u
