"""Runge-Kutta methods as data: a Butcher tableau, explicit or implicit, that proves its own order.

The method y_new = y + h Σ b_i f(t + c_i h, Y_i), Y_i = y + h Σ a_ij f(t + c_j h, Y_j) is of order p
if and only if every rooted tree of up to p nodes has the elementary weight 1/γ: Hairer, Norsett,
Wanner, Solving ODEs I, theorem II.2.13. Hence no condition is typed here; the trees are grown.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement, product
from math import prod

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray

Tree = tuple["Tree", ...]
"""A rooted tree: the subtrees that hang from its root, in a fixed order; a lone node is ()."""

ROUNDOFF = 1e-14
"""Of an order condition, in parts of the sum of the sizes of its terms."""


@dataclass(frozen=True)
class ButcherTableau:
    """Coefficients of a method of s stages: a (s, s), weights b (s,), nodes c (s,).

    Made only if every row of a sums to its node and the condition of each rooted tree of up to
    `order` nodes holds to roundoff; else `ValueError` names what fails. There are 8 of them for
    order 4, 37 for order 6 and 200 for order 8.
    """

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int

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
        # The same with all signs positive: how large the terms are whose rounding is let pass.
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

    def change(
        self,
        derivative: Callable[[float, FloatArray], FloatArray],
        t: float,
        y: FloatArray,
        h: float,
    ) -> FloatArray:
        """Return y(t + h) - y(t), shape (ny,), of an explicit method, stage after stage."""
        a, b, _ = self.arrays
        slopes = np.empty((len(b), len(y)))
        slopes[0] = derivative(t + self.c[0] * h, y)
        for i in range(1, len(b)):
            slopes[i] = derivative(t + self.c[i] * h, y + h * (a[i, :i] @ slopes[:i]))
        return h * (b @ slopes)

    def stability(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """R(z) of an explicit method at z = hλ (n,): what a step multiplies exp(λt) by.

        Hairer, Wanner, Solving ODEs II, (IV.2.9), stage after stage.
        """
        a, b, _ = self.arrays
        stages = np.ones((len(b), *z.shape), dtype=complex)
        for i in range(1, len(b)):
            stages[i] += z * (a[i, :i] @ stages[:i])
        return np.asarray(1 + z * (b @ stages))


@cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees of so many nodes: 1, 1, 2, 4, 9, 20, 48, 115, …"""
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
    """How many nodes a tree has."""
    return 1 + sum(size(subtree) for subtree in tree)


@cache
def density(tree: Tree) -> int:
    """γ of a tree: the product, over its nodes, of how many nodes hang from each, itself included.
    Hairer, Norsett, Wanner I, definition II.2.10.
    """
    return size(tree) * prod(density(subtree) for subtree in tree)


def written(tree: Tree) -> str:
    """A tree in Butcher's brackets: τ for a lone node, [τ[τ]] for a root with τ and [τ] on it."""
    return f"[{''.join(map(written, tree))}]" if tree else "τ"
