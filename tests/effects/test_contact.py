"""Contact: closed forms of both soft laws, friction, an independent solver, energy, rigid contacts.

Up is y in the plane and z in space; n is the normal, d how deep things overlap. "Exactly" is in 60
digits.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from engine import MP, Digits, Engine, along, apart, engine, exact
from scenes import WEIGHT, effect, lone, refusal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from spatial_newton_euler import STILL, SpatialMotion, carried, solve, under
from spatial_trees import PLANE, SPACE, SpatialTree, random_spatial_tree, random_state

from eomgen.commands.main import main
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.model.elaborate import elaborate
from eomgen.scalars.exact import Real
from eomgen.scene.effects.base import Contact, JointLoad, Load
from eomgen.scene.effects.vectors import NEAREST
from eomgen.scene.reader import parse_scene
from eomgen.tables.outputs import OUTPUTS

M, R, G = 2.0, 0.25, 9.81
KEPT = ("applied_force", "kinetic_energy", "potential_energy", "momentum")
DAMPED = 'law = "spring_damper"', "stiffness = 900.0", "damping = 13.0"
SPRING = 'law = "spring_damper"', "stiffness = 900.0"
HUNT = 'law = "hunt_crossley"', "stiffness = 900.0", "dissipation = 0.4"
HERTZ = 'law = "hunt_crossley"', "stiffness = 900.0"
RUB = "friction = 0.4", "slip_speed = 0.05"
RIGID = 'law = "impact"', "restitution = 0.6", "friction = 0.3", "slip_speed = 0.01"
contact = partial(effect, "contact")


def free(*names: str, dimensions: int = PLANE, inertia: float = 0.4 * M * R * R) -> str:
    """Bodies that nothing holds, spheres of radius R unless another inertia is given."""
    return scenes.free(*names, mass=M, inertia_com=inertia, dimensions=dimensions)


@cache
def made(text: str, route: str = "aba", *, tangents: bool = True, jacobian: bool = True) -> Engine:
    """A scene, compiled; with `tangents` no Jacobian is written out."""
    left_out = tuple(name for name in OUTPUTS if name not in KEPT)
    left_out += () if jacobian else ("jacobian",)
    return engine(text, route, leave_out=left_out, tangents=tangents)


def state(found: Engine, **values: float) -> np.ndarray:
    """A state, 0 but for these and unturned."""
    y = np.zeros(len(found.module.STATES))
    for indices in map(list, found.module.QUATERNIONS):
        y[indices[0]] = 1.0
    for name, value in values.items():
        y[found.module.STATES.index(name)] = value
    return y


def run(found: Engine, y0: np.ndarray, t_end: float) -> Callable[[float], dict[str, float]]:
    """The motion from a state by the names of its parts, good to 1e-10 or so."""
    f = found.module.derivative
    step = {"rtol": 1e-11, "atol": 1e-13, "dense_output": True, "max_step": t_end / 50}
    motion = solve_ivp(f, (0.0, t_end), y0, "DOP853", **step)
    assert motion.success
    return lambda t: dict(zip(found.module.STATES, motion.sol(t), strict=True))


def exact_dynamics(found: Engine, y: np.ndarray) -> Dynamics:
    """The model at a state, in 60 digits."""
    model = found.model
    parameters = {p.name: MP.mpf(p.default) for p in model.parameters}
    nq = len(model.coordinates)
    values = [MP.mpf(x) for x in y]
    return Dynamics(
        model, Values(parameters, {}, values[:nq], values[nq:], {}, MP.mpf(0)), Written()
    )


class Written(Digits):
    """60 digits, but directions and rotations of the scene are doubles, as in the module."""

    def number(self, value: Real) -> Any:
        """The double next to the value, exactly."""
        return super().number(float(value))


# One body on the ground, in closed form.


def test_a_spring_and_damper_throw_back_as_the_damped_oscillator() -> None:
    """The force ends at tan ωt = -c ω/(k - c β), before d does; speed there by the closed form."""
    found = made(free("b") + contact('body = "b"', "radius = 0.25", *DAMPED))
    k, c, v0 = 900.0, 13.0, 1.7
    beta = c / (2 * M)
    w = math.sqrt(k / M - beta * beta)
    end = math.atan2(c * w, c * beta - k) / w
    motion = run(found, state(found, b_y=R, b_y_dot=-v0), 2 * end)
    for t in (0.2 * end, 0.7 * end, end):
        d = v0 / w * math.exp(-beta * t) * math.sin(w * t)
        speed = v0 * math.exp(-beta * t) * (math.cos(w * t) - beta / w * math.sin(w * t))
        assert motion(t)["b_y"] == pytest.approx(R - d, abs=1e-9)
        assert motion(t)["b_y_dot"] == pytest.approx(-speed, abs=1e-8)
    assert 0.6 * v0 < -speed < 0.7 * v0  # it bounces, and not as fast as it came
    assert motion(2 * end)["b_y_dot"] == pytest.approx(-speed, abs=1e-8)


@pytest.mark.parametrize("a", [0.02, 0.4, 3.0])
def test_hunt_and_crossley_s_law_keeps_its_first_integral(a: float) -> None:
    """With A = 1.5 a and G(v) = v/A - ln(1 + A v)/A², G(ḋ) + 2/5 k/m d^2.5 never changes.

    So G(-e v) = G(v) gives the restitution e, and e = 1 - a v + O(a v)² as in the paper.
    """
    v0, k, big_a = 1.3, 900.0, 1.5 * a
    law = 'law = "hunt_crossley"', "stiffness = 900.0", f"dissipation = {a}"
    found = made(free("b") + contact('body = "b"', "radius = 0.25", *law))
    motion = run(found, state(found, b_y=R, b_y_dot=-v0), 0.6)

    def g(v: float) -> float:
        return v / big_a - math.log1p(big_a * v) / big_a**2

    for t in (0.02, 0.08, 0.12, 0.6):
        now = motion(t)
        d = max(R - now["b_y"], 0.0)
        kept = g(-now["b_y_dot"]) + 0.4 * k / M * d**2.5
        assert kept == pytest.approx(g(v0), rel=1e-7)
    lowest = -min(v0, (1 - 1e-12) / big_a)
    back = brentq(lambda v: g(v) - g(v0), lowest, -1e-9, xtol=1e-14)
    out = motion(0.6)
    assert out["b_y"] > R
    assert out["b_y_dot"] == pytest.approx(-back, rel=1e-7)
    if a == 0.02:
        assert out["b_y_dot"] / v0 == pytest.approx(1 - a * v0, abs=(a * v0) ** 2)


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("law", [DAMPED, HUNT])
def test_a_box_stands_on_its_corners(dimensions: int, law: tuple[str, ...]) -> None:
    """Its lower corners carry the weight, and it stays; tipped, the force is at the lowest one."""
    sizes, up = ("[0.5, 0.3, 0.2]", "z") if dimensions == SPACE else ("[0.5, 0.2]", "y")
    box = contact('body = "b"', f"corners = {sizes}", "offset = -0.7", *law, *RUB)
    found = made(free("b", dimensions=dimensions) + WEIGHT + box)
    load = M * G / (4 if dimensions == SPACE else 2) / 900.0
    d = load if law == DAMPED else load ** (2 / 3)
    standing = state(found, **{f"b_{up}": -0.7 + 0.2 - d})
    assert np.abs(found.module.derivative(0.0, standing)).max() < 1e-13
    deeper = state(found, **{f"b_{up}": -0.7 + 0.2 - 2 * d})
    lift = found.module.derivative(0.0, deeper)[found.module.STATES.index(f"b_{up}_dot")]
    assert lift == pytest.approx(G * (1 if law == DAMPED else 2**1.5 - 1))
    if dimensions == PLANE:
        angle = 0.3
        lowest = -0.5 * math.sin(angle) - 0.2 * math.cos(angle)
        tipped = state(found, b_y=-0.7 - lowest - d, b_angle=angle)
        force = found.module.applied_force(0.0, tipped)
        arm = -0.5 * math.cos(angle) + 0.2 * math.sin(angle)
        assert force == pytest.approx([0.0, load * 900.0, arm * load * 900.0], abs=1e-12)


def slide(speed: float, slip_speed: float) -> float:
    """∫ u du/(u/sqrt(u² + s²)) / (μ g): how far a block slides from a speed to its stop."""
    root = math.hypot(speed, slip_speed)
    return (speed * root + slip_speed**2 * math.asinh(speed / slip_speed)) / (2 * 0.4 * G)


def test_a_block_slides_to_a_stop_where_friction_says() -> None:
    """v²/(2 μ g) (1 + ε), ε = (s/v)² (½ + ln(2 v/s)) as the docstring says; and the creep."""
    rub = "friction = 0.4", "slip_speed = 0.01"
    found = made(free("b") + WEIGHT + contact('body = "b"', *DAMPED, *rub))
    motion = run(found, state(found, b_y=-M * G / 900.0, b_x_dot=1.5), 0.6)
    assert motion(0.6)["b_x"] == pytest.approx(slide(1.5, 0.01), abs=1e-8)
    plain, s = 1.5**2 / (2 * 0.4 * G), 0.01 / 1.5
    assert motion(0.6)["b_x"] / plain - 1 == pytest.approx(
        s * s * (0.5 + math.log(2 / s)), rel=1e-3
    )
    # On a slope of a fraction ρ of friction's angle it creeps at s ρ/sqrt(1 - ρ²).
    angle, rho = math.atan(0.4 * 0.9), 0.9
    n = f"normal = [{-math.sin(angle)}, {math.cos(angle)}]"
    found = made(free("b") + WEIGHT + contact('body = "b"', n, *DAMPED, *rub))
    deep, creep = M * G * math.cos(angle) / 900.0, 0.01 * rho / math.sqrt(1 - rho * rho)
    down = np.array([-math.cos(angle), -math.sin(angle)]) * creep
    held = state(
        found,
        b_x=math.sin(angle) * deep,
        b_y=-math.cos(angle) * deep,
        b_x_dot=down[0],
        b_y_dot=down[1],
    )
    assert found.module.derivative(0.0, held)[3:] == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("shape", ["disc", "sphere"])
def test_what_slides_ends_up_rolling(shape: str) -> None:
    """A disc at 2/3 of its speed, a sphere at (5 v + 2 r ω × n)/7, whatever the friction."""
    law = ('law = "spring_damper"', "stiffness = 9000.0", "damping = 250.0", *RUB)
    table = contact('body = "b"', f"radius = {R}", *law)
    if shape == "disc":
        found = made(free("b", inertia=0.5 * M * R * R) + WEIGHT + table)
        out = run(found, state(found, b_y=R - M * G / 9000.0, b_x_dot=2.0), 1.0)(1.0)
        assert out["b_x_dot"] == pytest.approx(4 / 3, rel=1e-9)
        assert out["b_angle_dot"] == pytest.approx(-4 / 3 / R, rel=1e-9)
        return
    found = made(free("b", dimensions=SPACE) + WEIGHT + table)
    v, w = np.array([2.0, -1.0, 0.0]), np.array([3.0, -4.0, 5.0])
    names = [name for name in found.module.STATES if name.endswith(("wx", "wy", "wz"))]
    spins = dict(zip(names, w, strict=True))
    start = state(found, b_z=R - M * G / 9000.0, b_x_dot=v[0], b_y_dot=v[1], **spins)
    out = run(found, start, 1.2)(1.2)
    rolling = (5 * v + 2 * R * np.cross(w, [0.0, 0.0, 1.0])) / 7
    assert [out["b_x_dot"], out["b_y_dot"]] == pytest.approx(rolling[:2], rel=1e-8)


# Random trees, with the loads put in by hand.


ORIGIN = np.zeros(3)
Put = tuple[int, np.ndarray, np.ndarray]


def soft(law: tuple[str, ...], d: float, rate: float, slip: np.ndarray, n: np.ndarray) -> Any:
    """The force of a law on the first of two that touch, from the docstring."""
    if d <= 0:
        return ORIGIN
    force = 900.0 * d + 13.0 * rate if law == DAMPED else 900.0 * d**1.5 * (1 + 0.6 * rate)
    force = max(force, 0.0)
    return force * n - 0.4 * force * slip / math.sqrt(slip @ slip + 0.05**2)


def put_in(law: tuple[str, ...], p: np.ndarray, n: np.ndarray, d: float, *ends: Any) -> list[Put]:
    """What the two bodies get at a point of both that p is; each end is a body and its motion."""
    spots = [body.axes.T @ (p - body.place) for _, body in ends]
    (_, one), (_, other) = (body.at(at) for (_, body), at in zip(ends, spots, strict=True))
    u = one - other
    force = soft(law, d, -float(n @ u), u - (n @ u) * n, n)
    puts = zip((1, -1), ends, spots, strict=True)
    return [(k, at, sign * force) for sign, (k, _), at in puts if k >= 0]


def loads_by_hand(tree: SpatialTree, motion: SpatialMotion, law: tuple[str, ...]) -> list[Put]:
    """Of the contacts of the test below."""
    last, zs = len(tree.bodies) - 1, tree.dimensions == SPACE
    slant = np.array([0.3, 0.2, 1.0]) if zs else np.array([0.3, 1.0, 0.0])
    slant = slant / np.linalg.norm(slant)
    at = np.array([0.1, -0.2, 0.3 * zs])
    still = (-1, STILL)
    ends = {k: (k, carried(motion, k)) for k in (0, last)}
    first, final = ends[0][1], ends[last][1]
    found = []
    for signs in product((-1, 1), repeat=3 if zs else 2):  # corners on a slanted plane
        half = np.array([*signs, 0.0])[:3] * np.array([0.3, 0.2, 0.4])
        corner, _ = first.at(at + half)
        p = corner - 0.05 * slant
        found += put_in(law, p, slant, 0.2 - slant @ p, ends[0], still)
    on = first.axes @ (np.array([0.0, -0.6, 0.8]) if zs else np.array([-0.6, 0.8, 0.0]))
    a, b = first.at(at)[0], final.at(at)[0]
    p = b - 0.7 * on  # a sphere on a plane of a body
    found += put_in(law, p, on, 0.1 - on @ (p - first.place), ends[last], ends[0])
    d = np.linalg.norm(a - b)
    p = b + (a - b) * 0.9 / 2.0  # two spheres, divided as their radii
    found += put_in(law, p, (a - b) / d, 2.0 - float(d), ends[0], ends[last])
    d = np.linalg.norm(b - np.array([0.5, -0.5, 0.0]))
    n = (b - np.array([0.5, -0.5, 0.0])) / d  # a point in a sphere of the world
    return found + put_in(law, b, n, 1.4 - float(d), ends[last], still)


@pytest.mark.parametrize("route", ["aba", "ldl"])
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("law", [DAMPED, HUNT])
@pytest.mark.every(6)
def test_random_trees_move_as_under_loads_put_in_by_hand(
    law: tuple[str, ...], dimensions: int, route: str
) -> None:
    """All four kinds at once, against a solver that shares nothing."""
    rng, tried, worked = np.random.default_rng(3), 0, 0
    for seed in range(500, 600):
        tree, text = random_spatial_tree(seed, dimensions)
        if tree.pushes or len(tree.bodies) not in (2, 3):
            continue
        tried += 1
        first, last, zs = "b0", f"b{len(tree.bodies) - 1}", dimensions == SPACE
        at = f"at = [0.1, -0.2{', 0.3' * zs}]"
        text += contact(
            f'body = "{first}"', at, f"corners = [0.3, 0.2{', 0.4' * zs}]", "radius = 0.05",
            f"normal = [0.3, {'0.2, 1' if zs else '1'}]", "offset = 0.2", *law, *RUB, name="e1",
        )  # fmt: skip
        text += contact(
            f'body = "{last}"', at, f'other = "{first}"', "offset = 0.1", "radius = 0.7",
            f"normal = {'[0, -3, 4]' if zs else '[-3, 4]'}", *law, *RUB, name="e2",
        )  # fmt: skip
        text += contact(
            f'bodies = ["{first}", "{last}"]', 'against = "each_other"', at, "radius = 0.9",
            f"radii = {{ {first} = 1.1 }}", *law, *RUB, name="e3",
        )  # fmt: skip
        text += contact(
            f'body = "{last}"', at, 'against = "ball"', f"other_at = [0.5, -0.5{', 0' * zs}]",
            "other_radius = 1.4", *law, *RUB, name="e4",
        )  # fmt: skip
        module = made(text, route, jacobian=False).module
        places = tree.places(module.STATES)
        for _ in range(3):
            q, v = random_state(tree, rng)
            u = tree.random_inputs(rng)
            motion = solve(tree, q, v, u)
            puts = loads_by_hand(tree, motion, law)
            worked += sum(bool(np.any(force)) for _, _, force in puts)
            expected = under(tree, q, v, puts, u)
            y = tree.state(module.STATES, q, v)
            rates = module.derivative(0.0, y, None, u)[places][len(q) :]
            assert apart(rates, expected) < 1e-10, tree.name
        if tried == 2:
            break
    assert worked >= 20


# Energy, momentum and derivatives, exactly.

EACH = 'against = "each_other"'
BALL = 'against = "ball"', "other_radius = 1.2"
OFF_CENTRE = 'against = "ball"', "other_AT", "radius = 0.7", "other_radius = 1.1"
ROD = 'rod = { body = "a", at = [0.3, -0.2~], end = [-0.9, 0.5~], radius = 0.3 }'
EGG = 'egg = { body = "b", at = [0.3, -0.2~], semi_axes = [1.1, 0.5~], TURN }'
CRATE = 'crate = { body = "a", half_sizes = [1.1, 0.5~], radius = 0.1, TURN }'
ROCK = 'rock = { body = "a", vertices = [[0.8, 0.1~], [-0.3, 0.7~], [-0.6, -0.9~]] }'
BAR = 'bar = { body = "b", at = [0.1, 0.4~], end = [0.2, -0.9~], radius = 0.9 }'
CHEST = 'chest = { body = "a", half_sizes = [0.3, 0.5~], radius = 0.2 }'
BRICK = 'brick = { body = "b", half_sizes = [0.2, 0.3~], at = [0.7, 0.1~], radius = 0.8 }'
GEOMETRY = {
    "points on a plane": ('bodies = "all"', "offset = 0.3"),
    "off-centre spheres on a slope": ('bodies = ["a", "b"]', "radius = 0.8", "AT", "NORMAL"),
    "a box on a slope": ('body = "a"', "AT", "CORNERS", "NORMAL"),
    "a rounded box on a body": ('body = "a"', "CORNERS", "radius = 0.2", "NORMAL", 'other = "b"'),
    "spheres": ('bodies = "all"', EACH, "AT", "radius = 0.9", "radii = { a = 1.4 }"),
    "a point in the world's sphere": ('body = "a"', 'against = "ball"', "AT", "other_radius = 2.0"),
    "spheres off-centre": ('body = "a"', 'other = "b"', *OFF_CENTRE),
    "shapes on a slope": (f"shapes = {{ {ROD}, {EGG}, {ROCK} }}", "NORMAL"),
    "shapes on each other": (f"shapes = {{ {ROD}, {BAR}, {CHEST}, {BRICK} }}", EACH),
    "shapes on a ball": (f"shapes = {{ {ROD}, {CHEST} }}", *BALL),
    "shapes on hills": (
        f"shapes = {{ {ROD}, {ROCK}, {CHEST} }}", 'against = "heights"',
        'height = "0.4*sin(2*x) + 0.3*x*x"'),
    "a box on a body": (f"shapes = {{ {CRATE} }}", "NORMAL", 'other = "b"'),
}  # fmt: skip
VECTORS = {"AT": "at = [0.3, -0.2", "NORMAL": "normal = [0.5, -1", "CORNERS": "corners = [0.9, 0.6"}
VECTORS["other_AT"] = "other_at = [0.1, 0.4"


def scene(geometry: str, dimensions: int, *lines: str) -> str:
    """Two free bodies and a contact."""
    end = ", 0.4]" if dimensions == SPACE else "]"
    own = [VECTORS[line] + end if line in VECTORS else line for line in GEOMETRY[geometry]]
    turn = f"orientation_deg = {'[20, -50, 35]' if dimensions == SPACE else 35}"
    own = [line.replace("~]", end).replace("TURN", turn) for line in own]
    return free("a", "b", dimensions=dimensions, inertia=0.3) + contact(*own, *lines)


def states(found: Engine, seed: int, count: int) -> Iterator[np.ndarray]:
    """Random states in 60 digits, with quaternions of length 1 there."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        y = exact(found.random_state(rng))
        for indices in map(list, found.module.QUATERNIONS):
            y[indices] = y[indices] / MP.sqrt(sum(y[indices] ** 2))
        yield y


