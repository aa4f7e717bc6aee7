"""Rigid contacts from the scene to the end of a run, against closed forms."""

import math

import numpy as np
import pytest
from campaign import some
from engine import Engine, apart, plain
from scipy.special import ellipk

from eomgen.run.integrate import integrate
from eomgen.run.module import as_powers, as_problem
from eomgen.run.trajectory import Trajectory

G = 9.81
GRAVITY = f'[[effects]]\ntype = "gravity"\ng = {G}\n'


def ran(
    made: Engine, t_end: float, integrator: str = "DOP853", rest_speed: float | None = None
) -> Trajectory:
    """A scene's run, with the works of its effects."""
    return integrate(
        as_problem(made.module),
        integrator,
        t_end,
        dt=1e-3 if integrator == "rk4" else None,
        rtol=1e-11,
        atol=1e-12,
        powers=as_powers(made.module),
        rest_speed=rest_speed,
    )


def unaccounted(made: Engine, run: Trajectory) -> float:
    """The most by which kinetic energy and works differ."""
    assert run.works is not None
    energy = np.array([made.module.kinetic_energy(t, y) for t, y in zip(run.t, run.y, strict=True)])
    return apart(energy - energy[0], run.works.sum(axis=1))


def impacts(run: Trajectory) -> list[float]:
    """When things struck, and bounced."""
    return [event.t for event in run.events if event.kind == "impact"]


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_ball_bounces_and_rests(dimensions: int) -> None:
    """After the first fall in √(2h/g) each flight takes e times the one before; then it lies."""
    e, h, r = 0.6, 0.8, 0.1
    up = "yz"[dimensions - 2]
    made = plain(f"""
name = "ball"
outputs = "all"
dimensions = {dimensions}
bodies = [{{ name = "b", mass = 0.3, inertia_com = {"1e-3" if dimensions == 2 else [1e-3] * 3} }}]
joints = [{{ name = "j", type = "free", child = "b" }}]
initial = {{ q = {{ b_{up} = {h + r} }} }}
{GRAVITY}
[[effects]]
type = "contact"
name = "floor"
law = "impact"
body = "b"
radius = {r}
restitution = {e}
""")
    run = ran(made, 4.0, rest_speed=1e-3)
    fall = math.sqrt(2 * h / G)
    found = impacts(run)
    count = 1 + int(math.log(1e-3 / math.sqrt(2 * G * h)) / math.log(e))
    expected = fall * (1 + 2 * np.cumsum([0.0, *(e**k for k in range(1, count))]))
    assert len(found) == count
    assert apart(found, expected) < 1e-10
    height = run.y[:, made.module.STATES.index(f"b_{up}")]
    assert height.min() > r - 1e-9
    assert abs(height[-1] - r) < 1e-9
    assert [event.kind for event in run.events][-1] == "rest"
    assert unaccounted(made, run) < 1e-9


@pytest.mark.parametrize("integrator", ["DOP853", "rk4"])
def test_a_pendulum_bounces_off_its_stop(integrator: str) -> None:
    """Halves of its swing: each rebound rises to e² of the energy before."""
    e = 0.8
    made = plain(f"""
name = "gate"
outputs = "all"
bodies = [{{ name = "b", mass = 0.4, inertia_com = 0 }}]
joints = [{{ name = "j", type = "revolute", parent = "world", child = "b", r_child = [0, 0.5] }}]
initial = {{ q = {{ j_angle = 1.0 }} }}
{GRAVITY}
[[effects]]
type = "joint_stop"
name = "post"
joint = "j"
low = 0.0
restitution = {e}
""")
    height = 0.5 * (1 - math.cos(1.0))
    times, t = [], 0.0
    for k in range(3):
        angle = math.acos(1 - e ** (2 * k) * height / 0.5)
        quarter = math.sqrt(0.5 / G) * ellipk(math.sin(angle / 2) ** 2)
        t += quarter * (1 if k == 0 else 2)
        times.append(t)
    run = ran(made, times[-1] + 1e-6, integrator)
    assert apart(impacts(run), times) < (1e-9 if integrator == "DOP853" else 1e-7)
    assert unaccounted(made, run) < 1e-8


