"""Effects against closed-form and published motions, and against an independent solver.

What is closed-form for one effect alone is with its own tests; here is where effects meet.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from engine import apart, engine, quick
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from scipy.special import ellipj, ellipk
from spatial_newton_euler import carried, solve, under
from spatial_trees import PLANE, SPACE, random_spatial_tree, random_state

M, G = 0.7, 9.81
BALL = """\
name = "ball"
outputs = "all"
dimensions = {}
bodies = [{{ name = "ball", mass = 0.7, inertia_com = {} }}]
joints = [{{ name = "flight", type = "free", child = "ball" }}]
"""
BEAD = """\
name = "bead"
outputs = "all"
dimensions = {}
[[bodies]]
name = "bead"
mass = 0.7
inertia_com = {}
[[joints]]
name = "wire"
type = "prismatic"
parent = "world"
child = "bead"
axis = [1, 0{}]
coordinate = "x"
"""
INERTIA = {PLANE: "0.03", SPACE: "[0.03, 0.03, 0.03]"}
both_dimensions = pytest.mark.parametrize("dimensions", [PLANE, SPACE])


def effect(kind: str, keys: str, name: str = "effect") -> str:
    """A table."""
    return f'[[effects]]\ntype = "{kind}"\nname = "{name}"\n{keys}\n'


def motion(text: str, times: np.ndarray, **start: float) -> dict[str, np.ndarray]:
    """Every state at some times, from the scene's initial state but for what is given."""
    module = quick(text).module
    y = module.initial_state()
    for name, value in start.items():
        y[module.STATES.index(name)] = value
    found = solve_ivp(module.derivative, (0, times[-1]), y, "DOP853", times, rtol=3e-14, atol=1e-14)
    return dict(zip(module.STATES, found.y, strict=True))


def flight(effects: str, dimensions: int) -> str:
    """A free body."""
    return BALL.format(dimensions, INERTIA[dimensions]) + effects


def vector(dimensions: int, *parts: object) -> str:
    """A list of a scene."""
    words = (f'"{p}"' if isinstance(p, str) else str(p) for p in parts[:dimensions])
    return f"[{', '.join(words)}]"


@both_dimensions
def test_a_projectile_with_linear_drag(dimensions: int) -> None:
    """x = u T (1 - e^(-t/T)), z = (w + g T) T (1 - e^(-t/T)) - g T t, T = m/k."""
    text = flight(
        effect("gravity", "g = 9.81", "weight") + effect("drag", 'body = "ball"\nlinear = 0.35'),
        dimensions,
    )
    up = "y" if dimensions == PLANE else "z"
    times, T = np.linspace(0, 4, 9), M / 0.35
    found = motion(text, times, **{"ball_x_dot": 12.0, f"ball_{up}_dot": 15.0})
    risen = T * -np.expm1(-times / T)
    assert apart(found["ball_x"], 12.0 * risen) < 1e-12
    assert apart(found[f"ball_{up}"], (15.0 + G * T) * risen - G * T * times) < 1e-12


@both_dimensions
def test_a_charge_circles_in_a_magnetic_field(dimensions: int) -> None:
    """F = q (E + v × B ẑ): cyclotron motion about a centre that drifts at E/B across both."""
    B, E, rate = 2.1, 0.8, 2.1 / M
    parts = vector(dimensions, f"{B}*vy", f"{E} - {B}*vx", "0")
    text = flight(effect("field", f'body = "ball"\nforce = {parts}'), dimensions)
    times = np.linspace(0, 6, 13)
    up = {"ball_z_dot": 0.6} if dimensions == SPACE else {}
    found = motion(text, times, ball_x_dot=1.7, ball_y_dot=-0.4, **up)
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
    centre = vector(dimensions, 0.4, -0.2, 0.1)
    keys = f'body = "ball"\nkind = "vortex"\nstrength = {c}\npower = 1\ncenter = {centre}'
    text = flight(
        effect("field", keys) + effect("drag", 'body = "ball"\nlinear = 0.3', "air"), dimensions
    )
    times = np.linspace(0, 7, 8)
    found = motion(text, times, ball_x=1.1, ball_y=0.5, ball_x_dot=0.2, ball_y_dot=-0.6)
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
    away = vector(dimensions, -5.0, 0, 0)
    table = {
        "joint_spring": effect(kind, f'joint = "wire"\nlaw = "{law}"'),
        "spring": effect(
            kind,
            f'body_1 = "world"\nat_1 = {away}\nbody_2 = "bead"\nrest_length = 5.0\nlaw = "{law}"',
        ),
        "motor": effect(kind, f'joint = "wire"\ntorque = "{here}"'),
        "field": effect(kind, f'body = "bead"\nforce = {vector(dimensions, here, 0, 0)}'),
    }[kind]
    # In a field x is the point's place, and the coordinate needs another name.
    text = BEAD.format(dimensions, INERTIA[dimensions], ", 0" * (dimensions - 2)) + table
    text = text.replace('coordinate = "x"', 'coordinate = "q"') if kind == "field" else text
    name = "q" if kind == "field" else "x"
    rate = math.sqrt((a + b * A * A) / M)
    modulus = b * A * A / (2 * M * rate**2)
    period = 4 * ellipk(modulus) / rate
    times = np.linspace(0, 2 * period, 9)
    found = motion(text, times, **{name: A})
    assert apart(found[name], A * ellipj(rate * times, modulus)[1]) < 1e-11
    assert abs(found[name][-1] - A) < 1e-11


