"""Modules of the closed form beside SymPy's equations and beside differences, in every state form.
Laws of mechanics that they keep are in `test_laws`.
"""

import numpy as np
import pytest
import sympy as sp
from campaign import BUILT_IN
from engine import apart, slopes, varied
from mechanisms import Compiled, compiled, random_tree

TREES = (9, 22, 7)
ROUNDING = 1e-12


@pytest.fixture(params=[*BUILT_IN, *TREES], ids=str)
def c(request: pytest.FixtureRequest) -> Compiled:
    """Every built-in scene, and some random trees."""
    return compiled(request.param if isinstance(request.param, str) else random_tree(request.param))


def assert_close(actual: object, expected: object) -> None:
    """Equal but for rounding."""
    found, known = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    assert apart(found, known) <= ROUNDING


@pytest.mark.every(4)
def test_mass_matrix(c: Compiled) -> None:
    """The module's is SymPy's."""
    eq, rng = c.equations, np.random.default_rng(31)
    names = (*eq.symbols.parameters.values(), *eq.symbols.q)
    matrix = sp.lambdify(names, eq.symmetric.M.tolist(), "math")
    for _ in range(5):
        y = c.random_state(rng)
        q = y[: len(y) // 2]
        assert_close(c.module.mass_matrix(0.0, y), matrix(*c.module.PARAMETERS.values(), *q))


CASES = [(scene, "velocity") for scene in (*BUILT_IN, *TREES)]
CASES += [  # the other forms need an inertia of every body
    (scene, form)
    for scene in ("double_pendulum", "two_body", "two_body_forced", 9, TREES[-1])
    for form in ("momentum", "redundant")
]


@pytest.mark.every(4)
@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobian(scene: str | int, form: str) -> None:
    """The exact Jacobian is the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    rng = np.random.default_rng(33)
    y, u = rng.uniform(-3.0, 3.0, len(c.module.STATES)), c.random_inputs(rng)
    expected = slopes(c, "jacobian", y, u)
    ours = c.module.jacobian(0.0, y, u=u)
    assert_close(ours, expected)
    both = np.column_stack((y, y))
    inputs = np.column_stack([[u[name] for name in c.module.INPUTS]] * 2)
    assert_close(c.module.jacobian(0.0, both, u=inputs)[:, :, 1], expected)


@pytest.mark.every(6)
@pytest.mark.parametrize(("scene", "form"), CASES)
def test_jacobians_by_inputs_and_parameters(scene: str | int, form: str) -> None:
    """∂f/∂u and ∂f/∂p are the derivative's, differentiated in 60 digits, in every state form."""
    scene = scene if isinstance(scene, str) else random_tree(scene)
    c = compiled(scene, form)
    module, rng = c.module, np.random.default_rng(34)
    y, u = rng.uniform(-3.0, 3.0, len(module.STATES)), c.random_inputs(rng)
    p = varied(c.model, rng, 0.5, 2.0)
    for output, by in (("input_jacobian", u), ("parameter_jacobian", p)):
        if not by:
            assert output not in module.COST
            continue
        expected = slopes(c, output, y, u, p)
        function = getattr(module, output)
        assert_close(function(0.0, y, p, u), expected)
        assert_close(function(0.0, np.column_stack((y, y)), p, u)[:, :, 1], expected)
        assert np.any(expected)
