"""Elimination and implicit steps over random inputs in three languages: the same bits."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from languages import NONE, Given, results

from eomgen.engine import differences, elimination, few, implicit, projection, rosenbrock, system
from eomgen.engine.implicit import (
    GAUSS_4,
    GAUSS_6,
    IMPLICIT_MIDPOINT,
    Collocation,
    Stages,
)
from eomgen.engine.rodas_5p_coefficients import GAMMA
from eomgen.engine.rosenbrock import MANY_SUMS, Rodas
from eomgen.subset.expander import Text

TEXT = Text.of(differences, elimination, implicit, projection, rosenbrock, system)
SEEDED = np.random.default_rng(1)


def same(name: str, cases: list[list[Any]], given: Given = NONE, **known: Any) -> None:
    """Assert that a function leaves and returns the same bits in all languages."""
    python, c, javascript = results(TEXT, name, cases, known, given)
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


@pytest.mark.parametrize("method", [IMPLICIT_MIDPOINT, GAUSS_4, GAUSS_6], ids=lambda m: m.name)
@pytest.mark.parametrize(("positions", "simplified"), [(0, False), (2, False), (2, True)])
def test_implicit_steps(method: Collocation, positions: int, simplified: bool) -> None:
    """Steps of methods of Gauss: short ones, and some that hardly converge."""
    many, n = len(method.b), 4
    shapes = (many, n), (many, n), (many * n, n), (many, many), (many * n, many * n)
    stages = Stages(many, positions, *map(np.zeros, shapes), simplified)
    factors = few.factors_of(many * n, -few.FEW)
    starts = SEEDED.normal(size=(3, n))
    cases = [
        [SYSTEM, 0.1, h, y, stages, factors, np.zeros(n)] for y in starts for h in (0.01, 0.5, 9.0)
    ]
    same("implicit_change", cases, SYSTEM, method=method)


@pytest.mark.parametrize("timed", [False, True])
def test_rosenbrock_steps(timed: bool) -> None:
    """Attempts at steps, with their sums and errors; then whole steps, some of them shortened. In
    JavaScript these have another `pow`.
    """
    n = 4
    arrays = np.full(n, 1e-6), *np.zeros((3, n)), np.zeros((MANY_SUMS, n))
    empty = Rodas(9.0, 3.0, 1e-4, 2, timed, 0.0, 0.02, 0.5, 0.0, 0, 0, *arrays)
    starts = SEEDED.normal(size=(4, n))
    attempts, steps = list[list[Any]](), list[list[Any]]()
    for y in starts:
        factors = few.factors_of(n, -few.FEW)
        slope, matrix = (f(0.1, y) for f in (SYSTEM.python.derivative, SYSTEM.python.jacobian))
        assert elimination.factored(factors, 1.0 / (0.05 * GAMMA), 2, matrix)
        attempts.append([SYSTEM, empty, factors, 0.1, 0.05, y, slope, SEEDED.normal(size=n)])
        lengths = (replace(empty, h_abs=length) for length in (0.01, 2.0))
        steps += [[SYSTEM, run, factors, 0.1, y] for run in lengths]
    same("rodas_attempted", attempts, SYSTEM)
    python, c, _ = results(TEXT, "rodas_step", steps, given=SYSTEM)
    assert python == c


class Circle:
    """States x, y, v, w on a circle."""

    def residuals_at(self, t: float, y: Any, out: Any) -> bool:
        out[:] = y[0] * y[0] + y[1] * y[1] - 1.0, y[0] - y[0]
        return bool(y[0] < 9.0)

    def move_closer(self, t: float, y: Any, there: Any) -> bool:
        far = (y[0] * y[0] + y[1] * y[1] - 1.0) / (2.0 * (y[0] * y[0] + y[1] * y[1]))
        there[:2] = y[0] - far * y[0], y[1] - far * y[1]
        return True

    def hold_velocities(self, t: float, y: Any) -> bool:
        out = (y[0] * y[2] + y[1] * y[3]) / (y[0] * y[0] + y[1] * y[1])
        y[2:] = y[2] - out * y[0], y[3] - out * y[1]
        return True


CIRCLE = Given(
    Circle(),
    """
typedef struct { int none; } Constraints;
static int64_t residuals_at(Constraints *c, double t, const double *y, double *out) {
    out[0] = y[0] * y[0] + y[1] * y[1] - 1.0, out[1] = y[0] - y[0];
    return y[0] < 9.0;
}
static int64_t move_closer(Constraints *c, double t, const double *y, double *there) {
    const double far = (y[0] * y[0] + y[1] * y[1] - 1.0) / (2.0 * (y[0] * y[0] + y[1] * y[1]));
    there[0] = y[0] - far * y[0], there[1] = y[1] - far * y[1];
    return 1;
}
static int64_t hold_velocities(Constraints *c, double t, double *y) {
    const double out = (y[0] * y[2] + y[1] * y[3]) / (y[0] * y[0] + y[1] * y[1]);
    y[2] = y[2] - out * y[0], y[3] = y[3] - out * y[1];
    return 1;
}
""",
    """
const system = {
  residuals_at(t, y, out) {
    out.set([y[0] * y[0] + y[1] * y[1] - 1.0, y[0] - y[0]]);
    return y[0] < 9.0;
  },
  move_closer(t, y, there) {
    const far = (y[0] * y[0] + y[1] * y[1] - 1.0) / (2.0 * (y[0] * y[0] + y[1] * y[1]));
    there.set([y[0] - far * y[0], y[1] - far * y[1]]);
    return true;
  },
  hold_velocities(t, y) {
    const out = (y[0] * y[2] + y[1] * y[3]) / (y[0] * y[0] + y[1] * y[1]);
    y.set([y[2] - out * y[0], y[3] - out * y[1]], 2);
    return true;
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
    differences.differences(SYSTEM.python, sizes, 0.1, starts[0], found)
    np.testing.assert_allclose(found, SYSTEM.python.jacobian(0.1, starts[0]), atol=1e-9)


def test_projection() -> None:
    """Near and far states; one where a function has no valid result."""
    starts = [*SEEDED.normal(size=(20, 4)), np.array([1e-9, 0, 1, 1]), np.array([9.0, 0, 1, 1])]
    room = np.array([1.0, 2.0]), *np.zeros((3, 2)), np.zeros(4)
    same("moved_onto", [[CIRCLE, 4, 2, 0.0, y, *room] for y in starts], CIRCLE)
