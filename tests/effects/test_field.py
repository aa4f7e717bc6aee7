"""Force fields: formulas by hand, orbits and energy, steering past obstacles, and mistakes."""

import numpy as np
import pytest
from bookkeeping import differences, gained, powers
from engine import Engine, apart, engine, motion, plain, quick
from scenes import effect, free, lone, refusal
from scipy.integrate import solve_ivp
from spatial_trees import PLANE, SPACE

from eomgen.scene.reader import read_scene

MASS = 0.7
BODY = effect("field", name="pull", body="ball")
AVOID = "steering = 3.0\nradius = 0.4\nreach = 1.0\n"


def ball(effects: str, dimensions: int = PLANE) -> Engine:
    """A free body under some effects."""
    inertia = 0.03 if dimensions == PLANE else [0.02, 0.03, 0.04]
    return quick(free("ball", mass=MASS, inertia_com=inertia, dimensions=dimensions) + effects)


def at(made: Engine, place: list[float], v: list[float]) -> np.ndarray:
    """The state of a body there that moves so, upright and not turning."""
    y, n = made.module.initial_state(), len(place)
    y[:n] = place
    y[7 if n == SPACE else 3 :][:n] = v
    return y


def force(made: Engine, place: list[float], v: list[float], t: float = 0.0) -> np.ndarray:
    """The force on it, N."""
    n = len(place)
    return MASS * made.module.derivative(t, at(made, place, v))[7 if n == SPACE else 3 :][:n]


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_a_formula_is_the_force(dimensions: int) -> None:
    """Of place, velocity and time of a point away from the centre of mass."""
    parts = ['"x*vy - t"', '"sin(y)*vx + 2*z"', '"z*vz + x"'][:dimensions]
    made = ball(
        f"{BODY}force = [{', '.join(parts)}]\nat = [0.3, {'0, 0' if dimensions == 3 else 0}]\n",
        dimensions,
    )
    place, v = [0.4, -0.8, 0.5][:dimensions], [1.1, 0.6, -0.7][:dimensions]
    x, y, z = place[0] + 0.3, place[1], (place[2] if dimensions == SPACE else 0.0)
    vz = v[2] if dimensions == SPACE else 0.0
    expected = [x * v[1] - 1.3, np.sin(y) * v[0] + 2 * z, z * vz + x][:dimensions]
    assert apart(force(made, place, v, 1.3), expected) < 1e-14
    turn = made.module.derivative(1.3, at(made, place, v))[-1]
    assert turn == pytest.approx(0.3 * expected[1] / (0.03 if dimensions == PLANE else 0.04))


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("power", [0, 1, 2, 3, 6])
@pytest.mark.every(3)
def test_central_fields(dimensions: int, power: int) -> None:
    """Attract, repel and vortex by hand, with softening and a centre away from the origin."""
    centre, place = np.array([0.2, -0.1, 0.3])[:dimensions], [1.2, 0.7, -0.6][:dimensions]
    way = np.array(place) - centre
    keys = f"center = {centre.tolist()}\nstrength = 1.7\nsoftening = 0.25\npower = {power}\n"
    for kind, sign in (("attract", -1), ("repel", 1)):
        made = ball(f'{BODY}kind = "{kind}"\n{keys}', dimensions)
        expected = sign * 1.7 * way / np.sqrt(way @ way + 0.25**2) ** (power + 1)
        assert apart(force(made, place, [0.0] * dimensions), expected) < 1e-14
        y = at(made, place, [0.3, 1.0, -0.4][:dimensions])
        work, change = powers(made, y)[0], gained(made, "potential_energy", y)
        assert work != 0
        assert abs(work + change) < 1e-10
        assert abs(gained(made, "kinetic_energy", y) - work) < 1e-10
    made = ball(f'{BODY}kind = "vortex"\n{keys}', dimensions)
    size = 1.7 / np.sqrt(way[0] ** 2 + way[1] ** 2 + 0.25**2) ** (power + 1)
    expected = size * np.array([-way[1], way[0], 0.0])[:dimensions]
    assert apart(force(made, place, [0.0] * dimensions), expected) < 1e-14


def test_attraction_of_the_inverse_square_is_an_ellipse() -> None:
    """After Kepler's period, from the pericentre of an orbit with e = 0.5, all is as before."""
    made = ball(f'{BODY}kind = "attract"\nstrength = 0.7\n')
    start = at(made, [0.5, 0.0], [0.0, np.sqrt(3.0)])
    found = motion(made, 2 * np.pi * np.linspace(0, 1, 51), start)
    assert apart(found[:, -1], start) < 1e-9
    assert abs(found[0].min() + 1.5) < 0.02


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_steering_is_sideways(dimensions: int) -> None:
    """It does no work, turns away from the obstacle, and is none behind it or beyond its reach."""
    made = ball(f'{BODY}kind = "avoid"\n{AVOID}', dimensions)
    rng = np.random.default_rng(4)
    felt = 0
    for _ in range(40):
        place, v = rng.uniform(-1.2, 1.2, (2, dimensions))
        found, distance = force(made, list(place), list(v)), np.linalg.norm(place)
        assert abs(found @ v) < 1e-14
        if v @ place > 0 or distance > 1.4:
            assert not found.any()
            continue
        felt += 1
        aside = place - v * (place @ v) / (v @ v)
        near = min(1, 1 - (distance - 0.4) / 1.0)
        cosine = -(v @ place) / distance / np.linalg.norm(v)
        expected = 3.0 * near**2 * cosine**2 * (v @ v) * aside / np.linalg.norm(aside)
        assert apart(found, expected) < 1e-13
    assert felt > 5


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_straight_at_an_obstacle_it_steers_right(dimensions: int) -> None:
    """Neither stuck nor through; and the way is the same at another speed."""
    made = ball(f'{BODY}kind = "avoid"\n{AVOID}', dimensions)
    ways = []
    for speed in (0.5, 4.0):
        start = at(made, [-2.0, 0.0, 0.0][:dimensions], [speed, 0.0, 0.0][:dimensions])
        times = np.linspace(0, 5, 200) / speed
        found = motion(made, times, start, rtol=1e-10, atol=1e-12)
        ways.append(found[:dimensions])
        rates = found[7 if dimensions == SPACE else 3 :][:dimensions]
        assert apart(np.linalg.norm(rates, axis=0), np.full(200, speed)) < 1e-8
    assert apart(*ways) < 1e-6
    assert ways[0][1, -1] < -0.4
    assert np.linalg.norm(ways[0], axis=0).min() > 0.4


