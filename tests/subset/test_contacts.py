"""The engine's forces of contacts, in three languages and against other solvers."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from campaign import some
from complementarity import drawn, of_unit_and_page, solution
from languages import Given, results

from eomgen.engine import complementarity, least_squares
from eomgen.engine.contacts import ALPHA, Place, Touching
from eomgen.engine.printed import CONTACT_STEPS, CONTACTS, text
from eomgen.engine.roots import Search
from eomgen.engine.structures import with_room
from eomgen.run.problem import FloatArray

SEEDED = np.random.default_rng(1)


def test_forces_have_the_same_bits_in_units_and_on_pages() -> None:
    """Of unsymmetric problems, of which one in four needs Lemke's method.
    `tests/campaigns/contact_forces.py` has more of them.
    """
    problems = drawn(some(100, 2000), 1)
    cases = [[len(b), a, b, np.zeros(len(b))] for a, b in problems]
    python, *others = results(text(), "complementary", cases, given=of_unit_and_page())
    assert others == [python, python]
    found = [solution(*problem) for problem in problems]
    assert 0 < sum(f is None for f in found) < len(found) / 2


@pytest.mark.parametrize("n", [1, 2, 4, 8, 20])
def test_least_squares_of_least_norm(n: int) -> None:
    """Those of LAPACK, for every rank, and right-hand sides inside and outside the range."""
    for rank in range(n + 1):
        a = SEEDED.normal(size=(n, rank)) @ SEEDED.normal(size=(rank, n))
        a *= 10.0 ** SEEDED.uniform(-9, 9)
        for b in (SEEDED.normal(size=n), a @ SEEDED.normal(size=n)):
            x = np.zeros(n)
            least_squares.shortest(n, a.tolist(), b, x)  # type: ignore[arg-type]
            right = np.linalg.lstsq(a, b, rcond=1e-10)[0]
            np.testing.assert_allclose(x, right, rtol=1e-8, atol=1e-8 * np.abs(right).max())


def every_solution(matrix: FloatArray, offset: FloatArray) -> list[FloatArray]:
    """All solutions, by trying each set of contacts that push."""
    found = []
    for tried in product((False, True), repeat=len(offset)):
        acts, forces = np.array(tried), np.zeros(len(offset))
        forces[acts] = np.linalg.lstsq(matrix[np.ix_(acts, acts)], -offset[acts], rcond=None)[0]
        left = matrix @ forces + offset
        if forces.min() > -1e-9 and left.min() > -1e-9 and np.abs(left[acts]).max(initial=0) < 1e-9:
            found.append(left)
    return found


def by_lemke(matrix: FloatArray, offset: FloatArray) -> FloatArray | None:
    """By Lemke's method alone."""
    forces, scale = np.zeros(len(offset)), float(np.abs(offset).max())
    given = (len(offset), matrix, offset, scale, forces)
    return forces if complementarity.by_lemke(*given) else None


@pytest.mark.parametrize("method", [solution, by_lemke])
@pytest.mark.parametrize("rank", [6, 3])
def test_forces_push_and_never_pull(method: object, rank: int) -> None:
    """Accelerations agree with those of an exhaustive search over sets of contacts."""
    assert callable(method)
    noise = np.random.default_rng(rank)
    pushed = 0
    for _ in range(100):
        rows = noise.normal(size=(6, rank))
        matrix = rows @ rows.T
        offset = rows @ noise.normal(size=rank) + 0.3 * noise.random(6) * (rank == 6)
        if offset.min() >= 0:
            continue
        solutions = every_solution(matrix, offset)
        forces = method(matrix, offset)
        assert solutions
        assert forces.min() >= 0
        np.testing.assert_allclose(matrix @ forces + offset, solutions[0], atol=1e-8)
        pushed += 1
    assert pushed > 50


def test_there_may_be_no_forces() -> None:
    """A contact that forces close, a contradiction, and what is not a number."""
    assert solution(np.array([[-1.0]]), np.array([-1.0])) is None
    assert solution(np.zeros((2, 2)), np.array([1.0, -1.0])) is None
    assert solution(np.array([[np.nan]]), np.array([-1.0])) is None
    assert solution(np.eye(2), np.array([-1.0, np.nan])) is None


class Stack:
    """Two unit masses above each other and the ground, from which forces push; gravity is 2. In a
    step the lower one is shaken.
    """

    def gaps(self, _: float, y: FloatArray) -> FloatArray:
        """Below each."""
        return np.array([y[0], y[1] - y[0]])

    def rates(self, _: float, y: FloatArray) -> FloatArray:
        """Their rates."""
        return np.array([y[2], y[3] - y[2]])

    def held(self, t: float, y: FloatArray, f: FloatArray) -> FloatArray:
        """Rates of positions and velocities, of the gaps' rates, and powers."""
        a, b = f[0] - f[1] - 2.0 + 5.0 * t, f[1] - 2.0
        return np.array([y[2], y[3], a, b, a, b - a, f[0] * y[2], f[1] * (y[3] - y[2])])

    def impact(self, _: float, y: FloatArray, contact: int, bounce: float) -> FloatArray:
        """With the restitution 0.5."""
        e = 1.0 + 0.5 * bounce
        if contact == 0:
            return np.array([y[0], y[1], y[2] - e * y[2], y[3]])
        push = 0.5 * e * (y[3] - y[2])
        return np.array([y[0], y[1], y[2] + push, y[3] - push])

    def go(self, t: float, y: FloatArray, length: float, end: float) -> bool:
        """A step, which may fail."""
        return bool(y[3] < 1.5)

    def part(self) -> None:
        """Nothing is forgotten."""

    def state(self, s: float) -> FloatArray:
        """Some seconds after the start of a step."""
        x = 0.3 - s + s * s * (3.0 - s)
        return np.array([x, x + 0.2 - s * s, 6.0 * s - 3.0 * s * s - 1.0, 4.0 * s - 3.0 * s * s])


