"""Several states at once in vector registers: sine and cosine, kernels, whole runs, sweeps."""

import ctypes
import math
import shutil
from dataclasses import replace
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.api.given import check, read
from eomgen.base.templating import render
from eomgen.codegen.backends import c
from eomgen.model.elaborate import in_order
from eomgen.native import lanes
from eomgen.native.lanes import Lanes
from eomgen.native.library import compiled_library
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.module import load_module
from eomgen.run.sine import cosine, sine
from eomgen.scene.built_in import built_in_names
from eomgen.store import generated_code, interfaced_program_of
from eomgen.study.verification.states import random_state

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(CC is None, reason="there is no C compiler")
WIDTHS = (2, 4, 8)
WRAPPER = """
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "vector.c"

void both(const double *x, double *sine, double *cosine) {
    V v, s, c;
    memcpy(&v, x, sizeof v);
    sine_and_cosine(v, &s, &c);
    memcpy(sine, &s, sizeof s);
    memcpy(cosine, &c, sizeof c);
}
"""


def usable() -> list[int]:
    """The widths that this processor has registers for."""
    return [width for width in WIDTHS if width <= lanes.width()]


@cache
def trigonometry(width: int, *more: str) -> Any:
    each = {"each": [(name, c.C_NAMES.get(name, name)) for name in c.EACH]}
    texts = {"vector.c": render(c.TEMPLATES, "sine.c.jinja", each), "both.c": WRAPPER}
    flags = (f"-DWIDTH={width}", *lanes.FLAGS[width], *more)
    return compiled_library(f"trigonometry {width} {more} {texts}", lambda: texts, "both.c", *flags)


def sine_and_cosine(x: np.ndarray, width: int, *more: str) -> np.ndarray:
    """Sines and cosines (2, n) of n angles, a multiple of the width."""
    found = np.empty((2, len(x)))
    call = trigonometry(width, *more).both
    call.argtypes = [ctypes.c_void_p] * 3
    for i in range(0, len(x), width):
        call(*(row[i:].ctypes.data for row in (x, *found)))
    return found


