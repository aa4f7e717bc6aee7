"""Runs with rigid contacts against closed forms: impacts, rest, sliding, lifting, works."""

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign import some
from scipy.optimize import brentq

from eomgen.base.errors import RunError
from eomgen.engine import contact_runs
from eomgen.engine.contact_times import first_zero
from eomgen.engine.contacts import TOLERANCE, Place
from eomgen.engine.roots import Search
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, FixedStep
from eomgen.run.problem import Contacts, Problem
from eomgen.run.works import Powers
from eomgen.tables.integrators import GENERAL as GENERAL_METHODS

G = 9.81
FIXED = [name for name in GENERAL_METHODS if isinstance(INTEGRATORS[name], FixedStep)]
# Leapfrog cannot run contacts.
GENERAL = [name for name in GENERAL_METHODS if not name.startswith(("leapfrog", "taylor"))]
A_FEW = some([n for n in GENERAL if not n.endswith(("_differences", "_6", "euler"))], GENERAL)
EXACT = {"rtol": 1e-12, "atol": 1e-14}
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def mechanism(
    q,
    v,
    normals,
    offsets=None,
    *,
    mass=1.0,
    force=lambda t, q, v: 0.0 * q,
    bounce=1.0,
    slips=None,
    friction=0.0,
    slip_speed=1e-4,
    ground=lambda t: (0.0, 0.0, 0.0),
    names=None,
):
    """M q'' = force, with gaps N q + offsets - ground(t), friction along `slips` q."""
    n = len(q)
    mass = np.broadcast_to(np.asarray(mass, float), (n,))
    normals = np.atleast_2d(np.asarray(normals, float))
    nc = len(normals)
    offsets = np.zeros(nc) if offsets is None else np.asarray(offsets, float)
    slips = np.zeros((nc, n)) if slips is None else np.atleast_2d(np.asarray(slips, float))

    def acceleration(t, y):
        return (force(t, y[:n], y[n:]).T / mass).T

    def derivative(t, y):
        return np.concatenate([y[n:], acceleration(t, y)])

    def jacobian(t, y):
        steps = 1e-6 * np.eye(2 * n)
        columns = [derivative(t, y + h) - derivative(t, y - h) for h in steps]
        return np.array(columns).T / 2e-6

    def impact(t, y, k, factor):
        row = normals[k] / mass
        u = normals[k] @ y[n:] - ground(t)[1]
        return np.append(y[:n], y[n:] - (1 + factor * bounce) * u / (normals[k] @ row) * row)

    def held(t, y, forces):
        v = y[n:]
        slip = slips @ v
        rub = friction * forces * slip / np.sqrt(slip**2 + slip_speed**2)
        vd = acceleration(t, y) + ((normals.T @ forces - slips.T @ rub).T / mass).T
        powers = forces * (normals @ v) - rub * slip
        return np.concatenate([v, vd, normals @ vd - ground(t)[2], powers])

    return Problem(
        name="test",
        states=tuple(f"q{i}" for i in range(n)) + tuple(f"v{i}" for i in range(n)),
        positions=tuple(range(n)),
        derivative=derivative,
        jacobian=jacobian,
        initial=np.array([*q, *v], dtype=float),
        contacts=Contacts(
            names=names or tuple(f"touch_{k}" for k in range(nc)),
            effects=("ground",) * nc,
            gaps=lambda t, y: normals @ y[:n] + offsets - ground(t)[0],
            rates=lambda t, y: normals @ y[n:] - ground(t)[1],
            impact=impact,
            held=held,
        ),
    )


def weight(t, q, v):
    return -G + 0 * q


def ball(height, bounce, v=0.0):
    return mechanism([height], [v], [[1.0]], force=weight, bounce=bounce, names=("ground_ball",))


def run(problem, integrator, t_end, dt=0.01, **options):
    step = {"dt": dt} if integrator in FIXED else {}
    trajectory = integrate(problem, integrator, t_end, **step, **options)
    assert trajectory.finished, trajectory.message
    return trajectory


