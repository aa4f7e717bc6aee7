"""The engine's text in three languages: the same bits; and what is not in its subset."""

from typing import Any

import numpy as np
from languages import results

from eomgen.engine import elimination, roots
from eomgen.subset.text import Text

TEXT = Text.of(elimination, roots)
SEEDED = np.random.default_rng(1)


def same(name: str, cases: list[list[Any]], **known: Any) -> None:
    """Assert that a function leaves and returns the same bits in all languages."""
    python, c, javascript = results(TEXT, name, cases, known)
    assert python == c
    assert python == javascript


def test_root_search() -> None:
    """Points of searches, with values that are anything."""
    searches = [roots.Search(1e-12, roots.RTOL, *x) for x in SEEDED.normal(size=(50, 8))]
    same("gone_on", [[search, float(SEEDED.normal())] for search in searches])
    same("begun", [[search, *SEEDED.normal(size=4).tolist()] for search in searches])


def test_arrays_of_other_sizes_in_the_next_call() -> None:
    """The room of a function's own arrays, which JavaScript keeps from call to call, fits."""
    same("subtract_products", [[n, 0, SEEDED.normal(size=(n, n))] for n in (3, 5, 2, 5)])