def angles() -> np.ndarray:
    """Angles of all sizes, near to multiples of a quarter turn, and near to where the reduction
    changes; among them the double that is nearest to such a multiple.
    """
    rng = np.random.default_rng(1)
    count = some(2000, 40000)
    multiples = np.rint(10.0 ** rng.uniform(0.0, 15.0, count)) * (math.pi / 2)
    some_sizes = 10.0 ** rng.uniform(-308.0, 308.0, count)
    border = 32768.0 + rng.uniform(-1.0, 1.0, count)
    small = rng.uniform(-7.0, 7.0, 4 * count)
    single = [6381956970095103.0 * 2.0**797, 1.7976931348623157e308, 5e-324, 32768.0, 0.0, 2.0**-26]
    single += [math.nextafter(32768.0, math.inf), 11.0, 710.0, 333.0, 245850922.0, 1e22]
    found = np.concatenate([multiples, some_sizes, border, small, single, nearest_to_quarters()])
    found = np.concatenate([found, -found])
    return found[: len(found) // 8 * 8]


def nearest_to_quarters() -> list[float]:
    """The doubles below 2^16 that are nearest to multiples of pi/2, one of each binade: numbers
    m 2^e with m / n a convergent or nearly one of the continued fraction of 2^-e pi/2.
    """
    found = []
    with mpmath.workprec(400):
        for e in range(-52, -36):
            ratio = mpmath.pi / 2 / mpmath.mpf(2) ** e
            before, now, value = (0, 1), (1, int(ratio)), ratio
            while now[1] < 2**53:
                found.append(math.ldexp(now[1], e))
                value = 1 / (value - int(value))
                before, now = (
                    now,
                    tuple(a + int(value) * b for a, b in zip(before, now, strict=True)),
                )
    return found


def test_plain_sine_and_cosine_have_the_bits_of_numpys() -> None:
    """Without fused sums, over the whole range of doubles, signs of zero too."""
    x = angles()
    found = sine_and_cosine(x, usable()[-1], "-DPLAIN")
    assert found.tobytes() == np.array([sine(x), cosine(x)]).tobytes()
    assert np.isnan([sine(math.inf), cosine(-math.inf), sine([[math.nan]])[0, 0]]).all()


@pytest.mark.every(2)
@pytest.mark.parametrize("more", [(), ("-DPLAIN",)], ids=["fused", "plain"])
def test_sine_and_cosine_are_within_an_ulp(more: tuple[str, ...]) -> None:
    """Against 1,200 bits, over the whole range of doubles."""
    x = angles()
    found = sine_and_cosine(x, usable()[-1], *more)
    worst = 0.0
    with mpmath.workprec(1200):
        for angle, *pair in zip(x.tolist(), *found.tolist(), strict=True):
            cosine, sine = mpmath.cos_sin(mpmath.mpf(angle))
            for value, true in zip(pair, (sine, cosine), strict=True):
                if true == 0:
                    assert value == 0 and math.copysign(1, value) == math.copysign(1, angle)
                    continue
                worst = max(worst, float(abs(mpmath.mpf(value) - true)) / math.ulp(float(true)))
    assert worst < 0.9, worst


FEW = ("two_body", "tumbling_body", "cart_pole", "double_pendulum")
LARGE = (
    "hanging_figure human_figure quadruped ragdoll stiff_beam walker_motors car_suspension "
    "peaucellier stewart_platform"
).split()


@cache
def kernels(scene: str, width: int = 0) -> tuple[Lanes, Any]:
    """The kernels of a scene's derivative and kinetic energy, and its Python module. A width beyond
    that of this processor is computed in narrower registers.
    """
    model = check(read(scene))
    model = replace(model, outputs=in_order((*model.outputs, "kinetic_energy")))
    module = load_module(generated_code(model).module, scene)
    texts = lanes.sources(*interfaced_program_of(model), ("kinetic_energy",))
    with pytest.MonkeyPatch.context() as patch:
        if width > lanes.width():
            patch.setitem(lanes.FLAGS, width, lanes.FLAGS[lanes.width()])
        return Lanes(texts, width or lanes.width()), module


def members(module: Any, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, parameters and inputs of this many members, as columns."""
    rng = np.random.default_rng(3)
    y = np.array([random_state(module, rng) for _ in range(count)]).T
    own = np.array([*module.PARAMETERS.values()])
    p = own[:, None] * rng.uniform(0.99, 1.0, count)
    u = rng.uniform(-1.0, 1.0, (len(module.INPUTS), count))
    return y.copy(), p, u


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", some([n for n in FEW if n != "cart_pole"], built_in_names()))
def test_columns_are_the_python_modules_to_rounding(scene: str) -> None:
    """With other parameters and inputs in each lane. The columns do not fill whole registers."""
    if scene in LARGE[1:]:
        pytest.skip("takes long to compile, and has nothing that others lack")
    ours, module = kernels(scene)
    y, p, u = members(module, 21)
    k, start, usual = ours.prepare(p.T)
    assert usual.all() or scene == "babyboot"  # which has parameters that must fit exactly
    for name in ("derivative", "kinetic_energy"):
        found, sound = ours.output(name, 0.3, y, k, u)
        assert sound.all()
        for j in np.flatnonzero(usual).tolist():
            true = getattr(module, name)(0.3, y[:, j], p[:, j], u[:, j])
            assert np.allclose(found[..., j], true, rtol=1e-12, atol=1e-12 * np.abs(true).max())
            assert np.array_equal(start[:, j], module.initial_state(p[:, j]))


@pytest.mark.every(4)
@pytest.mark.parametrize("scene", FEW)
def test_a_lane_has_the_same_bits_at_every_width_and_beside_any_others(scene: str) -> None:
    """Outputs and runs; one neighbour overflows, another is huge, and the order is reversed."""
    results = []
    for width in WIDTHS:
        ours, module = kernels(scene, width)
        y, p, u = members(module, 13)
        y[-1, 4], y[-1, 6] = np.inf, 1e300
        k, _, _ = ours.prepare(p.T)
        for order in (np.arange(13), np.arange(13)[::-1]):
            given = [np.ascontiguousarray(array[:, order]) for array in (y, k, u)]
            slopes, sound = ours.output("derivative", 0.0, *given)
            rows, stable = ours.rk4(*given, Grid(0.0, 0.25, 0.01, 10), sizes=np.ones((len(y), 1)))
            back = np.argsort(order)
            good = [j for j in range(13) if j not in (4, 6)]
            assert not sound[back][4] and stable[back][good].all() and not stable[back][4]
            results.append(
                (slopes[:, back][:, good].tobytes(), rows[..., back][..., good].tobytes())
            )


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", FEW)
def test_runs_are_those_of_a_plain_loop(scene: str) -> None:
    """Of the classical Runge-Kutta method over the Python module; the last step is shorter."""
    ours, module = kernels(scene)
    y, p, u = members(module, 5)
    k, _, _ = ours.prepare(p.T)
    rows, sound = ours.rk4(y, k, u, Grid(0.0, 0.253, 0.01, 5), sizes=np.ones((len(y), 1)))
    assert sound.all() and rows.shape[0] == 6
    for j in range(5):
        state, t = y[:, j], 0.0
        for i in range(26):
            h = 0.01 if i < 25 else 0.003

            def slope(after: float, at: np.ndarray, t: float = t, j: int = j) -> np.ndarray:
                return np.asarray(module.derivative(t + after, at, p[:, j], u[:, j]))

            f0 = slope(0.0, state)
            f1 = slope(h / 2, state + h / 2 * f0)
            f2 = slope(h / 2, state + h / 2 * f1)
            f3 = slope(h, state + h * f2)
            state, t = state + h / 6 * (f0 + 2 * f1 + 2 * f2 + f3), t + h
            for indices in module.QUATERNIONS:
                state[list(indices)] /= np.linalg.norm(state[list(indices)])
            if i in (4, 25):
                row = rows[0 if i == 4 else -1, :, j]
                assert np.allclose(row, state, rtol=1e-11, atol=1e-11 * np.abs(state).max())


def test_a_sweep_in_lanes_is_that_of_single_runs() -> None:
    """To rounding; and members that stop or are refused say why in the same words."""
    vary = {"m_A": [1.0, -1.0, 1.2, 0.9, 1e200], "theta": [0.1, 0.2, 1e5, 0.4, 0.5]}
    asked = {"t_end": 0.5, "integrator": "rk4", "dt": 0.01, "samples": 6}
    one, other = (
        eomgen.ensemble("two_body", vary, outputs=["kinetic_energy"], backend=backend, **asked)
        for backend in ("c", "numpy")
    )
    assert one.status == other.status and one.status[1] == "refused"
    assert one.messages.tolist() == other.messages.tolist() and "mass" in one.messages[1]
    assert np.array_equal(one.times, other.times) and one.rows.shape == other.rows.shape
    for a, b in ((one.final, other.final), (one.rows, other.rows)):
        assert np.allclose(a, b, rtol=1e-11, atol=1e-10, equal_nan=True)
    a, b = one.outputs["kinetic_energy"], other.outputs["kinetic_energy"]
    assert np.allclose(a, b, rtol=1e-11, equal_nan=True)


STIFF = """
name = "stiff"
bodies = [{ name = "rod", mass = 1.0, inertia_com = 0.1 }]
effects = [{ type = "joint_spring", name = "spring", joint = "pin", stiffness = 1e6 }]
initial = { q = { a = 0.2 } }
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "rod"
coordinate = "a"
"""


@pytest.mark.parametrize("scene", some([STIFF], [STIFF, "stiff_beam"]))
def test_steps_that_are_too_long_are_found(scene: str) -> None:
    """A stiff spring, or rod, at steps beyond its stability: the run overflows, or is bounded by
    rounding; and what is stable is not taken for unstable.
    """
    ours, module = kernels(scene)
    y = np.array([module.initial_state()]).T
    k, _, _ = ours.prepare(np.array([[*module.PARAMETERS.values()]]))
    u = np.zeros((len(module.INPUTS), 1))
    fastest = np.abs(np.linalg.eigvals(module.jacobian(0.0, y[:, 0]))).max()
    nearly = [] if scene == STIFF else [(2.5, True)]
    for steps, stable in ((1.5, True), *nearly, (3.2, False), (6.0, False)):
        dt = steps / fastest
        _, sound = ours.rk4(y, k, u, Grid(0.0, 200 * dt, dt, 200), sizes=np.ones((len(y), 1)))
        assert bool(sound[0]) is stable, steps


BRAKE = 'type = "joint_friction", name = "brake", joint = "pin", coulomb = 1.0, speed = 0.001'
STOP = 'type = "joint_stop", name = "stop", joint = "pin", low = -0.2, high = 0.2, stiffness = 1e4'


@pytest.mark.parametrize(
    ("effect", "dt", "sound"), [(BRAKE, 5.0 / 1e4, True), (STOP, 3.0 / math.sqrt(1e5), False)]
)
def test_steps_are_too_long_if_they_do_harm(effect: str, dt: float, sound: bool) -> None:
    """Friction that saturates holds a brake within 0.5 % of its speed, for as many steps as there
    are; what hits a stop is there for a step or two, and leaves it at 17 times its speed.
    """
    spring = STIFF[STIFF.index("type") : STIFF.index(" }]", STIFF.index("type"))]
    ours, module = kernels(STIFF.replace(spring, effect))
    k, _, _ = ours.prepare(np.array([[*module.PARAMETERS.values()]]))
    given = (np.array([[0.0], [1.0]]), k, np.zeros((len(module.INPUTS), 1)))
    _, found = ours.rk4(*given, Grid(0.0, 400 * dt, dt, 400), sizes=np.ones((2, 1)))
    assert bool(found[0]) is sound


UNSTABLE = ("light_cart_pole",)
"""Scenes with motions that are too fast for the steps of the next test."""


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "scene", some(FEW, [n for n in built_in_names() if n not in (*LARGE[1:], *UNSTABLE)])
)
def test_stable_runs_are_not_taken_for_unstable(scene: str) -> None:
    """Such runs are repeated in Python, which takes a thousand times as long."""
    ours, module = kernels(scene)
    y, p, u = members(module, 16)
    k, _, _ = ours.prepare(p.T)
    _, sound = ours.rk4(y, k, u, Grid(0.0, 0.2, 2e-4, 1000), sizes=np.ones((len(y), 1)))
    assert sound.all()


@pytest.mark.apart
def test_no_optimisation_changes_a_bit(request: pytest.FixtureRequest) -> None:
    """Other tests compile without it."""
    texts = lanes.sources(*interfaced_program_of(check(read("two_body_forced"))), ())
    y, p, u = members(kernels("two_body_forced")[1], 21)
    found = []
    for about in ("plain", "optimised"):
        if about == "optimised":
            request.getfixturevalue("optimised")
        ours = Lanes(texts, lanes.width(), about)
        k, _, _ = ours.prepare(p.T)
        rows, _ = ours.rk4(y, k, u, Grid(0.0, 0.2, 0.01, 5), sizes=np.ones((len(y), 1)))
        found.append((rows.tobytes(), ours.output("derivative", 0.0, y, k, u)[0].tobytes()))
    assert found[0] == found[1]