def times(trajectory, kind="impact"):
    return [event.t for event in trajectory.events if event.kind == kind]


def dense(problem, integrator, t_end, **options):
    """A run in which no row penetrates by more than the tolerance."""
    trajectory = run(problem, integrator, t_end, samples=5001, **options)
    gaps = [problem.contacts.gaps(t, y) for t, y in zip(trajectory.t, trajectory.y, strict=True)]
    assert np.min(gaps) >= -TOLERANCE
    return trajectory


def bounces(count, height, e):
    """The times of the bounces of a dropped ball, and their limit."""
    fall = math.sqrt(2 * height / G)
    at = fall * (1 + 2 * e * (1 - e ** np.arange(count)) / (1 - e))
    return at, fall * (1 + e) / (1 - e)


# --- a ball -------------------------------------------------------------------------------------


@pytest.mark.parametrize("e", [0.3, 0.8])
def test_bouncing_ball(e):
    """Time and speed of every bounce, and the end of the bouncing at the documented speed."""
    trajectory = dense(ball(1.0, e), "DOP853", 5.0, **EXACT)
    at = times(trajectory)
    exact, end = bounces(len(at), 1.0, e)
    np.testing.assert_allclose(at, exact, rtol=0, atol=1e-12)
    speeds = [event.speed for event in trajectory.events[:-1]]
    np.testing.assert_allclose(speeds, math.sqrt(2 * G) * e ** np.arange(len(at)), rtol=1e-9)
    assert trajectory.counts["impacts"] == len(at)
    rest = trajectory.events[-1]
    # It is held at the first meeting slower than rest_speed, which leaves less than this out:
    assert (rest.kind, rest.contact) == ("rest", "ground_ball")
    assert rest.speed < 1e-3 <= rest.speed / e
    assert 0 < end - rest.t < 2 * 1e-3 / (G * (1 - e))
    assert trajectory.y[-1] == pytest.approx([0, 0], abs=1e-12)
    # The row before an impact and the row after it have one time.
    twice = np.flatnonzero(np.diff(trajectory.t) == 0)
    np.testing.assert_allclose(trajectory.t[twice][: len(at)], at, rtol=0)
    before, after = trajectory.y[twice, 1], trajectory.y[twice + 1, 1]
    np.testing.assert_allclose(after[:-1], -e * before[:-1], rtol=1e-12)


def test_bouncing_goes_on_to_the_rest_speed_that_is_asked_for():
    counts = [run(ball(1.0, 0.5), "DOP853", 3.0, rest_speed=v).counts for v in (1e-1, 1e-5)]
    assert [c["impacts"] for c in counts] == [
        math.floor(math.log(math.sqrt(2 * G) / v, 2)) + 1 for v in (1e-1, 1e-5)
    ]


def test_energy_after_bounces():
    e = 0.9
    trajectory = dense(ball(1.0, e), "DOP853", 2.5, **EXACT)
    energy = trajectory.y[:, 1] ** 2 / 2 + G * trajectory.y[:, 0]
    struck = np.cumsum(np.append(0, np.diff(trajectory.t) == 0))
    assert struck[-1] > 2
    np.testing.assert_allclose(energy, G * e ** (2 * struck), rtol=1e-11)


@pytest.mark.parametrize("name", GENERAL)
@pytest.mark.every(4)
def test_every_integrator_bounces_and_rests(name):
    """Euler's method, of order 1, is accurate to its step; methods that are exact for parabolas are
    accurate to rounding.
    """
    order = getattr(INTEGRATORS[name], "order", 4)
    dt = 1e-3 if order == 1 else 1e-2
    trajectory = run(ball(1.0, 0.5), name, 2.0, dt=dt, rest_speed=0.05)
    exact, _ = bounces(5, 1.0, 0.5)
    bound = 1e-2 if order == 1 else 1e-8
    np.testing.assert_allclose(times(trajectory)[:5], exact, rtol=0, atol=bound)
    assert trajectory.events[-1].kind == "rest"
    assert trajectory.y[-1] == pytest.approx([0, 0], abs=1e-6)
    assert np.all(np.diff(trajectory.t) >= 0)


