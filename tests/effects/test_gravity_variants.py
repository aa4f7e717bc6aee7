"""Gravity of all kinds, and forces and torques in body axes, against closed forms and Euler."""

import numpy as np
import pytest
from engine import engine, motion, plain, quick, text_of, unit_state
from scenes import effect, free, refusal
from scipy.integrate import solve_ivp

from eomgen.base.errors import SceneError
from eomgen.run.module import as_problem
from eomgen.scene.reader import parse_scene

CHAIN = """\
name = "{name}"
dimensions = {dimensions}
outputs = "all"
[[bodies]]
name = "upper"
mass = 1.3
inertia_com = {inertia}
[[bodies]]
name = "lower"
mass = 0.7
inertia_com = {inertia}
[[joints]]
name = "shoulder"
type = "{joint}"
parent = "world"
child = "upper"
r_child = {pin}
[[joints]]
name = "elbow"
type = "{joint}"
parent = "upper"
child = "lower"
r_parent = {pin}
r_child = {pin}
"""
PLANE = CHAIN.format(name="flat", dimensions=2, inertia=0.02, joint="revolute", pin=[-0.3, 0.1])
SPACE = CHAIN.format(
    name="deep", dimensions=3, inertia=[0.02, 0.03, 0.04], joint="ball", pin=[-0.3, 0.1, 0.2]
)
MASSES = {"ship": 2.5, "moon": 0.5}
SHIP = free(*MASSES, mass=MASSES)
SPINNER = free(*MASSES, mass=MASSES, inertia_com=[0.2, 0.3, 0.45], dimensions=3)


def gravity(text: str = "", g: float = 9.81) -> str:
    """Gravity with more keys."""
    return effect("gravity", text, g=g)


COSTLY = ("jacobian", "parameter_jacobian", "inverse_dynamics", "forward_dynamics", "mass_matrix")
PULL = '[[effects]]\ntype = "point_gravity"\nname = "sun"\nmu = 2.0\n{}\n'


@pytest.mark.parametrize("route", ["aba", "ldl"])
def test_any_direction_is_a_turned_scene(route: str) -> None:
    """Pulled along +x in the plane as downwards with the whole scene turned by 90 degrees."""
    down = plain(PLANE + gravity(), route).module
    sideways = plain(PLANE + gravity("direction = [2.0, 0.0]"), route).module
    for seed in range(3):
        y = unit_state(down, seed)
        turned = y.copy()
        turned[down.STATES.index("shoulder_angle")] += np.pi / 2  # -y becomes +x
        assert np.allclose(
            sideways.derivative(0.0, turned), down.derivative(0.0, y), rtol=1e-12, atol=1e-12
        )
        assert np.isclose(sideways.potential_energy(0.0, turned), down.potential_energy(0.0, y))
        assert np.allclose(sideways.gravity_force(0.0, turned), down.gravity_force(0.0, y))


def test_any_direction_in_space() -> None:
    """A direction is the sum of three along the axes: accelerations are linear in gravity."""
    bare = engine(SPACE, leave_out=COSTLY).module
    y = unit_state(bare, 5)
    way = np.array([0.6, -1.0, 2.0])
    skew = engine(SPACE + gravity(f"direction = {way.tolist()}", 3.0), leave_out=COSTLY).module
    rest = bare.derivative(0.0, y)
    total, energy = rest.copy(), 0.0
    for axis, part in zip(np.eye(3), way / np.linalg.norm(way), strict=True):
        one = engine(SPACE + gravity(f"direction = {axis.tolist()}", 3.0), leave_out=COSTLY).module
        total += part * (one.derivative(0.0, y) - rest)
        energy += part * one.potential_energy(0.0, y)
    assert np.allclose(skew.derivative(0.0, y), total, rtol=1e-11, atol=1e-11)
    assert np.isclose(skew.potential_energy(0.0, y), energy)
    down = engine(SPACE + gravity(), leave_out=COSTLY).module
    same = engine(SPACE + gravity("direction = [0, 0, -7.0]"), leave_out=COSTLY).module
    assert np.allclose(same.derivative(0.0, y), down.derivative(0.0, y), rtol=1e-12)
    assert np.allclose(same.joint_forces(0.0, y), down.joint_forces(0.0, y), rtol=1e-11, atol=1e-12)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [PLANE, SPACE])
