"""Elimination and implicit steps over random inputs in three languages: the same bits."""

from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from languages import NONE, Given, results

from eomgen.engine import few
from eomgen.engine.adaptive import AT_END, MADE
from eomgen.engine.differences import differences
from eomgen.engine.elimination import factored, solve_by
from eomgen.engine.explicit import Step
from eomgen.engine.implicit import GAUSS_4, GAUSS_6, IMPLICIT_MIDPOINT, INVALID, Collocation
from eomgen.engine.printed import text
from eomgen.engine.rattle import rattle
from eomgen.engine.rodas_5p_coefficients import GAMMA
from eomgen.engine.rosenbrock import RodasRecords, rodas_many
from eomgen.engine.symmetric import Projected, projected_change
from eomgen.run.integrators.implicit_stages import stages_of
from eomgen.run.integrators.rattle import linked
from eomgen.run.integrators.rodas_5p import rodas

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
    same("factored", [[few.plain_factors(n), 0.25, positions, a] for a in jacobians])
    assert not factored(few.factors_of(n, n), 0.25, positions, jacobians[-1])
    for jacobian in jacobians[:-1]:
        factors, lists = few.plain_factors(n), few.factors_of(n, n)
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


@pytest.mark.every(2)
@pytest.mark.parametrize("method", [IMPLICIT_MIDPOINT, GAUSS_4, GAUSS_6], ids=lambda m: m.name)
@pytest.mark.parametrize(("positions", "simplified"), [(0, False), (2, False), (2, True)])
def test_implicit_steps(method: Collocation, positions: int, simplified: bool) -> None:
    """Steps of methods of Gauss: short ones, and some that hardly converge."""
    many, n = len(method.b), 4
    stages = stages_of(many, n, positions)
    stages.simplified = simplified
    factors = few.plain_factors(many * n)
    starts = SEEDED.normal(size=(3, n))
    cases = [
        [SYSTEM, 0.1, h, y, stages, factors, np.zeros(n)] for y in starts for h in (0.01, 0.5, 9.0)
    ]
    same("implicit_change", cases, SYSTEM, method=method)


@pytest.mark.every(2)
@pytest.mark.parametrize("timed", [False, True])
def test_rosenbrock_steps(timed: bool) -> None:
    """Attempts at steps, with their sums and errors; then whole steps, some of them shortened. In
    JavaScript these have another `pow`.
    """
    n = 4
    empty = replace(rodas(n, 1e-6, (9.0, 3.0, 1e-4), 2, timed), h_last=0.02, error=0.5)
    starts = SEEDED.normal(size=(4, n))
    attempts, steps = list[list[Any]](), list[list[Any]]()
    for y in starts:
        factors = few.plain_factors(n)
        slope, matrix = (f(0.1, y) for f in (SYSTEM.python.derivative, SYSTEM.python.jacobian))
        assert factored(factors, 1.0 / (0.05 * GAMMA), 2, matrix)
        attempts.append([SYSTEM, empty, factors, 0.1, 0.05, y, slope, SEEDED.normal(size=n)])
        lengths = (replace(empty, h_abs=length) for length in (0.01, 2.0))
        steps += [[SYSTEM, run, factors, 0.1, y] for run in lengths]
    same("rodas_attempted", attempts, SYSTEM)
    python, c, _ = results(TEXT, "rodas_step", steps, given=SYSTEM)
    assert python == c


class Free(Pendulums):
    """Nothing is held, and nothing is raised."""

    def clear(self) -> None:
        pass

    def is_raised(self) -> bool:
        return False

    def projected(self, t: float, y: Any) -> bool:
        return True

    def keep_step(self, t: float, y: Any, margin: Any) -> bool:
        return True


FREE = Given(
    Free(),
    SYSTEM.c
    + """
typedef struct { int none; } Constrained;
static void clear(Constrained *of) {}
static int64_t is_raised(Constrained *of) { return 0; }
static int64_t projected(Constrained *of, double t, double *y) { return 1; }
static int64_t keep_step(Constrained *of, double t, double *y, double *margin) { return 1; }
""",
    SYSTEM.javascript
    + """
Object.assign(system, {
  clear() {},
  is_raised: () => false,
  projected: () => true,
  keep_step: () => true,
});
""",
)


