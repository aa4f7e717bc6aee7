"""Steps of implicit methods in compiled code: the bits of Python's, and when a run takes them."""

import math
from typing import Any

import numpy as np
import pytest
from campaign import some
from test_compiled_steps import FALL, assert_same, both, compiler, empty_store

import eomgen
from eomgen.native import accelerator
from eomgen.scene.built_in import built_in_names

pytestmark = compiler
__all__ = ["empty_store"]

STIFF = """
name = "stiff_pendulum"
dimensions = 2
[[bodies]]
name = "upper"
mass = 1.0
inertia_com = 0.1
[[bodies]]
name = "lower"
mass = 0.5
inertia_com = 0.02
[[joints]]
name = "shoulder"
type = "revolute"
parent = "world"
child = "upper"
coordinate = "a"
r_child = [0, 0.5]
[[joints]]
name = "elbow"
type = "revolute"
parent = "upper"
child = "lower"
r_parent = [0, -0.5]
r_child = [0, 0.3]
coordinate = "b"
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "joint_spring"
name = "stiff"
joint = "elbow"
stiffness = 1e6
damping = 1e3
[[effects]]
type = "motor"
name = "drive"
joint = "shoulder"
torque = "3*sin(4*t)"
[initial]
q = [1.0, 0.001]
"""
"""A double pendulum with a stiff, damped elbow and a drive that depends on time."""

GAUSS = ("implicit_midpoint", "gauss_4", "gauss_6")
PLANE = """
name = "plane_orbit"
dimensions = 2
[[bodies]]
name = "cart"
mass = 1.0
inertia_com = 0
[[bodies]]
name = "bead"
mass = 2.0
inertia_com = 0
[[joints]]
name = "along"
type = "prismatic"
parent = "world"
child = "cart"
axis = [1, 0]
coordinate = "x"
[[joints]]
name = "across"
type = "prismatic"
parent = "cart"
child = "bead"
axis = [0.6, 0.8]
coordinate = "s"
[[effects]]
type = "motor"
name = "pull"
joint = "along"
torque = "sin(3*t) - 40*x**3"
[[effects]]
type = "motor"
name = "hold"
joint = "across"
torque = "-30*s + x"
[initial]
q = [1.0, 0.5]
v = [0.2, -1.0]
"""
"""Two masses on straight wires: forces depend on positions and time."""


@pytest.mark.every(2)
@pytest.mark.parametrize("rtol", [1e-3, 1e-7])
@pytest.mark.parametrize(
    "scene", some((STIFF, "spinning_top", "two_body_forced"), (STIFF, *built_in_names()))
)
def test_the_bits_are_those_of_python(scene: str, rtol: float) -> None:
    """Steps are rejected; quaternions are normalised, time counts, rows lie in steps."""
    end = 0.2 if scene in ("ragdoll", "walker_motors", "human_figure") else 2.0
    compiled, python = both(scene, integrator="Rodas5P", t_end=end, rtol=rtol, samples=137)
    assert_same(compiled, python)


def test_parameters_inputs_and_the_longest_step_count() -> None:
    options: dict[str, Any] = {
        "parameters": {"m_A": 1.7},
        "inputs": {"tau": 0.3},
        "max_step": 0.01,
        "t_end": 1.0,
        "integrator": "Rodas5P",
    }
    compiled, python = both("two_body_forced", **options)
    assert_same(compiled, python)
    assert compiled.compiled and compiled.trajectory.counts["capped"] > 30
    other = eomgen.simulate("two_body_forced", backend="c", **{**options, "inputs": {}})
    assert not np.array_equal(other.y, compiled.y)


