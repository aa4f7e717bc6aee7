"""Integrators against exact solutions and invariants, and all errors of a run."""

import io
import math
import re
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from campaigns import energy
from scipy.integrate import DOP853, RK45, solve_ivp
from scipy.special import ellipj, ellipk
from single_steps import made

from eomgen.base.errors import RunError
from eomgen.engine import dop853_coefficients as coefficients
from eomgen.engine.explicit import RUNGE_KUTTA_4 as TABLEAU
from eomgen.engine.tableau import ButcherTableau, density, size, trees
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, FixedStep, StepFailure
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.run.integrators.explicit import runge_kutta
from eomgen.run.integrators.implicit_stages import METHODS as GAUSS
from eomgen.run.integrators.implicit_stages import ImplicitMethod
from eomgen.run.problem import Problem
from eomgen.run.progress import terminal_progress
from eomgen.run.trajectory import Outcome
from eomgen.tables.integrators import GENERAL as GENERAL_METHODS

EQUAL = [name for name, method in INTEGRATORS.items() if isinstance(method, FixedStep)]
FIXED = [name for name in GENERAL_METHODS if isinstance(INTEGRATORS[name], FixedStep)]
SERIES = [name for name, method in INTEGRATORS.items() if getattr(method, "series", "")]
ADAPTIVE = [name for name in GENERAL_METHODS if name not in (*FIXED, *SERIES)]
ALL = [*FIXED, *ADAPTIVE]
KNOWN = ", ".join(INTEGRATORS)
# Leapfrog and its compositions can integrate few problems.
GENERAL = [name for name in ALL if not name.startswith("leapfrog")]
LEAPFROGS = [name for name in ALL if name.startswith("leapfrog")]

PENDULUM = Problem(
    name="pendulum",
    states=("angle", "rate"),
    positions=(0,),
    derivative=lambda t, y: np.array([y[1], -math.sin(y[0])]),
    jacobian=lambda t, y: np.array([[0.0, 1.0], [-math.cos(y[0]), 0.0]]),
    initial=np.array([1.2, 0.0]),
)
# The order of the states does not matter: velocity first here.
OSCILLATOR = Problem(
    name="oscillator",
    states=("rate", "place"),
    positions=(1,),
    derivative=lambda t, y: np.array([-4 * y[1], y[0]]),
    jacobian=lambda t, y: np.array([[0.0, -4.0], [1.0, 0.0]]),
    initial=np.array([0.3, 1.0]),
)
INERTIA = np.array([1.0, 2.0, 3.0])
GYRATION = np.array([-1.0, 1.0, -1 / 3])  # (I2 - I3) / I1 and so on, Euler's equations
SPINNING_BODY = Problem(
    name="spinning body",
    states=("wx", "wy", "wz"),
    positions=(),
    derivative=lambda t, w: GYRATION * np.array([w[1] * w[2], w[2] * w[0], w[0] * w[1]]),
    jacobian=lambda t, w: (
        GYRATION[:, None] * np.array([[0, w[2], w[1]], [w[2], 0, w[0]], [w[1], w[0], 0]])
    ),
    initial=np.array([0.1, 2.0, 0.2]),
)
BLOW_UP = Problem(
    name="blow-up",
    states=("size",),
    positions=(),
    derivative=lambda t, y: y * y,
    jacobian=lambda t, y: np.diag(2 * y),
    initial=np.array([1.0]),
)


def stiff(rate):
    return Problem(
        name="stiff",
        states=("x",),
        positions=(),
        derivative=lambda t, y: rate * y,
        jacobian=lambda t, y: np.array([[rate]]),
        initial=np.array([1.0]),
    )


def exact_pendulum(t):
    """The pendulum released at rest, by Jacobi's elliptic functions."""
    k = math.sin(PENDULUM.initial[0] / 2)
    sn, cn, _, _ = ellipj(ellipk(k * k) - t, k * k)
    return np.column_stack([2 * np.arcsin(k * sn), -2 * k * cn])


def run(problem, integrator, t_end, dt=0.01, **options):
    step = {"dt": dt} if integrator in FIXED else {}
    return integrate(problem, integrator, t_end, **step, **options)


def pendulum_energy(y):
    return y[:, 1] ** 2 / 2 - np.cos(y[:, 0])