@pytest.mark.parametrize("smooth", [9.0, 0.5])
def test_rosenbrock_runs(smooth: float) -> None:
    """Steps with rows between their ends, to the end of the run or to where a branch may begin. In
    JavaScript, with another `pow`, the same but for rounding.
    """
    n, most, times = 4, 60, np.linspace(0.11, 2.0, 40)
    sizes = *((most,),) * 4, (most, n), (most, n), (most,)
    wholes = np.zeros((4, most), np.int64)
    kept = RodasRecords(*map(np.zeros, sizes), *wholes, times, np.zeros((40, n)), 40, most)
    run = replace(rodas(n, 1e-6, (1.9, 3.0, 1e-4), 2, timed=True), h_abs=0.01)
    factors, none = few.plain_factors(n), np.zeros(0, np.int64)
    cases = [
        [FREE, FREE, run, factors, 0.1, smooth, 0, none, y, kept]
        for y in SEEDED.normal(size=(2, n))
    ]
    python, c, javascript = results(TEXT, "rodas_many", cases, given=FREE)
    assert python == c
    assert [len(case) for case in javascript] == [len(case) for case in c]
    made = deepcopy(cases[0])
    given = [FREE.python, FREE.python, *made[2:]]
    assert rodas_many(*given) == (AT_END if smooth < 1.9 else MADE)
    kept = given[-1]
    passed = kept.sampled[kept.made - 1]
    assert passed == (times <= kept.ends[kept.made - 1]).sum() and passed > 0
    assert kept.rows[:passed].all() and not kept.rows[passed:].any()


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
    differences(SYSTEM.python, sizes, 0.1, starts[0], found)
    np.testing.assert_allclose(found, SYSTEM.python.jacobian(0.1, starts[0]), atol=1e-9)


class Turning:
    """A body that turns about a point: states w, x, u, v of a quaternion, then angular velocities
    a, b, c; one constraint, x = 0.2 w. Its Jacobian is about right.
    """

    def derivative(self, t: float, y: Any) -> Any:
        w, x, u, v, a, b, c = y.tolist()
        q = -x * a - u * b - v * c, w * a - v * b + u * c, v * a + w * b - x * c
        rates = *q, x * b - u * a + w * c, t - a + x, 0.5 - b, w - c
        return 0.5 * np.array(rates)

    def jacobian(self, t: float, y: Any) -> Any:
        return np.diag(0.5 * np.array([0, 0, 0, 0, -1.0, -1.0, -1.0]))

    def off_by(self, t: float, y: Any, out: Any) -> bool:
        out[0] = y[1] - 0.2 * y[0]
        return bool(y[0] < 9.0)

    def rows_at(self, t: float, y: Any, out: Any) -> bool:
        out[0] = y[0] + 0.2 * y[1], 0.2 * y[2] - y[3], y[2] + 0.2 * y[3]
        out *= 0.5
        return True

    def drift_at(self, t: float, y: Any, out: Any) -> bool:
        j = np.zeros((1, 3))
        self.rows_at(t, y, j)
        out[0] = j[0, 0] * y[4] + j[0, 1] * y[5] + j[0, 2] * y[6]
        return True


