"""Effects against closed-form and published motions, and against an independent solver.

What is closed-form for one effect alone is with its own tests; here is where effects meet.
"""

import math

import numpy as np
import pytest
from engine import apart, motion, quick
from scenes import WEIGHT, effect, free, lone
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from scipy.special import ellipj, ellipk
from spatial_trees import PLANE, SPACE

M, G = 0.7, 9.81
both_dimensions = pytest.mark.parametrize("dimensions", [PLANE, SPACE])


def moved(text: str, times: np.ndarray, **start: float) -> dict[str, np.ndarray]:
    """Every state at some times, from the scene's initial state but for what is given."""
    made = quick(text)
    y = made.module.initial_state()
    for name, value in start.items():
        y[made.module.STATES.index(name)] = value
    found = motion(made, times, y, rtol=3e-14, atol=1e-14)
    return dict(zip(made.module.STATES, found, strict=True))


def flight(effects: str, dimensions: int) -> str:
    """A free body."""
    return free("ball", mass=M, inertia_com=0.03, dimensions=dimensions) + effects


def bead(*effects: str, dimensions: int = PLANE, coordinate: str = "x") -> str:
    """A body on a wire along x."""
    axis, own = [1, 0, 0][:dimensions], {"mass": M, "inertia_com": 0.03}
    return lone(
        "prismatic", *effects, body="bead", on="wire", dimensions=dimensions, axis=axis,
        coordinate=coordinate, **own,
    )  # fmt: skip


@both_dimensions
def test_a_projectile_with_linear_drag(dimensions: int) -> None:
    """x = u T (1 - e^(-t/T)), z = (w + g T) T (1 - e^(-t/T)) - g T t, T = m/k."""
    text = flight(
        WEIGHT + effect("drag", body="ball", linear=0.35),
        dimensions,
    )
    up = "y" if dimensions == PLANE else "z"
    times, T = np.linspace(0, 4, 9), M / 0.35
    found = moved(text, times, **{"ball_x_dot": 12.0, f"ball_{up}_dot": 15.0})
    risen = T * -np.expm1(-times / T)
    assert apart(found["ball_x"], 12.0 * risen) < 1e-12
    assert apart(found[f"ball_{up}"], (15.0 + G * T) * risen - G * T * times) < 1e-12


@both_dimensions
def test_a_charge_circles_in_a_magnetic_field(dimensions: int) -> None:
    """F = q (E + v × B ẑ): cyclotron motion about a centre that drifts at E/B across both."""
    B, E, rate = 2.1, 0.8, 2.1 / M
    parts = [f"{B}*vy", f"{E} - {B}*vx", "0"][:dimensions]
    text = flight(effect("field", body="ball", force=parts), dimensions)
    times = np.linspace(0, 6, 13)
    up = {"ball_z_dot": 0.6} if dimensions == SPACE else {}
    found = moved(text, times, ball_x_dot=1.7, ball_y_dot=-0.4, **up)
    # In the frame of the drift E/B x̂ the velocity only turns, clockwise.
    turning = (1.7 - E / B - 0.4j) * np.exp(-1j * rate * times)
    place = E / B * times + (turning - turning[0]) / (-1j * rate)
    assert apart(found["ball_x_dot"] + 1j * found["ball_y_dot"], E / B + turning) < 1e-11
    assert apart(found["ball_x"] + 1j * found["ball_y"], place) < 1e-11
    if dimensions == SPACE:
        assert apart(found["ball_z"], 0.6 * times) < 1e-13


@both_dimensions
def test_a_vortex_spins_up(dimensions: int) -> None:
    """Strength c r̂⊥/r has the torque c wherever a body is: with drag its angular momentum about
    the centre is L = L₀ e^(-t/T) + c T (1 - e^(-t/T)), T = m/k.
    """
    c, T = 0.9, M / 0.3
    keys = {"strength": c, "power": 1, "center": [0.4, -0.2, 0.1][:dimensions]}
    vortex = effect("field", 'kind = "vortex"', body="ball", **keys)
    text = flight(vortex + effect("drag", name="air", body="ball", linear=0.3), dimensions)
    times = np.linspace(0, 7, 8)
    found = moved(text, times, ball_x=1.1, ball_y=0.5, ball_x_dot=0.2, ball_y_dot=-0.6)
    x, y = found["ball_x"] - 0.4, found["ball_y"] + 0.2
    L = M * (x * found["ball_y_dot"] - y * found["ball_x_dot"])
    fade = np.exp(-times / T)
    assert apart(L, L[0] * fade + c * T * (1 - fade)) < 1e-11
    assert np.ptp(np.hypot(x, y)) > 1.0  # the body goes far, and L does not mind


