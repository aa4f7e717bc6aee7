"""The generated derivative against the strongest solve at run time.

The other side is one `lambdify(cse=True)` that returns M and F - h of the handout's equations, then
`numpy.linalg.solve`: array in, array out, one state at a time, and 1000 states stacked. Run with

    pytest tests/benchmarks/bench_derivative.py

Each pair stands in a group of its own; its ratio is the figure to quote.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp

from eomgen.derivation.handout.closed import derive
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import generate
from eomgen.run.module import load_module
from eomgen.scene.reader import read_scene

MODEL = elaborate(read_scene("two_body"))
MODULE = load_module(generate(MODEL).module)
ONE = MODULE.initial_state()
MANY = np.random.default_rng(1).normal(scale=2.0, size=(8, 1000))


def run_time_solve() -> Callable[[float, Any], Any]:
    """The derivative by CSE'd M and F - h, and LAPACK."""
    equations = derive(MODEL)
    symbols, collected = equations.symbols, equations.collected
    values = {symbols.parameters[name]: x for name, x in MODEL.defaults.items()}
    mass = collected.M.subs(values)
    push = (collected.F - collected.V - collected.G).subs(values)
    n = len(symbols.q)
    evaluate = sp.lambdify([[*symbols.q, *symbols.v]], (mass, push), modules="numpy", cse=True)
    entries = sp.lambdify([[*symbols.q, *symbols.v]], [*mass, *push], modules="numpy", cse=True)

    def derivative(t: float, y: Any) -> Any:
        if y.ndim == 1:
            matrix, right = evaluate(y)
            return np.concatenate((y[n:], np.linalg.solve(matrix, right[:, 0])))
        table = np.empty((n * n + n, y.shape[1]))
        for row, value in zip(table, entries(y), strict=True):
            row[:] = value
        matrices = table[: n * n].T.reshape(-1, n, n)
        accelerations = np.linalg.solve(matrices, table[n * n :].T[:, :, np.newaxis])
        return np.concatenate((y[n:], accelerations[:, :, 0].T))

    return derivative


SOLVE = run_time_solve()


def test_both_sides_agree() -> None:
    """A ratio of two programs that differ would mean nothing."""
    for y in (ONE, MANY):
        np.testing.assert_allclose(MODULE.derivative(0.0, y), SOLVE(0.0, y), rtol=1e-9, atol=1e-9)


@pytest.mark.benchmark(group="one state")
def test_one_state_generated(benchmark: Any) -> None:
    """`derivative(t, y)`."""
    benchmark(MODULE.derivative, 0.0, ONE)


@pytest.mark.benchmark(group="one state")
def test_one_state_run_time_solve(benchmark: Any) -> None:
    """lambdify and solve."""
    benchmark(SOLVE, 0.0, ONE)


@pytest.mark.benchmark(group="1000 states")
def test_1000_states_generated(benchmark: Any) -> None:
    """`derivative(t, y)` of columns."""
    benchmark(MODULE.derivative, 0.0, MANY)


@pytest.mark.benchmark(group="1000 states")
def test_1000_states_run_time_solve(benchmark: Any) -> None:
    """lambdify and stacked solve."""
    benchmark(SOLVE, 0.0, MANY)