# --- accuracy -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIXED)
def test_order_is_the_stated_one(name):
    t_end = 2.0
    # Enough steps to show a higher order, but so few that rounding does not hide the highest.
    steps = np.array(
        {1: [320, 640, 1280, 2560], 6: [5, 7, 10, 14]}.get(
            INTEGRATORS[name].order, [40, 80, 160, 320]
        )
    )
    errors = [
        np.linalg.norm(run(PENDULUM, name, t_end, dt=t_end / n).y[-1] - exact_pendulum(t_end))
        for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(INTEGRATORS[name].order, abs=0.1)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_adaptive_method_meets_its_tolerance(name):
    errors = {}
    for rtol in (1e-6, 1e-9):
        trajectory = integrate(PENDULUM, name, 10.0, rtol=rtol, atol=rtol, samples=501)
        assert trajectory.finished
        assert trajectory.message == ""
        assert trajectory.t == pytest.approx(np.linspace(0, 10, 501), abs=0)
        # Dense output between the steps included; local errors add up over the run.
        errors[rtol] = np.max(np.abs(trajectory.y - exact_pendulum(trajectory.t)))
        assert errors[rtol] < 100 * rtol
    assert errors[1e-9] < errors[1e-6] / 30


@pytest.mark.parametrize("name", ["Radau", "BDF"])
def test_the_jacobian_saves_derivative_calls(name):
    calls = 0

    def derivative(t, y):
        nonlocal calls
        calls += 1
        return van_der_pol.derivative(t, y)

    mu = 50.0
    van_der_pol = Problem(
        name="van der Pol",
        states=("x", "v"),
        positions=(0,),
        derivative=lambda t, y: np.array([y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]),
        jacobian=lambda t, y: np.array([[0, 1], [-2 * mu * y[0] * y[1] - 1, mu * (1 - y[0] ** 2)]]),
        initial=np.array([2.0, 0.0]),
    )
    trajectory = integrate(van_der_pol, name, 100.0, rtol=1e-5, atol=1e-7)
    without = solve_ivp(
        derivative, (0, 100), van_der_pol.initial, method=name, rtol=1e-5, atol=1e-7
    )
    assert trajectory.y[-1] == pytest.approx(without.y[:, -1], rel=1e-2)
    assert trajectory.counts["jacobians"] > 10
    assert trajectory.counts["derivatives"] < calls

    # Evaluations for differences count as derivatives, and so do two for SciPy's first step.
    differing = integrate(van_der_pol, f"{name}_differences", 100.0, rtol=1e-5, atol=1e-7)
    assert differing.y[-1] == pytest.approx(without.y[:, -1], rel=1e-12)
    assert differing.counts["jacobians"] == 0
    assert differing.counts["derivatives"] == calls


def test_the_jacobian_reaches_lsoda():
    trajectory = integrate(stiff(-1e6), "LSODA", 10.0)
    assert trajectory.finished
    assert trajectory.counts["jacobians"] > 0


# --- invariants ---------------------------------------------------------------------------------


@pytest.mark.every(2)
@pytest.mark.parametrize("name", [*GAUSS, *LEAPFROGS])
def test_symmetric_methods_run_backwards(name):
    change = INTEGRATORS[name].prepare(PENDULUM)
    h, y = 0.1, PENDULUM.initial
    for i in range(200):
        y = y + change(PENDULUM, i * h, y, h)
    assert np.abs(y - PENDULUM.initial).max() > 0.1
    for i in range(200, 0, -1):
        y = y + change(PENDULUM, i * h, y, -h)
    assert y == pytest.approx(PENDULUM.initial, abs=1e-13)


@pytest.mark.every(5)
@pytest.mark.parametrize("name", ["semi_implicit_euler", *LEAPFROGS, *GAUSS])
def test_symplectic_energy_is_bounded_without_trend(name):
    trajectory = run(PENDULUM, name, 200.0, dt=0.05)
    error = pendulum_energy(trajectory.y) - pendulum_energy(trajectory.y)[0]
    drift = np.polyfit(trajectory.t, error, 1)[0] * trajectory.t[-1]
    assert 0 < np.max(np.abs(error)) < 0.03
    assert abs(drift) < np.max(np.abs(error)) / 20


def growth(name):
    """The relative change of a small area of states in a step, by differences of order 4."""
    change, e = INTEGRATORS[name].prepare(PENDULUM), 1e-4

    def step(*shift):
        y = np.array([1.2, 0.4]) + shift
        return y + change(PENDULUM, 0.0, y, 0.3)

    by_angle = 8 * (step(e, 0) - step(-e, 0)) - step(2 * e, 0) + step(-2 * e, 0)
    by_rate = 8 * (step(0, e) - step(0, -e)) - step(0, 2 * e) + step(0, -2 * e)
    return np.linalg.det([by_angle, by_rate]) / (12 * e) ** 2 - 1


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["semi_implicit_euler", *LEAPFROGS, *GAUSS])
def test_symplectic_steps_keep_areas(name):
    assert abs(growth(name)) < 1e-11
    assert abs(growth("rk4")) > 1e-8


