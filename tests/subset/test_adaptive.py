"""Steps of DOP853 of few states by Python's own numbers. In other languages their bits are tried in
`native/test_compiled_runs.py` and `show/test_page_runs.py`.
"""

import ast
from typing import Any

import numpy as np
import pytest

from eomgen.engine import adaptive
from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.embedded import DOP853
from eomgen.engine.printed import steps_of_few
from eomgen.subset.text import NotInSubsetError, Text
from eomgen.subset.unrolled import unrolled_functions


class Waves:
    """A system of states that drive one another."""

    def derivative(self, t: float, y: Any) -> Any:
        """The rates."""
        return 0.7 * np.roll(y, -1) - 0.1 * y * y * y + 0.3 * t


@pytest.mark.parametrize("n", [1, 2, 12])
def test_few_states_as_single_numbers(n: int) -> None:
    """Python's own numbers have the bits of NumPy's."""
    seeded, waves = np.random.default_rng(n), Waves()
    for length in (1e-3, 0.3, 30.0):
        y, lost = seeded.normal(size=(2, n))
        found = []
        for function in (lambda *given: adaptive.made(DOP853, *given), steps_of_few(n)):
            k, change = [waves.derivative(0.0, y)] * 16, np.zeros(n)
            at = Progress(length=length)
            bounds = Bounds(np.full(n, 1e-9), 1e-6, 4.0, 3.0)
            assert function(waves, bounds, at, y, 1e-17 * lost, k, change)
            found.append((at, change.tobytes(), [x.tobytes() for x in k]))
        assert found[0] == found[1]


OUTSIDE = {
    "shifted": "def f(x: Annotated[Vector, 'STATES']) -> None:\n    x[1:] = x[:1]\n",
    "part": "def f(x: Annotated[Vector, 'STATES']) -> None:\n    x[:1] = 1.0\n",
    "whole": "def f(x: Annotated[Vector, 'STATES']) -> float:\n    y = x + x\n    return y\n",
    "column": "def f(k: Annotated[Matrix, 'STATES', '2']) -> None:\n    k[:, 0] = 1.0\n",
    "named": "def f(k: Annotated[Matrix, '2', 'STATES'], i: int) -> None:\n    k[i] = k[0]\n",
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_has_no_single_numbers_is_refused(name: str) -> None:
    """With its line."""
    text = Text(functions={"f": ast.parse(OUTSIDE[name]).body[0]})  # type: ignore[dict-item]
    with pytest.raises(NotInSubsetError, match=r"line [123]: "):
        unrolled_functions(text, [("f", {})], 2)
