"""Controllers with states of their own, against closed forms and hand-written equations."""

import numpy as np
import pytest
from engine import plain, quick, unit_state
from scenes import effect, lone, refusal
from scipy.integrate import solve_ivp

from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS
from eomgen.run.module import as_problem
from eomgen.tables.integrators import GENERAL

INERTIA = 0.4
WHEEL = lone("revolute", on="axle", inertia_com=INERTIA, coordinate="q")
CART = """\
name = "cart"
outputs = "all"
bodies = [
    { name = "cart", mass = 2.0, inertia_com = 0.1 },
    { name = "pole", mass = 0.5, inertia_com = 0.02 },
]
[[joints]]
name = "rail"
type = "prismatic"
parent = "world"
child = "cart"
axis = [1, 0]
coordinate = "s"
[[joints]]
name = "hinge"
type = "revolute"
parent = "cart"
child = "pole"
r_child = [0, 0.4]
coordinate = "q"
[[effects]]
type = "gravity"
g = 9.81
"""
ARM = """\
name = "arm"
dimensions = 3
outputs = "all"
bodies = [
    { name = "upper", mass = 1.0, inertia_com = [0.02, 0.03, 0.04] },
    { name = "lower", mass = 0.5, inertia_com = [0.015, 0.02, 0.03] },
]
[[joints]]
name = "shoulder"
type = "ball"
parent = "world"
child = "upper"
r_child = [0.3, 0, 0.1]
[[joints]]
name = "elbow"
type = "revolute"
parent = "upper"
child = "lower"
axis = [0, 1, 0]
r_parent = [-0.3, 0, 0]
r_child = [0.2, 0, 0.1]
coordinate = "q"
"""
TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}


def servo(kind: str, more: str = "", joint: str = "axle") -> str:
    """A PD or PID controller."""
    integral = {"integral_gain": 7.0} if kind == "pid" else {}
    gains = {"target": 0.5, "stiffness": 10.0, "damping": 1.2, **integral}
    return effect(kind, more, name="hold", joint=joint, **gains)


LOAD = effect("motor", name="load", joint="axle", torque=-1.5)
OWN = """\
[[effects]]
type = "controller"
name = "own"
[effects.states]
z = { initial = 0.3, rate = "q - k*z + u_in", unit = "rad", about = "a filter" }
w = { rate = "z*s_dot - sin(t)" }
[effects.torques]
hinge = "-3*z - 0.2*q_dot"
rail = "-2.0*s - w"
[[effects]]
type = "motor"
name = "u_in"
joint = "rail"
torque = "input"
[parameters]
k = 2.0
"""
SCENES = {
    "pd": CART + servo("pd", joint="hinge"),
    "pd limited": CART + servo("pd", "limit = 0.8", "hinge"),
    "pd lags": CART + servo("pd", "lag = 0.05\nlimit = 0.8", "rail"),
    "pid": CART + servo("pid", "lag = 0.05", "hinge"),
    "pid limited": CART + servo("pid", "limit = 2.0", "hinge"),
    "pid tracks": CART + servo("pid", "limit = 2.0\ntracking = 0.3\nlag = 0.1", "rail"),
    "own": CART + OWN,
    "space": ARM + servo("pid", "limit = 2.0\nlag = 0.1", "elbow"),
}


def response(scene: str, t: float) -> dict[str, float]:
    """The state after t seconds from the start."""
    module = plain(scene).module
    run = solve_ivp(module.derivative, (0, t), module.initial_state(), **TIGHT)
    return dict(zip(module.STATES, run.y[:, -1], strict=True))


