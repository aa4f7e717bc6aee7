"""References: extended precision against 60 digits, the motion against exact and published ones,
and whether the stated error holds.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gmpy2
import numpy as np
import pytest
from campaign import some
from engine import MP, engine, varied
from gmpy2 import mpfr
from mpmath import mp

from eomgen.base.errors import RunError
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import built_in_names, parse_scene, read_scene
from eomgen.store import generated_code, program_of
from eomgen.study.accuracy import measure
from eomgen.study.accuracy.collocation import rows
from eomgen.study.accuracy.gauss import gauss
from eomgen.study.accuracy.reference import LOOSE, TIGHT, reference
from eomgen.study.precision.precise import BITS, Precise, digits, precise

ONE_SIDED = """
name = "one_sided"
dimensions = 2
parameters = { k = 400.0, w = 9.5, c = 2.0 }
initial = { q = { x = 0.75 } }
bodies = [{ name = "block", mass = 1.0, inertia_com = 1.0 }]
joints = [
    { name = "slide", type = "prismatic", parent = "world", child = "block", axis = [1.0, 0.0], \
coordinate = "x" },
]
effects = [
    { type = "external_force", name = "push", body = "block", \
force = ["max(-k * x, 0) + c * step(-x) - w", 0] },
]
"""
"""A block that falls on a spring, with a kink, and into a field, with a jump, again and again."""
FORCED = """
name = "forced"
dimensions = 2
parameters = { a = 0.3 }
bodies = [{ name = "block", mass = 1.0, inertia_com = 1.0 }]
joints = [
    { name = "slide", type = "prismatic", parent = "world", child = "block", axis = [1.0, 0.0], \
coordinate = "x" },
]
effects = [
    { type = "external_force", name = "push", body = "block", force = \
["select(x - 0.3, 0.7, 0.1) * a * step(x_dot) - min(abs(x), 0.1) / 3 + sin(t) * x_dot", 0] },
]
"""
"""Corners of every kind, with plain numbers that meet."""


def compiled(scene: str) -> tuple[Model, Any]:
    """A scene's model and module."""
    model = elaborate(read_scene(scene) if scene in built_in_names() else parse_scene(scene))
    return model, load_module(generated_code(model).module)


def long_rows(
    made: tuple[Any, Any],
    times: np.ndarray,
    how: tuple[tuple[int, ...], float],
    exactly: Precise | None = None,
) -> np.ndarray:
    """The motion at some times in extended precision, relative to the scale used in comparisons."""
    model, module = made
    problem = as_problem(module)
    scale = measure.scales(module.STATES, module.UNITS, np.array([problem.initial + 1.0] * 2))
    exactly = exactly or precise(
        program_of(model), module, None, None, problem.initial, fix_branches=True
    )
    with digits():
        return np.array([row.y for row in rows(how[0], exactly, problem, scale, times, how[1])])


def to_mp(values: np.ndarray) -> np.ndarray:
    """Extended numbers converted exactly to mpmath."""

    def one(x: Any) -> Any:
        mantissa, exponent = x.as_mantissa_exp()
        return MP.mpf(int(mantissa)) * MP.mpf(2) ** int(exponent)

    return np.array([one(x) for x in values.ravel()], dtype=object).reshape(values.shape)


SCENES = some(("babyboot", "chain_in_wind", "two_body_forced", FORCED), (*built_in_names(), FORCED))


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.split()[0])
def test_the_derivative_is_the_program_in_long_numbers(scene: str) -> None:
    """It agrees with 60 digits to 30 digits, for any state, time, parameters and inputs."""
    rng = np.random.default_rng(1)
    made = engine(scene)
    module = made.module
    for watched in (False, True):
        y = made.random_state(rng)
        u = made.random_inputs(rng)
        p = varied(made.model, rng, 0.99, 1.01)
        exactly = made.exactly("derivative", y, u, p, t=0.7)
        module.derivative(0.7, y, p, u)  # keeps what it computed of these parameters, in doubles
        found = precise(made.system.program, module, p, u, y, fix_branches=watched)
        with digits():
            got = to_mp(np.array(found.derivative(mpfr(0.7), found.initial)))
        terms = np.maximum(np.abs(exactly), np.max(np.abs(exactly)))
        assert float(np.max(np.abs(got - exactly) / terms)) < 1e-30


