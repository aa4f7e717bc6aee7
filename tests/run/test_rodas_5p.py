"""The stiff method Rodas5P: its coefficients, its order, its stability."""

import math
from collections.abc import Iterator
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from single_steps import made

from eomgen.engine import rodas_5p_coefficients as own
from eomgen.engine import rosenbrock
from eomgen.run.integrate import integrate
from eomgen.run.integrators import rodas_5p
from eomgen.run.problem import Problem

Array = NDArray[np.float64]
Tree = tuple[Any, ...]
"""A rooted tree: the trees above its root."""


def trees(order: int) -> Iterator[Tree]:
    """All rooted trees with this many vertices."""

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
    stages = rosenbrock.STAGES
    a, c = np.zeros((2, stages, stages))
    for i in range(stages):
        a[i, :i], c[i, :i] = own.PLACES[i], own.COUPLINGS[i]
    gamma = np.linalg.inv(np.eye(stages) / own.GAMMA - c)
    alpha = a @ gamma
    return alpha, alpha + gamma, np.array(own.END) @ gamma


def residuals() -> list[float]:
    """What each condition on the coefficients misses: for order 5 of the step, order 4 of the one
    that gives the error estimate and of the dense output in its middle, for c and for d; and for
    what is infinitely stiff (Hairer, Wanner, Solving ODEs II, section VI.4).
    """
    alpha, beta, b = standard()
    gamma = beta - alpha

    def weights(tree: Tree) -> Array:
        found = np.ones(len(b))
        for above in tree:
            found = found * ((beta if len(tree) == 1 else alpha) @ weights(above))
        return found

    stiff, nodes = np.linalg.inv(beta), np.array(own.NODES)
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
    found += [b @ stiff @ nodes**power - 1.0 for power in range(5)]
    found += [half @ stiff @ nodes**power - 0.5**power for power in (2, 3)]
    return [abs(float(x)) for x in found]


def test_there_are_as_many_trees_as_known() -> None:
    assert [len(set(trees(order))) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


def test_the_coefficients_have_their_order() -> None:
    """All conditions for order 5, and those of the estimate and the dense output for order 4."""
    assert max(residuals()) < 2e-13


@pytest.mark.parametrize("name", ["PLACES", "COUPLINGS", "NODES", "IN_TIME", "END", "DENSE"])
def test_a_mistyped_coefficient_is_caught(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them in turn is wrong by 1e-8 of itself. The last column of the dense output enters
    no condition up to order 4, so it is compared with the published numbers.
    """
    true: tuple[Any, ...] = getattr(own, name)
    table = true if isinstance(true[0], tuple) else (true,)
    for i, row in enumerate(table):
        for j, value in enumerate(row):
            wrong = [list(each) for each in table]
            wrong[i][j] = value * (1 + 1e-8) if value else 1e-8
            monkeypatch.setattr(own, name, wrong if table is true else wrong[0])
            free = name == "DENSE" and j == 7
            assert free or max(residuals()) > 2e-12, (i, j)
    published = (-0.17202221070155493, -6.710236069923372, 4.883087185713722)
    assert name != "DENSE" or tuple(row[7] for row in true) == published


def problem(
    slope: Any, jacobian: Any, start: list[float], positions: tuple[int, ...] = ()
) -> Problem:
    return Problem(
        name="test",
        states=tuple(f"y{i}" for i in range(len(start))),
        positions=positions,
        derivative=slope,
        jacobian=lambda t, y: np.array(jacobian(t, y), dtype=float),
        initial=np.array(start),
    )


def driven(rate: float) -> Problem:
    """y' = rate (y - cos t) - sin t, with the solution cos t from y = 1 on."""
    return problem(
        lambda t, y: rate * (y - math.cos(t)) - math.sin(t), lambda t, y: [[rate]], [1.0]
    )


@pytest.mark.parametrize("rate", [-1e6, -1e3, -1.0])
def test_what_is_stiff_takes_few_steps(rate: float) -> None:
    """The error follows the tolerance, in the rows within steps, too, and the steps grow with its
    fifth root.
    """
    errors, steps = [], []
    for rtol in (1e-5, 1e-8):
        run = integrate(driven(rate), "Rodas5P", 10.0, rtol=rtol, atol=rtol)
        assert run.finished
        errors.append(float(np.abs(run.y[:, 0] - np.cos(run.t)).max()))
        steps.append(run.counts["steps"])
    assert errors[0] < 1e-4 and errors[1] < 1e-7
    assert steps[1] < 5.5 * steps[0] < 5.5 * 40


def test_a_fast_mode_vanishes() -> None:
    """L-stability: far from the slow solution, the first long step leads to it."""
    fast = problem(lambda t, y: -1e9 * y, lambda t, y: [[-1e9]], [1.0])
    solver = rodas_5p.Rodas5P(
        fun=fast.derivative, t0=0.0, y0=fast.initial, t_bound=1.0, jac=fast.jacobian, rtol=1e3,
        atol=1e3,
    )  # fmt: skip
    solver.h_abs = 1.0
    made(solver)
    assert solver.t == 1.0 and abs(solver.y[0]) < 1e-7


def test_the_order_is_five() -> None:
    """On a problem that depends on time and is not linear, with equal steps."""

    def slope(t: float, y: Array) -> Array:
        return np.array([y[1], -(y[0] ** 3) + math.cos(t) ** 3 - math.cos(t)])

    def jacobian(t: float, y: Array) -> list[list[float]]:
        return [[0.0, 1.0], [-3 * y[0] ** 2, 0.0]]

    wave = problem(slope, jacobian, [1.0, 0.0], (0,))
    errors = []
    for count in (16, 32, 64):
        solver = rodas_5p.Rodas5P(
            wave.derivative, 0.0, wave.initial, 4.0, jac=wave.jacobian, rtol=1e9, atol=1e9,
            positions=1,
        )  # fmt: skip
        for _ in range(count):
            solver.h_abs = solver.bounds.longest = 4.0 / count
            made(solver)
        errors.append(float(np.abs(solver.y - (math.cos(4), -math.sin(4))).max()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 5) < 0.4).all(), (errors, orders)