def test_bounces_are_as_exact_as_the_method():
    """On a spring with drag, where nothing is a polynomial: each method has its order."""

    def force(t, q, v):
        return -G - 30 * (q - 0.4) - 0.7 * v

    problem = mechanism([1.0], [0.0], [[1.0]], force=force, bounce=0.9)
    exact = run(problem, "DOP853", 2.0, rtol=3e-14, atol=1e-15)
    assert exact.counts["impacts"] >= 3
    for name, steps in (
        ("euler", (1000, 2000)),
        ("implicit_midpoint", (100, 200)),
        ("rk4", (40, 80)),
    ):
        errors = []
        for n in steps:
            trajectory = run(problem, name, 2.0, dt=2.0 / n)
            errors.append(np.max(np.abs(np.subtract(times(trajectory)[:3], times(exact)[:3]))))
        order = math.log2(errors[0] / errors[1])
        assert order > INTEGRATORS[name].order - 0.35, (name, errors)


@pytest.mark.every(2)
@pytest.mark.parametrize("margin", [-1e-6, 0.0, 1e-6])
@pytest.mark.parametrize("name", ["DOP853", "rk4", "Radau"])
def test_grazing(name, margin):
    """A ball thrown at a ceiling hits, touches or misses it by a micrometre, in one step."""
    top = 5.0**2 / (2 * G)
    problem = mechanism([0.0], [5.0], [[-1.0]], [top + margin], force=weight, bounce=0.5)
    trajectory = run(problem, name, 1.0, dt=1.0, **({} if name in FIXED else EXACT))
    at = times(trajectory)
    if margin < 0:
        speed = math.sqrt(2 * G * 1e-6)
        assert at == pytest.approx([(5 - speed) / G], abs=1e-11)
        assert trajectory.events[0].speed == pytest.approx(speed, rel=1e-6)
    else:
        assert at == []
        assert trajectory.y[-1] == pytest.approx([5 - G / 2, 5 - G], abs=1e-8)


def test_a_bounce_before_the_first_check_is_not_missed():
    """Up from the ground and down again within a twentieth of a very long step."""
    problem = ball(0.0, 1.0, v=0.2)
    trajectory = integrate(problem, "rk4", 2.5, dt=2.5)
    np.testing.assert_allclose(times(trajectory)[:50], 0.4 / G * np.arange(1, 51), rtol=1e-11)


def test_ball_in_a_box():
    """Without loss, each coordinate is a triangle wave."""
    box = [[1, 0], [-1, 0], [0, 1], [0, -1]]
    problem = mechanism([0.5, 0.5], [1.0, math.sqrt(2)], box, [0, 1, 0, 1])
    trajectory = dense(problem, "DOP853", 20.0)
    way = problem.initial[:2] + trajectory.t[:, None] * problem.initial[2:]
    np.testing.assert_allclose(trajectory.y[:, :2], np.abs((way + 1) % 2 - 1), atol=1e-12)
    assert trajectory.counts["impacts"] == sum(math.floor(c) for c in way[-1])


# --- several at once ----------------------------------------------------------------------------


def cradle(moving, e, balls=5):
    normals = np.zeros((balls - 1, balls))
    for k in range(balls - 1):
        normals[k, k : k + 2] = -1, 1
    places = np.arange(balls) - 0.5 * (np.arange(balls) < moving)
    speeds = (np.arange(balls) < moving).astype(float)
    return mechanism(places, speeds, normals, -np.ones(balls - 1), bounce=e)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", ["rk4", "DOP853", "LSODA"])
@pytest.mark.parametrize("moving", [1, 2, 3])
def test_newtons_cradle(name, moving):
    trajectory = dense(cradle(moving, 1.0), name, 2.0)
    assert trajectory.y[-1, 5:] == pytest.approx([0] * (5 - moving) + [1] * moving, abs=1e-11)


