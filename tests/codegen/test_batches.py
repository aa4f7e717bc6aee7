"""Batches of parameters and inputs beside batches of states."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.commands.main import main

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
SCENE = """\
name = "batched"
outputs = "all"
inputs = [{ name = "thrust", default = 1.5 }]
parameters = { m = 2.0, l = 0.4, angle = 0.3 }
bodies = [{ name = "rod", mass = "m*cos(angle)", inertia_com = 0.1 }]
joints = [{ name = "pin", type = "revolute", parent = "world", child = "rod", r_child = ["l", 0] }]
points = [{ name = "tip", body = "rod", at = [1, 0] }]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "external_force", name = "jet", body = "rod", force = ["thrust*sin(t)", 0] },
    { type = "motor", name = "push", joint = "pin", torque = "input" },
]
"""


@pytest.fixture(scope="module", params=["python", "compiled"])
def module(request: pytest.FixtureRequest) -> Any:
    """The module of the scene, in Python and with compiled kernels."""
    if request.param == "compiled" and CC is None:
        pytest.skip("there is no C compiler")
    backend = "c" if request.param == "compiled" else "numpy"
    return eomgen.load(eomgen.generate(SCENE, backend=backend))


@pytest.mark.every(2)
def test_columns_of_parameters_and_inputs_are_one_by_one(module: Any) -> None:
    """Arrays (n, k), and mappings to arrays (k,): each column as if it were alone."""
    random = np.random.default_rng(5)
    k = 7
    y = random.uniform(-1, 1, (2, k))
    p = np.array([*module.PARAMETERS.values()])[:, None] * random.uniform(0.8, 1.2, (6, k))
    u = random.uniform(-1, 1, (2, k))
    by_name = {"m": p[0], "l": 0.5}
    whole = np.array([*module.PARAMETERS.values()])
    for name in ("derivative", "jacobian", "joint_forces", "kinetic_energy", "input_jacobian",
                 "parameter_jacobian", "point_positions", "mass_matrix"):  # fmt: skip
        function = getattr(module, name)
        both = function(0.7, y, p, u)
        named = function(0.7, y, by_name, {"push": u[1]})
        alone = function(0.7, y, whole, u)
        for i in range(k):
            q = {"m": p[0, i], "l": 0.5}
            same = {"rtol": 1e-14, "atol": 1e-300}
            assert np.allclose(both[..., i], function(0.7, y[:, i], p[:, i], u[:, i]), **same)
            assert np.allclose(
                named[..., i], function(0.7, y[:, i], q, {"push": float(u[1, i])}), **same
            )
            assert np.allclose(alone[..., i], function(0.7, y[:, i], None, u[:, i]), **same)
    assert next(iter(module.PARAMETERS)) == "m" and module.INPUTS == {"thrust": 1.5, "push": 0.0}
    forward = module.forward_dynamics(y[:1], y[1:], None, 0.7, p, u)
    assert np.allclose(forward, module.derivative(0.7, y, p, u)[1:], rtol=1e-12)
    assert module.derivative(0.7, y[:, :0], p[:, :0], u[:, :0]).shape == (2, 0)


def test_defaults_of_inputs_are_taken(module: Any) -> None:
    """u None, or a mapping without them: the scene's defaults."""
    y = np.array([0.3, -0.2])
    for u in ({"thrust": 1.5}, {}, [1.5, 0.0]):
        assert np.array_equal(module.derivative(0.7, y), module.derivative(0.7, y, None, u))
    assert not np.array_equal(
        module.derivative(0.7, y), module.derivative(0.7, y, None, {"thrust": 0.0})
    )
    run = eomgen.simulate(SCENE, t_end=0.5)
    same = eomgen.simulate(SCENE, t_end=0.5, inputs={"thrust": 1.5})
    other = eomgen.simulate(SCENE, t_end=0.5, inputs={"thrust": 0.0})
    assert np.array_equal(run.y, same.y) and not np.array_equal(run.y, other.y)


def test_defaults_of_inputs_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By `check`, and in every language; 0 is not mentioned."""
    scene = tmp_path / "batched.toml"
    scene.write_text(SCENE)
    assert main(["check", str(scene)]) == 0
    assert "inputs      thrust = 1.5, push\n" in capsys.readouterr().out
    module = eomgen.generate(SCENE)
    assert "thrust = 1.5" in module.source and '"push": 0.0' in module.source
    assert "u = [1.5, 0.0]" in eomgen.generate(SCENE, backend="javascript").source
    (header,) = (
        text
        for name, text in eomgen.generate(SCENE, backend="c").others.items()
        if name.endswith(".h")
    )
    assert "1.5 by default" in header and "0.0 by default" not in header


def test_wrong_columns_are_refused(module: Any) -> None:
    """A wrong shape, a value that no parameter can have in one column, columns beside one state."""
    y, p = np.zeros((2, 3)), np.tile(np.array([*module.PARAMETERS.values()])[:, None], 3)
    for wrong, message in (
        (p[:, :2], r"parameters have shape \(6, 2\), not \(6,\) or \(6, 3\)"),
        ({"m": np.ones(2)}, r"parameter 'm' has shape \(2,\), not \(\) or \(3,\)"),
        ({"m": np.array([1, np.nan, 1])}, "parameter 'm' is nan"),
        ({"m": np.array([1.0, -1.0, 1.0])}, "mass of rod is not positive"),
        ({"mm": np.ones(3)}, "unknown parameter 'mm'"),
    ):
        with pytest.raises(ValueError, match=message):
            module.derivative(0.0, y, wrong)
    with pytest.raises(ValueError, match=r"parameters have shape \(6, 3\), not \(6,\)"):
        module.derivative(0.0, y[:, 0], p)
    with pytest.raises(ValueError, match=r"inputs have shape \(2, 2\), not \(2,\) or \(2, 3\)"):
        module.derivative(0.0, y, None, np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"input 'push' has shape \(4,\)"):
        module.derivative(0.0, y, None, {"push": np.ones(4)})


def test_a_column_without_a_value_is_nan_alone(module: Any) -> None:
    """As among states: a state that is not finite, or an input."""
    y, p = np.zeros((2, 3)), np.tile(np.array([*module.PARAMETERS.values()])[:, None], 3)
    u = np.array([[1.0, np.nan, 1.0], [0.0, 0.0, 0.0]])
    y[0, 0] = np.inf
    found = module.derivative(0.7, y, p, u)
    assert np.isnan(found[:, :2]).any(axis=0).all() and np.isfinite(found[:, 2]).all()
