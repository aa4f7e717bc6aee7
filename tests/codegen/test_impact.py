"""Rigid contacts: gaps, impacts and forces that hold, against hand formulas and dense algebra."""

from contextlib import nullcontext, suppress
from typing import Any

import numpy as np
import pytest
from engine import MP, Engine, along, exact
from scenes import WEIGHT, effect
from striking import MATERIAL, Balls, Limit, dense_impact, normals, striking, touching_velocities

FREE = """\
[[bodies]]
name = "{0}"
mass = {1}
inertia_com = {2}
[[joints]]
name = "{0}_free"
type = "free"
parent = "world"
child = "{0}"
"""
HINGE = """\
[[bodies]]
name = "{0}"
mass = {1}
inertia_com = {2}
[[joints]]
name = "{0}_hinge"
type = "{3}"
parent = "{4}"
child = "{0}"
r_parent = {5}
r_child = {6}
"""
GRAVITY = WEIGHT
RADIUS, MASS, INERTIA = 0.2, 2.0, 0.032
DISC = 'name = "disc"\n' + MATERIAL + FREE.format("ball", MASS, INERTIA) + GRAVITY
BALL = 'name = "ball"\ndimensions = 3\n' + MATERIAL
BALL += FREE.format("ball", MASS, [INERTIA] * 3) + GRAVITY
FLOOR_2 = Balls(normal=(0.0, 1.0), on_plane=(("ball", (0.0, 0.0), RADIUS),))
FLOOR_3 = Balls(normal=(0.0, 0.0, 1.0), on_plane=(("ball", (0.0, 0.0, 0.0), RADIUS),))

TWIN = 'name = "twin"\n' + MATERIAL
TWIN += HINGE.format("upper", 1.0, 0.02, "revolute", "world", [0, 0], [0, 0.5])
TWIN += HINGE.format("lower", 0.7, 0.01, "revolute", "upper", [0, -0.5], [0, 0.4]) + GRAVITY
WALL = Balls(normal=(-0.8, 0.6), on_plane=(("lower", (0.05, -0.4), 0.0), ("upper", (0, 0), 0.1)))

TREE = 'name = "tree"\ndimensions = 3\n' + MATERIAL + FREE.format("trunk", 3.0, [0.1, 0.12, 0.08])
for side, y, axis in (("left", 0.2, [0, 1, 0]), ("right", -0.2, [1, 0, 0])):
    TREE += HINGE.format(
        f"{side}_thigh", 1.0, [0.02, 0.03, 0.01], "ball", "trunk", [0, y, -0.3], [0.02, 0, 0.25]
    )
    TREE += (
        HINGE.format(
            f"{side}_shank",
            0.6,
            [0.01, 0.012, 0.004],
            "revolute",
            f"{side}_thigh",
            [0, 0, -0.25],
            [0, 0.03, 0.22],
        )
        + f"axis = {axis}\n"
    )
TREE += GRAVITY
SLOPE = Balls(
    normal=(0.36, -0.48, 0.8),
    on_plane=(
        ("left_shank", (0.1, 0.0, -0.2), 0.05),
        ("right_shank", (-0.1, 0.02, -0.2), 0.0),
        ("trunk", (0.0, 0.0, 0.0), 0.3),
    ),
    on_each_other=(
        ("left_shank", "right_shank", 0.125, 0.25),
        ("trunk", "left_shank", 0.25, 0.125),
    ),
)
BOXES = """\
name = "boxes"
dimensions = 3
bodies = [
    { name = "box", mass = 2.0, inertia_com = [0.03, 0.02, 0.04] },
    { name = "arm", mass = 0.5, inertia_com = [0.01, 0.02, 0.01] },
    { name = "ball", mass = 0.7, inertia_com = [0.01, 0.01, 0.01] },
]
joints = [
    { name = "f", type = "free", parent = "world", child = "box" },
    { name = "g", type = "free", parent = "world", child = "ball" },
    { name = "h", type = "revolute", axis = [1,0,0], parent = "box", child = "arm", \
r_parent = [0.2,0,0], r_child = [0,0.25,0] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "contact", name = "floor", law = "impact", body = "box", corners = [0.2,0.15,0.1], \
restitution = 0.3, friction = 0.5, slip_speed = 0.001 },
    { type = "contact", name = "roll", law = "impact", bodies = ["ball","arm"], radius = 0.1, \
normal = [0,0.6,0.8], restitution = 0.3 },
    { type = "contact", name = "catch", law = "impact", body = "ball", radius = 0.1, \
other = "arm", other_at = [0,0.1,0], other_radius = 0.05, against = "ball", restitution = 0.5, \
friction = 0.2, slip_speed = 0.001 },
    { type = "contact", name = "lid", law = "impact", body = "ball", radius = 0.1, other = "box", \
offset = 0.1, restitution = 0.5, friction = 0.2, slip_speed = 0.001 },
    { type = "contact", name = "each", law = "impact", bodies = ["ball","box"], radius = 0.1, \
against = "each_other", restitution = 0.5, friction = 0.3, slip_speed = 0.001 },
    { type = "joint_stop", name = "stop", joint = "h", low = -1, high = 1, restitution = 0.5 },
]
"""
MODELS = {
    "disc": (DISC, FLOOR_2), "ball": (BALL, FLOOR_3), "twin": (TWIN, WALL), "tree": (TREE, SLOPE),
}  # fmt: skip