def test_a_run_goes_on_in_either() -> None:
    """What one has begun the other continues, with the control of its steps."""
    options: dict[str, Any] = {"integrator": "Rodas5P", "rtol": 1e-6}
    whole = eomgen.simulate(STIFF, t_end=2.0, backend="numpy", **options)
    for first, second in (("c", "numpy"), ("numpy", "c")):
        begun = eomgen.simulate(STIFF, t_end=1.0, backend=first, **options)
        run = eomgen.simulate(STIFF, t_end=2.0, resume=begun, backend=second, **options)
        assert run.y[-1].tobytes() == whole.y[-1].tobytes()


def test_each_step_is_followed() -> None:
    seen: dict[str, list[tuple[float, bytes]]] = {"c": [], "numpy": []}
    runs = {}
    for backend, steps in seen.items():

        def follow(t: float, y: Any, steps: list[tuple[float, bytes]] = steps) -> bool:
            steps.append((t, y.tobytes()))
            return len(steps) == 30

        options: dict[str, Any] = {"t_end": 9.0, "integrator": "Rodas5P"}
        runs[backend] = eomgen.simulate(STIFF, backend=backend, follow=follow, **options)  # type: ignore[arg-type]
    assert seen["c"] == seen["numpy"] and len(seen["c"]) == 30
    assert_same(runs["c"], runs["numpy"])


def test_aims_are_met_by_the_same_runs() -> None:
    """The stiff method is chosen; trial runs, with constants perturbed, cost the same in either."""
    compiled, python = both(STIFF, accuracy=1e-4, integrator=None, t_end=1.0)
    assert "Rodas5P" in compiled.options
    assert compiled.options == python.options and compiled.error == python.error
    assert_same(compiled, python)


@pytest.mark.every(4)
@pytest.mark.parametrize("method", GAUSS)
@pytest.mark.parametrize(
    "scene", some((STIFF, "spinning_top", "pendulum"), (STIFF, *built_in_names()))
)
def test_equal_steps_have_the_bits_of_python(scene: str, method: str) -> None:
    """Newton's iterations are as many; quaternions are normalised; some of the steps are rows."""
    options: dict[str, Any] = {"integrator": method, "dt": 1e-3, "samples": 7}
    compiled, python = both(scene, t_end=0.0507, **options)
    assert_same(compiled, python)
    assert compiled.trajectory.counts["steps"] == 51 or not compiled.finished


@pytest.mark.every(2)
@pytest.mark.parametrize("method", [*GAUSS, "leapfrog"])
def test_equal_steps_go_on_in_either(method: str) -> None:
    """Also from the middle of a step of the whole run."""
    options: dict[str, Any] = {"integrator": method, "dt": 1e-2}
    whole = eomgen.simulate("pendulum", t_end=1.0, backend="numpy", **options)
    for first, second in (("c", "numpy"), ("numpy", "c"), ("c", "c")):
        begun = eomgen.simulate("pendulum", t_end=0.495, backend=first, **options)
        run = eomgen.simulate("pendulum", t_end=1.0, resume=begun, backend=second, **options)
        assert run.y[-1].tobytes() == whole.y[-1].tobytes()
        assert run.compiled == (second == "c")


@pytest.mark.every(2)
@pytest.mark.parametrize("method", [*GAUSS, "leapfrog"])
def test_equal_steps_fail_alike(method: str) -> None:
    """In the fall into a centre, and where Newton's iteration does not converge."""
    for dt in (1e-3, 0.3):
        compiled, python = both(FALL, t_end=3.0, integrator=method, dt=dt)
        assert_same(compiled, python)


@pytest.mark.every(8)
@pytest.mark.parametrize("scene", [PLANE, FALL, "pendulum"])
@pytest.mark.parametrize("unstable", [False, True])
@pytest.mark.parametrize("method", ["leapfrog", "leapfrog_4", "leapfrog_6"])
def test_leapfrog_has_the_bits_of_python(scene: str, unstable: bool, method: str) -> None:
    """The stability of its steps is judged alike, too."""
    for dt in (1e-3, 0.2):
        options: dict[str, Any] = {"integrator": method, "dt": dt, "unstable": unstable}
        compiled, python = both(scene, t_end=1.03, **options)
        assert_same(compiled, python)


