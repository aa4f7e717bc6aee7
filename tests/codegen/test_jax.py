"""The JAX backend: the Python module's numbers, mapped, differentiated, and in float32."""

import sys
from functools import cache
from typing import Any

import jax
import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.base.errors import RunError
from eomgen.study.verification.states import random_state
from eomgen.sweep import processes

pytestmark = pytest.mark.apart

jnp = jax.numpy
SCENES = ("two_body_forced", "tumbling_body", "human_figure")
"""Of the last one the kernel is long."""
LARGE = ("chain_in_wind", "ragdoll", "walker_motors", "stewart_platform", "bicycle")
STATES = 334
"""States of each scene: a thousand together."""
CORNERS = {
    "name": "corners", "initial": {"q": {"x": 1.0}},
    "bodies": [{"name": "puck", "mass": 2.0, "inertia_com": 0.1}],
    "joints": [{"name": "rail", "type": "prismatic", "parent": "world", "child": "puck",
     "axis": [1, 0], "coordinate": "x",}],
    "effects": [{"type": "motor", "name": "wall", "joint": "rail",
     "torque": "(3/x if x > 0 else 1 - 2*x_dot) - sqrt(max(x, 0)) + abs(x_dot - 1)*x",}],
}  # fmt: skip
"""Force of a motor: at x = 0 the quotient, which is not taken, is infinite, and so is the slope of
the root.
"""


@pytest.fixture(autouse=True, scope="module")
def in_doubles() -> Any:
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@cache
def pair(scene: str) -> tuple[Any, Any]:
    """A scene's JAX module and its Python module."""
    return eomgen.load(eomgen.generate(scene, backend="jax")), eomgen.load(eomgen.generate(scene))


def states(module: Any, count: int) -> np.ndarray:
    """States as columns, (ny, count)."""
    rng = np.random.default_rng(3)
    return np.array([random_state(module, rng) for _ in range(count)]).T


def error(found: Any, wanted: np.ndarray) -> float:
    """The largest error, relative to the largest entry of its column."""
    difference = np.abs(np.asarray(found) - wanted)
    return float((difference.max(0) / np.abs(wanted).max(0)).max())


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", some(SCENES, SCENES + LARGE))
def test_numbers_are_those_of_the_python_module(scene: str) -> None:
    """Of columns, of states mapped by vmap, and with other parameters and inputs."""
    ours, python = pair(scene)
    y = states(python, STATES)
    wanted = python.derivative(0.7, y)
    assert error(jax.jit(ours.derivative)(0.7, y), wanted) < 1e-13
    if scene != SCENES[1]:
        mapped = jax.jit(jax.vmap(lambda state: ours.derivative(0.7, state)))(y[:, :3].T)
        assert error(mapped.T, wanted[:, :3]) < 1e-13


def test_parameters_and_inputs_are_arrays_or_named() -> None:
    """Of one state and of columns, each with its own."""
    ours, python = pair("two_body_forced")
    y = states(python, 3)
    p = {name: value * np.array([0.9, 1.0, 1.1]) for name, value in python.PARAMETERS.items()}
    u = dict.fromkeys(python.INPUTS, 0.3)
    derivative = jax.jit(ours.derivative)
    wanted = python.derivative(0.7, y, p, u)
    assert error(derivative(0.7, y, p, u), wanted) < 1e-13
    arrays = np.array([*p.values()])[:, 0], np.array([*u.values()])
    assert error(derivative(0.7, y[:, 0], *arrays), wanted[:, 0]) < 1e-13


def test_outputs_are_those_of_the_python_module() -> None:
    ours, python = pair("two_body_forced")
    y = states(python, 3)
    names = "mass_matrix velocity_force kinetic_energy potential_energy momentum joint_forces"
    names = (*names.split(), "body_poses", "body_velocities", "applied_force")

    def outputs(module: Any, y: Any) -> list[Any]:
        q, v = y[:4], y[4:]
        dynamics = (module.forward_dynamics, module.inverse_dynamics)
        found = [getattr(module, name)(0.2, y) for name in names]
        return found + [function(q, v, v + 1.0, t=0.2) for function in dynamics]

    wanted = outputs(python, y)
    for one, other in zip(jax.jit(lambda y: outputs(ours, y))(y), wanted, strict=True):
        assert one.shape == other.shape and np.allclose(one, other, rtol=1e-13, atol=1e-13)
    assert np.array_equal(jax.jit(ours.initial_state)(), python.initial_state())
    assert not hasattr(ours, "jacobian") and ours.UNITS == python.UNITS