@pytest.mark.every(2)
@pytest.mark.parametrize("name", GAUSS)
@pytest.mark.parametrize("dt", [0.05, 0.2])
def test_gauss_conserves_quadratic_invariants(name, dt):
    oscillator = run(OSCILLATOR, name, 200 * dt, dt=dt)
    energy = oscillator.y**2 @ [1, 4]
    assert energy == pytest.approx(energy[0], rel=1e-14)

    body = run(SPINNING_BODY, name, 250 * dt, dt=dt)
    assert np.ptp(np.sign(body.y[:, 1])) == 2, "it should tumble about its middle axis"
    for weights in (INERTIA, INERTIA**2):  # twice the energy, and |angular momentum|^2
        invariant = body.y**2 @ weights
        assert invariant == pytest.approx(invariant[0], rel=1e-14)


@pytest.mark.parametrize("name", ["euler", "rk4", "gauss_4"])
def test_rounding_does_not_drift(name):
    """Every step is rounded at the last digit of y in the same direction. Compensated sums give the
    same end as sums in many digits.
    """
    away = Problem(
        name="away",
        states=("x",),
        positions=(),
        derivative=lambda t, y: np.array([1 / 3]),
        jacobian=lambda t, y: np.zeros((1, 1)),
        initial=np.array([1e6]),
    )
    end = integrate(away, name, 20.0, dt=0.01, samples=2).y[-1, 0]
    assert end == pytest.approx(1e6 + 20 / 3, abs=1.2e-10)
    plain = 1e6
    for _ in range(2000):
        plain += 0.01 / 3
    assert abs(plain - end) > 1e-9


# --- Newton -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GAUSS)
def test_gauss_is_stable_where_stiff(name):
    problem = stiff(-1e6)
    trajectory = run(problem, name, 10.0, dt=0.1)
    # The stability function is Padé's approximant of e^z of equal degrees, at z = -1e5: it tends to
    # -1 or 1, bounded, damping nothing, and without growth.
    z = -1e6 * 0.1
    even, odd = {
        "implicit_midpoint": (1, z / 2),
        "gauss_4": (1 + z**2 / 12, z / 2),
        "gauss_6": (1 + z**2 / 10, z / 2 + z**3 / 120),
    }[name]
    assert trajectory.y[-1, 0] == pytest.approx(((even + odd) / (even - odd)) ** 100, rel=1e-10)
    # On a linear problem the first iteration is exact, and the second only confirms it.
    stages = len(GAUSS[name].of.b)
    assert trajectory.counts["jacobians"] <= 2 * stages * trajectory.counts["steps"]


def test_newton_needs_the_right_jacobian():
    rigid = stiff(-1e6)
    blind = replace(rigid, jacobian=lambda t, y: np.array([[-4e5]]))
    failed = run(blind, "implicit_midpoint", 10.0, dt=0.1)
    assert failed.message == (
        "stopped at t = 0, x=1: Newton did not converge in 20 iterations; "
        "take a smaller --dt or an adaptive method (--integrator Radau)"
    )
    right = run(PENDULUM, "implicit_midpoint", 5.0, dt=0.1)
    slow = replace(PENDULUM, jacobian=lambda t, y: PENDULUM.jacobian(t, y) * [[1], [1.1]])
    wrong = run(slow, "implicit_midpoint", 5.0, dt=0.1)
    # It still converges, since only the residual matters, but not quadratically.
    assert wrong.y[-1] == pytest.approx(right.y[-1], abs=1e-11)
    assert right.counts["jacobians"] <= 4.5 * right.counts["steps"]
    assert wrong.counts["jacobians"] > 1.3 * right.counts["jacobians"]


def test_newton_stops_at_the_noise_of_the_derivative():
    noise = np.random.default_rng(1)
    resting = Problem(
        name="at rest",
        states=("x",),
        positions=(0,),
        derivative=lambda t, y: -1e3 * (y - 1) + 1e-10 * noise.normal(size=1),
        jacobian=lambda t, y: np.array([[-1e3]]),
        initial=np.array([1.0]),
    )
    trajectory = run(resting, "implicit_midpoint", 10.0, dt=0.1)
    assert trajectory.finished
    assert trajectory.y[-1, 0] == pytest.approx(1, abs=1e-10)


def test_newton_is_not_blurred_by_a_large_state():
    beside = replace(
        PENDULUM,
        states=("angle", "rate", "far"),
        derivative=lambda t, y: np.append(PENDULUM.derivative(t, y), 0.0),
        jacobian=lambda t, y: np.pad(PENDULUM.jacobian(t, y), (0, 1)),
        initial=np.append(PENDULUM.initial, 1e7),
    )
    alone = run(PENDULUM, "implicit_midpoint", 1.0, dt=1e-3).y
    assert run(beside, "implicit_midpoint", 1.0, dt=1e-3).y[:, :2] == pytest.approx(
        alone, abs=1e-14
    )


def test_singular_newton_matrix_says_what_to_change():
    with pytest.raises(StepFailure, match=r"Newton's matrix is singular; take a smaller --dt"):
        GAUSS["implicit_midpoint"].change(stiff(2.0), 0.0, np.array([1.0]), 1.0)