@pytest.mark.every(2)
@both_dimensions
@pytest.mark.parametrize("kind", ["joint_spring", "spring", "motor", "field"])
def test_duffing_in_elliptic_functions(kind: str, dimensions: int) -> None:
    """m ẍ = -(a x + b x³) from rest at A: x = A cn(Ω t | k²), Ω² = (a + b A²)/m,
    k² = b A²/(2 m Ω²), period 4 K/Ω.
    """
    a, b, A = 3.0, 8.0, 0.9
    law = f"{a}*stretch + {b}*stretch**3"
    here = f"-({a}*x + {b}*x**3)"
    tied = {"body_1": "world", "at_1": [-5.0, 0, 0][:dimensions], "body_2": "bead"}
    table = {
        "joint_spring": effect(kind, joint="wire", law=law),
        "spring": effect(kind, **tied, rest_length=5.0, law=law),
        "motor": effect(kind, joint="wire", torque=here),
        "field": effect(kind, body="bead", force=[here, 0, 0][:dimensions]),
    }[kind]
    # In a field x is the point's place, and the coordinate needs another name.
    name = "q" if kind == "field" else "x"
    text = bead(table, dimensions=dimensions, coordinate=name)
    rate = math.sqrt((a + b * A * A) / M)
    modulus = b * A * A / (2 * M * rate**2)
    period = 4 * ellipk(modulus) / rate
    times = np.linspace(0, 2 * period, 9)
    found = moved(text, times, **{name: A})
    assert apart(found[name], A * ellipj(rate * times, modulus)[1]) < 1e-11
    assert abs(found[name][-1] - A) < 1e-11


@both_dimensions
@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_a_pendulum_leans_in_the_wind(law: str, dimensions: int) -> None:
    """At rest tan θ = drag/weight; about there it swings at ω² = sqrt(D² + W²)/(m l), damped."""
    k, W, length = 0.4, 5.0, 0.6
    hangs = {"r_child": [0, length]}
    if dimensions == SPACE:
        hangs = {"r_child": [0, 0, length], "axis": [0, -1, 0]}
    air = effect("drag", f"{law} = {k}", name="air", body="b", wind=[W, 0, 0][:dimensions])
    own = {"dimensions": dimensions, "mass": M, "inertia_com": 0, **hangs}
    module = quick(lone("revolute", WEIGHT, air, coordinate="q", **own)).module
    drag = k * W if law == "linear" else k * W * W
    lean = math.atan(drag / (M * G))
    assert abs(module.derivative(0.0, np.array([lean, 0.0]))[1]) < 1e-13 * G
    stiff = math.hypot(drag, M * G) / (M * length)
    # Along the wire the quadratic drag is twice as steep as across: 2 cos² + sin².
    steep = 1.0 if law == "linear" else W * (1 + math.cos(lean) ** 2)
    slopes = module.jacobian(0.0, np.array([lean, 0.0]))
    assert slopes == pytest.approx(np.array([[0, 1], [-stiff, -k * steep / M]]), rel=1e-13)


def test_a_spinning_ball_slows_by_its_two_drags() -> None:
    """Turning and moving do not mix: ω and v fade each at their own rate."""
    times = np.linspace(0, 5, 6)
    text = flight(effect("drag", body="ball", linear=0.21, turning_linear=0.012), SPACE)
    names = quick(text).module.STATES[7:]
    found = moved(text, times, **dict(zip(names, (2.0, 0, 0, 3.0, 0, -1.0), strict=True)))
    assert apart(found[names[0]], 2.0 * np.exp(-0.21 / M * times)) < 1e-12
    assert apart(found[names[3]], 3.0 * np.exp(-0.012 / 0.03 * times)) < 1e-12
    assert apart(found[names[5]], -np.exp(-0.012 / 0.03 * times)) < 1e-12


def test_a_mass_on_a_belt_sticks_and_slips() -> None:
    """A spring holds a mass on a belt at V. It sticks until k x = F_s, then slips under F_k; with
    Δ = F_s - F_k, ω² = k/m, the period is 2 Δ/(k V) + (2/ω) (π - atan(Δ ω/(k V))) of Coulomb's law
    without smoothing. Smoothed over a speed w, it slips late as every slow passage of a fold does,
    by a time in proportion to w^(2/3): two runs show that, and what remains at w = 0.
    """
    k, V, F, Fk = 20.0, 0.3, 4.0, 1.5
    rate = math.sqrt(k / M)

    def smoothed(slip: float) -> float:
        return -(Fk + (F - Fk) * math.exp(-((slip / 4) ** 2))) * math.tanh(slip)

    largest = -minimize_scalar(smoothed, bounds=(0, 10), method="bounded").fun
    step = largest - Fk
    period = 2 * step / (k * V) + 2 / rate * (math.pi - math.atan(step * rate / (k * V)))

    def rests(t: float, y: np.ndarray) -> float:
        return y[1]

    rests.direction = -1.0  # type: ignore[attr-defined]
    spring = effect("joint_spring", name="spring", joint="wire", stiffness=k)
    hold = f"({Fk} + {F - Fk}*exp(-(({V} - x_dot)/(4*w))**2))*tanh(({V} - x_dot)/w)"
    belt = effect("motor", name="belt", joint="wire", torque=hold)
    module = quick(bead(spring, belt, "[parameters]\nw = 1e-4\n")).module

    def measured(w: float) -> float:
        run = solve_ivp(
            lambda t, y: module.derivative(t, y, {"w": w}),
            (0, 3.2 * period),
            [0.0, V],
            "Radau",
            events=rests,
            jac=lambda t, y: module.jacobian(t, y, {"w": w}),
            rtol=1e-8,
            atol=1e-11,
        )
        first, second = np.diff(run.t_events[0])
        assert abs(second - first) < 1e-6  # a limit cycle
        return second

    late = [measured(w) - period for w in (2e-4, 1e-4)]
    assert math.log2(late[0] / late[1]) == pytest.approx(2 / 3, abs=0.01)
    share = 2 ** (2 / 3)
    assert abs(share * late[1] - late[0]) / (share - 1) < 2e-5 * period
