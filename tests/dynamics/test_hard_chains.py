"""Long chains: digits do not go the way of the mass matrix, whose condition grows as N⁴."""

from dataclasses import replace

import numpy as np
import pytest
from campaign import some

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.start.diagnostics import values_at
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import load_module
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import BUILT_IN, parse_scene
from eomgen.study.verification.truth import Truth

BOUND = 1e-12
"""Of v̇, in parts of its largest component; the worst so far, of 200 links, is 4e-13."""
DIGITS = np.finfo(float).eps / 2


def chain(count: int) -> Model:
    """The built-in chain with this many links, and nothing but its derivative."""
    text = (BUILT_IN / "chain.toml").read_text("utf-8").replace("count = 10", f"count = {count}")
    return replace(elaborate(parse_scene(text)), outputs=())


def states(count: int) -> np.ndarray:
    """Straight and still, straight and moving, hanging, all but straight, and two at random."""
    noise = np.random.default_rng(count)
    still, moving = np.zeros(count), noise.normal(size=count)
    hanging = np.concatenate([[-np.pi / 2], still[1:]])
    q = [still, still, hanging, np.full(count, 1e-9)]
    v = [still, moving, 0.1 * moving, moving]
    for _ in range(2):
        q.append(noise.uniform(-np.pi, np.pi, count))
        v.append(3 * noise.normal(size=count))
    return np.hstack([q, v])


def condition(model: Model, y: np.ndarray) -> float:
    """Of the mass matrix."""
    values = values_at(model, 0.0, y.tolist(), {}, {})
    count = len(model.velocities)
    matrix = np.zeros((count, count))
    for (i, j), entry in Dynamics(model, values, FloatScalars()).mass_entries.items():
        matrix[i, j] = matrix[j, i] = entry
    return float(np.linalg.cond(matrix))


@pytest.mark.parametrize("count", some([50], [50, 100, 200]))
def test_long_chains_keep_their_digits(count: int) -> None:
    """Against 60 digits, by the route that is chosen: no more is lost straight than at random,
    where the condition number is a thousandth, and far less than that would let expect.
    """
    model, y = chain(count), states(count)
    made = compile_program(model, jacobian=False).system
    module = load_module(python_module(made), f"chain_{count}")
    true = Truth(model)(np.zeros(len(y)), y)
    for k, state in enumerate(y):
        exact = true[:, k]
        found = module.derivative(0.0, state)[count:]
        error = float(max(abs(found - exact)) / max(abs(exact)))
        assert error < BOUND, (k, error)
    straight = condition(model, y[0])
    assert straight * DIGITS > 1e-8 * (count / 100) ** 4
    assert straight > 50 * condition(model, y[-1])


def test_the_condition_number_grows_as_the_fourth_power() -> None:
    """Of straight chains of 10 to 40 links."""
    counts = [10, 20, 40]
    conditions = [condition(chain(count), states(count)[0]) for count in counts]
    slope = np.polyfit(np.log(counts), np.log(conditions), 1)[0]
    assert abs(slope - 4) < 0.2