@pytest.mark.parametrize(("balls", "moving"), [(5, 1), (5, 2), (12, 1)])
def test_plastic_balls_go_on_together(balls, moving):
    trajectory = dense(cradle(moving, 0.0, balls), "DOP853", 2.0)
    assert trajectory.y[-1, balls:] == pytest.approx(moving / balls, abs=1e-9)


def test_two_balls_meet_the_ground_at_once():
    problem = mechanism([1.0, 1.0], [0.0, 0.0], np.eye(2), force=weight, bounce=0.7)
    trajectory = dense(problem, "DOP853", 6.0)
    first, second = ([e.t for e in trajectory.events if e.contact == f"touch_{k}"] for k in (0, 1))
    assert first == second
    np.testing.assert_allclose(first[:-1], bounces(len(first) - 1, 1.0, 0.7)[0], atol=1e-8)
    assert trajectory.y[-1] == pytest.approx(np.zeros(4), abs=1e-12)


def plate(q, v, e):
    """A square plate over the ground, for small tilts: height and two angles, four corners."""
    corners = [[1, a, b] for a in (-1, 1) for b in (-1, 1)]
    return mechanism(
        q,
        v,
        corners,
        mass=[2.0, 0.7, 0.7],
        force=lambda t, q, v: (weight(t, q, v).T * LEVER).T,
        bounce=e,
    )


LEVER = np.array([2.0, 0.6, 0.3])
"""Of the plate's weight: off its middle."""


def test_a_plate_on_four_corners():
    """Redundant contacts: a singular system at rest, and a landing that rocks until it rests."""
    rest = run(plate([0, 0, 0], [0, 0, 0], 0.5), "DOP853", 1.0)
    assert rest.y[-1] == pytest.approx(np.zeros(6), abs=1e-12)
    assert [e.kind for e in rest.events] == ["rest"] * 4

    landing = dense(plate([0.5, 0.1, -0.05], [0, 0.2, 0], 0.5), "DOP853", 6.0)
    energy = landing.y[:, 3:] ** 2 @ [2.0, 0.7, 0.7] / 2 + landing.y[:, :3] @ (G * LEVER)
    assert np.diff(energy).max() < 1e-9
    assert landing.y[-1] == pytest.approx(np.zeros(6), abs=1e-9)
    held = {e.contact for e in landing.events if e.kind == "rest"}
    assert len(held) >= 3


# --- held ---------------------------------------------------------------------------------------


def slope(angle, mu, v, slip_speed=1e-4):
    pull = np.array([-G * math.sin(angle), -G * math.cos(angle)])

    def force(t, q, v):
        return pull if np.ndim(q) == 1 else np.broadcast_to(pull[:, None], q.shape)

    return mechanism(
        [0, 0],
        [v, 0],
        [[0, 1]],
        force=force,
        slips=[[1, 0]],
        friction=mu,
        slip_speed=slip_speed,
    )


@pytest.mark.parametrize("name", ["rk4", "DOP853", "Radau", "BDF"])
def test_block_slides_on_a_slope(name):
    """With the acceleration g (sin - mu cos), to the width of the friction's smoothing."""
    trajectory = run(slope(0.5, 0.3, -1.0), name, 1.0, rtol=1e-10)
    down = G * (math.sin(0.5) - 0.3 * math.cos(0.5))
    assert trajectory.y[-1] == pytest.approx([-1 - down / 2, 0, -1 - down, 0], abs=3e-8)
    assert [(e.t, e.kind) for e in trajectory.events] == [(0.0, "rest")]


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["Radau", "BDF", "LSODA"])
def test_block_comes_to_a_stop_on_a_slope(name):
    """Pushed up a slope that holds it: it moves v²/2g(sin + mu cos), then creeps as documented."""
    slip_speed, sine, cosine = 1e-4, math.sin(0.3), math.cos(0.3)
    trajectory = run(slope(0.3, 0.6, 2.0, slip_speed), name, 1.5)
    part = sine / (0.6 * cosine)
    creep = slip_speed * part / math.sqrt(1 - part**2)
    assert trajectory.y[-1, 2] == pytest.approx(-creep, rel=1e-5)
    far = 2.0**2 / (2 * G * (sine + 0.6 * cosine))
    assert trajectory.y[-1, 0] == pytest.approx(far - creep, abs=creep)