def approaching(engine: Engine, rng: np.random.Generator, contact: int) -> np.ndarray:
    """A random state in which a contact's gap shrinks."""
    y = engine.random_state(rng)
    if engine.module.gap_rates(0.0, y)[contact] > 0:
        y[len(engine.model.coordinates) :] *= -1.0
    return y


@pytest.mark.parametrize(
    ("slip", "rest", "mu"), [(0.5, 0.5, 0.6), (8.0, 0.5, 0.1), (-8.0, 0.9, 0.1), (3.0, 0.0, 0.0)]
)
def test_a_disc_bounces(slip: float, rest: float, mu: float) -> None:
    """By hand: μ (1 + e) |u_n| < |u_t| / (1 + m r²/I) slides, and slows by that; else it sticks."""
    y = np.array([0.3, RADIUS, 0.1, slip - 0.7, -2.0, 0.7 / RADIUS])
    found = striking(DISC, FLOOR_2).module.impact(0.0, y, 0, p={"rest": rest, "mu": mu})
    stuck = slip / (1 + MASS * RADIUS**2 / INERTIA)
    slide = mu * (1 + rest) * 2.0
    lost = np.sign(slip) * min(abs(stuck), slide)
    expected = [slip - 0.7 - lost, rest * 2.0, 0.7 / RADIUS - MASS * lost * RADIUS / INERTIA]
    np.testing.assert_allclose(found, [*y[:3], *expected], rtol=0, atol=2e-14)
    if abs(stuck) < slide:
        assert abs(found[3] + RADIUS * found[5]) < 1e-14


def test_a_ball_bounces_in_space() -> None:
    """Friction is against the slip, whichever the tangents; spin about the normal stays."""
    engine = striking(BALL, FLOOR_3)
    y = engine.module.initial_state()
    y[2], y[7:] = RADIUS, [3.0, -1.0, -2.0, 4.0, 5.0, -6.0]
    slip = np.array([3.0 - RADIUS * 5.0, -1.0 + RADIUS * 4.0])
    stuck = 1 / (1 + MASS * RADIUS**2 / INERTIA)
    for mu in (0.05, 0.9):
        lost = min(stuck, mu * 1.7 * 2.0 / np.linalg.norm(slip)) * slip
        w_x, w_y = np.array([-lost[1], lost[0]]) * MASS * RADIUS / INERTIA
        expected = [3.0 - lost[0], -1.0 - lost[1], 1.4, 4.0 + w_x, 5.0 + w_y, -6.0]
        for turn in (0.0, 1.1):
            floor = FLOOR_3.replaced(turned=turn)
            found = striking(BALL, floor).module.impact(0.0, y, 0, p={"mu": mu})
            np.testing.assert_allclose(found[7:], expected, rtol=0, atol=2e-14)


def test_a_rod_of_little_inertia_sticks() -> None:
    """Normal and tangent hang together but for one part in 10⁴, and both velocities are met."""
    end = Balls(normal=(0.0, 1.0), on_plane=(("ball", (-0.6, 0.0), 0.0),))
    module = striking(DISC.replace(str(INERTIA), "1e-5"), end).module
    y = np.array([0.0, 0.4, 0.8, 0.5, -3.0, 1.0])
    for bounce in (0.0, 0.5):
        found = module.impact(0.0, y, 0, bounce, p={"mu": 9.0})
        before, after = module.gap_rates(0.0, y)[0], module.gap_rates(0.0, found)[0]
        assert after == pytest.approx(-0.7 * bounce * before, rel=1e-11, abs=1e-11)
        # The rebound is without friction: by it the end slips, x/y = A_tn / A_nn.
        arm = -0.6 * np.array([np.cos(0.8), np.sin(0.8)])
        share = (-arm[0] * arm[1] / 1e-5) / (1 / MASS + arm[0] ** 2 / 1e-5)
        assert found[3] - arm[1] * found[5] == pytest.approx(after * share, abs=1e-11)