TURNING = Given(
    Turning(),
    """
typedef struct { int none; } System, StiffSystem, Linkage;
#define STATES 7
static void derivative(const System *of, double t, const double *y, double *r) {
    const double w = y[0], x = y[1], u = y[2], v = y[3], a = y[4], b = y[5], c = y[6];
    r[0] = -x * a - u * b - v * c, r[1] = w * a - v * b + u * c, r[2] = v * a + w * b - x * c;
    r[3] = x * b - u * a + w * c, r[4] = t - a + x, r[5] = 0.5 - b, r[6] = w - c;
    for (int i = 0; i < 7; i++) r[i] *= 0.5;
}
static void jacobian(const System *of, double t, const double *y, double *j) {
    for (int i = 0; i < 49; i++) j[i] = i % 8 == 0 && i >= 32 ? -0.5 : 0.0;
}
static int64_t off_by(Linkage *of, double t, const double *y, double *out) {
    out[0] = y[1] - 0.2 * y[0];
    return y[0] < 9.0;
}
static int64_t rows_at(Linkage *of, double t, const double *y, double *out) {
    out[0] = 0.5 * (y[0] + 0.2 * y[1]), out[1] = 0.5 * (0.2 * y[2] - y[3]);
    out[2] = 0.5 * (y[2] + 0.2 * y[3]);
    return 1;
}
static int64_t drift_at(Linkage *of, double t, const double *y, double *out) {
    double j[3];
    rows_at(of, t, y, j);
    out[0] = j[0] * y[4] + j[1] * y[5] + j[2] * y[6];
    return 1;
}
""",
    """
const STATES = 7;
const system = {
  derivative(t, [w, x, u, v, a, b, c], r) {
    const q = [-x * a - u * b - v * c, w * a - v * b + u * c, v * a + w * b - x * c];
    r.set([...q, x * b - u * a + w * c, t - a + x, 0.5 - b, w - c].map((x) => 0.5 * x));
  },
  jacobian(t, y, j) {
    j.forEach((_, i) => (j[i] = i % 8 === 0 && i >= 32 ? -0.5 : 0));
  },
  off_by(t, y, out) {
    out[0] = y[1] - 0.2 * y[0];
    return y[0] < 9;
  },
  rows_at(t, y, out) {
    const j = [y[0] + 0.2 * y[1], 0.2 * y[2] - y[3], y[2] + 0.2 * y[3]];
    out.set(j.map((x) => 0.5 * x));
    return true;
  },
  drift_at(t, y, out) {
    const j = [0, 0, 0];
    system.rows_at(t, y, { set: (x) => x.forEach((each, i) => (j[i] = each)) });
    out[0] = j[0] * y[4] + j[1] * y[5] + j[2] * y[6];
    return true;
  },
};
""",
)


@pytest.mark.parametrize("method", [IMPLICIT_MIDPOINT, GAUSS_4], ids=lambda m: m.name)
def test_symmetric_projection(method: Collocation) -> None:
    """With a quaternion: steps that converge, one whose constraint is not valid, and one in which
    nothing is left off the constraint.
    """
    many, n, rows = len(method.b), 7, 1
    stages = stages_of(many, n, 0)
    shapes = (4, 3), (rows, 3), *((2 * rows, n),) * 4, (2 * rows, 2 * rows), (n, n), (n, n)
    sizes = 4, 3, rows, 1, many + 1, n
    room = Projected(*sizes, np.arange(4), *map(np.zeros, (*shapes, (many + 1, n))))
    factors = [few.plain_factors(k) for k in (many * n, n, 2 * rows)]
    starts = SEEDED.normal(size=(4, n))
    starts[:, :4] /= np.linalg.norm(starts[:, :4], axis=1, keepdims=True)
    starts[:, 1] = 0.2 * starts[:, 0]
    starts[3, 0] = 30.0
    cases = [
        [TURNING, TURNING, 4, 3, rows, 0.1, h, y, stages, factors[0], room, *factors[1:], y.copy()]
        for y in starts
        for h in (0.02, 0.3)
    ]
    same("projected_change", cases, TURNING, method=method)
    found = [deepcopy(case) for case in cases]
    made = [projected_change(*_in_python(case, method)) for case in found]
    assert sum(each > 0 for each in made) >= 5 and made.count(INVALID) == 2


def _in_python(case: list[Any], method: Collocation) -> list[Any]:
    """The arguments of a case, with the method."""
    return [TURNING.python, TURNING.python, method, *case[2:]]