@pytest.mark.parametrize("scene", some(SCENES[1:2], SCENES + LARGE))
def test_derivatives_are_the_generated_jacobian(scene: str) -> None:
    """Forwards and backwards, of one state and of columns."""
    ours, python = pair(scene)
    y = states(python, 3)
    J = python.jacobian(0.7, y)
    weights = np.random.default_rng(4).normal(size=y.shape)
    backwards = jax.jit(jax.grad(lambda y: jnp.sum(weights * ours.derivative(0.7, y))))
    assert error(backwards(y), np.einsum("ik,ijk->jk", weights, J)) < 1e-10
    forwards = jax.jit(jax.jacfwd(lambda y: ours.derivative(0.7, y)))(y[:, 0])
    assert np.abs(forwards - J[..., 0]).max() < 1e-10 * np.abs(J[..., 0]).max()


@pytest.mark.full
def test_derivatives_by_parameters_are_generated_ones() -> None:
    ours, python = pair("double_pendulum")
    y, p = states(python, 1)[:, 0], np.array([*python.PARAMETERS.values()])
    found = jax.jit(jax.jacrev(lambda p: ours.derivative(0.0, y, p)))(p)
    assert np.allclose(found, python.parameter_jacobian(0.0, y, p), rtol=1e-12, atol=1e-12)


def test_rows_and_lines_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """The values, and second derivatives, of one program evaluated in both ways."""
    ours, python = pair("double_pendulum")
    y = states(python, 1)[:, 0]
    p = np.array([*python.PARAMETERS.values()])

    def found(y: Any) -> Any:
        def slopes(p: Any) -> Any:
            return jax.grad(lambda y: jnp.sum(ours.derivative(0.0, y, p) ** 2))(y)

        return jax.jit(lambda p: jax.jvp(slopes, (p,), (np.ones(5),))[1])(p)

    lines = found(y)
    monkeypatch.setattr(ours, "_LONGEST", 0)
    assert np.allclose(found(y), lines, rtol=1e-11, atol=1e-11 * np.abs(lines).max())


@pytest.mark.every(2)
@pytest.mark.parametrize("longest", [0, 1000], ids=["rows", "lines"])
def test_no_branch_makes_a_derivative_nan(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is not taken counts nothing, even if it is infinite or has an infinite slope."""
    ours = eomgen.load(eomgen.generate(CORNERS, backend="jax"))
    monkeypatch.setattr(ours, "_LONGEST", longest)

    def force(y: Any) -> Any:
        return ours.derivative(0.0, y)[1] * 2.0

    both = jax.jit(lambda y: (*jax.value_and_grad(force)(y), jax.jacfwd(force)(y)))
    for x in (-1.0, 0.0):
        value, *derivatives = both(np.array([x, 0.25]))
        assert float(value) == pytest.approx(0.5 + 0.75 * x)
        assert np.allclose(derivatives, [0.75, -2.0 - x])
    assert np.allclose(both(np.array([4.0, 2.0]))[1], [-3 / 16 - 1 / 4 + 1, 4.0])
    assert np.isnan(both(np.array([np.nan, 0.0]))[1]).all()


def test_float32_stays_float32() -> None:
    ours, python = pair("double_pendulum")
    y = states(python, 3)
    found = jax.jit(ours.derivative)(0.0, jnp.asarray(y, jnp.float32), dict(python.PARAMETERS))
    assert found.dtype == jnp.float32 and error(found, python.derivative(0.0, y)) < 1e-3


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((np.zeros(3),), r"y has shape \(3,\), not \(4,\) or \(4, k\): theta_1"),
        ((np.zeros(4), {"m": 1.0}), "unknown parameter 'm'; known: m_1"),
        ((np.zeros(4), np.ones(2)), r"parameters have shape \(2,\), not \(5,\): m_1"),
        ((np.zeros(4), {"m_1": np.ones(2)}), r"parameter 'm_1' has shape \(2,\), not \(\)"),
        ((np.zeros(4), None, {"push": 1.0}), "unknown input 'push'; known: none"),
    ],
)
def test_wrong_shapes_and_names_are_refused(given: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pair("double_pendulum")[0].derivative(0.0, *given)


def test_without_jax_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    module = eomgen.generate("pendulum", backend="jax")
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(RunError, match=r"backend 'jax': jax .*pip install 'eomgen\[jax\]'"):
        eomgen.load(module)


def test_a_sweep_beside_jax_copies_no_threads() -> None:
    """A process in which JAX runs is not forked: its threads would be missing in the copy."""
    assert processes._start().get_start_method() == "spawn"
