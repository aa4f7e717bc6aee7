"""Random complementarity problems, and what solves them in units and on pages."""

import re

import numpy as np
from languages import Given

from eomgen.api.given import model_of, read
from eomgen.engine.complementarity import complementary
from eomgen.engine.printed import SIZES, steps_of_pages
from eomgen.exports.fmu_source import MAIN, sources_of
from eomgen.exports.fmu_unit import unit_of
from eomgen.exports.steps import method_of
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


def of_unit_and_page() -> Given:
    """The source of an FMU with contacts, and what pages step by; both have `complementary`."""
    scene = read("bouncing_two_body")
    model = model_of(scene, scene)
    unit = unit_of(model, scene.simulation)
    method = method_of("DOP853", model, unit.interface, adaptive=True)
    files = dict(sources_of(unit, method)[0])

    def with_included(name: str) -> str:
        text = files.pop(name, "")
        return re.sub(r'#include "([\w.-]+)"', lambda found: with_included(found[1]), text)

    head, _, names = steps_of_pages().rpartition("return { ")
    page = f"{head}return {{ complementary, {names}".replace("makeSteps", "madeOfPage", 1)
    sizes = ", ".join(f"{name}: 1" for name in SIZES)
    javascript = f"{page}const {{ complementary }} = madeOfPage({{ {sizes} }});"
    return Given(None, with_included(MAIN), javascript + "\nconst system = {};", whole=True)
