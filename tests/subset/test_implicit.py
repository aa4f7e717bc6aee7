"""Elimination and implicit steps over random inputs in three languages: the same bits."""

from typing import Any

import numpy as np
import pytest
from languages import results

from eomgen.engine import elimination, few
from eomgen.subset.expander import Text

TEXT = Text.of(elimination)
SEEDED = np.random.default_rng(1)


def same(name: str, cases: list[list[Any]], **known: Any) -> None:
    """Assert that a function leaves and returns the same bits in all languages."""
    python, c, javascript = results(TEXT, name, cases, known)
    assert python == c
    assert python == javascript


@pytest.mark.parametrize(("n", "positions"), [(1, 0), (2, 1), (7, 3), (24, 10)])
def test_elimination(n: int, positions: int) -> None:
    """Factors of g I - J with positions first or not, of which some are singular, and solutions; in
    Python with lists, too.
    """
    jacobians = SEEDED.normal(size=(4, n, n)) * SEEDED.integers(0, 2, size=(4, n, n))
    jacobians[1:, :positions, :positions] = 0.0
    jacobians[-1] = np.diag([0.0] * positions + [0.25] * (n - positions))
    wholes = [np.zeros(size, np.int64) for size in (n * n, n, n)]
    empty = elimination.Factors(n, 0, 0.0, np.zeros((n, n)), np.zeros((n, n)), *wholes)
    same("factored", [[empty, 0.25, positions, a] for a in jacobians])
    for jacobian in jacobians[:-1]:
        factors, lists = (few.factors_of(n, of) for of in (-few.FEW, n))
        b = SEEDED.normal(size=n)
        x, y = b.copy(), b.copy()
        assert elimination.factored(factors, 0.25, positions, jacobian)
        assert elimination.factored(lists, 0.25, positions, jacobian)
        elimination.solve_by(factors, x)
        elimination.solve_by(lists, y)
        assert type(factors) is not type(lists) and (x == y).all()
        assert np.allclose(0.25 * x - jacobian @ x, b, rtol=1e-9, atol=1e-9)
        same("solve_by", [[factors, b]])
