"""Steps of adaptive methods are as long as their error allows, and pass over no branch.

Areas of pulses are known in closed form. Contacts, stops, ropes and kicks of random trees are
compared with runs with very short steps.
"""

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from campaign import FULL, some
from engine import text_of

from eomgen.commands.main import main
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, Adaptive
from eomgen.run.intervals import BY_INTERVALS, Interval
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Problem
from eomgen.run.schedule import Schedule
from eomgen.scalars.functions import BY_MATH, FUNCTIONS
from eomgen.scene.reader import parse_scene

ADAPTIVE = [
    name
    for name, method in INTEGRATORS.items()
    if isinstance(method, Adaptive) and not (name.endswith("_differences") or method.series)
]
INERTIA = 0.4
WHEEL = """
name = "wheel"
parameters = {{ a = 1.0, w = 0.1 }}
bodies = [{{ name = "disc", mass = 1.0, inertia_com = 0.4 }}]
[[joints]]
name = "axle"
type = "revolute"
parent = "world"
child = "disc"
coordinate = "q"
[[effects]]
type = "motor"
name = "m"
joint = "axle"
torque = "{torque}"
"""
PULSES = {
    "product": ("step(t - a)*step(a + w - t)", 1.0),
    "difference": ("step(t - a) - step(t - a - w)", 1.0),
    "one condition": ("1 if (t - a)*(a + w - t) > 0 else 0", 1.0),
    "triangle": ("max(0, 1 - abs(t - a)/w)", 1.0),
    "parabola": ("max(0, 1 - ((t - a)/w)**2)", 4 / 3),
    "bell": ("step(exp(-((t - a)/w)**2) - exp(-1))", 2.0),
    "ramps": ("min(max((t - a)/w, 0), 1) - min(max((t - a - 3*w)/w, 0), 1)", 3.0),
}
"""Torques, and their areas in parts of w."""


@cache
def module(scene: str):
    """The module of a scene."""
    return load_module(text_of(parse_scene(scene)))


@pytest.mark.every(6)
@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("shape", PULSES)
def test_pulses_are_found(shape: str, method: str) -> None:
    """However short it is, and wherever, in a run that takes a single step without it. Steps end at
    its beginning and end, to the bit: none is repeated, and none of its impulse is lost.
    """
    torque, area = PULSES[shape]
    rng = np.random.default_rng(sum(map(ord, shape + method)))
    for _ in range(40 if FULL else 1):
        width = 10 ** rng.uniform(-6, -0.5)
        values = {"a": rng.uniform(0.5, 9.0), "w": width}
        problem = as_problem(module(WHEEL.format(torque=torque)), values)
        run = integrate(problem, method, 10.0, samples=2)
        assert run.y[-1, 1] == pytest.approx(area * width / INERTIA, rel=1e-7, abs=1e-13)
        assert run.counts["cut"] == 0
        assert run.counts["steps"] < 300


@pytest.mark.every(3)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_every_pulse_of_many_is_found(method: str) -> None:
    """A pulse in each period of 0.1 s, one hundredth of it long."""
    scene = WHEEL.format(torque="step(sin(20*pi*t) - cos(pi/100))")
    run = integrate(as_problem(module(scene)), method, 1.0, rtol=1e-6, samples=2)
    assert run.y[-1, 1] == pytest.approx(0.01 / INERTIA, rel=1e-3)


