"""Firmware computes what the module does, in double and in float, and steps as Runge-Kutta 4."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from crank_rocker import STOPPED, four_bar
from falling_block import BLOCK
from firmware import Firmware

import eomgen
from eomgen.base.errors import RunError
from eomgen.engine.methods import EQUAL
from eomgen.exports import Number
from eomgen.exports.firmware import ERRORS, FARTHEST
from eomgen.run.columns import FUNCTIONS

pytestmark = pytest.mark.apart

LIMITS: dict[Number, float] = {"double": 1e-13, "float": 3e-5}


@pytest.mark.parametrize("number", LIMITS)
def test_sines_and_cosines_are_as_exact_as_they_say(number: Number) -> None:
    """From 0 to the last angle; beyond it they are not a number."""
    made, rng = Firmware("cart_pole", number), np.random.default_rng(1)
    far = float(FARTHEST[number])
    x = made.array(np.concatenate([rng.uniform(-7, 7, 4000), rng.uniform(-far, far, 4000)]))
    exact = x.astype(np.longdouble)
    for quarter, function in enumerate((np.sin, np.cos)):
        error = np.abs(made.circular(x, quarter) - function(exact)).max()
        assert 0.2 * float(ERRORS[number]) < error < float(ERRORS[number])
    assert np.isnan(made.circular(made.array([1.1 * far, -1.1 * far, np.inf, np.nan]), 0)).all()
    before = made.sources["cart_pole.c"].partition("#ifdef")[0]
    assert "math.h" not in before  # it is included only where its functions are asked for


@pytest.mark.parametrize("number", LIMITS)
def test_steps_and_the_filter_are_those_of_the_module(number: Number) -> None:
    """A step, the covariance after it, and a correction, beside NumPy's."""
    module: Any = eomgen.load(eomgen.generate("cart_pole"))
    made, dt, limit = Firmware("cart_pole", number), 0.01, LIMITS[number]
    y, u = np.array([0.3, 0.7, -0.4, 1.1]), np.array([0.5])
    slope = made.derivative(0.0, made.array(y), made.array(u))
    np.testing.assert_allclose(slope, module.derivative(0.0, y, None, u), rtol=limit, atol=limit)
    np.testing.assert_allclose(made.stepped(y, u, dt, 3), steps(module, y, u, dt, 3), atol=limit)
    noise, p = np.array([1e-3, 2e-3, 3e-3, 4e-3]), np.eye(4) + 0.1
    covariance = made.array(p)
    made.call(
        *("predict", 0.0, dt, made.array(y), made.k, made.array(u), made.array(noise), covariance)
    )
    a = np.eye(4) + dt * module.jacobian(0.0, y, None, u)
    ahead = a @ p @ a.T + dt * np.diag(noise)
    np.testing.assert_allclose(covariance, ahead, atol=limit)
    gain = ahead[:, 1] / (ahead[1, 1] + 0.2)
    corrected = made.array(y)
    made.call("correct", 1, 0.9, 0.2, corrected, covariance)
    np.testing.assert_allclose(corrected, y + gain * (0.9 - y[1]), atol=limit)
    np.testing.assert_allclose(covariance, ahead - np.outer(gain, ahead[1]), atol=limit)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["rk4", "gauss_4", "leapfrog", "leapfrog_4"])
def test_steps_keep_loops(method: str) -> None:
    """After some steps, beside our own run of the same method, in double and in float."""
    loop, options = four_bar(), {"integrator": method, "dt": 1e-3}
    run = eomgen.simulate(loop, t_end=0.05, samples=2, backend="numpy", **options)
    for number in LIMITS:
        found = Firmware(loop, number, method).stepped(run.y[0], [], 1e-3, 50)
        np.testing.assert_allclose(found, run.y[-1], atol=1e2 * LIMITS[number])


@pytest.mark.every(3)
@pytest.mark.parametrize("method", EQUAL)
def test_each_method_with_equal_steps(method: str) -> None:
    """Beside our own run of it, in double and in float; and each step has the bits of `stepper`
    where that makes such.
    """
    own = "pendulum" if "leapfrog" in method else "tumbling_body"
    made = {number: Firmware(own, number, method) for number in LIMITS}
    run = eomgen.simulate(own, integrator=method, dt=1e-3, t_end=0.2, samples=2, backend="numpy")
    for number, firmware in made.items():
        found = firmware.stepped(run.y[0], [], 1e-3, 200)
        np.testing.assert_allclose(found, run.y[-1], atol=1e2 * LIMITS[number])
    with pytest.raises(RunError, match=r"DOP853.* makes no steps of exported code.*gauss_6"):
        Firmware("pendulum", "float", "DOP853")