def power(dynamics: Dynamics, loads: tuple[Load | JointLoad, ...]) -> Any:
    """What loads do to the motion, W."""
    total = MP.mpf(0)
    for load in loads:
        if isinstance(load, JointLoad):
            total += load.force * dynamics.rate(load.joint)
            continue
        parts = zip(load.force, dynamics.velocity(load.body, load.at), strict=True)
        total += sum(f * v for f, v in parts)
        total += sum(
            m * w for m, w in zip(load.torque, dynamics.angular_velocity(load.body), strict=False)
        )
    return total


def wrench(dynamics: Dynamics, loads: tuple[Load | JointLoad, ...]) -> np.ndarray:
    """The force of loads and their moment about the origin, six components."""
    total = np.array([MP.mpf(0)] * 6)
    pad = [MP.mpf(0)] * 3
    for load in loads:
        assert isinstance(load, Load)
        force, place = ([*x, *pad][:3] for x in (load.force, dynamics.position(load.body, load.at)))
        torque = [*pad, *load.torque][-3:] if load.torque else pad
        total += np.array([*force, *(np.cross(place, force) + torque)])
    return total


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("geometry", GEOMETRY)
@pytest.mark.parametrize("law", [SPRING, HERTZ, (*HUNT, *RUB)])
@pytest.mark.every(14)
def test_the_change_of_energy_is_the_power_of_the_contacts(
    law: tuple[str, ...], geometry: str, dimensions: int
) -> None:
    """Elastic ones keep energy, others only lose it; between bodies momentum is kept, too."""
    found = made(scene(geometry, dimensions, *law))
    (effect,) = found.model.effects
    worked, between = 0.0, effect.other != "world" or EACH in GEOMETRY[geometry]
    for y in states(found, 5, 4 if dimensions == PLANE else 2):
        rate, here = found.exactly("derivative", y), exact_dynamics(found, y)
        done = here.power(effect)
        size = 1 + abs(done)
        kinetic = along(partial(found.exactly, "kinetic_energy"), y, rate)
        stored = along(partial(found.exactly, "potential_energy"), y, rate)
        assert abs(kinetic - done) < 1e-25 * size
        if law in (SPRING, HERTZ):
            assert abs(kinetic + stored) < 1e-25 * size
        else:
            assert kinetic + stored < 1e-25 * size
        worked += abs(float(done))
        if between:
            change = along(partial(found.exactly, "momentum"), y, rate)
            assert np.max(np.abs(change)) < 1e-25 * size
            assert abs(here.power(effect) - power(here, tuple(effect.loads(here)))) < 1e-40 * size
    assert worked > 0.1


