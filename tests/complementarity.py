"""Random complementarity problems."""

import numpy as np

from eomgen.engine.complementarity import complementary
from eomgen.run.problem import FloatArray

MOST = 8
"""The greatest number of contacts."""
Problem = tuple[FloatArray, FloatArray]


def drawn(count: int, seed: int) -> list[Problem]:
    """Matrices (n, n) and offsets (n,), n <= `MOST`: of a body that slides on n contacts, of which
    many are redundant; a positive definite matrix with a skew part; and any matrix.
    """
    random, found = np.random.default_rng(seed), list[Problem]()
    for k in range(count):
        n = int(random.integers(1, MOST + 1))
        free, wide = int(random.integers(1, MOST + 1)), random.normal(size=(n, MOST))
        if k % 3 == 0:
            normal, slip = random.normal(size=(2, n, free))
            matrix = normal @ (normal + random.uniform(0, 2) * slip).T
        elif k % 3 == 1:
            skew = random.normal(size=(n, n)) * random.uniform(0, 3)
            matrix = wide @ wide.T + skew - skew.T
        else:
            matrix = random.normal(size=(n, n)) + random.uniform(0, 2) * np.eye(n)
        found.append((matrix * 10.0 ** random.uniform(-6, 6), random.normal(size=n)))
    return found


def solution(matrix: FloatArray, offset: FloatArray) -> FloatArray | None:
    """The forces (n,) of a problem; None if none are found."""
    forces = np.zeros(len(offset))
    found = complementary(len(offset), matrix.tolist(), offset.tolist(), forces)
    return forces if found else None