def test_numbers_that_meet_stay_long() -> None:
    """Two constants of a formula that combine behind a corner are not rounded to a double."""
    made = engine(FORCED)
    with digits():
        found = precise(made.system.program, made.module, None, None, np.array([1.0, 1.0]))
        slope = found.derivative(mpfr(0), found.initial)[1]
        assert slope == mpfr(0.7) * mpfr(0.3) - mpfr(0.1) / 3


@pytest.mark.parametrize("stages", [5, 8, 12])
def test_collocation_is_of_gauss(stages: int) -> None:
    """To 32 digits, stages integrate polynomials of their degree, the end those of twice that."""
    method = gauss(stages)
    with digits():
        for k in range(2 * stages):
            powers = method.c**k
            if k < stages:
                off = np.max(np.abs(method.a @ powers - method.c ** (k + 1) / (k + 1)))
                assert off < 1e-31
            assert abs(method.d @ (method.a @ powers) - mpfr(1) / (k + 1)) < 1e-30
        assert (
            abs(method.d @ (method.a @ method.c ** (2 * stages)) - mpfr(1) / (2 * stages + 1)) > 0
        )


def exact_pendulum(times: np.ndarray) -> np.ndarray:
    """The scene's motion by Jacobi's functions in 40 digits; it starts at rest at an angle."""
    with mp.workdps(40):
        start = mp.mpf(float(np.pi)) - 3 * mp.pi / 2  # from hanging down
        k, w = mp.sin(start / 2), mp.sqrt(mp.mpf(9.81))
        quarter = mp.ellipk(k * k)
        found = []
        for t in times.tolist():
            u = w * mp.mpf(t) + quarter
            sn, cn = (mp.ellipfun(name, u, m=k * k) for name in ("sn", "cn"))
            found.append([2 * mp.asin(k * sn) + 3 * mp.pi / 2, 2 * w * k * cn])
        return np.array(found, dtype=object)


def test_the_pendulum_is_exact_and_its_error_stated() -> None:
    """The difference of the tighter and the looser run exceeds the error of either."""
    made = compiled("pendulum")
    times = np.linspace(0.0, 10.0, 21)
    exact = exact_pendulum(times)
    tight, loose = (to_mp(long_rows(made, times, how)) for how in (TIGHT, LOOSE))
    off = np.max(np.abs(tight - exact))
    assert off < 1e-19
    assert np.max(np.abs(tight - loose)) > off
    made_of = reference(*made, t_end=10.0)
    rounded = np.abs(made_of.y[::10] - exact) / made_of.scale
    assert float(np.max(rounded)) < made_of.error < 1e-15
    assert float(np.max(rounded[-1])) < made_of.final_error <= made_of.error
    assert np.array_equal(made_of.t[::10], times)
    assert made_of.origin.startswith("Gauss collocation")


@pytest.mark.parametrize("tolerance", [1e-8, 1e-12, 1e-16])
def test_the_stated_error_is_true_at_any_tolerance(tolerance: float) -> None:
    """The difference of two runs bounds the error of the tighter, and falls with the tolerance."""
    made = compiled("pendulum")
    times = np.linspace(0.0, 10.0, 6)
    exact = exact_pendulum(times)
    tight = to_mp(long_rows(made, times, (TIGHT[0], 0.01 * tolerance)))
    loose = to_mp(long_rows(made, times, (LOOSE[0], tolerance)))
    off, stated = (float(np.max(np.abs(tight - other))) for other in (exact, loose))
    assert off < stated < 100 * tolerance