@pytest.mark.parametrize(
    ("scene", "method", "dt"),
    [
        ("four_bar", "rk4", 1e-3),
        ("pendulum", "leapfrog_4", 1e-3),
        (BLOCK, "rk4", 0.02),
        (STOPPED, "semi_implicit_euler", 0.02),
    ],
)
def test_a_step_is_that_of_the_stepper(
    scene: str, method: str, dt: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bits, with the sines of the library; rigid contacts strike, are held and open."""
    for name, function in (("sin", math.sin), ("cos", math.cos)):
        of_each = np.frompyfunc(function, 1, 1)
        monkeypatch.setitem(FUNCTIONS, name, lambda x, of=of_each: of(x).astype(float))
    made = Firmware(scene, "double", method, "-DLIBM")
    step = eomgen.stepper(scene, dt=dt, method=method, backend="numpy")
    y, moved = step.initial(), 0
    u = np.zeros(len(step.inputs))
    for i in range(50):
        u[:] = 12.0 * (i > 45)  # which lifts the block
        after = step(y, u, t=i * dt)
        assert made.stepped(y, u, dt, 1, i).tolist() == after.tolist()
        moved += np.abs(after - y).max() > 1e-6
        y = after
    assert moved > 20


def test_gauss_steps_hold_contacts() -> None:
    """A block falls on two feet and stands, as by rk4; in `float` it falls on, which is said."""
    made = [Firmware(BLOCK, "double", method) for method in ("gauss_4", "rk4")]
    y = np.array([0.0, 0.1, 0.2, 0.5, 0.0, 0.0])
    found, other = (each.stepped(y, [0.0], 1e-3, 1000) for each in made)
    np.testing.assert_allclose(found, other, atol=1e-5)
    assert 0.02 < found[0] < 0.5 and (abs(found[[1, 2, 4, 5]]) < 1e-9).all()
    with pytest.warns(UserWarning, match="steps know no impacts"):
        assert Firmware(BLOCK, "float").stepped(y, [0.0], 1e-3, 1000)[1] < -4


def test_a_step_that_is_not_found_leaves_the_state(tmp_path: Path) -> None:
    """Newton's iteration does not converge in a step that is far too long; and then it goes on."""
    made = Firmware("double_pendulum", "double", "gauss_6")
    y = made.array([0.3, 2.0, 30.0, -40.0])
    before = y.copy()
    k, u = made.k, made.array([0.0, 0.0])
    assert made.call("step", 0.0, 50.0, y, k, u) == 0
    assert y.tolist() == before.tolist()
    assert made.call("step", 0.0, 1e-3, y, k, u) == 1


def test_the_example_estimates_what_is_not_measured(tmp_path: Path) -> None:
    """It follows the first state of a pendulum on a cart, and finds its velocities, in float."""
    import ctypes

    from eomgen.native.compiler import find_compiler

    made = Firmware("cart_pole", "float")
    main = '#include "cart_pole.c"\n#include "cart_pole_observer.c"\n'
    library = find_compiler().shared_library({**made.sources, "main.c": main}, "main.c", "-Os")
    (tmp_path / "observer.so").write_bytes(library)
    observer = ctypes.CDLL(str(tmp_path / "observer.so"))
    observer.observer_update.restype = ctypes.POINTER(ctypes.c_float)
    assert observer.observer_begin() == 0
    module: Any = eomgen.load(eomgen.generate("cart_pole"))
    begin = np.array([0.0, 0.01, 0.05, -0.05])
    y, open_loop, u = module.initial_state() + begin, module.initial_state(), np.array([0.2])
    given = (ctypes.c_float * 1)(0.2)
    for _ in range(400):
        y, open_loop = (steps(module, state, u, 0.005, 1) for state in (y, open_loop))
        found = observer.observer_update(given, ctypes.c_float(y[0]))
    assert np.abs(y - found[:4]).max() < 0.1 * np.abs(y - open_loop).max()


def steps(module: Any, y: np.ndarray, u: np.ndarray, dt: float, count: int) -> np.ndarray:
    """Steps of the classical method of order 4."""

    def slope(at: np.ndarray) -> np.ndarray:
        return np.asarray(module.derivative(0.0, at, None, u))

    for _ in range(count):
        a = slope(y)
        b = slope(y + dt / 2 * a)
        c = slope(y + dt / 2 * b)
        y = y + dt / 6 * (a + 2 * b + 2 * c + slope(y + dt * c))
    return y