QUADROTOR = """
name = "quadrotor"
parameters = { arm = 0.2, most = 12.0 }
bodies = [{ name = "body", mass = 0.6, inertia_com = 0.02 }]
joints = [{ name = "flight", type = "free", child = "body" }]
[definitions]
lift = "min(max(9.81*0.6 - 4*body_y - 3*body_y_dot, 0), most)/2"
roll = "min(max(0.3*body_x + 0.3*body_x_dot - 2*body_angle - 0.4*body_angle_dot, -1), 1)"
left = "lift - roll"
right = "lift + roll"
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "external_force"
name = "left"
body = "body"
at = ["-arm", 0]
force = ["-left*sin(body_angle)", "left*cos(body_angle)"]
[[effects]]
type = "external_force"
name = "right"
body = "body"
at = ["arm", 0]
force = ["-right*sin(body_angle)", "right*cos(body_angle)"]
[initial]
q = { body_x = 0.3, body_y = -0.2 }
"""
ROPE = """
name = "rope"
bodies = [{ name = "ball", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "flight", type = "free", child = "ball" }]
[[effects]]
type = "spring"
name = "rope"
body_1 = "ball"
body_2 = "world"
stiffness = 20.0
rest_length = 0.5
tension_only = true
[initial]
q = { ball_x = 2.0 }
v = { ball_y_dot = 3.0 }
"""


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("scene", [QUADROTOR, ROPE], ids=["quadrotor", "rope"])
@pytest.mark.every(3)
def test_steps_are_as_long_as_their_error_allows(scene: str, method: str) -> None:
    """A saturated controller and a taut rope take as many steps as without the check."""
    problem = as_problem(module(scene))
    free = integrate(replace(problem, corners=False, switching=None), method, 10.0, rtol=1e-6)
    run = integrate(problem, method, 10.0, rtol=1e-6)
    assert run.finished and problem.corners
    assert run.counts["steps"] <= 1.1 * free.counts["steps"]
    assert run.counts["derivatives"] <= 1.5 * free.counts["derivatives"]
    assert run.counts["capped"] == 0


