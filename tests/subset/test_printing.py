"""The engine's text in three languages: the same bits; and what is not in its subset."""

from typing import Any

import numpy as np
import pytest
from languages import results

from eomgen.engine import linear, roots
from eomgen.subset.expander import Text

TEXT = Text.of(linear, roots)
SEEDED = np.random.default_rng(1)


def same(name: str, cases: list[list[Any]], **known: Any) -> None:
    """Assert that a function leaves and returns the same bits in all languages."""
    python, c, javascript = results(TEXT, name, cases, known)
    assert python == c
    assert python == javascript


@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_elimination(n: int) -> None:
    """The factors of random matrices, of which some are singular, and solutions by them."""
    matrices = SEEDED.normal(size=(4, n, n))
    matrices[-1, :, 0] = 0.0
    cases = [[n, a, np.zeros(n, np.int64)] for a in matrices]
    same("factorised", cases)
    for _, a, order in cases[:-1]:
        b, x, factors = SEEDED.normal(size=n), np.zeros(n), a.copy()
        assert linear.factorised(n, factors, order)
        linear.solved(n, factors, order, b, x)
        assert np.allclose(a @ x, b, rtol=1e-10, atol=1e-10)
        same("solved", [[n, factors, order, b, np.zeros(n)]])


def test_root_search() -> None:
    """Points of searches, with values that are anything."""
    searches = [roots.Search(1e-12, roots.RTOL, *x) for x in SEEDED.normal(size=(50, 8))]
    same("gone_on", [[search, float(SEEDED.normal())] for search in searches])
    same("begun", [[search, *SEEDED.normal(size=4).tolist()] for search in searches])
