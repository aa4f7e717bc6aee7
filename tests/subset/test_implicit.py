"""Elimination and differences over random inputs in three languages: the same bits. Steps of
implicit methods are those of whole runs, `native/test_compiled_runs.py` and
`show/test_page_runs.py`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from languages import NONE, Given, results

from eomgen.engine import few
from eomgen.engine.differences import differences
from eomgen.engine.elimination import Factors, factored, solve_by
from eomgen.engine.printed import text
from eomgen.engine.structures import with_room

TEXT = text()
SEEDED = np.random.default_rng(1)


def same(name: str, cases: list[list[Any]], given: Given = NONE, **known: Any) -> None:
    """Assert that a function leaves and returns the same bits in all languages."""
    python, c, javascript = results(TEXT, name, cases, known, given)
    assert python == c
    assert python == javascript


@pytest.mark.every(2)
@pytest.mark.parametrize(("n", "positions"), [(1, 0), (2, 1), (7, 3), (24, 10)])
def test_elimination(n: int, positions: int) -> None:
    """Factors of g I - J with positions first or not, of which some are singular, and solutions; in
    Python with lists, too.
    """
    jacobians = SEEDED.normal(size=(4, n, n)) * SEEDED.integers(0, 2, size=(4, n, n))
    jacobians[1:, :positions, :positions] = 0.0
    jacobians[-1] = np.diag([0.0] * positions + [0.25] * (n - positions))
    same("factored", [[with_room(Factors, n=n), 0.25, positions, a] for a in jacobians])
    assert not factored(few.factors_of(n, n), 0.25, positions, jacobians[-1])
    for jacobian in jacobians[:-1]:
        factors, lists = with_room(Factors, n=n), few.factors_of(n, n)
        b = SEEDED.normal(size=n)
        x, y = b.copy(), b.copy()
        assert factored(factors, 0.25, positions, jacobian)
        assert factored(lists, 0.25, positions, jacobian)
        solve_by(factors, x)
        solve_by(lists, y)
        assert type(factors) is not type(lists) and (x == y).all()
        assert np.allclose(0.25 * x - jacobian @ x, b, rtol=1e-9, atol=1e-9)
        same("solve_by", [[factors, b]])


@dataclass
class Pendulums:
    """Two coupled pendulums with friction, as positions, then velocities; products in a stated
    order, without functions that languages compute with other bits.
    """

    def derivative(self, t: float, y: Any) -> Any:
        a, b, v, w = y.tolist()
        return np.array([v, w, t - a * a * a - 0.1 * v + b, a - 2.0 * b - 0.3 * w])

    def jacobian(self, t: float, y: Any) -> Any:
        row = [-(3.0 * y[0] * y[0]), 1.0, -0.1, 0.0]
        return np.array([[0, 0, 1, 0], [0, 0, 0, 1], row, [1, -2.0, 0, -0.3]])


SYSTEM = Given(
    Pendulums(),
    """
typedef struct { int none; } System, StiffSystem;
#define STATES 4
static void derivative(const System *of, double t, const double *y, double *r) {
    r[0] = y[2], r[1] = y[3], r[2] = t - y[0] * y[0] * y[0] - 0.1 * y[2] + y[1];
    r[3] = y[0] - 2.0 * y[1] - 0.3 * y[3];
}
static void jacobian(const System *of, double t, const double *y, double *j) {
    for (int i = 0; i < 16; i++) j[i] = 0.0;
    j[2] = j[7] = j[9] = j[12] = 1.0, j[8] = -(3.0 * y[0] * y[0]);
    j[10] = -0.1, j[13] = -2.0, j[15] = -0.3;
}
""",
    """
const STATES = 4;
const system = {
  derivative(t, y, r) {
    r.set([y[2], y[3], t - y[0] * y[0] * y[0] - 0.1 * y[2] + y[1], y[0] - 2.0 * y[1] - 0.3 * y[3]]);
  },
  jacobian(t, y, j) {
    j.set([0, 0, 1, 0, 0, 0, 0, 1, -(3.0 * y[0] * y[0]), 1, -0.1, 0, 1, -2, 0, -0.3]);
  },
};
""",
)


def test_differences() -> None:
    """The Jacobian of held contacts: to the bit, and near the exact one."""
    starts = SEEDED.normal(size=(3, 4))
    sizes = np.array([1.0, 0.1, 0.0, 3.0])
    same("differences", [[SYSTEM, sizes, 0.1, y, np.zeros((4, 4))] for y in starts], SYSTEM)
    found = np.zeros((4, 4))
    differences(SYSTEM.python, sizes, 0.1, starts[0], found)
    np.testing.assert_allclose(found, SYSTEM.python.jacobian(0.1, starts[0]), atol=1e-9)
