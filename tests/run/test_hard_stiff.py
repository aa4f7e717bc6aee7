"""Stiffness: an explicit method that cannot hold it says so, and names what can."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bookkeeping import light
from scenes import WEIGHT, effect, lone

import eomgen
from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.problem import Problem
from eomgen.run.trajectory import Trajectory
from eomgen.scene.reader import parse_scene

SLIDE = lone("prismatic", name="slide", inertia_com=0, axis=[0, 1])
SPRING = lone(
    "prismatic",
    effect("joint_spring", joint="j", stiffness=1e12, damping=0),
    inertia_com=0, axis=[0, 1], initial={"q": {"j_slide": 0.1}, "v": {"j_slide_dot": 1.0}},
)  # fmt: skip
WALL = lone(
    "prismatic",
    WEIGHT,
    effect("contact", law="hunt_crossley", body="b", stiffness=1e9, dissipation=0.0),
    inertia_com=0, axis=[0, 1], initial={"q": {"j_slide": 0.5}},
)  # fmt: skip
SERVO = """
name = "servo"
bodies = [{ name = "b", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "j", type = "revolute", parent = "world", child = "b", r_child = [0, 1] }]
initial = { q = { j_angle = 1.0 } }
effects = [
    { type = "gravity", g = 9.81 },
    { type = "pd", name = "hold", joint = "j", target = 0.5, stiffness = 1e8, damping = 1e7 },
]
"""
DROPPED = """
name = "dropped"
bodies = [{ name = "rod", mass = 1.0, inertia_com = 0.02 }]
joints = [{ name = "free", type = "free", parent = "world", child = "rod" }]
initial = { q = { rod_y = 0.6, rod_angle = 0.7 }, v = { rod_x_dot = 1.0 } }
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "contact"
name = "floor"
law = "hunt_crossley"
body = "rod"
corners = [0.25, 0.02]
stiffness = 1e4
dissipation = 0.5
friction = 0.8
slip_speed = 0.01
"""
"""Friction damps the points of the rod at 10,000/s while they stick, for a few steps a bounce."""
SCENES = {"spring": SPRING, "wall": WALL, "servo": SERVO}
EXPLICIT = ["euler", "semi_implicit_euler", "rk4"]


@cache
def problem(scene: str) -> Problem:
    return as_problem(light(SCENES[scene]).module)


def stopped(run: Trajectory) -> float:
    """The step that a message asks for."""
    assert not run.finished
    assert "too long for an explicit method" in run.message
    assert "--integrator implicit_midpoint, or Radau" in run.message
    found = re.search(r"take --dt (\S+) or less", run.message)
    assert found
    return float(found[1])


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", EXPLICIT)
def test_too_long_a_step_is_refused(scene: str, method: str) -> None:
    """Before the state is spoilt: at the last row there is no more energy than at the start. At
    the wall nothing would overflow: the ball would be thrown up a hundred metres.
    """
    asked = problem(scene)
    run = integrate(asked, method, 1.0, dt=1e-3)
    stopped(run)
    assert np.abs(run.y).max() < 10


@pytest.mark.parametrize(("scene", "rate"), [("spring", 1e6), ("servo", 1e7 / 1.1)])
def test_the_step_that_is_named_is_the_longest(scene: str, rate: float) -> None:
    """Of rk4 it is 2.83/ω of an oscillation and 2.79/λ of a decay; and it does hold."""
    asked = problem(scene)
    dt = stopped(integrate(asked, "rk4", 1.0, dt=1e-3))
    limit = {"spring": 2.8284, "servo": 2.7853}[scene] / rate
    assert 0.9 * limit < dt < 1.01 * limit
    run = integrate(asked, "rk4", 300 * dt, dt=dt)
    assert run.finished
    stopped(integrate(asked, "rk4", 300 * limit, dt=1.3 * limit))


def test_implicit_methods_hold_what_explicit_ones_do_not() -> None:
    """The energy of the spring, and where the servo comes to: where its torque bears the weight."""
    spring = problem("spring")
    run = integrate(spring, "implicit_midpoint", 1.0, dt=1e-3)
    energy = 0.5 * run.y[:, 1] ** 2 + 0.5e12 * run.y[:, 0] ** 2
    assert np.ptp(energy) < 1e-10 * energy[0]
    ends = []
    kept: list[tuple[str, dict[str, Any]]] = [("Radau", {"rtol": 1e-8}), ("gauss_4", {"dt": 1e-3})]
    for method, given in kept:
        run = integrate(problem("servo"), method, 2.0, **given)
        assert run.finished
        ends.append(run.y[-1, 0])
    lags = 0.5 * np.exp(-2.0 * 1e8 / 1e7)
    assert abs(ends[0] - 0.5) < 1e-7 + 2 * lags


def test_an_adaptive_explicit_method_names_stiffness() -> None:
    """Long before its steps are over, ten million by default."""
    run = integrate(problem("servo"), "RK45", 2.0, rtol=1e-6, max_steps=20_000)
    assert not run.finished and run.counts["steps"] <= 10_000
    assert "the motion is stiff: a mode decays at 9.1e+06/s" in run.message
    assert "take --integrator Rodas5P, or Radau" in run.message


def test_what_holds_is_left_alone() -> None:
    """A step within the limit, through a whole bounce."""
    run = integrate(problem("wall"), "rk4", 0.4, dt=5e-5, samples=101)
    assert run.finished
    energy = 0.5 * run.y[-1, 1] ** 2 + 9.81 * run.y[-1, 0]
    assert abs(energy - 0.5 * 9.81) < 0.02 * energy


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
def test_what_could_grow_but_does_not_is_left_alone(method: str) -> None:
    """Steps that are too long for the friction of a bounce, which saturates; much longer ones
    are refused.
    """
    asked = as_problem(light(DROPPED).module)
    right = integrate(asked, "DOP853", 1.5, rtol=1e-9)
    run = integrate(asked, method, 1.5, dt=1e-3)
    assert run.finished, run.message
    assert np.abs(run.y[-1] - right.y[-1]).max() < 3e-3
    stopped(integrate(asked, method, 1.5, dt=0.02))


def test_a_sweep_may_have_steps_that_are_too_long() -> None:
    """Members together in C, and one by one in Python; until they overflow they are kept."""
    scene, vary = parse_scene(SPRING), {"j_slide": [0.1] * 20}
    asked: dict[str, Any] = {"integrator": "rk4", "dt": 1e-5, "t_end": 2e-4}
    refused = eomgen.ensemble(scene, vary, backend="numpy", **asked)
    assert not refused.finished.any() and "take --dt" in refused.messages[0]
    one, other = (
        eomgen.ensemble(scene, vary, backend=backend, unstable=True, **asked)
        for backend in ("c", "numpy")
    )
    assert one.finished.all() and other.finished.all()
    assert np.allclose(one.final, other.final, rtol=1e-9)
    assert np.abs(one.final).max() > 1e10
    with pytest.raises(RunError, match=r"unstable: Radau is stable at any step"):
        eomgen.ensemble(scene, vary, integrator="Radau", unstable=True)


@pytest.mark.parametrize("method", ["euler", "semi_implicit_euler", "rk4"])
def test_wild_forces_are_looked_into_seldom_and_what_cannot_be_held_at_once(method: str) -> None:
    """Forces on 40 freedoms that jump at every step, to no harm; from 4 s on a damper on one of
    them, too strong by far. A Jacobian takes as long as 40 derivatives.
    """
    n, looks = 40, list[float]()

    def strengths(t: float) -> Any:
        return np.where(np.arange(n) == 7, 300.0 if t >= 4.0 else 0.0, 0.0)

    def derivative(t: float, y: Any) -> Any:
        force = np.copysign(10.0, np.sin(997.0 * t + np.arange(n)))
        return np.concatenate((y[n:], force - strengths(t) * y[n:]))

    def jacobian(t: float, y: Any) -> Any:
        looks.append(t)
        return np.block([[np.zeros((n, n)), np.eye(n)], [np.zeros((n, n)), -np.diag(strengths(t))]])

    states = tuple(f"y{i}" for i in range(2 * n))
    asked = Problem("wild", states, tuple(range(n)), derivative, jacobian, np.ones(2 * n))
    run = integrate(asked, method, 6.0, dt=0.01)
    derivatives = 400 * {"rk4": 4}.get(method, 1)
    assert 2 <= len([t for t in looks if t < 3.98]) * n < 0.5 * derivatives + 8000 / n
    assert stopped(run) < 0.01
    assert 3.9 < run.t[-1] < 4.1 and np.abs(run.y).max() < 500


@pytest.mark.parametrize("method", EXPLICIT)
def test_a_lecture_may_show_a_step_that_is_too_long(method: str) -> None:
    """It grows from step to step, and so it ends, with all rows up to there."""
    run = integrate(problem("spring"), method, 1.0, dt=1e-5, unstable=True)
    assert not run.finished and "the state overflows" in run.message
    sizes = np.abs(run.y[:, 0])
    assert len(sizes) > 30 and sizes[-1] > 1e100
    held = integrate(problem("spring"), method, 1e-5, dt=1e-7, unstable=True)
    assert held.finished


@pytest.mark.usefixtures("blank_figures")
def test_unstable_steps_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "spring.toml"
    scene.write_text(SPRING)
    given = ["simulate", str(scene), "-o", str(tmp_path), "--unstable"]
    steps = ["--integrator", "euler", "--dt", "1e-5"]
    assert main([*given, *steps, "--t-end", "1e-4"]) == 0
    assert "steps could be too long for stability (--unstable)" in capsys.readouterr().out
    for other in (["--integrator", "Radau"], ["--integrator", "gauss_4", "--dt", "0.1"]):
        assert main([*given, *other]) == 1
        assert f"--unstable: {other[1]} is stable at any step" in capsys.readouterr().err
    assert main([*given, "--accuracy", "1e-3"]) == 1
    assert "--unstable: is for a given step" in capsys.readouterr().err
