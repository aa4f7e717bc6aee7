"""Names of the text and of what is printed do not meet; sizes are known in time."""

import sys
from typing import Annotated

import numpy as np
import pytest
from languages import results

from eomgen.subset.languages import C
from eomgen.subset.printing import printed
from eomgen.subset.text import NotInSubsetError, Text
from eomgen.subset.words import Matrix, Vector, transposed, zeros


def turned(n: int, x: Annotated[Matrix, "n", "n"], to: Annotated[Matrix, "n", "n"]) -> None:
    """Columns as rows by an index with a usual name, in a branch; then all at once."""
    for j in range(n):
        if j > 0:
            to[j, :] = x[:, j]
    to[:, :] += 2.0 * transposed(x)


def late(n: int, x: Annotated[Vector, "n"]) -> None:
    """A local array whose size is a local number."""
    m = n - 1
    y = zeros(m)
    x[1:] = y


def text() -> Text:
    """That of this module."""
    return Text.of(sys.modules[__name__])


def test_indices_of_loops_have_names_of_their_own() -> None:
    x = np.arange(9.0).reshape(3, 3)
    python, c, javascript = results(text(), "turned", [[3, x, np.zeros((3, 3))]])
    assert python == c == javascript


def test_sizes_are_known_before_arrays_are_declared() -> None:
    with pytest.raises(NotInSubsetError, match="the size of y is known only when m is"):
        printed(text(), [("late", {})], C)
