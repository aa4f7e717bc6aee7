"""What lies between the steps of a run, and what rounding decides, is not called met; and every
search for a run comes to an end.

Many more of these scenes are drawn by `tests/campaigns/between_steps.py`.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen
from eomgen.run.shaking import EVERY, Shaken

PENDULUM = """
name = "pendulum"
bodies = [{{ name = "a", mass = 1.2, inertia_com = 0.04 }}]
joints = [{{ name = "p", type = "revolute", parent = "world", child = "a", r_child = [-0.35, 0] }}]
effects = [{{ type = "gravity", g = 9.81 }}{more}]
initial = {{ q = [{q}] }}
simulation = {{ t_end = {t_end} }}
"""
SLIDER = """
name = "slider"
bodies = [{{ name = "m", mass = 1.0, inertia_com = 0 }}]
effects = [{{ type = "motor", name = "m", joint = "s", torque = "{force}" }}]
initial = {{ q = [{x}], v = [{v}] }}
simulation = {{ t_end = {t_end} }}
[[joints]]
name = "s"
type = "prismatic"
parent = "world"
child = "m"
axis = [1, 0]
coordinate = "x"
"""
BULLET = """
name = "bullet"
bodies = [{ name = "b", mass = 1.0, inertia_com = 0 }]
joints = [
  { name = "f", type = "particle", parent = "world", child = "b", coordinates = ["x", "y"] },
]
initial = { v = [1000.0, 0.0] }
simulation = { t_end = 0.2 }
[[effects]]
name = "o"
type = "contact"
law = "spring_damper"
body = "b"
radius = 0.0
against = "ball"
other_at = [100.003, 0.0]
other_radius = 0.01
stiffness = 1e12
"""
LIGHT = """
name = "slide"
bodies = [
  { name = "a", mass = 2.0, inertia_com = 0.1 },
  { name = "b", mass = 0.5, inertia_com = 0.01 },
]
initial = { q = [0.7, 0.3] }
simulation = { t_end = 0.05 }
[[joints]]
name = "p"
type = "revolute"
parent = "world"
child = "a"
r_child = [-0.4, 0]
[[joints]]
name = "s"
type = "prismatic"
parent = "a"
child = "b"
r_parent = [0.4, 0]
axis = [1, 0]
coordinate = "x"
[[effects]]
type = "joint_spring"
name = "k"
joint = "s"
stiffness = 1e9
damping = 500.0
rest = 0.3
"""


def chosen(scene: str, accuracy: float, **given: Any) -> eomgen.Run:
    run = eomgen.simulate(scene, accuracy=accuracy, backend="numpy", **given)
    assert run.choice is not None
    return run


@pytest.mark.every(2)
@pytest.mark.parametrize("width", [5e-4, 1e-6])
def test_a_pulse_in_time_is_not_overlooked(width: float) -> None:
    """All tolerances step over it, by some seconds; so their runs agreed."""
    at, most = 5.03171, 0.4 / width
    torque = f"{most!r}*exp(-((t - {at})/{width})**2)"
    motor = f', {{ type = "motor", name = "m", joint = "p", torque = "{torque}" }}'
    run = chosen(PENDULUM.format(more=motor, q=-1.5, t_end=10), 1e-4)

    def f(t: float, y: Any) -> Any:
        push = most * math.exp(-(((t - at) / width) ** 2))
        return [y[1], (push - 1.2 * 9.81 * 0.35 * math.cos(y[0])) / (0.04 + 1.2 * 0.35**2)]

    y, marks = [-1.5, 0.0], (0.0, at - 9 * width, at + 9 * width, 10.0)
    for a, b in pairwise(marks):
        y = solve_ivp(f, (a, b), y, "DOP853", rtol=1e-12, atol=1e-12, max_step=(b - a) / 40).y[
            :, -1
        ]
    assert run.choice.met
    assert run.trajectory.y[-1] == pytest.approx(y, abs=1e-4)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "shape", ["exp(-((x - 3)/w)**2)", "(1 - tanh((x - 3)/w)**2)", "1/(1 + ((x - 3)/w)**4)"]
)
def test_a_bump_in_a_field_is_not_overlooked(shape: str) -> None:
    """It is too high to pass: the body comes back."""
    force = "-1e5*" + shape.replace("w", "1e-4")
    run = chosen(SLIDER.format(force=force, x=0.0, v=2.0, t_end=4), 1e-4)
    assert run.choice.met
    assert run.trajectory.y[-1] == pytest.approx([-2.0, -2.0], abs=1e-3)


def test_a_quotient_slows_down_a_body_that_passes_it() -> None:
    """Quotients count where a formula divides by what moves."""
    force = "-1e4/(1 + ((x - 1.5)/6e-5)**4)"
    run = chosen(SLIDER.format(force=force, x=0.0, v=2.75, t_end=3), 1e-3)
    lost = 2 * 1e4 * 6e-5 * math.pi / math.sqrt(2)
    assert run.choice.met
    assert run.trajectory.y[-1, 1] == pytest.approx(math.sqrt(2.75**2 - lost), abs=1e-3)


def test_a_bullet_meets_a_ball_for_a_moment() -> None:
    """The gap is a root, whose kink no polynomial follows; and in the middle there is no force."""
    run = chosen(BULLET, 1e-6)
    back = 0.2 - 0.099993 - math.pi * 1e-6
    assert run.choice.met
    assert run.trajectory.y[-1] == pytest.approx([99.993 - 1000 * back, 0, -1000, 0], abs=1e-4)


@pytest.mark.every(2)
@pytest.mark.parametrize("given", [{"integrator": "DOP853"}, {"integrator": "Rodas5P"}, {}])
def test_what_rounding_decides_is_not_met(given: dict[str, str]) -> None:
    """Whether the pendulum falls over again is decided by its last bits, not by its constants. An
    implicit method in long steps would keep it standing.
    """
    scene = PENDULUM.format(more="", q=1.5707963266948965, t_end=14)
    run = chosen(scene, 1e-3, **given)
    assert not run.choice.met
    assert "rounding" in run.choice.reason


def test_a_sliding_mode_ends_a_run_in_a_line() -> None:
    force = "-2 if x + 0.5*x_dot > 0 else 2"
    run = chosen(SLIDER.format(force=force, x=0.7, v=0.0, t_end=4), 1e-3)
    assert not run.finished and not run.choice.met
    assert "sliding mode" in run.outcome.reason and "tanh" in run.outcome.remedy
    assert run.choice.runs == 1


def test_a_relay_that_swings_is_no_sliding_mode() -> None:
    """It falls from 0.5 in 1 s, and is back after 4 s."""
    run = chosen(SLIDER.format(force="-1 if x > 0 else 1", x=0.5, v=0.0, t_end=16), 1e-5)
    assert run.choice.met
    assert run.trajectory.y[-1] == pytest.approx([0.5, 0.0], abs=1e-5)


def test_a_setting_that_stays_is_not_tried_again() -> None:
    """The scale of a stiff spring's length is known only from the run, and stays below noise."""
    run = chosen(LIGHT, 1e-3)
    assert run.choice.met and run.choice.runs < 12
    assert run.trajectory.counts["steps"] < 5000


def test_roundings_at_random_have_the_size_of_roundings() -> None:
    """And are others for each seed."""
    y = np.array([1.0, -3.0, 1e-9])
    shaken = [Shaken(lambda t, y: 2 * y, seed) for seed in range(2)]
    found = [[one.derivative(0.0, y) for _ in range(50)] for one in shaken]
    assert not np.array_equal(*found)
    off = np.abs(np.array(found) / (2 * y) - 1)
    assert 2**-53 <= off.max() <= 2**-51
    assert not shaken[0].error(0.0, y, 0.1, EVERY - 1).any()
    assert 0 < np.abs(shaken[0].error(0.0, y, 0.1, 1)).max() < 1e-14