def test_pd_step_response() -> None:
    """The step of a damped oscillator (Ogata, Modern Control Engineering, second order)."""
    omega, zeta, t = np.sqrt(10 / INERTIA), 1.2 / (2 * np.sqrt(10 * INERTIA)), 0.9
    damped = omega * np.sqrt(1 - zeta**2)
    wave = np.cos(damped * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(damped * t)
    found = response(WHEEL + servo("pd"), t)
    assert list(found) == ["q", "q_dot"]
    assert np.isclose(found["q"], 0.5 * (1 - np.exp(-zeta * omega * t) * wave), rtol=1e-9)


def test_targets_are_formulas() -> None:
    """With both targets from one motion the wheel, started on it, lacks its inertia alone."""
    target = 'target_rate = "-2*sin(2*t)"\n'
    scene = WHEEL + servo("pd", target).replace("target = 0.5", 'target = "cos(2*t)"')
    module = plain(scene).module
    for t in (0.0, 0.7):
        y = [np.cos(2 * t), -2 * np.sin(2 * t)]
        assert np.allclose(module.derivative(t, np.array(y)), [y[1], 0.0], atol=1e-14)


def test_steady_state_error() -> None:
    """PD gives way by load over stiffness, PID by nothing: its integral holds the load."""
    assert np.isclose(response(WHEEL + LOAD + servo("pd"), 30.0)["q"], 0.5 - 0.15, atol=1e-8)
    found = response(WHEEL + LOAD + servo("pid"), 60.0)
    assert np.isclose(found["q"], 0.5, atol=1e-8)
    assert np.isclose(7.0 * found["hold_integral"], 1.5, atol=1e-7)


def test_saturation() -> None:
    """Away from the target the torque is the limit: the wheel gains speed evenly."""
    found = response(WHEEL + servo("pd", "limit = 0.6"), 0.4)
    assert np.isclose(found["q_dot"], 0.6 / INERTIA * 0.4, rtol=1e-10)
    module = plain(WHEEL + servo("pd", "limit = 0.6")).module
    force = [module.applied_force(0.0, np.array([q, 0.0]))[0] for q in (-9.0, 0.48, 9.0)]
    assert np.allclose(force, [0.6, 0.2, -0.6])


def test_integral_does_not_wind_up() -> None:
    """Held by a load above the limit, z settles where back calculation is at rest."""
    stuck = WHEEL.replace("0.4", "1e9") + servo("pid", "limit = 0.6\ntracking = 0.2")
    z = response(stuck, 20.0)["hold_integral"]  # 0 = e + (0.6 - 10 e - 7 z)/(7 * 0.2) at e = 1/2
    assert np.isclose(z, (0.6 - 5.0 + 1.4 * 0.5) / 7, rtol=1e-4)
    free = response(stuck.replace("limit = 0.6\ntracking = 0.2", ""), 20.0)
    assert np.isclose(free["hold_integral"], 10.0, rtol=1e-2)


def test_saturated_pid() -> None:
    """Against the same controller by hand; with the usual tracking time k_p/k_i."""
    scene = WHEEL + LOAD + servo("pid", "limit = 3.0\nlag = 0.02")

    def by_hand(t: float, y: np.ndarray) -> list[float]:
        q, v, z, torque = y
        wanted = 10 * (0.5 - q) - 1.2 * v + 7 * z
        cut = min(3.0, max(-3.0, wanted))
        rate = 0.5 - q + (cut - wanted) / 10
        return [v, (torque - 1.5) / INERTIA, rate, (cut - torque) / 0.02]

    module = plain(scene).module
    assert module.STATES == ("q", "q_dot", "hold_integral", "hold_torque")
    for seed in range(5):
        y = unit_state(module, seed)
        assert np.allclose(module.derivative(0.0, y), by_hand(0.0, y), rtol=1e-13, atol=1e-13)
    assert np.isclose(response(scene, 40.0)["q"], 0.5, atol=1e-6)


def test_lag() -> None:
    """Toward a constant command the torque goes as 1 - exp(-t/T), and the speed as its integral."""
    scene = WHEEL + servo("pd", "limit = 0.6\nlag = 0.1").replace("0.5", "1e3")
    found, t = response(scene, 0.25), 0.25
    assert np.isclose(found["hold_torque"], 0.6 * (1 - np.exp(-t / 0.1)), rtol=1e-10)
    speed = 0.6 / INERTIA * (t - 0.1 * (1 - np.exp(-t / 0.1)))
    assert np.isclose(found["q_dot"], speed, rtol=1e-9)


def test_negative_gains_on_purpose() -> None:
    """Taken where the scene says so."""
    scene = WHEEL + servo("pd", "allow_active = true").replace("10.0", "-10.0")
    assert np.isclose(plain(scene).module.applied_force(0.0, np.zeros(2))[0], -5.0)


def test_a_sliding_joint() -> None:
    """There the command is a force, along the slide and back on the parent."""
    module = plain(CART + servo("pd", joint="rail")).module
    y = np.array([0.1, 0.0, 0.3, 0.0])
    assert list(module.STATES)[:3:2] == ["s", "s_dot"]
    assert np.allclose(module.applied_force(0.0, y), [10 * 0.4 - 1.2 * 0.3, 0.0])


def test_user_defined() -> None:
    """A controller of formulas, as one would write it by hand for the wheel."""
    scene = WHEEL + (
        '[[effects]]\ntype = "controller"\nname = "own"\n'
        'states = { z = { initial = 0.3, rate = "q - 2*z" }, w = { rate = "z*cos(t) - 0.5*w" } }\n'
        'torques = { axle = "-3*z - 0.2*q_dot + max(w, -0.1)" }\n'
    )

    def by_hand(t: float, y: np.ndarray) -> list[float]:
        q, v, z, w = y
        torque = -3 * z - 0.2 * v + max(w, -0.1)
        return [v, torque / INERTIA, q - 2 * z, z * np.cos(t) - 0.5 * w]

    module = plain(scene).module
    assert module.initial_state().tolist() == [0.0, 0.0, 0.3, 0.0]
    exact = solve_ivp(by_hand, (0, 3), [0, 0, 0.3, 0], **TIGHT).y[:, -1]
    assert np.allclose(list(response(scene, 3.0).values()), exact, atol=1e-9)


def test_numbers_are_parameters() -> None:
    """Gains, rates and torques that are bare numbers can be changed afterwards."""
    scene = WHEEL + (
        '[[effects]]\ntype = "controller"\nname = "own"\n'
        "states = { z = { rate = 0.25 } }\ntorques = { axle = 0.8 }\n"
    )
    module = plain(scene).module
    assert module.PARAMETERS["own_z_rate"] == 0.25 and module.PARAMETERS["own_torques_axle"] == 0.8
    rates = module.derivative(0.0, np.zeros(3), {"own_torques_axle": 4.0, "own_z_rate": 5.0})
    assert np.allclose(rates, [0.0, 10.0, 5.0])
    module = plain(WHEEL + servo("pid", "limit = 3.0\nlag = 0.02")).module
    names = ("target", "stiffness", "damping", "integral_gain", "limit", "lag")
    assert all(f"hold_{name}" in module.PARAMETERS for name in names)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SCENES)