@pytest.mark.every(3)
@pytest.mark.parametrize("route", ["aba", "ldl"])
@pytest.mark.parametrize("name", list(MODELS))
def test_impacts_against_dense_algebra(name: str, route: str) -> None:
    """Every contact of every model, sliding and sticking, from velocities of bodies alone."""
    scene, effect = MODELS[name]
    engine = striking(scene, effect, route=route)
    module, rng = engine.module, np.random.default_rng(4)
    nq = len(engine.model.coordinates)
    for _ in range(12):
        y = engine.random_state(rng)
        mass = module.mass_matrix(0.0, y)
        directions = zip(
            touching_velocities(engine, effect, y), normals(engine, effect, y), strict=True
        )
        rates = module.gap_rates(0.0, y)
        for k, (jacobian, normal) in enumerate(directions):
            np.testing.assert_allclose(rates[k], normal @ jacobian @ y[nq:], rtol=0, atol=2e-14)
            if rates[k] > 0:
                y[nq:] *= -1
                rates = -rates
            rest, mu = rng.uniform(0, 1), rng.choice([0.1, 0.5, 2.0])
            found = module.impact(0.0, y, k, p={"rest": rest, "mu": mu})
            expected = dense_impact(mass, jacobian, normal, y[nq:], rest, mu)
            size = np.max(np.abs(expected))
            np.testing.assert_allclose(found[nq:], expected, rtol=0, atol=3e-12 * size)
            assert (found[:nq] == y[:nq]).all()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_two_bodies_keep_their_momentum(dimensions: int) -> None:
    """Linear and angular, with friction, however deep they overlap."""
    inertia: Any = [0.05] * 3 if dimensions == 3 else 0.05
    scene = f'name = "pair"\ndimensions = {dimensions}\n' + MATERIAL
    scene += FREE.format("one", 1.3, inertia) + FREE.format("two", 0.4, inertia)
    normal = (0.0,) * (dimensions - 1) + (1.0,)
    engine = striking(scene, Balls(normal=normal, on_each_other=(("one", "two", 0.3, 0.2),)))
    module, rng = engine.module, np.random.default_rng(2)
    for _ in range(20):
        y = approaching(engine, rng, 0)
        found = module.impact(0.0, y, 0)
        assert np.max(np.abs(found - y)) > 1e-3
        np.testing.assert_allclose(module.momentum(0.0, found), module.momentum(0.0, y), atol=1e-13)


def test_what_moves_apart_is_bounced_back_without_friction() -> None:
    """The law holds of any normal velocity, but friction is no more than μ times a push."""
    module = striking(DISC, FLOOR_2).module
    y = np.array([0.0, RADIUS, 0.0, 3.0, 1.0, 2.0])
    np.testing.assert_allclose(module.impact(0.0, y, 0, 0.0), [*y[:4], 0.0, 2.0], atol=1e-15)
    y[4] = 0.0
    assert (module.impact(0.0, y, 0) == y).all()
    assert (module.impact(0.0, np.zeros(6), 0) == np.zeros(6)).all()


SLIDE = """\
[[bodies]]
name = "ball"
mass = 2.0
inertia_com = [0.03, 0.03, 0.03]
[[joints]]
name = "slide"
type = "prismatic"
parent = "world"
child = "ball"
axis = {}
"""


@pytest.mark.parametrize(
    ("axis", "after"), [([0, 0, 1], 0.7), ([3, 0, 4], 0.7), ([1, 0, 0], -1.0), ([1e-9, 0, 1], 0.7)]
)
def test_a_bead_takes_no_impulse_where_it_cannot_move(axis: list[float], after: float) -> None:
    """On a straight wire the normal impulse alone decides, however rough; along the floor, none."""
    scene = 'name = "bead"\ndimensions = 3\n' + MATERIAL + SLIDE.format(axis)
    module = striking(scene, FLOOR_3).module
    found = module.impact(0.0, np.array([0.1, -1.0]), 0, p={"mu": 5.0})
    np.testing.assert_allclose(found, [0.1, after], rtol=0, atol=1e-15)


