"""Steps of DOP853 in all languages: the same bits, from random states and in whole runs."""

import ast
from typing import Any

import numpy as np
import pytest
from campaign import some
from languages import Given, results

from eomgen.engine import adaptive, sums, system
from eomgen.engine.adaptive import Bounds, Progress, Records
from eomgen.engine.embedded import DOP853
from eomgen.engine.printed import steps_of_few
from eomgen.subset.expander import NotInSubsetError, Text
from eomgen.subset.unrolled import unrolled_functions

TEXT = Text.of(adaptive, sums, system)
KNOWN = {"method": DOP853}
C = """
#define STATES {states}
typedef struct {{ int none; }} System;
typedef System Checks;
struct Progress;
static void derivative(System *s, double t, const double *y, double *rates) {{
    for (int i = 0; i < STATES; i++)
        rates[i] = 0.7 * y[(i + 1) % STATES] - 0.1 * y[i] * y[i] * y[i] + 0.3 * t;
}}
static void begins(Checks *c) {{ }}
static int are_usual(Checks *c, const double *k, int64_t first, int64_t past) {{ return 1; }}
static int placed(Checks *c, double t, double *y) {{ y[0] *= 1.0 - 1e-9; return 1; }}
static int64_t seen(Checks *c, struct Progress *at, double *y, double *raw, double *last, double *k,
                    double *terms) {{ return last[0] > 3.0 ? 2 : 0; }}
static int keeps(Checks *c, struct Progress *at, double *last) {{ return 1; }}
"""
JAVASCRIPT = """
const STATES = {states};
const system = {{
  derivative(t, y, rates) {{
    for (let i = 0; i < STATES; i++)
      rates[i] = 0.7 * y[(i + 1) % STATES] - 0.1 * y[i] * y[i] * y[i] + 0.3 * t;
  }},
  begins() {{}},
  are_usual: () => 1,
  placed(t, y) {{ y[0] *= 1.0 - 1e-9; return 1; }},
  seen: (at, y, raw, last) => (last[0] > 3.0 ? 2 : 0),
  keeps: () => 1,
}};
"""


class Waves:
    """A system of states that drive one another, and checks that let all pass."""

    def derivative(self, t: float, y: Any) -> Any:
        """The rates."""
        return 0.7 * np.roll(y, -1) - 0.1 * y * y * y + 0.3 * t

    def begins(self) -> None:
        """Nothing is to be done."""

    def are_usual(self, k: Any, first: int, past: int) -> bool:
        """They are."""
        return True

    def placed(self, t: float, y: Any) -> bool:
        """A place that differs a little."""
        y[0] *= 1.0 - 1e-9
        return True

    def seen(self, at: Progress, y: Any, raw: Any, last: Any, k: Any, terms: Any) -> int:
        """Far states are not for these steps."""
        return 2 if last[0] > 3.0 else 0

    def keeps(self, at: Progress, last: Any) -> bool:
        """It is kept."""
        return True


def given(n: int) -> Given:
    """The system in three languages."""
    return Given(Waves(), C.format(states=n), JAVASCRIPT.format(states=n))


def same(name: str, cases: list[list[Any]], **options: Any) -> list[list[str]]:
    """Assert that a function leaves and returns the same bits in all languages; returns them."""
    python, c, javascript = results(TEXT, name, cases, **options)
    assert python == c
    assert python == javascript
    return python


@pytest.mark.every(2)
@pytest.mark.parametrize("n", some([1, 20], [1, 2, 5, 20]))
def test_a_step(n: int) -> None:
    """Steps that are accepted or rejected once or twice, and states within them."""
    seeded, system = np.random.default_rng(n), given(n)
    cases: list[list[Any]] = []
    for length in (1e-3, 0.3, 3.0, 30.0):
        at, bounds = Progress(0.2, length=length), Bounds(seeded.uniform(1e-9, 1e-6, n), 1e-7, 25.0)
        bounds.until = 29.0
        k, (y, lost, change, raw) = np.zeros((16, n)), seeded.normal(size=(4, n))
        k[0] = system.python.derivative(0.2, y)
        cases.append([system, bounds, at, y, 1e-17 * lost, k, change, raw])
    found = same("made", cases, known=KNOWN, given=system)
    assert len({bits[-1] for bits in found}) == 1  # all are made
    (y, raw), k, terms = (seeded.normal(size=(many, n)) for many in (2, 16, 7))
    at = Progress(0.2, 0.4, 0.6)
    same("interpolate", [[system, at, y, raw, k, np.zeros((7, n))]], known=KNOWN, given=system)
    same("within", [[at, y, terms, 0.31, np.zeros(n)]], given=system)


@pytest.mark.parametrize("n", some([2], [1, 2, 13]))
def test_many_steps(n: int) -> None:
    """They end where there is no room for more, before the end, and where one is not to be made;
    rows lie within steps and at their ends.
    """
    seeded, system, cases = np.random.default_rng(n), given(n), []
    for most, until, size in ((5, 50.0, 0.5), (200, 1.0, 0.5), (200, 50.0, 2.0)):
        times = np.sort(seeded.uniform(0, 9, 40))
        y = size * seeded.normal(size=n)
        room = [np.zeros(most) for _ in range(2)] + [np.zeros(most, np.int64) for _ in range(2)]
        room += [np.zeros((most, n)) for _ in range(3)] + [np.zeros((7 * most, n))]
        kept = Records(*room, times, np.zeros((40, n)), 40, most)
        start = [y, system.python.derivative(0.0, y), np.zeros(n)]
        bounds = Bounds(np.full(n, 1e-9), 1e-6, 4.0, until, dense=True)
        cases.append([system, system, bounds, Progress(length=0.01), *start, kept])
    found = same("made_many", cases, known=KNOWN, given=system)
    assert {int(bits[-1][:4], 16) for bits in found} == {0x0000, 0x3FF0, 0x4000}  # each why


@pytest.mark.parametrize("n", [1, 2, 12])
def test_few_states_as_single_numbers(n: int) -> None:
    """Python's own numbers have the bits of NumPy's."""
    seeded, waves = np.random.default_rng(n), Waves()
    for length in (1e-3, 0.3, 30.0):
        y, lost = seeded.normal(size=(2, n))
        found = []
        for function in (lambda *given: adaptive.made(DOP853, *given), steps_of_few(n)):
            k, change, raw = [waves.derivative(0.0, y)] * 16, np.zeros(n), np.zeros(n)
            at = Progress(length=length)
            bounds = Bounds(np.full(n, 1e-9), 1e-6, 4.0, 3.0)
            assert function(waves, bounds, at, y, 1e-17 * lost, k, change, raw)
            found.append((at, change.tobytes(), raw.tobytes(), [x.tobytes() for x in k]))
        assert found[0] == found[1]


OUTSIDE = {
    "shifted": "def f(x: Annotated[Vector, 'STATES']) -> None:\n    x[1:] = x[:1]\n",
    "whole": "def f(x: Annotated[Vector, 'STATES']) -> float:\n    y = x + x\n    return y[0]\n",
    "power": "def f(x: Annotated[Vector, 'STATES']) -> None:\n    x[:] = x ** x\n",
    "named": "def f(k: Annotated[Matrix, '2', 'STATES'], i: int) -> None:\n    k[i] = k[0]\n",
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_has_no_single_numbers_is_refused(name: str) -> None:
    """With its line."""
    text = Text(functions={"f": ast.parse(OUTSIDE[name]).body[0]})  # type: ignore[dict-item]
    with pytest.raises(NotInSubsetError, match=r"line [123]: "):
        unrolled_functions(text, [("f", {})], 2)