PENDULUM = """\
name = "pendulum"
outputs = "all"
dimensions = {}
[[bodies]]
name = "bob"
mass = 0.7
inertia_com = {}
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "bob"
r_child = {}
coordinate = "q"
{}
"""


@both_dimensions
@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_a_pendulum_leans_in_the_wind(law: str, dimensions: int) -> None:
    """At rest tan θ = drag/weight; about there it swings at ω² = sqrt(D² + W²)/(m l), damped."""
    k, W, length = 0.4, 5.0, 0.6
    hangs, axis = vector(dimensions, 0, length, 0), ""
    if dimensions == SPACE:
        hangs, axis = "[0, 0, 0.6]", "axis = [0, -1, 0]"
    text = PENDULUM.format(dimensions, "0", hangs, axis)
    wind = vector(dimensions, W, 0, 0)
    text += effect("gravity", "g = 9.81", "weight")
    text += effect("drag", f'body = "bob"\n{law} = {k}\nwind = {wind}', "air")
    module = quick(text).module
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
    keys = 'body = "ball"\nlinear = 0.21\nturning_linear = 0.012'
    times = np.linspace(0, 5, 6)
    text = flight(effect("drag", keys), SPACE)
    names = quick(text).module.STATES[7:]
    found = motion(text, times, **dict(zip(names, (2.0, 0, 0, 3.0, 0, -1.0), strict=True)))
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
    spring = effect("joint_spring", f'joint = "wire"\nstiffness = {k}', "spring")
    hold = f"({Fk} + {F - Fk}*exp(-(({V} - x_dot)/(4*w))**2))*tanh(({V} - x_dot)/w)"
    belt = effect("motor", f'joint = "wire"\ntorque = "{hold}"', "belt")
    text = BEAD.format(PLANE, INERTIA[PLANE], "") + spring + belt + "[parameters]\nw = 1e-4\n"
    module = quick(text).module

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


# Random trees, with the loads put in by hand.


def couple(
    k: int, axes: np.ndarray, torque: np.ndarray
) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """A torque in world axes as two opposite forces."""
    across = np.cross(torque, [0.3, 0.5, -0.7] if torque[2] == 0 else [1.0, 0.2, 0.0])
    arm = across / np.linalg.norm(across)
    force = np.cross(torque, arm)
    return [(k, axes.T @ arm, force), (k, np.zeros(3), -force)]