def test_friction_where_one_way_is_open() -> None:
    """On a plane that no tangent lies in, a bead slides or sticks as it would in that plane."""
    second = SLIDE.replace("ball", "cart").replace("slide", "rail").replace("2.0", "0.5")
    scene = 'name = "lift"\ndimensions = 3\n' + MATERIAL
    scene += second.format([0, 0, 1]) + SLIDE.format([0.6, 0.8, 0]).replace('"world"', '"cart"')
    for turned in (0.0, 0.4, 1.3):
        module = striking(scene, FLOOR_3.replaced(turned=turned)).module
        for mu, slip in ((0.1, 3.0), (0.1, -3.0), (9.0, 3.0)):
            y = np.array([0.0, 0.0, -2.0, slip])
            # Impulses per mass: 2.5 kg are lifted, 2 kg slide; normal and tangent do not mix.
            lost = min(mu * 1.7 * 2.0 * 2.5 / 2.0, abs(slip)) * np.sign(slip)
            found = module.impact(0.0, y, 0, p={"mu": mu})
            np.testing.assert_allclose(found, [0, 0, 1.4, slip - lost], rtol=0, atol=1e-14)


def test_no_input_makes_what_is_no_number() -> None:
    """Rest, tiny and huge speeds, no friction and much, poses and wires that let nothing move; at
    speeds whose powers floats cannot hold, a number or a refusal.
    """
    rng = np.random.default_rng(3)
    wire = 'name = "wire"\ndimensions = 3\n' + MATERIAL + SLIDE.format([0.3, 0.2, 0.7])
    flat = wire.replace("dimensions = 3\n", "").replace("[0.03, 0.03, 0.03]", "0.03")
    flat = flat.replace("[0.3, 0.2, 0.7]", "[0.3, 0.7]")
    hanging = Balls(normal=(0.0, 1.0), on_plane=(("upper", (0, 0), 0.1), ("lower", (0, 0), 0.1)))
    models = [*MODELS.values(), (TWIN, hanging), (flat, FLOOR_2)]
    models += [(wire, FLOOR_3.replaced(turned=turn)) for turn in (0.0, 1.0)]
    for scene, acting in models:
        engine = striking(scene, acting)
        for size in (0.0, 1e-200, 1e6, 1e100):
            for mu in (0.0, 1e-12, 1e12):
                y = engine.module.initial_state()
                ways = rng.integers(-1, 2, size=len(engine.model.velocities))
                y[len(engine.model.coordinates) :] = size * ways
                y[: len(engine.model.coordinates)] += 0.0 if acting is not SLOPE else 1e-3
                forces = np.full(len(engine.module.CONTACTS), 2.0)
                with suppress(FloatingPointError) if size > 1e20 else nullcontext():
                    for k in range(len(engine.module.CONTACTS)):
                        for rest in (0.0, 1.0):
                            found = engine.module.impact(0.0, y, k, p={"mu": mu, "rest": rest})
                            assert np.isfinite(found).all()
                    held = engine.module.held(0.0, y, forces, p={"mu": mu, "creep": 0.0})
                    assert np.isfinite(held).all()


@pytest.mark.every(3)
@pytest.mark.parametrize("route", ["aba", "ldl"])
@pytest.mark.parametrize("name", list(MODELS))
def test_held(name: str, route: str) -> None:
    """Affine in the forces, `derivative` without them; accelerations and powers by definition."""
    engine = striking(*MODELS[name], route=route)
    module, rng = engine.module, np.random.default_rng(5)
    ny, nc, nq = len(module.STATES), len(module.CONTACTS), len(engine.model.coordinates)
    y = engine.random_state(rng)
    forces = rng.uniform(0.0, 20.0, size=(nc, 2))
    base, one, two, both = (
        module.held(0.0, y, f) for f in (np.zeros(nc), *forces.T, forces.sum(axis=1))
    )
    np.testing.assert_allclose(base[:ny], module.derivative(0.0, y), rtol=1e-13, atol=1e-12)
    assert (base[ny + nc :] == 0).all()
    np.testing.assert_allclose(both - base, one - base + (two - base), rtol=1e-10, atol=1e-10)
    # What the contacts do to the motion is vᵀ M of the change of v̇.
    power = y[nq:] @ module.mass_matrix(0.0, y) @ (one - base)[nq:ny]
    assert one[ny + nc :].sum() == pytest.approx(power, rel=1e-11)
    # Each alone against the dense algebra.
    _, effect = MODELS[name]
    found = zip(touching_velocities(engine, effect, y), normals(engine, effect, y), strict=True)
    for k, (jacobian, normal) in enumerate(found):
        force = 3.0 * (np.arange(nc) == k)
        slip = jacobian @ y[nq:]
        slip -= normal * (normal @ slip)
        push = 3.0 * (normal - 0.4 * slip / np.hypot(np.linalg.norm(slip), 0.01))
        change = np.linalg.solve(module.mass_matrix(0.0, y), jacobian.T @ push)
        alone = module.held(0.0, y, force) - base
        np.testing.assert_allclose(alone[nq:ny], change, rtol=1e-10, atol=1e-11)
        assert alone[ny + nc + k] == pytest.approx(push @ jacobian @ y[nq:], rel=1e-12)


