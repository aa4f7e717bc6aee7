"""The engine's forces of contacts, in three languages and against other solvers."""

from itertools import product

import numpy as np
import pytest
from campaign import some
from complementarity import drawn, solution
from languages import results

from eomgen.engine import complementarity, least_squares
from eomgen.engine.printed import text
from eomgen.run.problem import FloatArray

SEEDED = np.random.default_rng(1)


def test_forces_have_the_same_bits_in_three_languages() -> None:
    """Of unsymmetric problems, of which one in four needs Lemke's method.
    `tests/campaigns/contact_forces.py` has more of them.
    """
    problems = drawn(some(200, 2000), 1)
    cases = [[len(b), a, b, np.zeros(len(b))] for a, b in problems]
    python, c, javascript = results(text(), "complementary", cases)
    assert python == c
    assert python == javascript
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