def test_newton_does_not_iterate_on_nan():
    lost = replace(BLOW_UP, derivative=lambda t, y: y * np.nan)
    with pytest.raises(StepFailure, match=r"Newton's iteration diverges; take a smaller --dt"):
        GAUSS["implicit_midpoint"].change(lost, 0.0, np.array([1.0]), 0.1)


# --- steps, samples, times ----------------------------------------------------------------------


def test_last_step_is_shortened_to_the_end():
    trajectory = integrate(PENDULUM, "rk4", 1.05, t_start=0.5, dt=0.1)
    assert trajectory.t == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.05], abs=1e-15)
    assert trajectory.t[-1] == 1.05
    assert trajectory.y[-1] == pytest.approx(exact_pendulum(0.55)[0], abs=1e-5)
    assert trajectory.counts["steps"] == 6 and trajectory.counts["derivatives"] == 24


def test_times_do_not_gather_rounding():
    trajectory = integrate(PENDULUM, "euler", 100.0, dt=0.1)
    assert trajectory.t.tolist() == [i * 0.1 for i in range(1000)] + [100.0]
    assert integrate(PENDULUM, "euler", 0.07, dt=0.01).counts["steps"] == 7  # 0.07 / 0.01 > 7


def test_samples_thin_the_rows_and_keep_both_ends():
    every = integrate(PENDULUM, "euler", 1.0, dt=0.001)
    some = integrate(PENDULUM, "euler", 1.0, dt=0.001, samples=8)
    assert every.t.size == 1001
    assert some.t.tolist() == [*every.t[::143].tolist(), 1.0]
    assert some.y[-1].tolist() == every.y[-1].tolist()
    assert integrate(PENDULUM, "RK45", 1.0, samples=2).t.tolist() == [0.0, 1.0]
    assert integrate(PENDULUM, "RK45", 1.0).t.size == 1001


def test_forcing_is_evaluated_at_the_right_times():
    forced = Problem(
        "forced",
        ("x",),
        (),
        lambda t, y: np.array([t**3]),
        lambda t, y: np.zeros((1, 1)),
        np.zeros(1),
    )
    assert run(forced, "rk4", 3.0, dt=0.5, t_start=1.0).y[-1, 0] == pytest.approx(20.0, abs=1e-13)
    midpoint_sum = 0.5 * sum((1.25 + 0.5 * i) ** 3 for i in range(4))
    assert run(forced, "implicit_midpoint", 3.0, dt=0.5, t_start=1.0).y[-1, 0] == pytest.approx(
        midpoint_sum, abs=1e-13
    )


# --- what goes wrong ----------------------------------------------------------------------------

REMEDY = {
    name: "take a smaller --dt" if name in FIXED else "try another --integrator" for name in ALL
}


def raising(error):
    def derivative(t, y):
        if y[0] > 5:
            raise error
        return y * y

    return replace(BLOW_UP, derivative=derivative)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", GENERAL)
def test_blow_up_keeps_the_finite_rows(name):
    # LSODA stops one rounding before t = 1; the others stop at it or pass it.
    trajectory = run(BLOW_UP, name, 2.0, rtol=1e-6, atol=1e-6)
    last_t, last_y = trajectory.t[-1], trajectory.y[-1, 0]
    assert not trajectory.finished
    assert 0.9 < last_t < 1.2
    assert last_y > 10
    assert np.all(np.diff(trajectory.t) > 0)
    assert trajectory.message.startswith(f"stopped at t = {last_t:.6g}, size={last_y:.6g}: ")
    assert REMEDY[name] in trajectory.message
    assert "\n" not in trajectory.message
    assert "encountered" not in trajectory.message, "NumPy's own warnings say nothing new"
    assert trajectory.counts["steps"] > 50


@pytest.mark.every(4)
@pytest.mark.parametrize("name", GENERAL)
@pytest.mark.parametrize(
    "error",
    [
        OverflowError("math range error"),
        ZeroDivisionError("division by zero"),
        ValueError("math domain error"),
        FloatingPointError("underflow"),
    ],
)
def test_arithmetic_that_raises_keeps_the_rows(name, error):
    trajectory = run(raising(error), name, 2.0)
    last_t, last_y = trajectory.t[-1], trajectory.y[-1, 0]
    assert not trajectory.finished
    assert 0.7 < last_t < 0.83
    assert last_y == pytest.approx(1 / (1 - last_t), rel=0.1)
    assert trajectory.message.startswith(
        f"stopped at t = {last_t:.6g}, size={last_y:.6g}: {type(error).__name__}: {error}; "
    )
    assert REMEDY[name] in trajectory.message


