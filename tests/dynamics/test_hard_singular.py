"""Gimbal lock on the way of a run: it goes through, or stops with the reason."""

import math

import numpy as np
import pytest

from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene
from eomgen.study.diagnosis import locks, problem_of


def cardan(initial: str) -> Model:
    """A point mass on a universal joint, a metre below: in line with the first axis at 90°."""
    return elaborate(
        parse_scene(f"""
name = "cardan"
dimensions = 3
bodies = [{{ name = "b", mass = 1.0, inertia_com = [0, 0, 0] }}]
joints = [{{ name = "j", type = "universal", parent = "world", child = "b", r_child = [0, 0, 1] }}]
initial = {{ {initial} }}
[[effects]]
type = "gravity"
g = 9.81
""")
    )


LOCK = "next to nothing resists 'j_angle_1_dot' of joint 'j', gimbal lock: a turn about its axis"


@pytest.mark.parametrize("method", ["DOP853", "rk4"])
def test_a_universal_joint_crosses_gimbal_lock(method: str) -> None:
    """Swung right through it: energy is kept, nothing is nan, and the crossing is named."""
    model = cardan("q = { j_angle_2 = 1.0 }, v = { j_angle_2_dot = 9.0 }")
    module = load_module(python_module(compile_program(model, jacobian=False).system), "cardan")
    step = {"dt": 1e-3} if method == "rk4" else {}
    run = integrate(problem_of(module, model=model), method, 1.0, samples=1001, **step)
    assert run.finished and np.isfinite(run.y).all()
    assert (np.abs(np.cos(run.y[:, 1])) < 0.01).any()
    energy = run.y[:, 3] ** 2 / 2 - 9.81 * np.cos(run.y[:, 1])
    assert np.ptp(energy) < 1e-6
    (line,) = locks(model, run)
    assert LOCK in line
    away = integrate(problem_of(module, model=model), method, 0.01, **step)
    assert locks(model, away) == []


def test_a_start_in_gimbal_lock_stops_with_the_reason() -> None:
    """There a turn about the first axis has no acceleration, and its rate falls at 1e11/s."""
    model = cardan("q = { j_angle_2_deg = 90.0 }, v = { j_angle_1_dot = 1.0 }")
    module = load_module(python_module(compile_program(model, jacobian=False).system), "locked")
    run = integrate(problem_of(module, model=model), "RK45", 1.0)
    assert not run.finished and math.isfinite(run.y[-1].sum())
    assert LOCK in run.message and "take a joint of type 'ball'" in run.message
