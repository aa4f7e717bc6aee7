"""Mechanisms of which all is driven: no freedom is left, and forces of drives are the question."""

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import NODE, run_in_node

import eomgen
from eomgen.commands.main import main
from eomgen.show.live import live_table
from eomgen.show.page import render_page
from eomgen.store import live_code

MASS, INERTIA, ARM, G = 2.0, 0.1, 0.5, 9.81
CRANK, COUPLER, ROCKER, GROUND, SPEED = 0.3, 1.0, 1.0, 1.2, 3.0
ROD = f"""
name = "rod"
bodies = [{{ name = "rod", mass = {MASS}, inertia_com = {INERTIA} }}]
joints = [{{ name = "pivot", type = "revolute", parent = "world", child = "rod", r_child = [-{ARM}, 0] }}]
effects = [{{ type = "gravity", g = {G} }}, {{ type = "driven", name = "drive", joint = "pivot", coordinate = "0.3*t*t" }}]
outputs = ["all"]
"""  # noqa: E501
BAR = f"""
name = "bar"
bodies = [
    {{ name = "crank", mass = 1.0, inertia_com = 0.1 }},
    {{ name = "coupler", mass = 1.0, inertia_com = 0.1 }},
    {{ name = "rocker", mass = 1.0, inertia_com = 0.1 }},
]
joints = [
    {{ name = "a", type = "revolute", parent = "world", child = "crank", r_child = [-{CRANK / 2}, 0.0] }},
    {{ name = "b", type = "revolute", parent = "crank", child = "coupler", r_child = [-0.5, 0.0], r_parent = [{CRANK / 2}, 0.0] }},
    {{ name = "c", type = "revolute", parent = "world", child = "rocker", r_child = [-0.5, 0.0], r_parent = [{GROUND}, 0.0] }},
    {{ name = "d", type = "revolute", parent = "coupler", child = "rocker", r_child = [0.5, 0.0], r_parent = [0.5, 0.0], loop = true }},
]
effects = [{{ type = "gravity", g = {G} }}, {{ type = "driven", name = "drive", joint = "a", coordinate = "1 + {SPEED}*t" }}]
outputs = ["driving_forces", "joint_forces"]
initial = {{ guess = {{ b_angle = 0.0, c_angle = 1.5 }} }}
"""  # noqa: E501


def centres(theta: Any) -> list[tuple[Any, Any, Any]]:
    """x, y and angle of the four-bar's bodies at crank angles, by the law of cosines."""
    x, y = CRANK * np.cos(theta), CRANK * np.sin(theta)
    far, way = np.hypot(GROUND - x, y), np.arctan2(-y, GROUND - x)
    at_crank = np.arccos((COUPLER**2 + far**2 - ROCKER**2) / (2 * COUPLER * far))
    beta = way + at_crank
    end_x, end_y = x + COUPLER * np.cos(beta), y + COUPLER * np.sin(beta)
    gamma = np.arctan2(end_y, end_x - GROUND)
    return [
        (x / 2, y / 2, theta),
        ((x + end_x) / 2, (y + end_y) / 2, beta),
        ((GROUND + end_x) / 2, end_y / 2, gamma),
    ]