@pytest.mark.parametrize("name", GENERAL)
def test_ctrl_c_keeps_the_rows(name):
    trajectory = run(raising(KeyboardInterrupt()), name, 2.0)
    assert not trajectory.finished
    assert trajectory.t[-1] > 0.7
    assert trajectory.message == f"interrupted at t = {trajectory.t[-1]:.6g}"


@pytest.mark.parametrize("name", GENERAL)
def test_a_start_without_derivative_is_one_row(name):
    nowhere = replace(BLOW_UP, derivative=lambda t, y: y * np.nan)
    trajectory = run(nowhere, name, 2.0)
    assert trajectory.t.tolist() == [0.0]
    assert trajectory.message == (
        "stopped at t = 0, size=1: the derivative there is not finite; change the initial state"
    )


@pytest.mark.parametrize("name", GENERAL)
def test_a_derivative_that_turns_nan_ends_the_run(name):
    cliff = replace(BLOW_UP, derivative=lambda t, y: y * y + 0 * np.sqrt(5 - y))
    trajectory = run(cliff, name, 2.0)
    assert not trajectory.finished
    assert 0.7 < trajectory.t[-1] < 0.83


def _misled(slope):
    """Van der Pol's oscillator with a wrong Jacobian."""
    return Problem(
        name="van der Pol",
        states=("x", "v"),
        positions=(0,),
        derivative=lambda t, y: np.array([y[1], 1000 * (1 - y[0] ** 2) * y[1] - y[0]]),
        jacobian=slope,
        initial=np.array([2.0, 0.0]),
    )


def _opposite(t, y):
    return -1e9 * np.array([[0, 1], [-2000 * y[0] * y[1] - 1, 1000 * (1 - y[0] ** 2)]])


def _singular(t, y):
    return np.full((2, 2), 1e200)


def test_lsoda_stops_with_scipys_reason():
    """SciPy itself only warns of it."""
    trajectory = integrate(_misled(_opposite), "LSODA", 200.0)
    assert trajectory.outcome == Outcome(
        "stopped",
        "lsoda: Repeated convergence failures (perhaps bad Jacobian or tolerances)",
        "try another --integrator, or a looser --rtol and --atol",
    )
    assert "lsoda: Repeated convergence failures" in trajectory.message
    assert trajectory.message.count("lsoda") == 1


@pytest.mark.parametrize("method", ["Radau", "BDF"])
def test_a_singular_matrix_is_in_the_message(method):
    trajectory = integrate(_misled(_singular), method, 200.0, max_steps=30)
    assert trajectory.message.endswith("; Diagonal number 2 is exactly zero. Singular matrix.")


def test_runs_in_threads_keep_their_remarks_apart():
    """Each has its own remarks in any interleaving, and Python's warning filters stay unchanged."""
    filters = list(warnings.filters)
    asked = [(_opposite, "LSODA", {}), (_singular, "Radau", {"max_steps": 100})]
    asked += [(_singular, "BDF", {"max_steps": 100}), (_opposite, "Radau", {"max_steps": 100})]

    def message(slope, method, options):
        return integrate(_misled(slope), method, 200.0, **options).message

    alone = [message(slope, method, options) for slope, method, options in asked]
    with ThreadPoolExecutor(len(asked)) as pool:
        together = list(pool.map(lambda one: message(*one[:2], one[2]), asked))
    assert together == alone and len(set(alone)) == 4
    assert warnings.filters == filters


def test_what_a_derivative_warns_of_is_the_callers():
    """A run that finishes does not report it; it stays a Python warning."""

    def derivative(t, y):
        warnings.warn("close to the edge", stacklevel=1)
        return -y

    with pytest.warns(UserWarning, match="close to the edge"):
        trajectory = run(replace(BLOW_UP, derivative=derivative), "rk4", 1.0)
    assert trajectory.finished and trajectory.message == ""


