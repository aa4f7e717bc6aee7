"""Runge-Kutta methods as data: Butcher tableaus, explicit or implicit, whose order is verified.

The method y_new = y + h Σ b_i f(t + c_i h, Y_i), Y_i = y + h Σ a_ij f(t + c_j h, Y_j) is of order p
if and only if every rooted tree of up to p nodes has the elementary weight 1/γ: Hairer, Norsett,
Wanner, Solving ODEs I, theorem II.2.13. The order conditions are generated from the trees.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement, product
from math import prod

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Tree = tuple["Tree", ...]
"""A rooted tree: the subtrees of its root, in a fixed order; a single node is ()."""

Terms = tuple[tuple[int, float], ...]
"""The factors of a sum over slopes, with the numbers of these."""

ROUNDOFF = 1e-14
"""Allowed error of an order condition, relative to the sum of the magnitudes of its terms."""


@dataclass(frozen=True)
class ButcherTableau:
    """Coefficients of a method of s stages: a (s, s), weights b (s,), nodes c (s,); its name.

    Raises `ValueError` if a row of a does not sum to its node, or if the condition of a rooted tree
    of up to `order` nodes does not hold to roundoff. There are 8 such trees for order 4, 37 for
    order 6 and 200 for order 8.
    """

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int
    name: str = ""

    def __post_init__(self) -> None:
        a, b, c = self.arrays
        stages = len(b)
        if a.shape != (stages, stages) or c.shape != (stages,):
            raise ValueError(f"tableau: a {a.shape}, b {b.shape} and c {c.shape} do not fit")
        if self.order < 1:
            raise ValueError(f"tableau: order {self.order} is not 1 or more")
        if not all(np.isfinite(part).all() for part in (a, b, c)):
            raise ValueError("tableau: not all coefficients are finite numbers")
        if np.any(np.abs(a.sum(axis=1) - c) > ROUNDOFF * np.maximum(1.0, np.abs(a).sum(axis=1))):
            raise ValueError("tableau: the rows of a do not sum to c")
        # Each condition is also summed with absolute values, as the scale of its rounding error.
        matrices, weights = np.stack((a, np.abs(a))), np.stack((b, np.abs(b)))
        grown: dict[Tree, FloatArray] = {}
        for order in range(1, self.order + 1):
            for tree in trees(order):
                at_stages = np.ones_like(weights)
                for subtree in tree:
                    at_stages = at_stages * grown[subtree]
                value, magnitude = (weights * at_stages).sum(axis=1).tolist()
                if not abs(value - 1 / density(tree)) <= ROUNDOFF * magnitude:
                    raise ValueError(
                        f"tableau: not of order {order}, the tree {written(tree)} "
                        f"has the weight {value:.12g}, not 1/{density(tree)}"
                    )
                grown[tree] = (matrices @ at_stages[:, :, None])[:, :, 0]

    @cached_property
    def arrays(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """a (s, s), b (s,) and c (s,)."""
        a, b, c = (np.array(part, dtype=np.float64) for part in (self.a, self.b, self.c))
        return a, b, c

    @property
    def stages(self) -> int:
        """The number of its derivatives in a step."""
        return len(self.b)

    @cached_property
    def rows(self) -> tuple[Terms, ...]:
        """The factors of the slopes for each stage that are not 0, with their numbers, in order."""
        return tuple(map(_terms, self.a))

    @cached_property
    def sums(self) -> Terms:
        """Those of the step."""
        return _terms(self.b)

    def stability(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """The stability function R(z) of an explicit method at z = hλ (n,).

        Hairer, Wanner, Solving ODEs II, (IV.2.9), evaluated stage by stage.
        """
        a, b, _ = self.arrays
        stages = np.ones((len(b), *z.shape), dtype=complex)
        for i in range(1, len(b)):
            stages[i] += z * (a[i, :i] @ stages[:i])
        return np.asarray(1 + z * (b @ stages))


def _terms(row: Sequence[float]) -> Terms:
    return tuple((j, float(factor)) for j, factor in enumerate(row) if factor)


@cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees with this number of nodes: 1, 1, 2, 4, 9, 20, 48, 115, …"""
    return tuple(
        tuple(subtree for group in chosen for subtree in group)
        for sizes in _partitions(nodes - 1, nodes - 1)
        for chosen in product(
            *(
                combinations_with_replacement(trees(size), sizes.count(size))
                for size in sorted(set(sizes))
            )
        )
    )


def _partitions(total: int, largest: int) -> Iterator[tuple[int, ...]]:
    """All ways to write `total` as a sum of positive numbers up to `largest`, descending."""
    if not total:
        yield ()
    for first in range(min(total, largest), 0, -1):
        for rest in _partitions(total - first, first):
            yield (first, *rest)


@cache
def size(tree: Tree) -> int:
    """Number of nodes of a tree."""
    return 1 + sum(size(subtree) for subtree in tree)


@cache
def density(tree: Tree) -> int:
    """The density γ of a tree: the product of the sizes of the subtrees at all of its nodes.
    Hairer, Norsett, Wanner I, definition II.2.10.
    """
    return size(tree) * prod(density(subtree) for subtree in tree)


def written(tree: Tree) -> str:
    """A tree in Butcher's notation: τ for a single node, [τ[τ]] for a root with subtrees τ, [τ]."""
    return f"[{''.join(map(written, tree))}]" if tree else "τ"
