"""Steps of many states with inputs between them: bits in C and NumPy, resets, threads, mistakes."""

import math
import pickle
import shutil
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import pytest
from campaign import some
from crank_rocker import STOPPED, four_bar
from falling_block import BLOCK

import eomgen
from eomgen.api.given import check
from eomgen.run.module import load_module
from eomgen.scene.built_in import built_in_names
from eomgen.store import generated_code
from eomgen.study.verification.states import random_state

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
compiled = pytest.mark.skipif(CC is None, reason="there is no C compiler")
LANES = 11
LARGE = (
    "hanging_figure human_figure puma560 quadruped ragdoll stiff_beam walker_motors "
    "car_suspension stewart_platform"
).split()
FEW = ("cart_pole", "tumbling_body", "slider_crank", "steering_particles")
SOME = some(FEW, [name for name in built_in_names() if name not in LARGE])
LOOP = four_bar()
FUNCTIONS = """\
name = "functions"
inputs = [{ name = "thrust", default = 1.5 }]
bodies = [{ name = "rod", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "pin", type = "revolute", parent = "world", child = "rod", coordinate = "a" }]
effects = [{ type = "motor", name = "push", joint = "pin", torque = "%s" }]
"""
FUNCTIONS %= (
    "thrust*exp(-t)*tanh(a_dot) + max(a, min(atan2(a, 2), 0.5))*tan(0.1*a) - abs(a)*log(2 + a**2)"
    " + (sqrt(1 + a**2) if a > 0 else asin(0.3*sin(t)) + acos(0.1) + atan(a_dot))"
)


@cache
def pair(scene: str, method: str = "rk4") -> tuple[eomgen.Stepper, eomgen.Stepper, Any]:
    """The steps of a scene in C and in NumPy, and its module."""
    given = {"dt": 1e-3, "method": method, "lanes": LANES}
    found = [eomgen.stepper(scene, backend=name, **given) for name in ("c", "numpy")]
    model = check(scene)
    return found[0], found[1], load_module(generated_code(model).module, model.name)


def states(module: Any, rng: np.random.Generator) -> np.ndarray:
    return np.array([random_state(module, rng) for _ in range(LANES)]).T.copy()


@compiled
@pytest.mark.parametrize(
    ("scene", "method"),
    [
        *(pytest.param(name, "rk4", marks=pytest.mark.every(8)) for name in SOME),
        (FUNCTIONS, "rk4"),
        (LOOP, "rk4"),
        ("bouncing_two_body", "rk4"),
        *(("cart_pole", method) for method in ("euler", "semi_implicit_euler")),
        *(("pendulum", method) for method in some(("leapfrog_4",), ("leapfrog", "leapfrog_6"))),
    ],
)
def test_compiled_steps_have_the_bits_of_numpy(scene: str, method: str) -> None:
    """Other parameters and inputs in each lane, times of all and of each, a mask, what rounding
    took; the lanes do not fill whole registers.
    """
    *both, module = pair(scene, method)
    rng = np.random.default_rng(3)
    y = both[0].projected(states(module, rng))
    p = np.array([*module.PARAMETERS.values()])[:, None] * rng.uniform(0.99, 1.0, LANES)
    u = rng.uniform(-1.0, 1.0, (len(module.INPUTS), LANES))
    if scene == "babyboot":  # which has parameters that must fit exactly
        p = np.repeat(p[:, :1] * 0 + np.array([[*module.PARAMETERS.values()]]).T, LANES, axis=1)
    found = []
    for step in both:
        lost = np.zeros_like(y)
        rows = [step(y, steps=3), step(y, u, p, t=0.3, steps=2, lost=lost)]
        rows += [step(y, u, t=np.linspace(0.0, 1.0, LANES), reset=np.arange(LANES) % 4 == 1), lost]
        found.append([row.tobytes() for row in rows])
    assert found[0] == found[1]
    assert both[0].compiled and np.isfinite(both[0](y)).any()


@pytest.mark.parametrize("backend", ["numpy", pytest.param("c", marks=compiled)])
def test_many_calls_are_one_call_and_a_run(backend: Any) -> None:
    """With what rounding took, to the bit; and `simulate` by the same method, to rounding."""
    step = eomgen.stepper("two_body", dt=0.01, backend=backend)
    y, lost = step.initial(), np.zeros(8)
    once = step(y, steps=50)
    for i in range(50):
        assert step(y, t=i * 0.01, out=y, lost=lost) is y
    assert np.array_equal(y, once)
    run = eomgen.simulate("two_body", t_end=0.5, integrator="rk4", dt=0.01, backend="numpy")
    assert np.allclose(y, run.y[-1], rtol=1e-12, atol=1e-12)


