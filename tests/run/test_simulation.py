"""The physics of whole runs: what is conserved, published values, orders, state forms."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engine import text_of

from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.run.integrate import integrate
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.scene.reader import read_scene


def loaded(scene: str, form: Any = "velocity") -> tuple[Model, GeneratedModule]:
    """Model and module of a built-in scene in one state form."""
    model = replace(elaborate(read_scene(scene)), form=form)
    return model, load_module(text_of(model), f"{scene}_{form}")


@pytest.fixture(scope="module")
def two_body() -> dict[str, tuple[Model, GeneratedModule]]:
    """The handout's bodies in all three state forms."""
    return {form: loaded("two_body", form) for form in ("velocity", "momentum", "redundant")}


def test_ten_seconds_of_free_flight_conserve_what_they_should(two_body: Any) -> None:
    """Energy, both momenta and the parabola of the centre of mass to 1e-10 at rtol 1e-12."""
    _, module = two_body["velocity"]
    run = integrate(as_problem(module), "DOP853", 10.0, rtol=1e-12, atol=1e-14)
    assert run.finished
    t, y, p = run.t, run.y.T, module.PARAMETERS
    kinetic, potential = module.kinetic_energy(0.0, y), module.potential_energy(0.0, y)
    energy = kinetic + potential
    assert np.max(np.abs(energy - energy[0])) < 1e-10 * np.max(kinetic)

    mass = p["m_A"] + p["m_B"]
    px, py, spin = module.momentum(0.0, y)
    assert np.max(np.abs(px - px[0])) < 1e-10 * np.max(np.abs(px))
    assert np.max(np.abs(py - (py[0] - mass * p["g"] * t))) < 1e-10 * np.max(np.abs(py))

    poses = module.body_poses(0.0, y)
    x, height = (p["m_A"] * poses[0, :2] + p["m_B"] * poses[1, :2]) / mass
    about_centre = spin - (x * py - height * px)
    assert np.max(np.abs(about_centre - about_centre[0])) < 1e-10 * np.max(np.abs(spin))
    parabola = height[0] + py[0] / mass * t - p["g"] * t**2 / 2
    assert np.max(np.abs(x - (x[0] + px[0] / mass * t))) < 1e-10 * np.max(np.abs(x))
    assert np.max(np.abs(height - parabola)) < 1e-10 * np.max(np.abs(height))


# IFToMM benchmark A01, simple pendulum of length 1 m let go level, g = 9.81 m/s^2: exact values
# t, x, y, vx, vy from θ = 2 asin(k sn(K - w t | k²)), k = sin(π/4), w = √(g/L).
A01 = np.array(
    [
        [0.5, -0.3910487915505464, -0.9203699487851922, 3.9110480039555524, -1.6617346075474144],
        [1.0, 0.9862917511318753, -0.16501085312554117, 0.2969055159163158, 1.7746436411126556],
        [2.5, -0.9963344039582815, -0.0855438804888806, 0.11082377057174633, -1.2907707104935788],
        [5.0, -0.9423054350437573, -0.3347543384140006, 0.8579042568859491, -2.4149286543704886],
        [7.5, -0.7274587213083755, -0.6861514474169557, 2.517557956711684, -2.669118456142095],
        [10.0, -0.2750874625761169, -0.961419205099125, 4.175598100951729, -1.1947490545604753],
    ]
)


def test_the_published_pendulum() -> None:
    """IFToMM A01 within 1e-10 at rtol 1e-12."""
    _, module = loaded("pendulum")
    problem = as_problem(module)
    run = integrate(problem, "DOP853", 10.0, rtol=1e-12, atol=1e-14, samples=41)
    assert module.PARAMETERS["gravity_g"] == 9.81
    rows = [int(np.argmin(np.abs(run.t - t))) for t in A01[:, 0]]
    np.testing.assert_allclose(run.t[rows], A01[:, 0], atol=1e-12)
    y = run.y[rows].T
    x, height, _ = module.body_poses(0.0, y)[0]
    np.testing.assert_allclose(x, A01[:, 1], atol=1e-10)
    np.testing.assert_allclose(height, A01[:, 2], atol=1e-10)
    np.testing.assert_allclose(-height * y[1], A01[:, 3], atol=1e-10)
    np.testing.assert_allclose(x * y[1], A01[:, 4], atol=1e-10)


def test_all_state_forms_are_one_motion(two_body: Any) -> None:
    """[q, v], the handout's 12 redundant and its 8 reduced numbers end in the same poses."""
    ends = {}
    for form, (_, module) in two_body.items():
        run = integrate(as_problem(module), "DOP853", 2.5, rtol=1e-12, atol=1e-14)
        assert run.finished
        ends[form] = module.body_poses(0.0, run.y[-1])
    assert two_body["redundant"][1].STATES == (
        "x_A", "y_A", "P_A_x", "P_A_y", "theta", "L_A",
        "x_B", "y_B", "P_B_x", "P_B_y", "angle_B", "L_B",
    )  # fmt: skip
    assert two_body["momentum"][1].STATES == (
        "x_A", "y_A", "P_A_x", "P_A_y", "theta", "L_A", "angle_B", "L_B",
    )  # fmt: skip
    np.testing.assert_allclose(ends["momentum"], ends["velocity"], atol=1e-9)
    np.testing.assert_allclose(ends["redundant"], ends["velocity"], atol=1e-9)


@pytest.mark.usefixtures("blank_figures")
def test_a_fresh_module_is_not_derived_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second run takes the module from the store, and a run never imports SymPy for it."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    for expected in ("derived now", "not derived again"):
        assert main(["simulate", "pendulum", "--t-end", "0.1", "-o", str(tmp_path)]) == 0
        assert expected in capsys.readouterr().out