def test_except_bodies(scene: str) -> None:
    """Weights of all but some: as forces from outside on the others, and none excepted is all."""
    dims = 2 if scene is PLANE else 3
    weight = [*[0.0] * (dims - 1), -0.7 * 9.81]
    some = quick(scene + gravity('except_bodies = ["upper"]')).module
    push = f'[[effects]]\ntype = "external_force"\nname = "w"\nbody = "lower"\nforce = {weight}\n'
    other = quick(scene + push).module
    for seed in range(3):
        y = unit_state(some, seed)
        for output in ("derivative", "jacobian"):
            ours, theirs = (getattr(m, output)(0.0, y) for m in (some, other))
            assert np.allclose(ours, theirs, rtol=1e-11, atol=1e-11)
        assert np.allclose(
            some.joint_forces(0.0, y), other.joint_forces(0.0, y), rtol=1e-11, atol=1e-11
        )
        height = some.body_poses(0.0, y)[1, 1] if dims == 2 else some.body_poses(0.0, y)[1, 2, 3]
        assert np.isclose(some.potential_energy(0.0, y), 0.7 * 9.81 * height)


def test_free_bodies_and_except() -> None:
    """The one falls, the other flies straight on."""
    module = plain(SHIP + gravity('except_bodies = ["moon"]')).module
    rates = dict(zip(module.STATES, module.derivative(0.0, unit_state(module, 1)), strict=True))
    assert np.isclose(rates["ship_y_dot"], -9.81) and rates["ship_x_dot"] == 0.0
    assert rates["moon_x_dot"] == rates["moon_y_dot"] == 0.0


@pytest.mark.parametrize("dimensions", [2, 3])
def test_kepler_ellipse(dimensions: int) -> None:
    """An ellipse about a point off the origin closes after 2π √(a³/μ), and Kepler's equation."""
    mu, a, e = 2.0, 1.5, 0.6
    point = [0.3, -0.2, 0.1][:dimensions]
    scene = SHIP if dimensions == 2 else SPINNER
    made = plain(scene + PULL.format(f'at = {point}\nexcept_bodies = ["moon"]'))
    module = made.module
    period = 2 * np.pi * np.sqrt(a**3 / mu)
    y = np.array(module.initial_state())
    names = list(module.STATES)
    start = [names.index(f"ship_{axis}") for axis in "xyz"[:dimensions]]
    moving = [names.index(f"ship_{axis}_dot") for axis in "xyz"[:dimensions]]
    far = a * (1 + e)
    y[start] = np.array(point) - np.eye(dimensions)[0] * far
    y[moving[-1]] = -np.sqrt(mu / a * (1 - e) / (1 + e))
    energy = 2.5 * (y[moving] @ y[moving] / 2 - mu / far)
    assert np.isclose(module.potential_energy(0.0, y) + module.kinetic_energy(0.0, y), energy)
    assert np.isclose(energy, -2.5 * mu / (2 * a))
    run = motion(made, np.array([0.3, 1.0]) * period, y)
    assert np.allclose(run[start, -1], y[start], atol=1e-9)
    assert np.allclose(run[moving, -1], y[moving], atol=1e-9)
    anomaly, mean = np.pi, np.pi + 0.3 * 2 * np.pi  # from the far end on
    for _ in range(50):
        anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    along, across = a * (np.cos(anomaly) - e), a * np.sqrt(1 - e**2) * np.sin(anomaly)
    exact = np.array(point)
    exact[0] += along
    exact[-1] += across
    assert np.allclose(run[start, 0], exact, atol=1e-9)


def test_where_it_is_infinite() -> None:
    """A body that starts at the point itself is refused."""
    text = SHIP + PULL.format('except_bodies = ["moon"]') + "[initial]\nq = { ship_x = 0.0 }\n"
    with pytest.raises(Exception, match=r"singular|not finite|division"):
        as_problem(plain(text).module)


def _torque(text: str, body: str = "ship") -> str:
    return effect("external_torque", text, name="twist", body=body)


def _spun(text: str) -> tuple[object, np.ndarray, list[int], list[int]]:
    module = plain(SPINNER + _torque(text)).module
    names = list(module.STATES)
    spin = [names.index(f"ship_w{axis}") for axis in "xyz"]
    turn = list(module.QUATERNIONS[0])
    y = unit_state(module, 3)
    y[spin] = [0.7, -1.1, 2.0]
    return module, y, spin, turn


def test_torque_in_body_axes() -> None:
    """A spinning body under a torque of its own axes: Euler's equations, integrated by SciPy."""
    inertia = np.array([0.2, 0.3, 0.45])
    module, y, spin, _ = _spun('axes = "body"\ntorque = ["0.1*sin(3*t)", 0.05, "-0.02*ship_wz"]')

    def euler(t: float, w: np.ndarray) -> np.ndarray:
        torque = np.array([0.1 * np.sin(3 * t), 0.05, -0.02 * w[2]])
        return (torque - np.cross(w, inertia * w)) / inertia

    kept = {"rtol": 1e-11, "atol": 1e-12, "method": "DOP853"}
    ours = solve_ivp(module.derivative, (0, 4), y, **kept).y[spin, -1]
    assert np.allclose(ours, solve_ivp(euler, (0, 4), y[spin], **kept).y[:, -1], atol=1e-8)