def test_what_fails_fails_alike() -> None:
    compiled, python = both(FALL, t_end=5.0, integrator="Rodas5P")
    assert not compiled.finished and compiled.compiled
    assert_same(compiled, python)


def test_a_long_run_is_compiled_on_its_way(
    empty_store: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It begins in Python. A short one is not compiled, but takes libraries that are there."""
    options: dict[str, Any] = {"integrator": "Rodas5P", "rtol": 1e-6}
    assert not eomgen.simulate(STIFF, t_end=0.01, **options).compiled
    with monkeypatch.context() as patch:
        patch.setattr(accelerator, "STARTING", 1e-3)
        patch.setattr(accelerator, "AN_OPERATION", 0.0)
        run = eomgen.simulate(STIFF, t_end=2.0, **options)
    assert run.compiled
    assert_same(run, eomgen.simulate(STIFF, t_end=2.0, backend="numpy", **options))
    assert eomgen.simulate(STIFF, t_end=0.01, **options).compiled


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_corners_in_time_are_seen(rtol: float) -> None:
    """A force that begins and ends within a moment. Steps are cut there, by the same bits."""
    pushed = FALL.replace("-1/x**2", "1000 if max(0.7 - t, t - 0.701) < 0 else 0")
    compiled, python = both(pushed, t_end=40.0, integrator="Rodas5P", rtol=rtol)
    assert_same(compiled, python)
    assert compiled.compiled
    assert compiled.trajectory.y[-1][1] == pytest.approx(0.5, rel=5 * rtol)


@pytest.mark.parametrize("integrator", ["DOP853", "Rodas5P"])
def test_steps_end_at_known_times_in_both(integrator: str) -> None:
    """At the last double before a pulse of 10 µs begins, and before it ends: none of it is lost."""
    pulse = "1e5*(step(t - 5.00001) - step(t - 5.00002))"
    pushed = FALL.replace("-1/x**2", pulse)
    compiled, python = both(pushed, t_end=10.0, integrator=integrator, rtol=1e-13, atol=1e-12)
    assert_same(compiled, python)
    assert compiled.compiled
    speed = 1e5 * (5.00002 - 5.00001) / 2
    assert compiled.trajectory.y[-1][1] == pytest.approx(speed, rel=1e-9)
    assert compiled.trajectory.counts["derivatives"] < 1000


def test_corners_in_space_are_seen() -> None:
    """Python makes these steps."""
    pushed = FALL.replace("-1/x**2", "-2*max(x, 0)")
    run = eomgen.simulate(pushed, t_end=2.0, integrator="Rodas5P", backend="c")
    assert run.trajectory.y[-1][1] == pytest.approx(-1.0, rel=1e-6)


def test_works_are_the_same() -> None:
    """Their powers need states within steps: Python makes these steps, with functions in C."""
    compiled, python = both(STIFF, integrator="Rodas5P", t_end=0.3, rtol=1e-5, works=True)
    assert_same(compiled, python)
    ours, theirs = compiled.trajectory.works, python.trajectory.works
    assert ours is not None and theirs is not None and ours.tobytes() == theirs.tobytes()


def test_inputs_of_time_count() -> None:
    """The derivative depends on time, though its kernel does not."""
    options = {"inputs": {"tau": lambda t: math.sin(5 * t)}, "t_end": 0.1, "samples": 11}
    runs = [
        eomgen.simulate("two_body_forced", integrator=name, rtol=1e-9, **options)  # type: ignore[arg-type]
        for name in ("Rodas5P", "DOP853")
    ]
    assert np.abs(runs[0].y - runs[1].y).max() < 1e-8
    counts = runs[0].trajectory.counts
    assert counts["derivatives"] >= 11 * counts["steps"], "two for the derivative in time"
