"""Rigid contact on driven bodies: bounces on a shaken floor by hand, and where the energy goes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from engine import MP, STEP, apart, engine, exact, plain
from scipy.optimize import brentq

from eomgen.run.integrate import integrate
from eomgen.run.module import as_powers, as_problem

G, RADIUS, BALL, FLOOR = 9.81, 0.3, 2.0, 3.0
SHAKEN = """\
name = "shaken"
outputs = ["kinetic_energy", "potential_energy", "effect_powers"]
parameters = { a = 0.03, w = 20.0, e = 0.5 }
bodies = [
    { name = "floor", mass = 3.0, inertia_com = 0.1 },
    { name = "ball", mass = 2.0, inertia_com = 0.03 },
]
joints = [
    { name = "lift", type = "prismatic", parent = "world", child = "floor", axis = [0, 1] },
    { name = "flight", type = "free", child = "ball" },
]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "driven"
name = "shaker"
joint = "lift"
coordinate = "a*sin(w*t)"
[[effects]]
type = "contact"
name = "ground"
law = "impact"
body = "ball"
radius = 0.2
other = "floor"
offset = 0.1
restitution = "e"
"""
METHODS = {
    "DOP853": {"rtol": 1e-11, "atol": 1e-13},
    "Radau": {"rtol": 1e-10, "atol": 1e-12},
    "rk4": {"dt": 1e-3},
}


def bounces(height: float, t_end: float, a: float, w: float, e: float) -> list[tuple[float, float]]:
    """Times and speeds: between them parabolas, at them -e times the velocity against the floor."""
    t, y, v = 0.0, height, 0.0
    found: list[tuple[float, float]] = []
    while True:

        def gap(s: float, t: float = t, y: float = y, v: float = v) -> float:
            return y + v * (s - t) - G * (s - t) ** 2 / 2 - a * math.sin(w * s) - RADIUS

        times = np.linspace(t + 1e-6, t_end, 2001)
        below = [i for i, s in enumerate(times) if gap(s) < 0]
        if not below:
            return found
        s = float(brentq(gap, times[below[0] - 1], times[below[0]], xtol=1e-15))
        y, v, floor = (
            y + v * (s - t) - G * (s - t) ** 2 / 2,
            v - G * (s - t),
            a * w * math.cos(w * s),
        )
        found.append((s, floor - v))
        t, v = s, floor - e * (v - floor)


@pytest.mark.parametrize("name", METHODS)
def test_a_ball_bounces_on_a_shaken_floor(name: str) -> None:
    """Between bounces steps are long, as a parabola has no error, and the floor's drive is fast:
    its work is to be right all the same.
    """
    module = plain(SHAKEN).module
    start = replace(as_problem(module), initial=np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    run = integrate(start, name, 1.2, powers=as_powers(module), **METHODS[name])
    assert run.finished and run.works is not None
    found = [(event.t, event.speed) for event in run.events]
    expected = bounces(1.0, 1.2, 0.03, 20.0, 0.5)
    assert len(expected) == 4
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    energy = [float(module.kinetic_energy(t, y)) for t, y in zip(run.t, run.y, strict=True)]
    change = np.subtract(energy, energy[0])
    np.testing.assert_allclose(run.works.sum(axis=1), change, rtol=0, atol=1e-6)
    assert abs(run.works[-1].sum() - change[-1]) < 1e-11


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["DOP853", "rk4"])
def test_a_drive_bears_what_rests_on_its_floor(name: str) -> None:
    """Its work is what both bodies' energy grows by; the contact does none."""
    module, p = plain(SHAKEN).module, {"a": 0.02, "w": 15.0, "e": 0.0}
    start = replace(as_problem(module, p), initial=np.array([0.0, 0.3, 0.0, 0.0, 0.3, 0.0]))
    given = {"dt": 5e-4} if name == "rk4" else METHODS[name]
    run = integrate(start, name, 0.5, powers=as_powers(module, p), **given)
    assert [event.kind for event in run.events] == ["rest"]
    assert run.works is not None
    height, speed = 0.02 * np.sin(15 * run.t), 0.3 * np.cos(15 * run.t)
    expected = (BALL + FLOOR) * (G * height + (speed**2 - 0.3**2) / 2)
    works = dict(zip(run.work_names, run.works.T, strict=True))
    np.testing.assert_allclose(works["shaker"], expected, rtol=0, atol=1e-7)
    np.testing.assert_allclose(works["ground"], 0.0, atol=1e-9)


ARMS = """\
name = "arms"
dimensions = 3
bodies = [
    { name = "base", mass = 1.5, inertia_com = [0.05, 0.06, 0.07] },
    { name = "upper", mass = 0.9, inertia_com = [0.02, 0.03, 0.025] },
    { name = "lower", mass = 0.6, inertia_com = [0.01, 0.012, 0.011] },
]
[[joints]]
name = "table"
type = "revolute"
parent = "world"
child = "base"
axis = [0, 0.6, 0.8]
r_child = [0.1, 0, 0.2]
[[joints]]
name = "shoulder"
type = "ball"
parent = "base"
child = "upper"
r_parent = [0.2, 0.1, 0]
r_child = [0, 0, 0.3]
orientation_deg = [20, 30, 40]
[[joints]]
name = "elbow"
type = "prismatic"
parent = "upper"
child = "lower"
axis = [0.6, 0, 0.8]
r_parent = [0, 0, -0.3]
[[effects]]
type = "contact"
name = "floor"
law = "impact"
bodies = ["lower", "upper"]
radius = 0.1
restitution = 0.5
friction = 0.4
slip_speed = 0.1
other = "base"
normal = [0.1, 0.2, 0.9]
[[effects]]
type = "driven"
name = "reach"
joint = "elbow"
coordinate = "0.2*sin(3*t)"
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "driven"
name = "spin"
joint = "table"
coordinate = "0.4*t*t"
"""


@pytest.mark.every(2)
@pytest.mark.parametrize("route", ["aba", "ldl"])
def test_powers_under_contact_forces_add_up(route: str) -> None:
    """Of contacts, drives, in the order of the effects, and weight: dE/dt, in 60 digits."""
    e = engine(ARMS, route, leave_out=("jacobian", "parameter_jacobian"))
    ny, nc, t, forces = len(e.module.STATES), 2, MP.mpf("0.7"), [30.0, 70.0]
    y = exact(e.random_state(np.random.default_rng(6)))
    rates, _, contacts, drives = np.split(
        e.exactly("held", y, extra=forces, t=t), [ny, ny + nc, ny + 2 * nc]
    )
    ahead, behind = (e.exactly("kinetic_energy", y + h * rates, t=t + h) for h in (STEP, -STEP))
    gained = (ahead - behind) / (2 * STEP)
    weight = e.exactly("effect_powers", y, t=t)[e.module.EFFECT_NAMES.index("gravity")]
    assert apart(gained, weight + contacts.sum() + drives.sum()) < 1e-14
    assert as_problem(e.module).contacts.drives == ("reach", "spin")
    # Without forces they are those of `effect_powers`.
    alone = e.exactly("held", y, extra=[0.0, 0.0], t=t)[ny + 2 * nc :]
    assert apart(alone, e.exactly("effect_powers", y, t=t)[[1, 3]]) < 1e-50
