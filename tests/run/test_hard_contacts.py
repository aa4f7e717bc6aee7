"""Grazing, several contacts at once, and bounces that accumulate."""

import math

import numpy as np
import pytest
from bookkeeping import light

from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.trajectory import Trajectory

DEEPEST = 1e-9
"""Of the size of a mechanism, m here: what is promised."""
G = 9.81


def ran(text: str, method: str, t_end: float, **given: float) -> tuple[Trajectory, np.ndarray]:
    """A run of many rows, and the gaps at each, m."""
    problem = as_problem(light(text).module)
    assert problem.contacts is not None
    step = {"dt": 1e-3} if method == "rk4" else {"rtol": 1e-11, "atol": 1e-13}
    run = integrate(problem, method, t_end, samples=2001, **step, **given)
    assert run.finished, run.message
    rows = zip(run.t, run.y, strict=True)
    return run, np.array([problem.contacts.gaps(t, y) for t, y in rows])


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