class Bead:
    """A bead of direction-dependent mass on a circle: states x, y, v, w."""

    def off_by(self, t: float, y: Any, out: Any) -> bool:
        out[0] = y[0] * y[0] + y[1] * y[1] - 1.0
        return bool(y[0] < 9.0)

    def rows_at(self, t: float, y: Any, out: Any) -> bool:
        out[0] = 2.0 * y[0], 2.0 * y[1]
        return True

    def rates_at(self, t: float, y: Any, out: Any) -> bool:
        out[:] = y[2], y[3], 0.3 - y[0] * y[1], -9.81
        return True

    def inertia_at(self, t: float, y: Any, out: Any) -> bool:
        out[:] = [[2.0 + y[0] * y[0], 0.1], [0.1, 1.0]]
        return True

    def slopes_at(self, t: float, y: Any, out: Any) -> bool:
        out[:] = y[0] * y[2] * y[2], 0.0
        return True


BEAD = Given(
    Bead(),
    """
typedef struct { int none; } Linkage;
#define STATES 4
static int64_t off_by(Linkage *of, double t, const double *y, double *out) {
    out[0] = y[0] * y[0] + y[1] * y[1] - 1.0;
    return y[0] < 9.0;
}
static int64_t rows_at(Linkage *of, double t, const double *y, double *out) {
    out[0] = 2.0 * y[0], out[1] = 2.0 * y[1];
    return 1;
}
static int64_t rates_at(Linkage *of, double t, const double *y, double *out) {
    out[0] = y[2], out[1] = y[3], out[2] = 0.3 - y[0] * y[1], out[3] = -9.81;
    return 1;
}
static int64_t inertia_at(Linkage *of, double t, const double *y, double *out) {
    out[0] = 2.0 + y[0] * y[0], out[1] = out[2] = 0.1, out[3] = 1.0;
    return 1;
}
static int64_t slopes_at(Linkage *of, double t, const double *y, double *out) {
    out[0] = y[0] * y[2] * y[2], out[1] = 0.0;
    return 1;
}
""",
    """
const STATES = 4;
const written = (of) => (t, y, out) => (out.set(of(y)), true);
const system = {
  off_by: (t, y, out) => ((out[0] = y[0] * y[0] + y[1] * y[1] - 1), y[0] < 9),
  rows_at: written((y) => [2 * y[0], 2 * y[1]]),
  rates_at: written((y) => [y[2], y[3], 0.3 - y[0] * y[1], -9.81]),
  inertia_at: written((y) => [2 + y[0] * y[0], 0.1, 0.1, 1]),
  slopes_at: written((y) => [y[0] * y[2] * y[2], 0]),
};
""",
)


def test_rattle() -> None:
    """Steps that converge, others that do not, and one whose constraint is not valid."""
    room, factors = linked(2, 1), [few.plain_factors(k) for k in (2, 2, 1)]
    angles = np.random.default_rng(2).normal(size=5)
    starts = [np.array([np.cos(a), np.sin(a), -np.sin(a), np.cos(a)]) for a in angles]
    starts.append(np.array([9.0, 0.0, 1.0, 1.0]))
    step = Step(*np.zeros((3, 4)))
    cases = [[BEAD, 2, 1, 0.1, y, h, room, *factors, step] for y in starts for h in (0.01, 3.0)]
    same("rattle", cases, BEAD)
    with np.errstate(all="ignore"):
        made = [rattle(BEAD.python, *deepcopy(case[1:])) for case in cases]
    assert min(made[:10:2]) > 0 and min(made[1:10:2]) < 1 and made[10:] == [INVALID] * 2


def test_projection() -> None:
    """Near and far states; one where a function has no valid result."""
    starts = [*SEEDED.normal(size=(20, 4)), np.array([1e-9, 0, 1, 1]), np.array([9.0, 0, 1, 1])]
    room = np.array([1.0, 2.0]), *np.zeros((3, 2)), np.zeros(4)
    same("moved_onto", [[CIRCLE, 4, 2, 0.0, y, *room] for y in starts], CIRCLE)