def test_babyboot_as_others_recomputed_it() -> None:
    """The chaotic benchmark at 10 s against 20 digits of an extrapolation method in 48 digits.

    Problem: T. R. Kane 1974, in Drake's multibody/benchmarks/chaotic_babyboot, which publishes 7.
    """
    model, module = compiled("babyboot")
    with digits():
        decimal = {name: mpfr(repr(value)) for name, value in module.PARAMETERS.items()}
        problem = as_problem(module)
        start = (gmpy2.const_pi() / 2, gmpy2.const_pi() / 180, mpfr(0), mpfr(0))
        found = precise(program_of(model), module, decimal, None, problem.initial)
        exactly = replace(found, initial=start)
        y = long_rows((model, module), np.linspace(0.0, 10.0, 101), TIGHT, exactly)[-1]
        degrees = [
            y[0] * 180 / gmpy2.const_pi() - mpfr("-61.312983517501685533557430"),
            y[1] * 180 / gmpy2.const_pi() - mpfr("-929.47789813700101347430713"),
        ]
        rates = [
            y[2] - mpfr("-6.7440080753737697787210635"),
            y[3] - mpfr("-2.7795696723106601822852136"),
        ]
        assert max(map(abs, degrees)) < 1e-15
        assert max(map(abs, rates)) < 1e-16


def test_corners_are_met_exactly() -> None:
    """A block that falls on a spring repeatedly: parabolas and sines in 40 digits."""
    made = compiled(ONE_SIDED)
    times = np.linspace(0.0, 10.0, 51)[: some(31, 51)]
    tight, loose = (to_mp(long_rows(made, times, how)) for how in (TIGHT, LOOSE))
    with mp.workdps(40):
        k, w, height = mp.mpf(400), mp.mpf(9.5), mp.mpf(0.75)
        omega, fall = mp.sqrt(k), mp.sqrt(2 * height / w)
        speed = w * fall
        rest = (w - 2) / k  # how deep it would rest
        phase = mp.atan2(speed / omega, rest)
        within = (2 * mp.pi - 2 * phase) / omega
        size = mp.hypot(speed / omega, rest)
        exact = []
        for t in times.tolist():
            s = (mp.mpf(t) + fall) % (2 * fall + within)  # since it last left the spring
            if s < 2 * fall:
                exact.append([speed * s - w * s * s / 2, speed - w * s])
            else:
                angle = omega * (s - 2 * fall) + phase
                exact.append([size * mp.cos(angle) - rest, -size * omega * mp.sin(angle)])
        exact = np.array(exact, dtype=object)
    assert np.max(np.abs(tight - exact)) < 1e-17
    assert np.max(np.abs(tight - exact)) < np.max(np.abs(tight - loose)) < 1e-15


STOPPED = """
name = "stopped"
dimensions = 2
initial = { v = { x_dot = 1.0 } }
bodies = [{ name = "block", mass = 1.0, inertia_com = 1.0 }]
joints = [
    { name = "slide", type = "prismatic", parent = "world", child = "block", axis = [1.0, 0.0], \
coordinate = "x" },
]
effects = [
    { type = "joint_stop", name = "stop", joint = "slide", low = -0.5, high = 0.5, \
stiffness = 100.0, damping = 2.0 },
]
"""


def test_damped_stops_let_go() -> None:
    """Back and forth between two stops: the force ends before the penetration does."""
    made = compiled(STOPPED)
    times = np.linspace(0.0, 4.0, 41)
    tight = to_mp(long_rows(made, times, TIGHT))
    with mp.workdps(40):
        k, c = mp.mpf(100), mp.mpf(2)
        omega = mp.sqrt(k - c * c / 4)

        def pushed(s: Any) -> Any:
            """Depth and rate at a time s after touching at 1 m/s: x'' = -k x - c x'."""
            fall, sine, cosine = mp.exp(-c / 2 * s), mp.sin(omega * s), mp.cos(omega * s)
            return fall * sine / omega, fall * (cosine - c / 2 * sine / omega)

        # k x + c x' = 0, with x and x' as above.
        within = (mp.pi - mp.atan2(c * omega, k - c * c / 2)) / omega
        depth, back = pushed(within)
        exact, begin, speed, way = [], mp.mpf(0), mp.mpf(1), 1  # of a ride from the middle
        for t in map(mp.mpf, times.tolist()):
            while t > (end := begin + 0.5 / speed + within - (0.5 + depth * speed) / back / speed):
                begin, speed, way = end, -back * speed, -way
            s = t - begin - 0.5 / speed  # since it touched
            x, v = 0.5 + s * speed, speed
            if s >= within:
                x, v = 0.5 + (depth + (s - within) * back) * speed, back * speed
            elif s >= 0:
                x, v = 0.5 + pushed(s)[0] * speed, pushed(s)[1] * speed
            exact.append([way * x, way * v])
        exact = np.array(exact, dtype=object)
    assert np.max(np.abs(tight - exact)) < 1e-17