def shaken(t):
    return 0.1 * np.sin(12 * t), 1.2 * np.cos(12 * t), -14.4 * np.sin(12 * t)


@pytest.mark.parametrize("name", A_FEW)
@pytest.mark.every(4)
def test_mass_leaves_a_shaken_table(name):
    """It lifts when the table accelerates downward by more than g, flies, and lands again."""
    problem = mechanism([0.0], [1.2], [[1.0]], force=weight, ground=shaken, bounce=0.0)
    lift = math.asin(G / 14.4) / 12
    fixed, order = name in FIXED, getattr(INTEGRATORS[name], "order", 4)
    dt = {"gauss_4": 2e-3, "gauss_6": 5e-3}.get(name, 1e-3)
    trajectory = run(
        problem,
        name,
        0.6,
        dt=dt,
        **({} if fixed else {"rtol": 1e-10 if "Radau" in name else 1e-11}),
    )
    first, second, *_ = [e for e in trajectory.events if e.kind != "rest"]
    bound = {1: 1e-3, 2: 5e-6}.get(order, 1e-9)
    assert first.kind == "lift"
    assert first.t == pytest.approx(lift, abs=bound)
    place, speed, _ = shaken(lift)
    landing = brentq(
        lambda t: place + speed * (t - lift) - G * (t - lift) ** 2 / 2 - shaken(t)[0], 0.2, 0.5
    )
    assert second.kind == "impact"
    assert second.t == pytest.approx(landing, abs=10 * bound)
    assert trajectory.events[4].t == pytest.approx(lift + 2 * math.pi / 12, abs=bound)


def test_what_flies_off_is_not_struck_again_where_it_was():
    """The gap at a bounce is 0 but for rounding, and a long step ends below the ground."""

    def gap(s):
        return 1e-16 + 0.0032 * s - 5 * s**2 if s > 1e-15 else math.copysign(1e-16, 1e-16 - s)

    class Falling:  # the state is the time
        state = staticmethod(lambda s: np.array([s]))
        gaps = staticmethod(lambda t, y: np.array([gap(y[0])]))
        rates = staticmethod(lambda t, y: np.array([0.0032 - 10 * y[0]]))

    search = Search(here=0.1, at_before=1e-16, at_here=gap(0.1))
    none = np.zeros(1, np.int64)
    place = Place(0.0, np.zeros(1), none, none, 0.0, 0.0, 0)
    at = first_zero(Falling, Falling, None, search, place)
    assert at == pytest.approx(0.00064, rel=1e-9)


