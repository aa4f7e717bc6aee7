"""Names of the text and of what is printed do not meet; sizes are known in time."""

import ast
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from languages import results

from eomgen import engine
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


def test_what_is_given_has_no_name_of_the_engine() -> None:
    """C has one name for each: functions of all texts, and those that mechanisms give, may meet in
    one unit.
    """
    own: list[str] = []
    given: set[str] = set()
    for path in sorted(Path(engine.__path__[0]).glob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                own.append(node.name)
            elif isinstance(node, ast.ClassDef) and "Protocol" in map(ast.unparse, node.bases):
                given |= {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    assert len(set(own)) == len(own) > 100
    assert given and not given & set(own)