@pytest.mark.every(4)
@pytest.mark.parametrize("route", ["aba", "ldl"])
@both_dimensions
def test_random_trees_under_fields_forces_and_torques(dimensions: int, route: str) -> None:
    """Formula, attraction, vortex, steering, a planet, body axes, turning drag, a PD and a lag."""
    rng = np.random.default_rng(8)
    seen = 0
    for seed in range(700, 900):
        tree, text = random_spatial_tree(seed, dimensions)
        if tree.pushes or tree.motor < 0 or len(tree.bodies) < 2:
            continue
        seen += 1
        last, flat = len(tree.bodies) - 1, dimensions == PLANE
        at = np.array([0.2, -0.3, 0.0 if flat else 0.15])
        sun = np.array([3.0, 4.0, 0.0 if flat else -5.0])
        rock = np.array([0.7, -2.0, 0.0 if flat else 1.0])
        inner = np.array([0.4, -0.6, 0.0 if flat else 0.8])
        spot, point = vector(dimensions, *at), f"at = {vector(dimensions, *at)}"
        turn = "0.7" if flat else "[0.7, -0.2, 0.4]"
        z = "z" if not flat else "0"
        text += effect(
            "field",
            f'body = "b0"\n{point}\nforce = '
            + vector(dimensions, "y*vx - t", "sin(x) - 2*vy", f"x*{z}"),
            "e1",
        )
        text += effect(
            "field",
            f'body = "b{last}"\n{point}\nkind = "attract"\nstrength = 2.0\n'
            f"power = 3\nsoftening = 0.5\ncenter = {vector(dimensions, *rock)}",
            "e2",
        )
        text += effect(
            "field",
            'body = "b0"\nkind = "vortex"\nstrength = 1.5\npower = 2\n'
            f"center = {vector(dimensions, *sun)}",
            "e3",
        )
        text += effect("point_gravity", f"mu = 6.0\nat = {vector(dimensions, *sun)}", "e4")
        text += effect(
            "external_force",
            f'body = "b{last}"\naxes = "body"\n{point}\nforce = {vector(dimensions, *inner)}',
            "e5",
        )
        text += effect("external_torque", f'body = "b0"\naxes = "body"\ntorque = {turn}', "e6")
        text += effect(
            "drag", f'body = "b{last}"\nturning_linear = 0.2\nturning_quadratic = 0.3', "e7"
        )
        text += effect(
            "pd",
            f'joint = "j{tree.motor}"\ntarget = "sin(t)"\nstiffness = 4.0\n'
            "damping = 0.5\nlimit = 1.5",
            "e8",
        )
        text += effect(
            "field",
            f'body = "b{last}"\nkind = "avoid"\nsteering = 2.0\nradius = 0.5\n'
            f"reach = 9.0\ncenter = {vector(dimensions, *rock)}",
            "e9",
        )
        assert spot in text
        module = engine(text, route, leave_out=("input_jacobian", "parameter_jacobian")).module
        for _ in range(2):
            q, v = random_state(tree, rng)
            t = float(rng.uniform(0, 5))
            plain = solve(replace(tree, pushes=()), q, v)
            states = [carried(plain, k) for k in range(last + 1)]
            loads = []
            place, axes, (p, w) = states[0].place, states[0].axes, states[0].at(at)
            force = np.array([p[1] * w[0] - t, math.sin(p[0]) - 2 * w[1], p[0] * p[2]])
            loads.append((0, at, force))
            r = place - sun
            loads.append(
                (0, np.zeros(3), 1.5 * np.array([-r[1], r[0], 0]) / np.hypot(r[0], r[1]) ** 3)
            )
            loads += couple(0, axes, axes @ np.array([0, 0, 0.7] if flat else [0.7, -0.2, 0.4]))
            for k, (body, moved) in enumerate(zip(tree.bodies, states, strict=True)):
                r = moved.place - sun
                loads.append((k, np.zeros(3), -6.0 * body.mass * r / np.linalg.norm(r) ** 3))
            moved = states[last]
            place, axes, speed, spin = moved.place, moved.axes, moved.velocity, moved.spin
            r = place + axes @ at - rock
            loads.append((last, at, -2.0 * r / (r @ r + 0.25) ** 2))
            loads.append((last, at, axes @ inner))
            loads += couple(last, axes, -(0.2 + 0.3 * np.linalg.norm(spin)) * spin)
            d = rock - place
            gap = np.linalg.norm(d) - 0.5
            near = min(max(1 - gap / 9.0, 0.0), 1.0)
            cosine = max(speed @ d, 0.0) / (np.linalg.norm(speed) * np.linalg.norm(d))
            n = np.cross(speed, d) / np.linalg.norm(np.cross(speed, d))
            size = 2.0 * near**2 * cosine**2 * np.linalg.norm(speed)
            loads.append((last, np.zeros(3), size * np.cross(speed, n)))
            q0, v0 = q[tree.q_slices()[tree.motor]][0], v[tree.v_slices()[tree.motor]][0]
            drive = min(max(4.0 * (math.sin(t) - q0) - 0.5 * v0, -1.5), 1.5)
            expected = under(tree, q, v, loads)
            expected += solve(tree, q, v, {"drive": drive}).accelerations - plain.accelerations
            y = np.zeros(len(module.STATES))
            y[tree.places(module.STATES)] = np.concatenate((q, v))
            found = module.derivative(t, y)[tree.places(module.STATES)][len(q) :]
            assert apart(found, expected) < 1e-10, tree.name
        if seen == 2:
            break
    assert seen == 2