def hump(v):
    """A point mass on top of a circle, without friction."""

    def gap(t, y):
        return np.array([math.hypot(y[0], y[1]) - 1])

    def derivative(t, y):
        return np.concatenate([y[2:], 0 * y[:1], 0 * y[:1] - G])

    def held(t, y, forces):
        radius = np.hypot(y[0], y[1])
        normal, v = y[:2] / radius, y[2:]
        a = np.array([0 * y[0], 0 * y[0] - G]) + normal * forces
        rate = (normal * v).sum(axis=0)
        second = (normal * a).sum(axis=0) + ((v * v).sum(axis=0) - rate**2) / radius
        return np.concatenate([v, a, [second], forces * rate])

    return Problem(
        "hump",
        ("x", "y", "vx", "vy"),
        (0, 1),
        derivative,
        lambda t, y: np.eye(4, k=2),
        np.array([0, 1, v, 0.0]),
        contacts=Contacts(
            ("hump_mass",),
            ("hump",),
            gap,
            lambda t, y: np.array([y[:2] @ y[2:] / math.hypot(y[0], y[1])]),
            lambda t, y, k, bounce: pytest.fail("nothing strikes"),
            held,
        ),
    )


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["rk4", "DOP853", "Radau"])
def test_mass_slides_off_a_hump(name):
    """It leaves a circle of radius r at cos = 2/3 + v²/3gr."""
    v = 0.5
    trajectory = run(hump(v), name, 2.0, dt=1e-3, **({} if name in FIXED else TIGHT))
    lift = trajectory.events[-1]
    assert [e.kind for e in trajectory.events] == ["rest", "lift"]
    after = int(np.searchsorted(trajectory.t, lift.t))
    cosine = 2 / 3 + v * v / (3 * G)
    # From there on it is a parabola.
    speed = math.sqrt(G * cosine)
    sine = math.sqrt(1 - cosine**2)
    t = trajectory.t[after:] - lift.t
    np.testing.assert_allclose(trajectory.y[after:, 0], sine + speed * cosine * t, atol=1e-8)
    np.testing.assert_allclose(
        trajectory.y[after:, 1], cosine - speed * sine * t - G * t**2 / 2, atol=1e-8
    )


# --- works --------------------------------------------------------------------------------------


def airy(names=("gravity", "air", "ground")):
    """A ball that slides after landing: weight, drag, and a ground that dissipates energy."""

    def drag(v):
        return -0.3 * np.hypot(v[0], v[1]) * v

    def force(t, q, v):
        return drag(v) + np.array([0 * q[0], 0 * q[0] - G])

    problem = mechanism(
        [0, 1], [3, 0], [[0, 1]], force=force, bounce=0.6, slips=[[1, 0]], friction=0.2,
        slip_speed=1e-2,
    )  # fmt: skip

    def powers(t, y):
        every = {"gravity": -G * y[3], "air": drag(y[2:]) @ y[2:], "ground": 0.0}
        return np.array([every[name] for name in names])

    return problem, Powers(names, powers, lambda t, y: float(y[2:] @ y[2:] / 2))


@pytest.mark.every(2)
@pytest.mark.parametrize("names", [("gravity", "air", "ground"), ("gravity", "air")])
def test_works_sum_to_the_change_of_energy(names):
    """At every row, through drag, impacts, sliding and rest; the ground has its own work."""
    problem, powers = airy(names)
    trajectory = run(problem, "DOP853", 2.3, powers=powers, **EXACT)
    assert trajectory.work_names == ("gravity", "air", "ground")
    assert trajectory.works.shape == (len(trajectory.t), 3)
    energy = (trajectory.y[:, 2:] ** 2).sum(axis=1) / 2
    np.testing.assert_allclose(trajectory.works.sum(axis=1), energy - energy[0], atol=1e-9)
    np.testing.assert_allclose(
        trajectory.works[:, 0], -G * (trajectory.y[:, 1] - trajectory.y[0, 1]), atol=1e-9
    )
    gravity, air, ground = trajectory.works[-1]
    assert gravity == pytest.approx(G, abs=1e-9)
    assert air < -0.1
    # From its rest on it only slides on the ground: friction and drag dissipate its energy.
    start = int(np.searchsorted(trajectory.t, trajectory.events[-1].t, side="right"))
    assert trajectory.works[start, 2] - ground > 0.01
    # Works are not computed by default, and the run is the same.
    plain = run(problem, "DOP853", 2.3, **EXACT)
    assert plain.works is None
    assert plain.work_names == ()
    assert plain.y.tobytes() == trajectory.y.tobytes()


def test_works_follow_the_order_of_the_method():
    problem, powers = airy()
    errors = []
    for dt in (0.02, 0.01):
        trajectory = run(replace(problem, contacts=None), "rk4", 2.0, dt=dt, powers=powers)
        energy = (trajectory.y[:, 2:] ** 2).sum(axis=1) / 2
        errors.append(abs(trajectory.works[-1].sum() - energy[-1] + energy[0]))
    assert errors[1] < 1e-7
    assert math.log2(errors[0] / errors[1]) > 3.8