def tree(seed: int) -> str:
    """A random planar tree that meets stops, the ground, a rope and a kick, each briefly or not at
    all.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    lines = ['name = "tree"']
    if rng.random() < 0.5:
        lines += ["[[effects]]", 'type = "gravity"', "g = 2.0"]
    for i in range(count):
        kind = str(rng.choice(["revolute", "prismatic", "revolute" if i else "free"]))
        lines += ["[[bodies]]", f'name = "b{i}"', f"mass = {rng.uniform(0.3, 2)}"]
        lines += [f"inertia_com = {rng.uniform(0.01, 0.1)}"]
        lines += ["[[joints]]", f'name = "j{i}"', f'type = "{kind}"', f'child = "b{i}"']
        if kind == "free":
            continue
        parent = f"b{rng.integers(0, i)}" if i else "world"
        lines += [f'parent = "{parent}"', f"r_parent = {rng.normal(size=2).tolist()}"]
        lines += [f"r_child = {(0.5 * rng.normal(size=2)).tolist()}"]
        if kind == "prismatic":
            lines += [f"axis = {rng.normal(size=2).tolist()}"]
        if rng.random() < 0.6:
            limit = rng.uniform(0.1, 2)
            lines += ["[[effects]]", 'type = "joint_stop"', f'name = "stop{i}"', f'joint = "j{i}"']
            lines += [f"low = {-limit}", f"high = {limit}"]
            lines += [f"stiffness = {10 ** rng.uniform(1, 5)}"]
            lines += [f"damping = {10 ** rng.uniform(-2, 1)}"]
    last = f"b{count - 1}"
    if rng.random() < 0.6:
        lines += ["[[effects]]", 'type = "contact"', 'name = "ground"', f'body = "{last}"']
        lines += ['law = "spring_damper"', "radius = 0.1", f"offset = {-rng.uniform(0.3, 3)}"]
        lines += [f"stiffness = {10 ** rng.uniform(2, 6)}", f"damping = {10 ** rng.uniform(-1, 1)}"]
    if rng.random() < 0.4:
        lines += ["[[effects]]", 'type = "spring"', 'name = "rope"', f'body_1 = "{last}"']
        lines += ['body_2 = "world"', f"at_2 = {rng.normal(size=2).tolist()}"]
        lines += [f"stiffness = {10 ** rng.uniform(1, 4)}", "tension_only = true"]
        lines += [f"rest_length = {rng.uniform(1, 4)}"]
    start, width = rng.uniform(0.2, 2), 10 ** rng.uniform(-4, -1)
    kick = f"{1 / width}*step(t - {start})*step({start + width} - t)"
    lines += ["[[effects]]", 'type = "external_force"', 'name = "kick"', 'body = "b0"']
    lines += [f'force = ["{kick}", 0]']
    return "\n".join(lines)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(60 if FULL else 1))
def test_brief_contacts_of_random_trees(seed: int) -> None:
    """As close to a run with very short steps as a run with 1000 steps, except where the motion
    amplifies errors, which a run with another tolerance shows.
    """
    problem, t_end = as_problem(module(tree(seed))), some(1.5, 3.0)
    y = problem.initial.copy()
    y[len(y) // 2 :] = 2 * np.random.default_rng(seed).normal(size=len(y) - len(y) // 2)
    problem = replace(problem, initial=y)
    brief = {"samples": 2, "max_step": t_end / some(2000, 5000)}
    true, other = (integrate(problem, "DOP853", t_end, rtol=r, **brief) for r in (1e-11, 1e-10))
    scale = np.maximum(1.0, np.abs(true.y[-1]))
    noise = float(np.max(np.abs(other.y[-1] - true.y[-1]) / scale))
    for method in some(("DOP853",), ADAPTIVE):
        short = integrate(problem, method, t_end, samples=2, max_step=t_end / 1000)
        run = integrate(problem, method, t_end, samples=2)
        off, before = (float(np.max(np.abs(r.y[-1] - true.y[-1]) / scale)) for r in (run, short))
        assert off <= max(1e-6, 1e4 * noise, 30 * before), (method, off, before, noise)


def test_fast_rotation_is_checked_in_every_revolution() -> None:
    """A rotor that only a cam of 4° accelerates, once per revolution: without it, the method would
    cover the whole run in one step.
    """
    scene = WHEEL.format(torque="-0.01*step(cos(q) - cos(pi/90))")
    problem = replace(as_problem(module(scene)), initial=np.array([1.0, 3.0]))
    true = integrate(problem, "DOP853", 10.0, rtol=1e-11, max_step=0.01, samples=2)
    assert true.y[-1, 1] < 2.999
    for method in ("DOP853", "LSODA"):
        run = integrate(problem, method, 10.0, samples=2)
        assert run.y[-1] == pytest.approx(true.y[-1], abs=1e-6), method


@pytest.mark.usefixtures("blank_figures")
def test_a_step_that_cannot_be_followed_is_limited_and_reported(capsys, tmp_path) -> None:
    """With a million revolutions of a cam, steps are limited, and the run reports that."""
    scene = tmp_path / "wheel.toml"
    cam = WHEEL.format(torque="-1e-9*step(cos(q) - cos(pi/90))")
    scene.write_text(cam + "[initial]\nv = { q_dot = 1e6 }\n[simulation]\nt_end = 5\n")
    command = ["simulate", str(scene), "-o", str(tmp_path / "out"), "--rtol", "1e-6"]
    command += ["--no-pictures"]
    assert main(command) == 0
    held = re.search(
        r"(\d+) of (\d+) steps were limited to 1/1000 of the run", capsys.readouterr().out
    )
    assert held and 990 <= int(held[1]) <= int(held[2])
    assert main([*command, "--max-step", "0.1"]) == 0
    held = re.search(r"(\d+) of (\d+) steps were limited by --max-step", capsys.readouterr().out)
    assert held and 40 <= int(held[1]) <= int(held[2]) <= 80


def test_without_switching_functions_steps_are_limited() -> None:
    """Limited steps and steps that are cut are counted."""
    problem = Problem(
        name="kicked",
        states=("q", "v"),
        positions=(0,),
        derivative=lambda t, y: np.array([y[1], float(1.0 < t < 1.02)]),
        jacobian=lambda t, y: np.array([[0.0, 1.0], [0.0, 0.0]]),
        initial=np.zeros(2),
        corners=True,
    )
    run = integrate(problem, "DOP853", 10.0, samples=2)
    assert run.y[-1, 1] == pytest.approx(0.02, abs=1e-9)
    assert 900 <= run.counts["capped"] <= run.counts["steps"]
    free = integrate(replace(problem, corners=False), "DOP853", 10.0, samples=2, max_step=2.0)
    assert free.counts["capped"] >= 3


def test_functions_of_intervals_enclose() -> None:
    """The image of every number in an interval lies in the image of the interval."""
    rng = np.random.default_rng(5)
    for name, arity in FUNCTIONS.items():
        for _ in range(200):
            centres, radii = rng.normal(size=arity) * 3, 10 ** rng.uniform(-9, 1, arity)
            boxes = [Interval(c - r, c + r) for c, r in zip(centres, radii, strict=True)]
            found = BY_INTERVALS[name](*boxes)
            for share in rng.uniform(-1, 1, (10, arity)):
                try:
                    value = BY_MATH[name](*(centres + share * radii).tolist())
                except (ValueError, ArithmeticError):
                    continue
                assert found.low <= value <= found.high, (name, boxes)


def test_arithmetic_of_intervals_encloses() -> None:
    """Sums, products and quotients of intervals and numbers, and of an interval with itself."""
    rng = np.random.default_rng(6)
    for _ in range(2000):
        (a, b), (r, s) = rng.normal(size=2), 10 ** rng.uniform(-6, 0.5, 2)
        x, y = Interval(a - r, a + r), Interval(b - s, b + s)
        u, v = a + rng.uniform(-1, 1) * r, b + rng.uniform(-1, 1) * s
        pairs = [(x + y, u + v), (x - y, u - v), (x * y, u * v), (x * x, u * u), (2.0 - x, 2 - u)]
        pairs += [(x / y, u / v), (3.0 / y, 3 / v), (x * -2.0, -2 * u), (-x, -u)]
        assert all(found.low <= value <= found.high for found, value in pairs)
    assert (x * x).low >= 0 or x.low > 0


def test_changes_in_time_are_found_where_they_are() -> None:
    """All zeros of a wave within a step, to the last digits, however many."""
    sine = BY_INTERVALS["sin"]
    schedule = Schedule(lambda t: [sine(t * 40.0)])
    found, whole = schedule.changes(0.01, 3.0)
    zeros = math.pi / 40 * np.arange(1, 39)
    assert whole and found == pytest.approx(zeros[zeros < 3.0], abs=1e-11)
    assert Schedule(lambda t: [sine(t * 1e9)]).changes(0.01, 3.0)[1] is False
    assert schedule.changes(3.0, 3.01) == ([], True)


def test_steps_end_at_the_last_time_before_a_change() -> None:
    """The next one starts at the double after it, where the derivative has the other branch."""
    for c in (5.00001, 0.1, 7 / 3):
        for sign in (1.0, -1.0):
            last, first = Schedule(lambda t, c=c, s=sign: [(t - c) * s]).first(0.0, 10.0) or (0, 0)
            assert last == (c if sign > 0 else math.nextafter(c, 0.0))
            assert first == math.nextafter(last, 10.0)
    late = Schedule(lambda t: [(t - 1.0) * (t - 1.0 - 1e-12)])
    assert late.first(0.5, 10.0)[0] == math.nextafter(1.0, 0.0)
    assert late.first(1.0, 10.0)[1] == pytest.approx(1.0 + 1e-12, abs=3e-16)


def test_scenes_without_corners_have_no_such_functions() -> None:
    """And their bytes are the same as without the check."""
    smooth = module(WHEEL.format(torque="sin(t)"))
    assert not hasattr(smooth, "switching_functions")
    assert not hasattr(smooth, "switching_functions_of_time")
    timed, both = module(WHEEL.format(torque="step(t - a)")), module(QUADROTOR)
    assert timed.switching_functions_of_time(3.0, np.zeros(2)).tolist() == [2.0]
    assert not hasattr(timed, "switching_functions")
    assert both.switching_functions(0.0, both.initial_state()).shape == (4,)