def rates_and_accelerations_off(engine: Engine, rng: np.random.Generator) -> Any:
    """How far, in 60 digits, gap rates are from differences of gaps along the motion, and
    accelerations from those of rates.
    """
    ny, nc = len(engine.module.STATES), len(engine.module.CONTACTS)
    y = exact(engine.random_state(rng))
    for indices in map(list, engine.module.QUATERNIONS):
        y[indices] = y[indices] / MP.sqrt(sum(y[indices] ** 2))
    forces = [MP.mpf(x) for x in rng.uniform(0.0, 9.0, size=nc)]
    held = engine.exactly("held", y, extra=forces)
    pairs = {"gaps": engine.exactly("gap_rates", y), "gap_rates": held[ny : ny + nc]}
    return max(
        max(abs(found - along(lambda x, name=name: engine.exactly(name, x), y, held[:ny])))
        for name, found in pairs.items()
    )


@pytest.mark.parametrize("name", list(MODELS))
def test_gap_rates_and_accelerations_by_differences(name: str) -> None:
    """Rates are those of the gaps, accelerations those of the rates."""
    engine = striking(*MODELS[name])
    assert rates_and_accelerations_off(engine, np.random.default_rng(6)) < MP.mpf(10) ** -35


def test_a_stop_strikes() -> None:
    """A hinge against its limit: its own rate turns round, the other keeps momentum with it."""
    engine = striking(TWIN, Limit(joint="lower_hinge", high=0.3), route="aba")
    module = engine.module
    assert module.CONTACTS == {"limit_high": "limit"}
    assert module.UNITS["limit_high"] == "rad"
    y = np.array([0.4, 0.3, 1.0, 2.5])
    assert module.gaps(0.0, y) == pytest.approx([0.0], abs=1e-16)
    assert module.gap_rates(0.0, y) == pytest.approx([-2.5])
    found = module.impact(0.0, y, 0)
    assert found[3] == pytest.approx(-0.7 * 2.5, rel=1e-14)
    mass = module.mass_matrix(0.0, y)
    # The stop acts on the elbow alone, so what belongs to the shoulder stays.
    np.testing.assert_allclose((mass @ (found - y)[2:])[0], 0.0, atol=1e-14)
    held = module.held(0.0, y, [4.0])
    change = np.linalg.solve(mass, [0.0, -4.0])
    np.testing.assert_allclose(held[2:4] - module.derivative(0.0, y)[2:], change, rtol=1e-12)
    assert held[4] == pytest.approx(-held[3], rel=1e-14)
    assert held[5] == pytest.approx(-10.0, rel=1e-14)


def test_time_inputs_and_states_of_effects() -> None:
    """Contacts beside what commands; states of effects go through an impact as they are."""
    drive = effect(
        "pid",
        name="drive",
        joint="upper_hinge",
        target="0.3*sin(2*t)",
        stiffness=4.0,
        integral_gain=2.0,
        lag=0.1,
    ) + effect("motor", name="push", joint="lower_hinge", torque="input")
    rocking = Limit(joint="lower_hinge", high=0.3, weight="1 + sin(3*t)/2")
    engine = striking(TWIN + drive, WALL, rocking)
    module, t, u = engine.module, 0.7, {"push": 2.0}
    y = np.array([0.4, 0.2, 1.0, 2.5, 0.3, -0.6])
    found = module.impact(t, y, 2, u=u)
    assert (found[4:] == y[4:]).all()
    assert (found[:4] == striking(TWIN, WALL, rocking).module.impact(t, y[:4], 2)).all()
    base = module.held(t, y, np.zeros(3), u=u)
    np.testing.assert_allclose(base[:6], module.derivative(t, y, u=u), rtol=1e-14)
    held = engine.exactly("held", exact(y), u, extra=[MP.mpf(x) for x in (1, 2, 3)], t=t)
    ahead = np.append(held[:6], MP.mpf(1))
    expected = along(lambda x: engine.exactly("gap_rates", x[:6], u, t=x[6]), exact([*y, t]), ahead)
    assert max(abs(expected - held[6:9])) < MP.mpf(10) ** -35