STACK = Given(
    Stack(),
    c="""
enum { STATES = 4, CONTACTS = 2, PRESSED = 8 };
typedef struct { int none; } ContactLaw;
typedef ContactLaw Within, Way;
static int64_t go(Way *way, double t, const double *y, double length, double end) {
    (void)way, (void)t, (void)length, (void)end;
    return y[3] < 1.5;
}
static void part(Way *way) { (void)way; }
static void gaps(ContactLaw *law, double t, const double *y, double *to) {
    (void)law, (void)t;
    to[0] = y[0], to[1] = y[1] - y[0];
}
static void rates(ContactLaw *law, double t, const double *y, double *to) {
    (void)law, (void)t;
    to[0] = y[2], to[1] = y[3] - y[2];
}
static void held(ContactLaw *law, double t, const double *y, const double *f, double *to) {
    (void)law;
    const double a = f[0] - f[1] - 2.0 + 5.0 * t, b = f[1] - 2.0;
    to[0] = y[2], to[1] = y[3], to[2] = a, to[3] = b, to[4] = a, to[5] = b - a;
    to[6] = f[0] * y[2], to[7] = f[1] * (y[3] - y[2]);
}
static void impact(ContactLaw *law, double t, const double *y, int64_t k, double much, double *to) {
    (void)law, (void)t;
    const double e = 1.0 + 0.5 * much, push = 0.5 * e * (y[3] - y[2]);
    for (int i = 0; i < 4; i++) to[i] = y[i];
    if (k == 0) to[2] = y[2] - e * y[2];
    else to[2] = y[2] + push, to[3] = y[3] - push;
}
static void state(Within *within, double s, double *to) {
    (void)within;
    to[0] = 0.3 - s + s * s * (3.0 - s), to[1] = to[0] + 0.2 - s * s;
    to[2] = 6.0 * s - 3.0 * s * s - 1.0, to[3] = 4.0 * s - 3.0 * s * s;
}
""",
    javascript="""
const [STATES, CONTACTS, PRESSED] = [4, 2, 8];
const system = {
  gaps: (t, y, to) => to.set([y[0], y[1] - y[0]]),
  rates: (t, y, to) => to.set([y[2], y[3] - y[2]]),
  held: (t, y, f, to) => {
    const [a, b] = [f[0] - f[1] - 2.0 + 5.0 * t, f[1] - 2.0];
    to.set([y[2], y[3], a, b, a, b - a, f[0] * y[2], f[1] * (y[3] - y[2])]);
  },
  impact: (t, y, k, bounce, to) => {
    const e = 1.0 + 0.5 * bounce;
    const push = 0.5 * e * (y[3] - y[2]);
    to.set(k === 0 ? [y[0], y[1], y[2] - e * y[2], y[3]] : [y[0], y[1], y[2] + push, y[3] - push]);
  },
  go: (t, y, length, end) => y[3] < 1.5,
  part: () => {},
  state: (s, to) => {
    const x = 0.3 - s + s * s * (3.0 - s);
    to.set([x, x + 0.2 - s * s, 6.0 * s - 3.0 * s * s - 1.0, 4.0 * s - 3.0 * s * s]);
  },
};
""",
)


def known(holds: list[int]) -> Touching:
    """Contacts of the stack, of which some are held."""
    slack = 1e-9 * SEEDED.random(2)
    own = {"holds": np.array(holds), "units": np.ones(2), "slack": slack, "rest": -np.ones(2)}
    return with_room(Touching, alpha=ALPHA, fastest=1.0, **own, CONTACTS=2, PRESSED=8)


def random_case(name: str) -> list[object]:
    """Arguments of a function, for the stack."""
    holds = SEEDED.integers(0, 2, 2).tolist()
    y = np.concatenate([1e-9 * SEEDED.random(2), SEEDED.normal(size=2)])
    y[1] += y[0]
    t = float(SEEDED.uniform(0, 1))
    end, share = t + float(SEEDED.uniform(0.5, 2)), float(SEEDED.choice([0.25, 1.0]))
    at = Place(t, y, *np.zeros((2, 2), np.int64), 1.0, t, int(SEEDED.choice([0, 10_000])))
    return {
        "begin": [STACK, known(holds), t, y, 10.0],
        "press": [STACK, known(holds), t, y],
        "strike": [STACK, known(holds), replace(at, closed=np.array(holds))],
        "release": [STACK, known(holds), t, y, np.array([*holds[:1], 0])],
        "settle": [STACK, known(holds), t, y],
        "deepest": [STACK, t, y - 1e-9],
        "through": [STACK, STACK, known(holds), Search(), at, end - t, end],
        "taken": [STACK, STACK, known(holds), Search(), at, end, share],
    }[name]


@pytest.mark.parametrize("name", [name for name, _ in (*CONTACTS, *CONTACT_STEPS)])
@pytest.mark.every(3)
def test_contacts_have_the_same_bits_in_three_languages(name: str) -> None:
    """Of two masses that fall on the ground and on each other."""
    cases = [random_case(name) for _ in range(50)]
    python, c, javascript = results(text(), name, cases, given=STACK)
    assert python == c
    assert python == javascript
    assert len({tuple(found) for found in python}) > 3