@pytest.mark.parametrize("law", [SPRING, DAMPED, (*HUNT, *RUB)])
def test_just_touching_is_smooth(law: tuple[str, ...]) -> None:
    """At d = 0 and next to it, from both sides: no force of d, and finite slopes."""
    found = made(free("b", dimensions=SPACE) + contact('body = "b"', f"radius = {R}", *law))
    row, column = (found.module.STATES.index(x) for x in ("b_z_dot", "b_z"))
    for d in (0.0, 1e-200, 5e-17, -5e-17):
        y = state(found, b_z=R - d)
        jacobian = found.module.jacobian(0.0, y)
        assert np.isfinite(jacobian).all()
        assert abs(found.module.derivative(0.0, y)[row]) < 1e-13
        y = state(found, b_z=R - d, b_z_dot=-1.0, b_x_dot=2.0)
        assert np.isfinite(found.module.jacobian(0.0, y)).all()
        if "hunt" in law[0]:
            assert abs(jacobian[row, column]) < 1e-4


@pytest.mark.every(3)
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("law", [SPRING, (*DAMPED, *RUB), HERTZ, (*HUNT, *RUB)])
def test_centres_may_meet(law: tuple[str, ...], dimensions: int) -> None:
    """At zero distance and within ε all is finite, and the energy has the force for a slope."""
    where = scene("spheres", dimensions, *law).replace("at = [0.3, -0.2", "at = [0, 0")
    found = made(where.replace("0, 0, 0.4]", "0, 0, 0]"), tangents=False)
    for x in (0.0, 1e-200, 0.3 * NEAREST, NEAREST, 1.01 * NEAREST):
        y = state(found, b_x=x, b_x_dot=0.7, a_y_dot=-0.3)
        assert np.isfinite(found.module.derivative(0.0, y)).all()
        assert np.isfinite(found.module.jacobian(0.0, y)).all()
        assert np.isfinite(found.module.potential_energy(0.0, y))
    still = state(found)
    assert not found.module.derivative(0.0, still)[len(still) // 2 + 1 :].any()
    if law in (SPRING, HERTZ):
        for x in (0.3, 0.99, 1.01, 2.0):
            y, way = exact(state(found, b_x=x * NEAREST)), exact(state(found) * 0)
            way[found.module.STATES.index("b_x")] = MP.mpf(1)
            slope = along(partial(found.exactly, "potential_energy"), y, way)
            force = exact_dynamics(found, y).loads[0][1].force[0]
            assert abs(slope + force) < 1e-12 * abs(force)


# Rigid contacts.


def rigid(found: Engine, y: np.ndarray) -> tuple[tuple[Contact, ...], Dynamics]:
    """The contacts at a state, exactly."""
    here = exact_dynamics(found, y)
    return tuple(c for effect in found.model.effects for c in effect.contacts(here)), here


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("geometry", GEOMETRY)
@pytest.mark.every(4)
def test_rigid_contacts_say_how_their_gaps_change(geometry: str, dimensions: int) -> None:
    """The power of `normal` is the gap's rate; tangents are unit vectors across; in pairs the loads
    cancel; no load acts.
    """
    found = made(scene(geometry, dimensions, *RIGID))
    for y in states(found, 6, 3):
        rate = found.exactly("derivative", y)
        contacts, here = rigid(found, y)
        assert contacts and not here.loads[0]
        gaps = along(lambda z: np.array([c.gap for c in rigid(found, z)[0]]), y, rate)
        for gap_rate, c in zip(gaps, contacts, strict=True):
            assert abs(gap_rate - power(here, c.normal)) < 1e-25
            ways = np.array([c.normal[0].force, *(t[0].force for t in c.tangents)])
            assert len(ways) == dimensions
            if geometry == "shapes on hills":  # whose gap rises by another speed than along it
                ways[0] /= MP.sqrt(ways[0] @ ways[0])
            if geometry.startswith("shapes on") and np.abs(ways[0]).max() < 1e-30:
                continue  # within the core of a box there is no normal
            assert np.abs(ways @ ways.T - np.eye(dimensions)).max() < 1e-15  # of a double's normal
            assert np.linalg.det(ways.astype(float)) == pytest.approx(1.0)
            for loads in (c.normal, *c.tangents):
                if len(loads) == 2:
                    assert np.abs(wrench(here, loads)).max() < 1e-25
        assert [c.effect for c in contacts] == ["e"] * len(contacts)
        assert float(contacts[0].restitution) == 0.6
        pressed = (
            1.0
            if "hills" not in geometry
            else np.linalg.norm(np.array(contacts[0].normal[0].force, dtype=float))
        )
        assert float(contacts[0].friction) == pytest.approx(0.3 * pressed, rel=1e-15)
        assert float(contacts[0].slip_speed) == 0.01


def test_slip_is_that_of_the_touching_point() -> None:
    """A sphere on the ground that rolls slips nowhere; one that spins slips by r ω × n."""
    found = made(free("b", dimensions=SPACE) + contact('body = "b"', f"radius = {R}", *RIGID))
    spins = [name for name in found.module.STATES if name.endswith(("wx", "wy", "wz"))]
    for wx, wy, vx, vy in ((0.0, 2.0, 2.0 * R, 0.0), (-3.0, 0.0, 0.0, 3.0 * R), (1.0, 2.0, 0, 0)):
        spinning = dict(zip(spins, (wx, wy, 7.0), strict=True))
        y = state(found, b_z=R, b_x_dot=vx, b_y_dot=vy, **spinning)
        (c,), here = rigid(found, y)
        slips = [power(here, t) for t in c.tangents]
        total = sum(s * np.array(t[0].force) for s, t in zip(slips, c.tangents, strict=True))
        assert (total == np.array([vx - R * wy, vy + R * wx, 0.0])).all()
        assert c.gap == 0


NAMED = {
    "a box on a slope": [f"e_a_{k}" for k in range(1, 5)],
    "points on a plane": ["e_a", "e_b"],
    "shapes on a slope": ["e_rod_1", "e_rod_2", "e_egg", "e_rock_1", "e_rock_2", "e_rock_3"],
    "shapes on each other": [
        *("e_rod_bar", "e_rod_brick_1", "e_rod_brick_2", "e_rod_brick_3"),
        *("e_bar_chest_1", "e_bar_chest_2", "e_bar_chest_3"),
        *(f"e_chest_brick_{k}" for k in range(1, 9)),
    ],
    "shapes on a ball": ["e_rod", "e_chest"],
    "shapes on hills": [
        *("e_rod_1", "e_rod_2", "e_rock_1", "e_rock_2", "e_rock_3"),
        *(f"e_chest_{k}" for k in range(1, 5)),
    ],
    "spheres": ["e_a_b"],
    "spheres off-centre": ["e_a"],
}


@pytest.mark.parametrize("geometry", NAMED)
def test_rigid_contacts_have_names(geometry: str) -> None:
    """As the run calls them; corner 2 is that of +x, -y."""
    found = made(scene(geometry, PLANE, *RIGID))
    contacts, _ = rigid(found, exact(state(found, a_x=5.0, b_y=3.0)))
    assert [c.name for c in contacts] == NAMED[geometry]
    (effect,) = found.model.effects
    assert effect.contact_names(["a", "b"]) == tuple(NAMED[geometry])
    whole = scene("points on a plane", PLANE, 'other = "b"', *RIGID)
    (c,) = rigid(made(whole), exact(state(found, a_x=5.0)))[0]
    assert c.name == "e_a"  # no body touches its own plane
    flat = made(
        free("b") + contact('body = "b"', "corners = [0.5, 0.3]", "normal = [1, 0]", *RIGID)
    )
    gaps = [float(c.gap) for c in rigid(flat, exact(state(flat, b_y=9.0)))[0]]
    assert gaps == [-0.5, 0.5, -0.5, 0.5]


def test_a_soft_contact_is_no_event_and_a_rigid_one_no_load() -> None:
    """Nor has one the other's parameters."""
    soft, hard = (made(scene("spheres", PLANE, *law)) for law in (DAMPED, RIGID))
    plain = made(free("a", "b", inertia=0.3))
    assert not rigid(soft, state(soft, a_x=1.0))[0]
    assert soft.model.effects[0].contact_names(["a", "b"]) == ()
    y = state(plain, a_x=0.2, a_x_dot=1.0, b_angle=0.3, b_angle_dot=0.2)
    assert (hard.module.derivative(0.0, y) == plain.module.derivative(0.0, y)).all()
    assert soft.module.derivative(0.0, y)[6] > 1.0
    assert hard.module.potential_energy(0.0, y) == 0.0
    assert not {"e_restitution", "e_friction", "e_slip_speed"} & set(soft.module.PARAMETERS)
    assert not {"e_stiffness", "e_damping", "e_dissipation"} & set(hard.module.PARAMETERS)


SLIDER = lone("prismatic", axis=[1, 0], coordinate="x")
stop = partial(effect, "joint_stop", name="s", joint="j")


@pytest.mark.parametrize("limits", ["both", "low", "high"])
def test_a_rigid_stop_is_a_contact_of_each_limit(limits: str) -> None:
    """Gaps q - low and high - q, pushed apart along q and against it; no load, no friction."""
    given = [line for line in ("low = -0.2", "high = 0.3") if limits in ("both", line.split()[0])]
    found = made(SLIDER + stop(*given, "restitution = 0.7"))
    contacts, here = rigid(found, state(found, x=0.1, x_dot=2.0))
    expected = {"s_low": (0.3, 1.0), "s_high": (0.2, -1.0)}
    assert [c.name for c in contacts] == [n for n in expected if limits in ("both", n[2:])]
    for c in contacts:
        gap, way = expected[c.name]
        assert float(c.gap) == pytest.approx(gap)
        assert c.normal == (JointLoad("j", way),)
        assert power(here, c.normal) == 2.0 * way
        assert (c.tangents, c.friction, float(c.restitution)) == ((), 0.0, 0.7)
    assert not here.loads[1]
    assert not found.module.applied_force(0.0, state(found, x=0.9)).any()
    assert found.module.potential_energy(0.0, state(found, x=0.9)) == 0.0


# Only what is there.


@pytest.mark.parametrize(("lines", "most"), [((), 0), (RUB, 10)])
def test_a_sphere_on_the_ground_in_space_costs_little(lines: tuple[str, ...], most: int) -> None:
    """Operations beyond those of a force and a torque that depend on the motion as much."""
    drag = effect("drag", *["turning_linear = 1.0"] * bool(lines), body="b", linear=1.0)
    body = free("b", dimensions=SPACE)
    costs = [
        made(body + table).module.COST["derivative"]["total"]
        for table in (drag, contact('body = "b"', "radius = 0.1", *HUNT, *lines))
    ]
    assert costs[1] - costs[0] <= most


# Bad input.

SOFT = 'law = "spring_damper"', "stiffness = 9.0"
MEET = "two points never meet; give a radius > 0"
BAD = {
    ("stiffness = 9.0",): "effects[0].law: missing; every such table needs it",
    ('law = "hertz"',): (
        "effects[0].law: unknown value 'hertz'; known: spring_damper, hunt_crossley, impact"
    ),
    ('law = "spring_damper"',): (
        "effects[0].stiffness: is missing; law 'spring_damper' needs it"
    ),
    ('law = "impact"',): "effects[0].restitution: is missing; law 'impact' needs it",
    (*SOFT, "dissipation = 0.1"): (
        "effects[0].dissipation: does not belong to law 'spring_damper'; it takes stiffness, "
        "damping, allow_active"
    ),
    ('law = "impact"', "restitution = 0.5", "damping = 0.1"): (
        "effects[0].damping: does not belong to law 'impact'; it takes restitution"
    ),
    ('law = "impact"', "restitution = 1.5"): (
        "effects[0].restitution: 1.5 is not from 0 to 1; give one that is"
    ),
    ('law = "impact"', "restitution = -0.1"): (
        "effects[0].restitution: -0.1 is not from 0 to 1; give one that is"
    ),
    (*SOFT, "friction = 0.3"): (
        "effects[0].slip_speed: is missing; it smooths friction; give a small value in m/s"
    ),
    (*SOFT, "slip_speed = 0.3"): (
        "effects[0].slip_speed: smooths friction, which is missing; give both"
    ),
    (*SOFT, "normal = [0, 0]"): (
        "effects[0].normal: has no direction; give one that is not zero"
    ),
    (*SOFT, "normal = [0, 0, 1]"): "effects[0].normal: has 3 components; the plane takes 2",
    (*SOFT, 'normal = ["n", 1]'): "effects[0].normal[0]: 'n' is not a number; give one",
    (*SOFT, 'offset = "sin(t)"'): (
        "effects[0].offset: 't' changes with the motion, which this value must not; use parameters"
    ),
    (*SOFT, 'other = "a"'): (
        "effects[0].other: 'a' cannot touch itself; name another body or world"
    ),
    (*SOFT, "radii = { b = 0.3 }"): (
        "effects[0].radii.b: is not one of the bodies in contact; leave it out"
    ),
    (*SOFT, EACH): (
        "effects[0].body: one body has no other to touch; give two or more in bodies"
    ),
    (*SOFT, EACH, "normal = [0, 1]"): (
        "effects[0].normal: does not belong to against 'each_other'; it takes pairs, "
        "except_pairs"
    ),
    (*SOFT, 'against = "ball"', "corners = [0.1, 0.1]"): (
        "effects[0].corners: does not belong to against 'ball'; it takes other_radius, "
        "other_at, other"
    ),
    (*SOFT, 'against = "ball"'): f"effects[0].other_radius: {MEET}",
    ("BOTH", *SOFT, EACH): f"effects[0].radius: {MEET}",
    ("BOTH", *SOFT, EACH, "radius = 1", 'pairs = [["a", "b"]]'): (
        "effects[0].pairs[0]: 'a' is no shape here; name two of them"
    ),
    ("TWICE", *SOFT, EACH, "radius = 1"): (
        "effects[0].bodies[1]: 'a' is listed twice; leave one out"
    ),
    ("ALL", *SOFT, EACH): f"effects[0].radius: {MEET}",
}  # fmt: skip
WHO = {"BOTH": '["a", "b"]', "TWICE": '["a", "a"]', "ALL": '"all"'}
BAD_STOPS = {
    ("low = 0", "restitution = 1.1"): (
        "effects[0].restitution: 1.1 is not from 0 to 1; give one that is"
    ),
    ("low = 0", "restitution = 0.5", "stiffness = 9"): (
        "effects[0].stiffness: a restitution replaces it; give only one of them"
    ),
    ("low = 0",): "effects[0].stiffness: missing; give it or a restitution",
    ("restitution = 0.5",): "effects[0].low: missing, as is high; give one of them or both",
}


@pytest.mark.parametrize("lines", [*BAD, *BAD_STOPS])
def test_bad_input_gets_one_clear_line(lines: tuple[str, ...]) -> None:
    """Place, value, remedy."""
    if lines in BAD_STOPS:
        text = SLIDER + stop(*lines)
    else:
        who = f"bodies = {WHO[lines[0]]}" if lines[0] in WHO else 'body = "a"'
        text = free("a", "b") + contact(who, *lines[lines[0] in WHO :])
    assert refusal(text) == {**BAD, **BAD_STOPS}[lines]


def test_contacts_keep_their_names_apart() -> None:
    """Effect g on a_b and effect g_a on b, say."""
    one, two = (contact(f'body = "{x}"', *RIGID, name=n) for x, n in (("a_b", "g"), ("b", "g_a")))
    soft = contact('body = "b"', *DAMPED, name="g_a")
    elaborate(parse_scene(free("a_b", "b") + one + soft))
    assert refusal(free("a_b", "b") + one + two) == (
        "'g_a_b' would be the name of a contact of 'g' and of one of 'g_a'; rename one of them"
    )


def test_what_starts_pressed_in_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A soft contact or stop that overlaps at the start holds energy: ½ k d² and 2/5 k d^2.5."""
    effects = [
        contact(*DAMPED, body="a", radius=0.25, name="floor"),
        contact(*HERTZ, body="a", radius=0.25, normal=[1, 0], name="wall"),
        contact(*SPRING, body="a", radius=0.25, offset=-9, name="far"),
        stop(low=0.5, stiffness=100.0),
    ]
    bodies = [{"name": name, "mass": 1.0, "inertia_com": 0.1} for name in "ab"]
    rail = {"type": "prismatic", "parent": "world", "axis": [1, 0], "coordinate": "x"}
    joints = [{"name": "fly", "type": "free", "child": "a"}, {"name": "j", "child": "b", **rail}]
    initial = {"q": {"a_x": 0.09, "a_y": 0.19, "x": 0.2}}
    text = scenes.lines({"name": "deep", "bodies": bodies, "joints": joints, "initial": initial})
    scene = tmp_path / "deep.toml"
    scene.write_text(text + WEIGHT + "".join(effects))
    expected = [
        f"contact 'floor' starts 0.06 m deep, with {450 * 0.06**2:.3g} J stored in it",
        f"contact 'wall' starts 0.16 m deep, with {360 * 0.16**2.5:.3g} J stored in it",
        f"stop 's' starts 0.3 m deep, with {50 * 0.3**2:.3g} J stored in it",
    ]
    assert main(["check", str(scene)]) == 0
    reported = [line for line in capsys.readouterr().out.splitlines() if "starts" in line]
    assert reported == [f"at start    {line}" for line in expected]