@compiled
def test_rigid_contacts_strike_and_are_held() -> None:
    """To the motion of `simulate`; lanes have the bits of NumPy before, while and after they stand,
    whatever their neighbours, and a mask begins them anew.
    """
    run = eomgen.simulate(BLOCK, integrator="rk4", dt=1e-3, t_end=1.0, backend="c")
    kinds = {event.kind for event in run.trajectory.events}
    assert run.trajectory.counts["impacts"] > 20 and kinds >= {"impact", "rest"}
    c, python, _ = pair(BLOCK)
    y, lifts = c.initial(), np.arange(LANES) == 2
    y[1] += np.arange(LANES) * 1e-3
    u, first, again = 12.0 * lifts[None], y[:, 1].copy(), np.arange(LANES) == 3
    for _ in range(4):
        y = c(y, steps=250)
        step = {"reset": again, "first": first}
        assert python(y, u, **step).tobytes() == c(y, u, **step).tobytes()
    np.testing.assert_allclose(y[:, 0], run.y[-1], atol=1e-9)
    assert (abs(y[1:3]) < 1e-9).all() and (abs(y[4:]) < 1e-9).all()
    lifted = c(y, u, steps=100)
    for i in (0, 2):
        same = np.repeat(y[:, i : i + 1], LANES, axis=1)
        assert c(same, u[:, i], steps=100)[:, 5].tobytes() == lifted[:, i].tobytes()
    assert lifted[1, 2] == pytest.approx((12.0 - 9.81) * 0.1**2 / 2, rel=1e-6)


@compiled
def test_lanes_do_not_touch_one_another() -> None:
    """One that is no number stays so; one that overflows becomes nan; others have their bits."""
    *both, module = pair("tumbling_body")
    y = states(module, np.random.default_rng(5))
    alone = both[0](y)
    for step in both:
        y[2, 3], y[-1, 7] = math.nan, 1e200
        found = step(y)
        assert np.isnan(found[:, [3, 7]]).all()
        good = [i for i in range(LANES) if i not in (3, 7)]
        assert np.array_equal(found[:, good], alone[:, good])
        room = y.copy()
        again = step(room, reset=np.isin(np.arange(LANES), (3, 7)), first=y[:, 0], out=room)
        assert again is room and np.array_equal(room[:, good], alone[:, good])
        assert np.array_equal(room[:, [3, 7]], y[:, [0, 0]])


@compiled
def test_threads_share_a_stepper() -> None:
    """Each finds what it finds alone; so does a copy, for other processes."""
    step = eomgen.stepper("cart_pole", dt=1e-3, lanes=512)
    rng = np.random.default_rng(7)
    given = [
        (rng.uniform(-3, 3, (4, 512)), rng.uniform(-1, 1, (1, 512)), {"l": rng.uniform(0.4, 0.6)})
        for _ in range(24)
    ]
    wanted = [step(*each, steps=20).tobytes() for each in given]
    assert pickle.loads(pickle.dumps(step))(*given[0], steps=20).tobytes() == wanted[0]
    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(lambda x: step(*x, steps=20).tobytes(), given)) == wanted


@pytest.mark.parametrize("backend", ["numpy", pytest.param("c", marks=compiled)])
def test_loops_stay_closed(backend: Any) -> None:
    """Rows of constraints are met after each step, and states are drawn onto them; not so where
    they cannot be met.
    """
    step = eomgen.stepper(four_bar(), dt=1e-3, lanes=4, backend=backend)
    y = step.initial()
    y[0] += [0.0, 0.1, 0.2, 0.0]
    y[:3, 3] = 0.3, 2.0, -1.0
    y = step.projected(y)
    after = step(y, steps=30)
    for state in (y[:, :3], after[:, :3]):
        assert np.abs(step.module.constraint_residuals(0.0, state)).max() < 1e-15
    assert np.abs(after - y)[:3, :3].max() > 1e-4
    once = step(y[:, :1].repeat(4, axis=1), steps=30)
    assert np.array_equal(once[:, 2], after[:, 0])
    far = step(np.full((6, 4), 1e3))
    assert np.isnan(far).all() or np.abs(step.module.constraint_residuals(0.0, far)).max() < 1e-9


@compiled
def test_loops_strike_and_rest() -> None:
    """On rigid stops, with the bits of NumPy, to the motion of `simulate`."""
    run = eomgen.simulate(STOPPED, integrator="rk4", dt=5e-3, t_end=1.0, backend="numpy")
    assert {event.kind for event in run.trajectory.events} == {"impact", "rest"}
    c, python = (eomgen.stepper(STOPPED, dt=5e-3, backend=name) for name in ("c", "numpy"))
    y, t = c.initial(), 0.0
    for steps in (52, 28, 24, 96):
        assert c(y, t=t, steps=3).tobytes() == python(y, t=t, steps=3).tobytes()
        y, t = c(y, t=t, steps=steps), t + steps * 5e-3
        there = run.y[np.flatnonzero(abs(run.t - t) < 1e-9)[-1]]
        np.testing.assert_allclose(y, there, atol=1e-11)
    assert (abs(y[3:]) < 1e-12).all()