def energy(theta: Any) -> Any:
    """T + V of the four-bar whose crank turns steadily."""
    h = 1e-5
    total = 0.0
    for now, ahead, behind in zip(
        centres(theta), centres(theta + h), centres(theta - h), strict=True
    ):
        rates = [SPEED * (a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
        total = total + 0.5 * (rates[0] ** 2 + rates[1] ** 2 + 0.1 * rates[2] ** 2) + G * now[1]
    return total


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", ["DOP853", "rk4", "gauss_4", "Radau"])
def test_a_driven_rod(integrator: str) -> None:
    """Its torque is (I + m l²) θ̈ + m g l cos θ, with any method: there is nothing to integrate."""
    step = {"dt": 0.1} if integrator in ("rk4", "gauss_4") else {}
    run = eomgen.simulate(
        ROD, t_end=2.0, integrator=integrator, save=("driving_forces",), backend="numpy", **step
    )
    assert run.finished and run.states == () and run.y.shape == (len(run.t), 0)
    theta = 0.3 * run.t**2
    torque = (INERTIA + MASS * ARM**2) * 0.6 + MASS * G * ARM * np.cos(theta)
    np.testing.assert_allclose(run.saved["driving_forces"][:, 0], torque, rtol=1e-13)


def test_a_coupling_with_the_time() -> None:
    """It drives as a drive does, and its multiplier is the torque."""
    drive = '{ type = "driven", name = "drive", joint = "a", coordinate = "1 + 3.0*t" }'
    coupling = '{ type = "coupling", name = "k", coordinate = "a_angle", equals = "1 + 3*t" }'
    follow = f"constraints = [{coupling}]"
    text = BAR.replace(f", {drive}", "").replace("driving_forces", "constraint_forces") + follow
    runs = [
        eomgen.simulate(scene, t_end=0.5, save=(what,), backend="numpy")
        for scene, what in ((BAR, "driving_forces"), (text, "constraint_forces"))
    ]
    torque = runs[1].saved["constraint_forces"][-1, 2]
    assert abs(torque) == pytest.approx(abs(runs[0].saved["driving_forces"][-1, 0]), rel=1e-7)


def test_a_driven_crank() -> None:
    """Its torque is the change of the energy over the angle; the loop stays closed."""
    run = eomgen.simulate(BAR, t_end=2.0, save=("driving_forces", "poses"), backend="numpy")
    theta, h = 1 + SPEED * run.t, 1e-3
    assert run.finished and run.model.freedom.startswith("0 degrees of freedom")
    poses = run.saved["body_poses"]
    names = [body.name for body in run.model.bodies]
    for name, (x, y, _) in zip(("crank", "coupler", "rocker"), centres(theta), strict=True):
        at = poses[:, names.index(name), :2]
        np.testing.assert_allclose(at, np.column_stack([x, y]), atol=1e-12)
    slope = (8 * (energy(theta + h) - energy(theta - h)) - energy(theta + 2 * h)
             + energy(theta - 2 * h)) / (12 * h)  # fmt: skip
    torque = run.saved["driving_forces"][:, 0]
    np.testing.assert_allclose(torque, slope, atol=1e-5 * np.abs(slope).max())
    coarse = eomgen.simulate(
        BAR, t_end=2.0, integrator="rk4", dt=0.05, save=("driving_forces",), backend="numpy"
    )
    rough = np.interp(coarse.t, run.t, torque)
    np.testing.assert_allclose(coarse.saved["driving_forces"][:, 0], rough, atol=5e-2)


@pytest.mark.apart
@pytest.mark.every(2)
@pytest.mark.every(2)
@pytest.mark.parametrize("text", [ROD, BAR], ids=["tree", "loop"])
def test_all_commands_take_what_is_driven(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Runs, sweeps, pictures, pages, modules in other languages; what has nothing to do says so."""
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "it.toml"
    scene.write_text(text)
    name = "rod" if text is ROD else "bar"
    end = ["--t-end", "0.2"]
    for words in (
        ["check"],
        ["simulate", *end, "--save", "energy,driving_forces", "--works", "--live"],
        ["simulate", *end, "--accuracy", "1e-6", "--no-pictures"],
        ["sweep", *end, "--vary", "gravity_g=1:2:2", "--outputs", "kinetic_energy"],
        ["generate", "--backend", "c"],
        ["generate", "--backend", "matlab"],
        ["derive"],
    ):
        assert (
            main([words[0], str(scene), *words[1:], *(["--force"] if "-o" in words else [])]) == 0
        )
    figure = ["plot", f"out/{name}.npz", "--of", "energy", "-o", "it.svg"]
    assert main(figure) == 0
    capsys.readouterr()
    if text is ROD:
        assert main(["accuracy", str(scene)]) == 1
        assert "all coordinates are driven" in capsys.readouterr().err


def test_a_page_of_a_driven_rod() -> None:
    """It replays, and goes on live."""
    run = eomgen.simulate(ROD, t_end=0.2, backend="numpy")
    for live in (False, True):
        assert "mechanism" in render_page(run.motion, run.page(live=live))


def test_what_nothing_drives_does_not_move() -> None:
    """Locked is not driven: nothing would happen."""
    locked = ROD.replace("outputs", "locked = { pivot_angle = 1 }\noutputs").partition(
        ', { type = "driven"'
    )
    text = locked[0] + "]\n" + locked[2].partition("\n")[2]
    with pytest.raises(eomgen.SceneError, match="every coordinate is locked, so nothing moves"):
        eomgen.check(text)


def test_javascript_without_states(tmp_path: Path) -> None:
    """The module of a driven rod computes its torque from the time alone."""
    path = tmp_path / "rod.mjs"
    eomgen.generate(ROD, backend="javascript").save(path)
    code = f"import(`{path}`).then((m) => console.log(m.driving_forces(0, [])[0]))"
    done = subprocess.run(["node", "-e", code], check=True, capture_output=True, text=True)
    torque = (INERTIA + MASS * ARM**2) * 0.6 + MASS * G * ARM
    assert float(done.stdout) == pytest.approx(torque, rel=1e-14)


@pytest.mark.skipif(NODE is None, reason="needs Node.js")
def test_the_page_moves_a_driven_rod() -> None:
    """The page's own engine goes on from time to time by each method, without a state."""
    scene = eomgen.read(ROD)
    model = eomgen.check(ROD)
    code = live_code(model)
    data = live_table(model, code, scene.simulation)
    script = """
const engine = makeEngine(mechanism, given);
const found = [];
for (const { name } of engine.methods) {
  engine.setMethod(name);
  engine.reset(new Float64Array(0));
  engine.advance(0.5);
  const pose = mechanism.bodyPoses(engine.t, engine.y, engine.p, engine.u);
  found.push([engine.t, engine.error, ...pose]);
}
return found;
"""
    found = run_in_node(code.source, script, data)
    assert found
    for t, error, _, _, angle in found:
        assert error is None and t == pytest.approx(0.5) and angle == pytest.approx(0.3 * t * t)