KINDS = {
    "formula": 'force = ["x*vy - t", "vx*abs(vx)"]',
    "attract": 'kind = "attract"\nstrength = 1.3\nsoftening = 0.1',
    "repel": 'kind = "repel"\nstrength = 1.3\npower = 1\nsoftening = 0.1',
    "vortex": 'kind = "vortex"\nstrength = 1.3\npower = 3\nsoftening = 0.1',
    "avoid": f'kind = "avoid"\n{AVOID}',
}


@pytest.mark.parametrize("kind", KINDS)
def test_jacobians_at_rest(kind: str) -> None:
    """Against differences of the module; in the very centre, finite."""
    made = ball(f"{BODY}{KINDS[kind]}\nat = [0.1, 0.05]\n")
    y = np.array([-0.5, 0.3, 0.4, 0.0, 0.0, 0.0])
    found = made.module.jacobian(0.6, y)
    assert np.isfinite(found).all()
    assert apart(found, differences(made, y, 0.6)) < 1e-5
    y[:3] = -0.1, -0.05, 0.0
    assert np.isfinite(made.module.jacobian(0.6, y)).all()
    assert np.isfinite(made.module.derivative(0.6, y)).all()


def test_jacobian_of_steering_straight_ahead() -> None:
    """On the seam of two ways it is finite."""
    made = ball(f'{BODY}kind = "avoid"\n{AVOID}', SPACE)
    for v in ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]):
        assert np.isfinite(made.module.jacobian(0.0, at(made, [-0.6, 0.0, 0.0], v))).all()


TIP = {"body": "b", "at": [0.3, 0.1]}


@pytest.mark.parametrize("place", [{"points": ["tip"]}, TIP], ids=["a point", "a place"])
def test_a_constant_force_has_a_closed_form(place: dict[str, object]) -> None:
    """At a named point and at one of a body."""
    push = effect("field", force=["2", "1"], **place)
    text = lone("revolute", push, mass=3.0, r_child=[-0.4, 0], points=[{"name": "tip", **TIP}])
    one, other = (plain(text, route).module for route in ("closed", "aba"))
    y = np.array([0.4, 1.5])
    np.testing.assert_allclose(one.derivative(0.0, y), other.derivative(0.0, y), rtol=1e-13)


def test_the_particles_pass_every_obstacle() -> None:
    """The scene `steering_particles`: none of its discs touches, all get through."""
    scene = read_scene("steering_particles")
    made = engine("steering_particles", leave_out=("parameter_jacobian",))
    found = solve_ivp(
        made.module.derivative,
        (0, 7),
        made.module.initial_state(),
        "DOP853",
        rtol=1e-6,
        max_step=0.1,
    )
    assert found.success
    radii = [
        body.shapes[0].radius.value for body in scene.bodies if body.name.startswith("obstacle")
    ]
    centres = [e.center for e in scene.effects if e.type == "field"]
    for disc in range(7):
        x, y = found.y[3 * disc : 3 * disc + 2]
        assert x[-1] > 5.5
        for (a, b), radius in zip(centres, radii, strict=True):
            assert np.hypot(x - a.value, y - b.value).min() > radius + 0.04


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "effects[0].force: is missing; kind 'formula' needs it"),
        ('kind = "attract"', "effects[0].strength: is missing; kind 'attract' needs it"),
        (
            'kind = "avoid"\nsteering = 1\nradius = 1',
            "effects[0].reach: is missing; kind 'avoid' needs it",
        ),
        (
            'kind = "atract"\nstrength = 1',
            "effects[0].kind: unknown value 'atract' (did you mean 'attract'?)",
        ),
        (
            'kind = "repel"\nstrength = 1\nradius = 1',
            "effects[0].radius: does not belong to kind 'repel'; it takes center, strength, "
            "power, softening",
        ),
        (
            'kind = "repel"\nstrength = 1\npower = 1.5',
            "effects[0].power: 1.5 is not a whole number; give one",
        ),
        ('force = ["motion", 0]', "effects[0].force[0]: unknown parameter 'motion'"),
    ],
)
def test_mistakes(text: str, message: str) -> None:
    """Each in one line, with its place and what to do."""
    assert message in refusal(f"{free('ball')}{BODY}{text}\n")