def test_adaptive_run_stops_after_max_steps():
    trajectory = integrate(PENDULUM, "RK45", 100.0, max_steps=20)
    assert trajectory.counts["steps"] == 20
    assert ": 20 steps did not suffice; try another" in trajectory.message
    # The last step made is kept, though no sample falls on it.
    assert trajectory.y[-1] == pytest.approx(exact_pendulum(trajectory.t[-1])[0], abs=1e-7)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("rk5", {}, f"integrator: unknown name 'rk5' (did you mean 'rk4'?); known: {KNOWN}"),
        ("radau", {}, f"integrator: unknown name 'radau' (did you mean 'Radau'?); known: {KNOWN}"),
        ("euler", {}, "dt: euler needs a step; give e.g. --dt 0.001"),
        ("euler", {"dt": -0.1}, "dt: -0.1 is not a positive step; give e.g. --dt 0.001"),
        ("euler", {"dt": 0}, "dt: 0 is not a positive step; give e.g. --dt 0.001"),
        ("euler", {"dt": math.nan}, "dt: nan is not a positive step; give e.g. --dt 0.001"),
        ("euler", {"dt": math.inf}, "dt: inf is not a positive step; give e.g. --dt 0.001"),
        ("euler", {"dt": 1e-9}, "dt: 1e-09 takes 1e+09 steps, but at most 10000000 are allowed"),
        (
            "euler",
            {"dt": 5e-324},
            "dt: 4.94066e-324 takes inf steps, but at most 10000000 are allowed",
        ),
        (
            "BDF",
            {"dt": 0.1},
            "dt: BDF chooses its own steps; leave --dt out, or take one of " + ", ".join(EQUAL),
        ),
        ("BDF", {"t_start": 1.0}, "t_end: 1 is not after t_start = 1"),
        ("BDF", {"t_start": -math.inf}, "t_start: -inf is not a finite time"),
        ("BDF", {"t_end": math.nan}, "t_end: nan is not a finite time"),
        ("BDF", {"rtol": 0.0}, "rtol: 0 is not a positive number"),
        ("BDF", {"rtol": 1e-15}, "rtol: 1e-15 is too small; the smallest allowed is 2.3e-14"),
        ("BDF", {"atol": -1.0}, "atol: -1 is not a positive number"),
        ("BDF", {"atol": math.inf}, "atol: inf is not a positive number"),
        ("BDF", {"samples": 1}, "samples: 1 is too few; give at least 2, the first and the last"),
    ],
)
def test_arguments_that_cannot_be_served(name, options, message):
    with pytest.raises(RunError) as caught:
        integrate(PENDULUM, name, **{"t_end": 1.0, **options})
    assert str(caught.value) == message


def test_smallest_tolerance_is_taken_without_a_warning():
    assert integrate(PENDULUM, "DOP853", 1.0, rtol=2.3e-14).message == ""


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ([1.0], "initial: has shape (1,), but pendulum has 2 states; give one number for each"),
        ([1.0, math.nan], "initial: rate = nan is not finite"),
    ],
)
def test_initial_state_that_does_not_fit(initial, message):
    with pytest.raises(RunError) as caught:
        replace(PENDULUM, initial=initial)
    assert str(caught.value) == message