def test_torque_in_world_axes() -> None:
    """Angular momentum in the world grows by the torque, as an input or as a number."""
    module, y, _, _ = _spun('torque = "input"')
    assert list(module.INPUTS) == ["twist_x", "twist_y", "twist_z"]
    given = np.array([0.3, -0.2, 0.5])
    u = dict(zip(module.INPUTS, given.tolist(), strict=True))
    f = module.derivative(0.0, y, None, u)
    h = 1e-6
    grown = (module.momentum(0.0, y + h * f) - module.momentum(0.0, y - h * f)) / (2 * h)
    assert np.allclose(grown, [0, 0, 0, *given], atol=1e-7)
    fixed, _, _, _ = _spun(f"torque = {given.tolist()}")
    assert np.allclose(fixed.derivative(0.0, y), f, rtol=1e-13)


def test_torque_in_the_plane() -> None:
    """One number: torque over moment of inertia."""
    module = plain(SHIP + _torque("torque = 0.6")).module
    rates = dict(zip(module.STATES, module.derivative(0.0, module.initial_state()), strict=True))
    assert np.isclose(rates["ship_angle_dot"], 6.0)
    module = plain(SHIP + _torque('torque = "input"')).module
    assert list(module.INPUTS) == ["twist"]


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [SHIP, SPINNER])
def test_force_in_body_axes(scene: str) -> None:
    """At every instant the force of the world that the body's turn makes of it."""
    dims = 2 if scene is SHIP else 3
    push = '[[effects]]\ntype = "external_force"\nname = "jet"\nbody = "ship"\nforce = "input"\n'
    place = f"at = {[0.1, 0.2, -0.3][:dims]}\n"
    own = plain(scene + push + place + 'axes = "body"').module
    world = plain(scene + push + place).module
    named = plain(scene + push + place + 'axes = "world"')
    assert named.source == plain(scene + push + place).source
    for seed in range(3):
        y = unit_state(own, seed)
        force = np.array([0.4, -1.0, 0.7][:dims])
        if dims == 2:
            angle = own.body_poses(0.0, y)[0, 2]
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        else:
            turn = own.body_poses(0.0, y)[0, :, :3]
        by = [dict(zip(own.INPUTS, f.tolist(), strict=True)) for f in (force, turn @ force)]
        ours, theirs = own.derivative(0.0, y, None, by[0]), world.derivative(0.0, y, None, by[1])
        assert np.allclose(ours, theirs, rtol=1e-11, atol=1e-12)


def test_plain_gravity_is_as_it_was() -> None:
    """Downwards for all bodies needs no other key. The closed form takes every kind, aslant in as
    few operations; a form with momenta takes this one only.
    """
    down = plain(PLANE + gravity(), "closed").system
    assert plain(PLANE + gravity("except_bodies = []")).source == plain(PLANE + gravity()).source
    aslant = plain(PLANE + gravity("direction = [3, -4]"), "closed").system
    assert aslant.program.operations["derivative"] <= down.program.operations["derivative"] + 4
    for more in ("direction = [3, -4]", 'except_bodies = ["upper"]'):
        closed, aba = (plain(PLANE + gravity(more), route).module for route in ("closed", "aba"))
        y = closed.initial_state() + 0.3
        for name in ("derivative", "potential_energy", "gravity_force", "applied_force"):
            found, right = getattr(closed, name)(0.0, y), getattr(aba, name)(0.0, y)
            np.testing.assert_allclose(found, right, rtol=1e-12, atol=1e-12, err_msg=name)
        with pytest.raises(SceneError, match="and in momenta it takes no 'gravity'"):
            text_of(parse_scene('form = "redundant"\n' + PLANE + gravity(more)))


MISTAKES = [
    (gravity("direction = [0, 0]"), "effects[0].direction: [0, 0] has no direction; give a vector "
     "that is not zero"),
    (gravity("direction = [0, 0, 1]"), "effects[0].direction: has 3 components; the plane takes 2"),
    (gravity('direction = ["a", 1]'), "effects[0].direction[0]: 'a' is not a number; give one"),
    (gravity('except_bodies = ["uper"]'),
     "effects[0].except_bodies[0]: no body is named 'uper' (did you mean 'upper'?)"),
    (_torque("torque = [1, 2]", "upper"),
     "effects[0].torque: is a list; in the plane give one number, about z"),
    (_torque('axes = "bdy"\ntorque = 1', "upper"),
     "effects[0].axes: unknown value 'bdy' (did you mean 'body'?)"),
]  # fmt: skip


@pytest.mark.parametrize(("more", "message"), MISTAKES)
def test_mistakes(more: str, message: str) -> None:
    """One line: place, value, remedy."""
    assert refusal(PLANE + more) == message


def test_a_number_in_space() -> None:
    """A torque in space has three components."""
    assert "torque: has 1 component; space takes 3" in refusal(
        SPACE + _torque("torque = 1", "upper")
    )