@pytest.mark.parametrize("name", A_FEW)
@pytest.mark.every(4)
def test_every_integrator_books_works(name):
    problem, powers = airy()
    order = getattr(INTEGRATORS[name], "order", 4)
    dt = 1e-3 if order < 4 else 1e-2
    trajectory = run(problem, name, 1.5, dt=dt, powers=powers, rest_speed=0.05)
    energy = (trajectory.y[:, 2:] ** 2).sum(axis=1) / 2
    left = np.abs(trajectory.works.sum(axis=1) - energy + energy[0]).max()
    assert left < {1: 1e-2, 2: 1e-5}.get(order, 1e-6)


# --- what goes wrong ----------------------------------------------------------------------------


def message(problem, name="DOP853", t_end=1.0, **options):
    trajectory = integrate(problem, name, t_end, **options)
    assert not trajectory.finished
    return trajectory.message


def test_starts_too_deep():
    assert message(ball(-0.02, 0.5)) == (
        "stopped at t = 0, q0=-0.02, v0=0: contact ground_ball starts 0.02 deep; "
        "move its bodies apart in the initial state"
    )
    # A penetration within the tolerance decays like (1 + αt) exp(-αt).
    left = run(ball(-1e-9, 0.5), "rk4", 1.0).y[-1, 0]
    assert left == pytest.approx(-1e-9 * 11 * math.exp(-10), rel=1e-3)


def test_no_forces():
    """A contact that a push closes, as in Painlevé's paradox."""
    problem = ball(0.0, 0.5)

    def held(t, y, forces):
        return problem.contacts.held(t, y, -forces)

    odd = replace(problem, contacts=replace(problem.contacts, held=held))
    assert message(odd) == (
        "stopped at t = 0, q0=0, v0=0: no contact forces at t = 0 keep ground_ball from closing "
        "(strong friction can cause this); take less friction, or another contact law"
    )


def test_impacts_without_end():
    problem = ball(0.0, 0.5, v=-1.0)
    odd = replace(problem.contacts, impact=lambda t, y, k, bounce: y)
    assert message(replace(problem, contacts=odd)) == (
        "stopped at t = 0, q0=0, v0=-1: the impacts among ground_ball at t = 0 do not end; "
        "take less restitution"
    )


def test_bouncing_without_end(monkeypatch):
    """With a rest speed that is negligible."""
    assert message(ball(1.0, 0.9999), t_end=1e5, rest_speed=1.0, max_steps=500).endswith(
        "500 steps did not suffice; try another --integrator, or a looser --rtol and --atol"
    )
    monkeypatch.setattr(contact_runs, "MOST_EVENTS", 100)
    stuck = ball(0.0, 1.0, v=1e-9)
    assert "contacts struck or opened 100 times within 1e-06 s; take a larger rest_speed" in (
        message(stuck, "rk4", 1e3, dt=1.0, rest_speed=1e-30)
    )


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_rest_speed_that_cannot_be_served(speed):
    with pytest.raises(RunError, match=r"rest_speed: \S+ is not a positive speed, in m/s"):
        integrate(ball(1.0, 0.5), "rk4", 1.0, dt=0.1, rest_speed=speed)


def test_progress_grows_through_impacts():
    heard = []
    run(ball(1.0, 0.8), "RK45", 5.0, progress=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == 1.0


def test_an_impact_to_nowhere_stops():
    problem = ball(1.0, 0.5)
    odd = replace(problem.contacts, impact=lambda t, y, k, bounce: y * np.nan)
    trajectory = integrate(replace(problem, contacts=odd), "DOP853", 1.0)
    assert trajectory.message.startswith("stopped at t = 0.451524, ")
    assert "the state overflows" in trajectory.message