# --- tableaus -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"b": (1 / 6, 1 / 3, 1 / 3, 1 / 5)}, "not of order 1, the tree τ has the weight 1.03"),
        ({"b": (1 / 3, 1 / 3, 1 / 6, 1 / 6)}, "not of order 2, the tree [τ]"),
        ({"b": (1 / 6, 2 / 3, 0, 1 / 6)}, "not of order 3, the tree [[τ]]"),
        ({"c": (0, 1 / 2, 1 / 2, 0.9)}, "rows of a do not sum to c"),
        ({"a": ((0, 0, 0, 0), (0.5, 0, 0, 0), (0.5, 0, 0, 0), (0, 0, 1, 0))}, "not of order 3"),
        ({"order": 5}, "not of order 5"),
        ({"order": 0}, "order 0 is not 1 or more"),
        ({"b": (1 / 6, 1 / 3, 1 / 3, math.nan)}, "not all coefficients are finite"),
        ({"b": (1.0,)}, "do not fit"),
    ],
)
def test_wrong_tableau_is_refused(change, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        replace(TABLEAU, **change)


def test_tableau_of_lower_order_serves():
    heun = ButcherTableau(a=((0, 0), (1, 0)), b=(1 / 2, 1 / 2), c=(0, 1), order=2)
    growing = replace(PENDULUM, derivative=lambda t, y: y)
    change = runge_kutta(heun).prepare(growing)
    assert change(growing, 0.0, np.ones(2), 0.1) == pytest.approx([0.105, 0.105])
    with pytest.raises(ValueError, match="not of order 3"):
        replace(heun, order=3)


def test_trees():
    """The number of trees is known (Hairer, Norsett, Wanner I, table II.2.3), and so is, for each
    order, the sum of α = n! / (σ γ) = (n - 1)!, σ the symmetry of a tree (Butcher, 2003, 304).
    """

    def symmetry(tree):
        times = [tree.count(each) for each in dict.fromkeys(tree)]
        return math.prod(map(math.factorial, times)) * math.prod(map(symmetry, tree))

    assert [len(trees(n)) for n in range(1, 11)] == [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]
    for n in range(1, 9):
        assert len(set(trees(n))) == len(trees(n))
        assert {size(tree) for tree in trees(n)} == {n}
        ways = [math.factorial(n) // (symmetry(tree) * density(tree)) for tree in trees(n)]
        assert sum(ways) == math.factorial(n - 1)


def scipys(solver, order):
    """A method of SciPy as a tableau."""
    stages = len(solver.B)
    a = np.zeros((stages, stages))
    a[: len(solver.A), : solver.A.shape[1]] = solver.A[:stages, :stages]
    return {
        "a": tuple(map(tuple, a.tolist())),
        "b": tuple(solver.B.tolist()),
        "c": tuple(solver.C[:stages].tolist()),
        "order": order,
    }


def collocation(method, order):
    a = np.array(method.shares) * method.b
    return {"a": tuple(map(tuple, a.tolist())), "b": method.b, "c": method.c, "order": order}


def dormand_prince(weights, order):
    """The stages of DOP853 with the weights of one of its sums."""
    rows = coefficients.STAGES
    return {
        "a": tuple(tuple(row.get(j, 0.0) for j in range(len(rows))) for row in rows),
        "b": tuple(weights.get(j, 0.0) for j in range(len(rows))),
        "c": coefficients.NODES[: len(rows)],
        "order": order,
    }


PROVED = {
    "rk4": {"a": TABLEAU.a, "b": TABLEAU.b, "c": TABLEAU.c, "order": 4},
    "RK45": scipys(RK45, 5),
    "DOP853": dormand_prince(coefficients.END, 8),
    **{name: collocation(method.of, method.order) for name, method in GAUSS.items()},
}


@pytest.mark.parametrize("name", PROVED)
def test_tableaus_prove_their_order(name):
    """They have the stated order and no higher one; an error in the tenth digit is detected."""
    whole = PROVED[name]
    ButcherTableau(**whole)
    with pytest.raises(ValueError, match=f"not of order {whole['order'] + 1}"):
        ButcherTableau(**{**whole, "order": whole["order"] + 1})
    for part in ("a", "b", "c"):
        numbers = np.array(whole[part], dtype=float)
        for at in zip(*np.nonzero(numbers), strict=True):
            faulty = numbers.copy()
            faulty[at] *= 1 + 1e-10
            rows = faulty.tolist()
            given = tuple(map(tuple, rows)) if part == "a" else tuple(rows)
            with pytest.raises(ValueError, match="tableau: "):
                ButcherTableau(**{**whole, part: given})


def test_the_error_estimates_of_dop853_have_their_orders():
    """They are differences from methods of orders 5 and 3, and of no higher ones."""
    fifth = {i: coefficients.END[i] - x for i, x in coefficients.ERROR_5.items()}
    for weights, order in ((fifth, 5), (coefficients.ORDER_3, 3)):
        ButcherTableau(**dormand_prince(weights, order))
        with pytest.raises(ValueError, match=f"not of order {order + 1}"):
            ButcherTableau(**dormand_prince(weights, order + 1))


def test_dop853_makes_the_steps_of_scipys():
    """But for rounding: states, lengths of steps, and dense output, whose order is 7."""
    errors, same = [], 0
    for rtol in (1e-6, 1e-10):
        ours, theirs = (
            solver(PENDULUM.derivative, 0.0, PENDULUM.initial, 9.0, rtol=rtol, atol=1e-3 * rtol)
            for solver in (DormandPrince8, DOP853)
        )
        while theirs.status == "running":
            ours.t, ours.y, ours.f, ours.h_abs = theirs.t, theirs.y, theirs.f, theirs.h_abs
            ours.lost = 0.0 * ours.y
            (_, dense), _ = made(ours), theirs.step()
            # The estimate of the error is a difference with few digits: the length of the next
            # step, or of this one if it was repeated, is not the same.
            assert ours.t == pytest.approx(theirs.t, rel=1e-3)
            assert ours.h_abs == pytest.approx(theirs.h_abs, rel=0.1)
            if ours.t == theirs.t:
                same += 1
                assert ours.y == pytest.approx(theirs.y, abs=1e-14)
                times = np.linspace(theirs.t_old, theirs.t, 5)[1:-1]
                assert dense(times) == pytest.approx(theirs.dense_output()(times), abs=1e-14)
        assert ours.t == 9.0
    assert same > 30
    for h in (0.4, 0.2):  # one step of each length, against a very accurate run
        step = DormandPrince8(
            PENDULUM.derivative, 0.0, PENDULUM.initial, 9.0, rtol=1.0, atol=1.0, max_step=h
        )
        step.h_abs = h
        _, dense = made(step)
        true = solve_ivp(
            PENDULUM.derivative, (0, h / 3), PENDULUM.initial, "DOP853", rtol=1e-13, atol=1e-15
        )
        errors.append(np.abs(dense([h / 3])[:, 0] - true.y[:, -1]).max())
    assert 7.5 < math.log2(errors[0] / errors[1]) < 8.7  # the local error is of order 8


def test_a_method_of_shares_is_checked_too():
    shares = ((1 / 2, -0.07), (1.07, 1 / 2))
    with pytest.raises(ValueError, match="tableau: "):
        ImplicitMethod(replace(GAUSS["gauss_4"].of, shares=shares), 4)
    for method in GAUSS.values():
        shares = np.array(method.of.shares)
        assert (shares + shares.T == 1).all(), "to the last digit"


# --- leapfrog -----------------------------------------------------------------------------------


def test_leapfrog_takes_one_derivative_a_step():
    """Beside those that tell whether it may."""
    short, long = (run(PENDULUM, "leapfrog", t, dt=0.01).counts for t in (1.0, 3.0))
    assert long["derivatives"] - short["derivatives"] == long["steps"] - short["steps"] == 200


@pytest.mark.parametrize(
    ("problem", "why"),
    [
        (SPINNING_BODY, "no state is a position"),
        (
            replace(PENDULUM, contacts="some"),
            "those of rigid contacts that are held depend on velocities",
        ),
        (
            replace(
                PENDULUM,
                derivative=lambda t, y: np.array([y[1], -y[0] - 0.1 * y[1]]),
                jacobian=lambda t, y: np.array([[0, 1], [-1, -0.1]]),
            ),
            "the rate of rate depends on rate",
        ),
        (
            replace(
                PENDULUM,
                derivative=lambda t, y: np.array([y[1] * (1 + y[0] ** 2), -y[0]]),
                jacobian=lambda t, y: np.array([[2 * y[0] * y[1], 1 + y[0] ** 2], [-1, 0]]),
            ),
            "the rate of angle depends on angle",
        ),
        (
            replace(
                PENDULUM,
                derivative=lambda t, y: np.array([y[1] * (1 + t), -y[0]]),
                jacobian=lambda t, y: np.array([[0, 1 + t], [-1, 0]]),
            ),
            "the rate of angle is not the velocities times constants",
        ),
    ],
)
def test_leapfrog_refuses_what_does_not_separate(problem, why):
    with pytest.raises(RunError) as caught:
        integrate(problem, "leapfrog", 1.0, dt=0.1)
    assert str(caught.value) == (
        f"integrator: leapfrog needs forces that depend on positions alone, and {why}; "
        "take --integrator implicit_midpoint or gauss_4"
    )


# --- many periods -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tumbling():
    """The two-body scene, and the same by Hamilton's equations."""
    return {"scene": energy.scene()[1], "canonical": energy.canonical()}


def test_canonical_momenta_tell_the_same_motion(tumbling):
    exact = {"rtol": 1e-12, "atol": 1e-13, "samples": 2}
    ends = {
        form: integrate(each.problem, "DOP853", 3.0, **exact).y for form, each in tumbling.items()
    }
    alpha, beta = ends["canonical"][-1, :2]
    assert ends["scene"][-1, 2:4] == pytest.approx([alpha, beta - alpha], abs=1e-10)
    by_form = [each.energy(ends[form]) for form, each in tumbling.items()]
    assert by_form[0] == pytest.approx(by_form[1], rel=1e-11)
    problem = tumbling["canonical"].problem
    y = problem.initial
    columns = [
        (problem.derivative(0.0, y + d) - problem.derivative(0.0, y - d)) / 2e-6
        for d in np.eye(4) * 1e-6
    ]
    assert problem.jacobian(0.0, y) == pytest.approx(np.array(columns).T, abs=1e-8)


# --- progress, imports --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rk4", "Radau"])
def test_progress_grows_to_one_and_is_not_called_at_every_step(name):
    heard = []
    trajectory = run(PENDULUM, name, 5.0, dt=0.001, progress=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == 1.0
    assert len(heard) < trajectory.counts["steps"] / 10


class Screen(io.StringIO):
    def __init__(self, terminal):
        super().__init__()
        self.terminal = terminal

    def isatty(self):
        return self.terminal


@pytest.mark.parametrize("terminal", [True, False])
def test_terminal_progress(terminal, monkeypatch):
    screen = Screen(terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("COLUMNS", "60")
    with pytest.raises(KeyError), terminal_progress("simulate") as progress:
        progress(0.5)
        raise KeyError
    if terminal:
        drawn = screen.getvalue().split("\r")
        assert drawn[1].rstrip() == f"simulate [{'#' * 15}{' ' * 15}]  50%"
        assert drawn[2:] == [" " * 59, ""], "the line is wiped, also after an error"
    else:
        assert screen.getvalue() == ""


def test_running_needs_no_sympy():
    code = "import sys, eomgen.run.integrate; sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_newton_ends_where_a_component_should_be_zero():
    """With a Jacobian by differences it shrinks by a constant factor, and never to its own eps."""
    problem = Problem(
        name="rest",
        states=("x", "v"),
        positions=(0,),
        derivative=lambda t, y: np.array([0.0, -3000.0 * y[1]]),
        jacobian=lambda t, y: np.array([[0.0, 0.0], [0.0, -2950.0]]),
        initial=np.array([1.0, 1e-18]),
    )
    assert integrate(problem, "implicit_midpoint", 0.01, dt=1e-3).finished