def test_a_block_slides_down_a_slope() -> None:
    """With g (sin α - μ cos α), but for the smoothing of friction; a steep one slides, a flat one
    creeps no faster than that says.
    """
    made = {
        angle: plain(f"""
name = "slope"
outputs = "all"
bodies = [{{ name = "b", mass = 1.5, inertia_com = 0.01 }}]
joints = [{{ name = "j", type = "free", child = "b" }}]
{GRAVITY}
[[effects]]
type = "contact"
name = "slope"
law = "impact"
body = "b"
corners = [0.2, 0.1]
normal = [{-math.sin(angle)!r}, {math.cos(angle)!r}]
restitution = 0.0
friction = 0.3
slip_speed = 1e-3
[initial.q]
b_x = {-0.1 * math.sin(angle)!r}
b_y = {0.1 * math.cos(angle)!r}
b_angle = {angle!r}
""")
        for angle in (0.2, 0.5)
    }
    run = ran(made[0.5], 1.0, "LSODA")
    speed = np.linalg.norm(run.y[-1, 3:5])
    assert abs(speed - G * (math.sin(0.5) - 0.3 * math.cos(0.5))) < 2e-3
    assert abs(run.y[-1, 5]) < 1e-9
    assert unaccounted(made[0.5], run) < 1e-7
    share = math.tan(0.2) / 0.3
    creep = 1e-3 * share / math.sqrt(1 - share**2)
    run = ran(made[0.2], 0.5, "LSODA")
    assert abs(np.linalg.norm(run.y[-1, 3:5]) - creep) < 1e-3 * creep


def test_two_bodies_bounce_until_they_lie_still() -> None:
    """The built-in scene: all energy is accounted for, nothing sinks in, and it ends at rest."""
    made = plain("bouncing_two_body")
    run = ran(made, 5.5)
    assert run.finished
    assert unaccounted(made, run) < 1e-7
    gaps = np.array([made.module.gaps(t, y) for t, y in zip(run.t, run.y, strict=True)])
    assert gaps.min() > -1e-8
    assert np.max(np.abs(gaps[-1])) < 1e-8
    assert np.max(np.abs(run.y[-1, 5:])) < 0.05  # friction is smoothed: it never quite sticks
    assert {e.contact for e in run.events if e.kind == "rest"} == set(made.module.CONTACTS)


SHORT = some(["DOP853", "LSODA"], ["DOP853", "RK45", "Radau", "BDF", "LSODA"])


@pytest.mark.every(2)
@pytest.mark.parametrize("integrator", SHORT)
def test_no_step_leaps_over_what_is_short(integrator: str) -> None:
    """A stiff ball between two far walls, and then a pulse of a force: steps would like to be long.

    The walls give back its speed, and the pulse, 100 N for 20 ms on 1 kg, adds 2 m/s.
    """
    wall = '[[effects]]\ntype = "contact"\nlaw = "hunt_crossley"\nbody = "b"\nstiffness = 1e8\n'
    made = plain(
        'name = "court"\noutputs = "all"\n'
        'bodies = [{ name = "b", mass = 1.0, inertia_com = 0 }]\n'
        'joints = [{ name = "p", type = "prismatic", parent = "world", child = "b", '
        "axis = [1, 0] }]\n"
        "initial = { v = { p_slide_dot = 1.0 } }\n"
        f'{wall}name = "right"\nnormal = [-1, 0]\noffset = -1\n'
        f'{wall}name = "left"\nnormal = [1, 0]\noffset = -1\n'
        '[[effects]]\ntype = "external_force"\nname = "kick"\nbody = "b"\n'
        'force = ["100*step(t - 5.2)*step(5.22 - t)", 0]\n'
    )
    run = ran(made, 4.9, integrator)
    found = run.y[:, 1]
    assert np.count_nonzero(np.diff(np.sign(found))) == 2  # at 1 and 3 s
    assert abs(found[-1] - 1.0) < 1e-4
    run = ran(made, 5.3, integrator)
    assert abs(run.y[-1, 1] - 1.0) < 1e-2  # -1 at the wall, and 2 by the pulse
    assert not run.counts["capped"]
