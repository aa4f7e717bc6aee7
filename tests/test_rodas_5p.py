"""The stiff method Rodas5P: its coefficients, its order, its stability, its linear algebra."""

import math
from collections.abc import Iterator
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from eomgen.run.integrate import integrate
from eomgen.run.integrators import rodas_5p
from eomgen.run.integrators import rodas_5p_coefficients as own
from eomgen.run.integrators.elimination import factored
from eomgen.run.problem import Problem

Array = NDArray[np.float64]
Tree = tuple[Any, ...]
"""A rooted tree: the trees above its root."""


def trees(order: int) -> Iterator[Tree]:
    """All rooted trees with so many vertices."""

    def forests(vertices: int, most: int) -> Iterator[Tree]:
        if not vertices:
            yield ()
        for size in range(min(vertices, most), 0, -1):
            for many in range(1, vertices // size + 1):
                for same in combinations_with_replacement(list(trees(size)), many):
                    for rest in forests(vertices - many * size, size - 1):
                        yield (*same, *rest)

    return forests(order - 1, order - 1)


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    return size(tree) * math.prod(map(density, tree))


def standard() -> tuple[Array, Array, Array]:
    """The coefficients α, β = α + γ and b of the form with products of the Jacobian with vectors,
    by which order conditions are written. Hairer, Wanner, Solving ODEs II, section IV.7.
    """
    stages = rodas_5p.STAGES
    a, c = np.zeros((2, stages, stages))
    for i in range(stages):
        a[i, :i], c[i, :i] = own.PLACES[i], own.COUPLINGS[i]
    gamma = np.linalg.inv(np.eye(stages) / own.GAMMA - c)
    alpha = a @ gamma
    return alpha, alpha + gamma, np.array(own.END) @ gamma


def residuals() -> list[float]:
    """What each condition on the coefficients misses: for order 5 of the step, order 4 of the one
    that gives the error estimate and of the dense output in its middle, for c and for d.
    """
    alpha, beta, b = standard()
    gamma = beta - alpha

    def weights(tree: Tree) -> Array:
        found = np.ones(len(b))
        for above in tree:
            found = found * ((beta if len(tree) == 1 else alpha) @ weights(above))
        return found

    inverse = np.linalg.inv(gamma)
    end, last = np.array(own.END), np.eye(len(b))[-1]
    first, second, third = np.array(own.DENSE)
    half = (end + (first + (second + third / 2) / 2) / 2) / 2 @ gamma
    found = [*(alpha.sum(1) - own.NODES), *(gamma.sum(1) - own.IN_TIME)]
    for order in range(1, 6):
        for tree in trees(order):
            found.append(b @ weights(tree) - 1 / density(tree))
            if order < 5:
                found.append((end - last) @ gamma @ weights(tree) - 1 / density(tree))
                found.append(half @ weights(tree) - 0.5**order / density(tree))
    assert np.isfinite(inverse).all()
    return [abs(float(x)) for x in found]


def test_there_are_as_many_trees_as_known() -> None:
    assert [len(set(trees(order))) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


def test_the_coefficients_have_their_order() -> None:
    """All conditions for order 5, and those of the estimate and the dense output for order 4."""
    assert max(residuals()) < 2e-12


@pytest.mark.parametrize("name", ["PLACES", "COUPLINGS", "NODES", "IN_TIME", "END", "DENSE"])
def test_a_mistyped_coefficient_is_caught(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One wrong digit in any of them, the 8th after the first."""
    true = getattr(own, name)
    for at in [(i,) for i in range(len(true))] if isinstance(true[0], float) else [
        (i, j) for i in range(len(true)) for j in range(len(true[i]))
    ]:
        value = true[at[0]] if len(at) == 1 else true[at[0]][at[1]]
        changed: Any = list(map(list, true)) if len(at) == 2 else list(true)
        target = changed[at[0]] if len(at) == 2 else changed
        target[at[-1]] = value * (1 + 1e-8) if value else 1e-8
        monkeypatch.setattr(own, name, changed)
        assert max(residuals()) > 1e-11, at
        monkeypatch.undo()