BALL = """
name = "ball"
dimensions = 2
bodies = [{ name = "b", mass = 0.3, inertia_com = 1e-3 }]
joints = [{ name = "j", type = "free", child = "b" }]
initial = { q = { b_y = 0.9 } }
effects = [
    { type = "gravity", g = 9.81 },
    { type = "contact", name = "floor", law = "impact", body = "b", radius = 0.1, \
restitution = 0.6, friction = 0.3, slip_speed = 0.01 },
]
"""


def test_rigid_contacts_are_followed_in_doubles() -> None:
    """A ball that bounces twice, against parabolas; the stated error holds."""
    model, module = compiled(BALL)
    found = reference(model, module, t_end=1.1)
    assert "rigid contacts" in found.origin
    fall = np.sqrt(2 * 0.8 / 9.81)
    begins = fall * np.array([0.0, 1.0, 2.2])
    flight = np.searchsorted(begins, found.t, side="right") - 1
    past = found.t - begins[flight]
    speed = 9.81 * fall * np.array([0.0, 0.6, 0.36])[flight]
    height = np.where(flight == 0, 0.9, 0.1) + speed * past - 9.81 / 2 * past**2
    k = module.STATES.index("b_y")
    off = np.max(np.abs(found.y[:, k] - height)) / found.scale[k]
    assert 0 < off < found.error < 1e-13


def test_doubles_stand_in() -> None:
    """If there is no time for extended precision; the stated error holds, too."""
    made = compiled("pendulum")
    made_of = reference(*made, t_end=1.0, seconds=1e-6)
    assert "doubles" in made_of.origin and "s in extended precision" in made_of.origin
    rounded = np.abs(made_of.y[::10] - exact_pendulum(made_of.t[::10])) / made_of.scale
    assert float(np.max(rounded)) < made_of.error < 1e-10


def test_kept_and_found_again(tmp_path: Path) -> None:
    """A reference is computed once for the same data; a damaged file is computed anew."""
    model, module = compiled("pendulum")

    def made(**changes: Any) -> Any:
        given = {"t_end": 0.5, "folder": tmp_path, "seconds": 60.0, **changes}
        return reference(model, module, **given)

    first = made()
    (path,) = tmp_path.iterdir()
    before, whole = path.stat().st_ino, path.read_bytes()
    again = made()
    assert path.stat().st_ino == before
    assert np.array_equal(first.y, again.y) and first.seconds == again.seconds
    assert (first.error, first.final_error, first.origin) == (
        again.error,
        again.final_error,
        again.origin,
    )
    for changes in ({"t_end": 0.25}, {"parameters": {"gravity_g": 9.0}}, {"seconds": 0.0}):
        count = len(list(tmp_path.iterdir()))
        made(**changes)
        assert len(list(tmp_path.iterdir())) == count + 1, changes
    path.write_bytes(whole[:300])
    assert np.array_equal(made().y, first.y)
    assert path.read_bytes()[:46] == whole[:46] and len(path.read_bytes()) > 300


def test_trouble() -> None:
    """Ctrl-C passes through; errors of the module are reported in a line; progress goes up to 1."""
    model, module = compiled("pendulum")
    reported: list[float] = []
    reference(model, module, t_end=0.5, progress=reported.append)
    assert reported == sorted(reported) and reported[-1] == 1.0

    def interrupt(done: float) -> None:
        if done > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reference(model, module, t_end=0.5, progress=interrupt)
    with pytest.raises(RunError, match="mass of bob is not positive"):
        reference(model, module, {"bob_mass": -1.0}, t_end=0.5)
    assert gmpy2.get_context().precision != BITS