def test_without_a_compiler_it_is_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why; and asked for C it is an error."""
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("CC", "/nowhere/cc")
    step = eomgen.stepper("pendulum", dt=0.01)
    assert not step.compiled and "/nowhere/cc" in step.notice
    assert step(step.initial()).shape == (2,)
    with pytest.raises(eomgen.RunError, match="/nowhere/cc"):
        eomgen.stepper("pendulum", dt=0.01, backend="c")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"dt": 0.0}, "dt: 0 is not a positive time"),
        ({"dt": "1"}, "dt: '1' is not a number"),
        ({"lanes": 0}, "lanes: 0 is not a positive number"),
        (
            {"method": "rk5"},
            r"method: no 'rk5' with steps of equal length \(did you mean 'rk4'\?\)",
        ),
        ({"method": "DOP853"}, "method: no 'DOP853' with steps of equal length; known: rk4, euler"),
        ({"method": "leapfrog"}, "integrator: leapfrog needs forces that depend on positions"),
        ({"backend": "rust"}, "backend: 'rust' is not one of auto, numpy, c"),
        ({"source": four_bar(), "method": "leapfrog"}, "leapfrog with constraints"),
    ],
)
def test_a_stepper_that_cannot_be(given: dict[str, Any], said: str) -> None:
    """One line that says what to do."""
    asked = {"source": "cart_pole", "dt": 0.01, **given}
    with pytest.raises(eomgen.RunError, match=said) as caught:
        eomgen.stepper(asked.pop("source"), **asked)
    assert len(caught.value.lines) == 1


Y, READ_ONLY = np.zeros((4, 3)), np.zeros((4, 3))
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"y": np.zeros(4)}, r"y: shape \(4,\) is not \(4, 3\): a row for each of x, theta"),
        ({"y": "text"}, "y: of type str"),
        ({"y": [[0, 0, 0], [0]]}, "y: rows differ in length"),
        ({"u": {"pusch": 1.0}}, r"u: no input 'pusch' \(did you mean 'push'\?\)"),
        ({"u": {"push": [1.0, 2.0]}}, r"u: push has shape \(2,\), not \(\) or \(3,\)"),
        ({"u": [1.0, 2.0]}, r"u: shape \(2,\) is not \(1,\) or \(1, 3\): push"),
        ({"u": [math.nan]}, "u: not all are finite"),
        ({"p": {"m_cart": -1.0}}, "p: mass of cart is not positive"),
        ({"p": {"m_cart": [1.0, 0.0, 1.0]}}, "p: mass of cart is not positive"),
        ({"p": {"m_cart": math.inf}}, "p: not all are finite"),
        ({"steps": 0}, "steps: 0 is not a positive whole number"),
        ({"steps": 1.5}, "steps: 1.5 is not a positive whole number"),
        ({"t": math.nan}, "t: give a finite number"),
        ({"t": [0.0, 1.0]}, "t: give a finite number"),
        ({"reset": [1, 0, 1]}, "reset: give an array of 3 bools"),
        ({"reset": [True]}, "reset: give an array of 3 bools"),
        ({"first": np.zeros(3)}, r"first: shape \(3,\) is not \(4,\) or \(4, 3\)"),
        ({"first": np.full(4, np.nan)}, "first: not all are finite"),
        ({"out": np.zeros((4, 2))}, "out: give a contiguous array of floats of shape"),
        ({"out": np.zeros((3, 4)).T}, "out: give a contiguous array"),
        ({"out": READ_ONLY}, "out: is read-only"),
        ({"u": Y[:1], "out": Y}, "out: shares memory with u"),
        ({"lost": [0.0]}, "lost: give a contiguous array"),
    ],
)
@pytest.mark.parametrize("backend", ["numpy", pytest.param("c", marks=compiled)])
def test_mistakes_in_a_call_are_a_line(given: dict[str, Any], said: str, backend: Any) -> None:
    """Each names the argument; nothing is stepped."""
    step = eomgen.stepper("cart_pole", dt=0.01, lanes=3, backend=backend)
    asked = {"y": np.zeros((4, 3)), **given}
    with pytest.raises(eomgen.RunError, match=said) as caught:
        step(asked.pop("y"), **asked)
    assert len(caught.value.lines) == 1


def test_arrays_may_be_the_same_or_overlap() -> None:
    """In place; into a part of the array that is read; lists and whole numbers."""
    step = eomgen.stepper("cart_pole", dt=0.01, lanes=3)
    rng = np.random.default_rng(1)
    room = rng.uniform(-1.0, 1.0, 16)
    wanted = step(room[:12].reshape(4, 3))
    shifted = step(room[:12].reshape(4, 3), out=room[4:].reshape(4, 3))
    assert np.array_equal(shifted, wanted)
    assert np.array_equal(step([[0] * 3] * 4), step(np.zeros((4, 3))))
    assert np.array_equal(step(np.zeros((3, 4)).T), step(np.zeros((4, 3))))