def test_dynamics_with_states(name: str) -> None:
    """Forward and inverse dynamics take the states as `x`, and answer each other."""
    module = quick(SCENES[name]).module
    rng = np.random.default_rng(2)
    y = unit_state(module, 2)
    extra = len(quick(SCENES[name]).model.extra)
    nq = len(module.POSITIONS)
    q, v, x = y[:nq], y[nq : len(y) - extra], y[len(y) - extra :]
    tau = rng.normal(size=len(v))
    given = {"x": x} if extra else {}
    vd = module.forward_dynamics(q, v, tau, t=0.4, **given)
    assert np.allclose(module.inverse_dynamics(q, v, vd, t=0.4, **given), tau, atol=1e-10)
    plain = module.forward_dynamics(q, v, t=0.4, **given)
    assert np.allclose(plain, module.derivative(0.4, y)[nq : nq + len(v)], atol=1e-10)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "integrator",
    [name for name in GENERAL if not name.startswith(("leapfrog", "taylor"))],
)
def test_integrators(integrator: str) -> None:
    """Each goes its way with states that are neither positions nor velocities."""
    scene = WHEEL + LOAD + servo("pid", "lag = 0.05")
    problem = as_problem(quick(scene).module)
    exact = list(response(scene, 0.5).values())
    adaptive = hasattr(INTEGRATORS[integrator], "uses_jacobian")
    kept = {"rtol": 1e-8, "atol": 1e-10} if adaptive else {"dt": 5e-4}
    run = integrate(problem, integrator, 0.5, **kept)
    assert run.finished
    off = 1e-5 if adaptive else {"euler": 1e-2, "semi_implicit_euler": 1e-2}.get(integrator, 1e-6)
    assert np.allclose(run.y[-1], exact, atol=off)


CONTROLLER = '[[effects]]\ntype = "controller"\nname = "own"\n{}\n'
MISTAKES = [
    (CONTROLLER.format('torques = { axel = "1" }'), "effects[0].torques.axel: no revolute or "
     "prismatic joint is named 'axel' (did you mean 'axle'?)"),
    (CONTROLLER.format("torques = {}"), "effects[0].torques: has 0 entries; give at least 1"),
    (CONTROLLER.format("states = { z = { rate = 1 } }"),
     "effects[0].torques: missing; every such table needs it"),
    (CONTROLLER.format('states = { z = { rate = "zz" } }\ntorques = { axle = "z" }'),
     "effects[0].states.z.rate: unknown parameter 'zz' (did you mean 'z'?)"),
    (CONTROLLER.format('states = { z = { rat = 1 } }\ntorques = { axle = "z" }'),
     "effects[0].states.z.rat: unknown key (did you mean 'rate'?)"),
    (CONTROLLER.format('states = { z = { rate = "__import__" } }\ntorques = { axle = "zeta" }'),
     "effects[0].states.z.rate: '__import__' has '__import__' at column 1; a name starts with a "
     "letter, does not end in _, and contains no __"),
    (CONTROLLER.format('states = { q = { rate = "1" } }\ntorques = { axle = "q" }'),
     "effects[0]: 'q' would be the name of a state and of a coordinate (joints[0]); rename one of "
     "them"),
    (CONTROLLER.format('states = { t = { rate = "1" } }\ntorques = { axle = "t" }'),
     "effects[0]: 't' would be the name of a state and of time; rename one of them"),
    (CONTROLLER.format('states = { hold_torque = { rate = "1" } }\ntorques = { axle = "t" }')
     + servo("pd", "lag = 0.1"),
     "effects[1]: 'hold_torque' would be the name of a state and of another (effects[0]); rename "
     "one of them"),
]  # fmt: skip


@pytest.mark.parametrize(("more", "message"), MISTAKES)
def test_mistakes(more: str, message: str) -> None:
    """One line: place, value, remedy."""
    assert refusal(WHEEL + more) == message
