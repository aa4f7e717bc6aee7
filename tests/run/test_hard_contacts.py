"""Grazing, several contacts at once, and bounces that accumulate."""

import math

import numpy as np
import pytest
from bookkeeping import light

from eomgen.engine.contacts import RISE
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.trajectory import Trajectory

DEEPEST = 1e-9
"""Of the size of a mechanism, m here: what is promised."""
G = 9.81
SWING = 0.5


def pendulum(below: float) -> str:
    """A ball on a rod, let go from the level, whose lowest point is so far above a floor, m."""
    return f"""
name = "graze"
bodies = [{{ name = "b", mass = 0.5, inertia_com = 0 }}]
initial = {{ q = {{ j_angle = 1.5 }} }}
[[joints]]
name = "j"
type = "revolute"
parent = "world"
child = "b"
r_child = [0, {SWING}]
[[effects]]
type = "gravity"
g = {G}
[[effects]]
type = "contact"
name = "floor"
law = "impact"
body = "b"
radius = 0.125
offset = {-SWING - 0.125 - below!r}
restitution = 1.0
"""


def ran(text: str, method: str, t_end: float, **given: float) -> tuple[Trajectory, np.ndarray]:
    """A run of many rows, and the gaps at each, m."""
    problem = as_problem(light(text).module)
    assert problem.contacts is not None
    step = {"dt": 1e-3} if method == "rk4" else {"rtol": 1e-11, "atol": 1e-13}
    run = integrate(problem, method, t_end, samples=2001, **step, **given)
    assert run.finished, run.message
    rows = zip(run.t, run.y, strict=True)
    return run, np.array([problem.contacts.gaps(t, y) for t, y in rows])


@pytest.mark.parametrize("method", ["rk4", "DOP853"])
@pytest.mark.parametrize("below", [1e-6, 1e-12, 0.0, -1e-12, -1e-6, -1e-3])
@pytest.mark.every(3)
def test_grazing(method: str, below: float) -> None:
    """A floor just missed, just touched, or just hit, in two swings: the run comes to its end,
    keeps its energy, and is never deeper than is stated. What misses is not disturbed.
    """
    run, gaps = ran(pendulum(below), method, 3.0)
    assert gaps.min() > -DEEPEST
    energy = SWING * run.y[:, 1] ** 2 / 2 - G * np.cos(run.y[:, 0])
    assert np.ptp(energy) < 1e-8
    if below > 1e-9:
        assert not run.events
    if below < -1e-9:
        first = next(event for event in run.events if event.kind == "impact")
        angle = math.acos(1 + below / SWING)
        speed = math.sqrt(2 * G / SWING * (math.cos(angle) - math.cos(1.5)))
        assert abs(first.speed - speed * SWING * math.sin(angle)) < 1e-6


ROD = f"""
name = "rod"
bodies = [{{ name = "b", mass = 2.0, inertia_com = 0.25 }}]
joints = [{{ name = "j", type = "free", child = "b" }}]
points = [
    {{ name = "left", body = "b", at = [-0.5, 0] }},
    {{ name = "middle", body = "b", at = [0, 0] }},
    {{ name = "right", body = "b", at = [0.5, 0] }},
]
initial = {{ q = {{ b_y = 1.0 }}, v = {{ b_x_dot = 0.5 }} }}
[[effects]]
type = "gravity"
g = {G}
[[effects]]
type = "contact"
name = "floor"
law = "impact"
points = ["left", "middle", "right"]
radius = 0.125
restitution = E
"""


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_rod_falls_flat_on_three_balls(e: float) -> None:
    """Three contacts at one moment: no energy is made, all of it is kept where nothing takes any,
    what moves along the floor goes on, and in the end it lies flat.
    """
    run, gaps = ran(ROD.replace("E\n", f"{e}\n"), "DOP853", 6.0 if e else 1.0)
    assert gaps.min() > -DEEPEST
    y, v = run.y[:, 1], run.y[:, 3:]
    energy = v[:, 0] ** 2 + v[:, 1] ** 2 + 0.125 * v[:, 2] ** 2 + 2 * G * y
    assert np.diff(energy).max() < 1e-9
    np.testing.assert_allclose(v[:, 0], 0.5, rtol=0, atol=1e-12)
    first = min(event.t for event in run.events)
    assert abs(first - math.sqrt(2 * 0.875 / G)) < 1e-12
    if e == 1.0:
        assert np.ptp(energy) < 1e-8
    else:
        assert np.max(np.abs(gaps[-1])) < DEEPEST
        assert np.max(np.abs(v[-1, 1:])) < 1e-9
        assert {k.contact for k in run.events if k.kind == "rest"} >= {"floor_left", "floor_right"}


@pytest.mark.parametrize("e", [0.5, 0.9, 0.97])
def test_bounces_that_accumulate_end(e: float) -> None:
    """Zeno's ball: infinitely many bounces within √(2h/g) (1 + e)/(1 - e). It lies still from the
    first that would rise by less than is stated, and with no energy left.
    """
    height = 0.5
    text = f"""
name = "zeno"
bodies = [{{ name = "b", mass = 1.0, inertia_com = 0 }}]
joints = [{{ name = "j", type = "prismatic", parent = "world", child = "b", axis = [0, 1] }}]
initial = {{ q = {{ j_slide = {height + 0.125} }} }}
[[effects]]
type = "gravity"
g = {G}
[[effects]]
type = "contact"
name = "floor"
law = "impact"
body = "b"
radius = 0.125
restitution = {e}
"""
    end = math.sqrt(2 * height / G) * (1 + e) / (1 - e)
    run, gaps = ran(text, "DOP853", 1.1 * end)
    assert gaps.min() > -DEEPEST
    rest = [event for event in run.events if event.kind == "rest"]
    assert len(rest) == 1
    size = 0.125  # the greatest length of the scene, but for where it starts
    least = math.sqrt(2 * RISE * size * G)
    speed = math.sqrt(2 * G * height)
    bounces = 1 + math.floor(math.log(least / speed) / math.log(e))
    assert run.counts["impacts"] == bounces
    left = 2 * speed * e ** (bounces + 1) / G / (1 - e)
    assert abs(end - rest[0].t - left) < 1e-9
    assert abs(run.y[-1, 1]) < 1e-12 and abs(gaps[-1, 0]) < DEEPEST * size