def test_stops_and_rough_contacts_in_one_module() -> None:
    """A contact without tangents beside others: its impact is as it is alone."""
    limit = Limit(joint="lower_hinge", high=0.3)
    together, alone = striking(TWIN, WALL, limit).module, striking(TWIN, limit).module
    y = np.array([0.4, 0.3, 1.0, 2.5])
    assert list(together.CONTACTS.values()) == ["balls", "balls", "limit"]
    np.testing.assert_allclose(together.impact(0.0, y, 2), alone.impact(0.0, y, 0), atol=1e-15)


def test_contacts_of_a_scene() -> None:
    """Corners, balls on planes and on each other, lids that move, stops: 60 digits and energy."""
    engine = striking(BOXES)
    module, rng = engine.module, np.random.default_rng(10)
    ny, nc = len(module.STATES), len(module.CONTACTS)
    assert list(module.CONTACTS) == [
        *(f"floor_box_{i}" for i in range(1, 9)),
        *("roll_ball", "roll_arm", "catch_ball", "lid_ball", "each_ball_box"),
        *("stop_low", "stop_high"),
    ]
    assert rates_and_accelerations_off(engine, rng) < MP.mpf(10) ** -35
    for _ in range(200):
        k = int(rng.integers(nc))
        y = approaching(engine, rng, k)
        found = module.impact(0.0, y, k)
        rest = 0.3 if k < 10 else 0.5
        before, after = (module.gap_rates(0.0, x)[k] for x in (y, found))
        assert abs(after + rest * before) < 1e-13 * max(1.0, np.max(np.abs(y)))
        energies = [module.kinetic_energy(0.0, x) for x in (y, found)]
        assert energies[1] <= energies[0] * (1 + 1e-14)
    assert module.held(0.0, module.initial_state(), np.ones(nc)).shape == (ny + 2 * nc,)


def test_columns() -> None:
    """Many states at once give what each gives."""
    engine = striking(TREE, SLOPE)
    module, rng = engine.module, np.random.default_rng(8)
    y = np.array([engine.random_state(rng) for _ in range(4)]).T
    forces = rng.uniform(0.0, 9.0, size=(5, 4))
    for f in (forces, forces[:, 0]):
        found = module.held(0.0, y, f)
        assert found.shape == (len(y) + 10, 4)
        for i in range(4):
            expected = module.held(0.0, y[:, i], f if f.ndim == 1 else f[:, i])
            np.testing.assert_allclose(found[:, i], expected, rtol=1e-11, atol=1e-11)
    found = module.impact(0.0, y, 1)
    singles = [module.impact(0.0, y[:, i], 1) for i in range(4)]
    np.testing.assert_allclose(found, np.array(singles).T, rtol=1e-11, atol=1e-11)


def test_wrong_arguments() -> None:
    """One line that says what there is."""
    module = striking(TWIN, WALL).module
    y = module.initial_state()
    for contact in (2, -1, 0.5):
        with pytest.raises(ValueError, match=rf"contact is {contact}, not one of 0 to 1: balls_0_"):
            module.impact(0.0, y, contact)
    with pytest.raises(ValueError, match=r"forces have shape \(3,\), not \(2,\): balls_0_lower"):
        module.held(0.0, y, [1.0, 2.0, 3.0])


def test_absence_is_free() -> None:
    """Nothing of contacts where there are none; the rest is the same beside them."""
    bare = striking(TWIN, route="aba")
    for word in ("CONTACTS", "impact", "held", "gap", "ontact"):
        assert word not in bare.source
    beside = striking(TWIN, WALL, route="aba").module
    y = bare.random_state(np.random.default_rng(9))
    for name in ("derivative", "jacobian", "joint_forces"):
        assert (getattr(beside, name)(0.0, y) == getattr(bare.module, name)(0.0, y)).all()
        assert beside.COST[name] == bare.module.COST[name]
    lacks = "Forces of held contacts are left out."
    for name in ("derivative", "joint_forces"):
        assert getattr(beside, name).__doc__.endswith(lacks)
        assert lacks not in getattr(bare.module, name).__doc__
