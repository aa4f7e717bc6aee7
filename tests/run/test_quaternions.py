"""Quaternions stay of unit length whatever integrates them, and no method loses its order by it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from campaign import some
from engine import text_of

from eomgen.base.errors import RunError
from eomgen.model.elaborate import elaborate
from eomgen.run.integrate import integrate
from eomgen.run.integrators import INTEGRATORS, Adaptive
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Problem
from eomgen.scene.reader import read_scene
from eomgen.scene.schema import SHOWN

ADAPTIVE = [
    name
    for name, method in INTEGRATORS.items()
    if isinstance(method, Adaptive) and not method.series
]
SCENES = ("tumbling_body", "spinning_top")


@cache
def problem(scene: str) -> Problem:
    """A built-in scene."""
    model = replace(elaborate(read_scene(scene)), outputs=SHOWN, route="aba")
    found = as_problem(load_module(text_of(model), scene))
    assert len(found.quaternions) == 1
    return found


def off_unit(asked: Problem, y: np.ndarray) -> float:
    """The largest | |q| - 1 | over rows (n, ny)."""
    lengths = [np.linalg.norm(y[:, list(indices)], axis=1) for indices in asked.quaternions]
    return float(np.max(np.abs(np.array(lengths) - 1)))


@pytest.mark.parametrize("scene", some(["spinning_top"], ["tumbling_body", "spinning_top"]))
def test_steps_stay_on_the_sphere(scene: str) -> None:
    """Classical Runge-Kutta of the tumbling body and of the top: below 1e-12 off, at every row."""
    asked, dt = problem(scene), 5e-4
    steps = some(5_000, 1_000_000)
    run = integrate(asked, "rk4", steps * dt, dt=dt, samples=1001)
    assert run.finished and run.counts["steps"] == steps
    assert off_unit(asked, run.y) < 1e-12


def test_left_alone_it_leaves_the_sphere() -> None:
    """What the test above would see without scaling."""
    asked = problem("spinning_top")
    alone = integrate(replace(asked, quaternions=()), "rk4", 2.5, dt=5e-4)
    assert off_unit(asked, alone.y) > 1e-11


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_rows_of_adaptive_methods_are_unit(scene: str, method: str) -> None:
    """Steps and dense output alike, within 1e-15, at a tolerance that would show."""
    asked = problem(scene)
    run = integrate(asked, method, 1.0, rtol=1e-5, atol=1e-7, samples=200)
    assert run.finished
    assert off_unit(asked, run.y) < 1e-15


def test_a_stopped_run_keeps_a_unit_row() -> None:
    """The row of the step after which a run was interrupted."""
    asked = problem("spinning_top")

    def interrupted(fraction: float) -> None:
        raise KeyboardInterrupt

    for method in ("BDF", "DOP853"):
        run = integrate(asked, method, 1.0, rtol=1e-4, samples=2, progress=interrupted)
        assert not run.finished and len(run.t) == 2
        assert off_unit(asked, run.y) < 1e-15


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("method", "order", "steps"),
    [
        ("euler", 1, (8000, 16000)),
        ("semi_implicit_euler", 1, (8000, 16000)),
        ("rk4", 4, (100, 200, 400)),
        ("implicit_midpoint", 2, (200, 400, 800)),
    ],
)
def test_order_of_fixed_step_methods(method: str, order: int, steps: tuple[int, ...]) -> None:
    """The slope of log error over log step of the spinning top, by regression."""
    asked, t_end = problem("spinning_top"), 0.2
    exact = integrate(asked, "DOP853", t_end, rtol=1e-13, atol=1e-15).y[-1]
    errors = [
        np.max(np.abs(integrate(asked, method, t_end, dt=t_end / n).y[-1] - exact)) for n in steps
    ]
    slope = np.polyfit(np.log([t_end / n for n in steps]), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.1, (slope, errors)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_one_step_methods_are_as_accurate_and_as_cheap(scene: str, method: str) -> None:
    """Against the same without scaling: no more error, no more than a derivative in a hundred."""
    asked, t_end = problem(scene), 0.5
    exact = integrate(asked, "DOP853", t_end, rtol=1e-13, atol=1e-15).y[-1]
    for rtol in (1e-4, 1e-7):
        runs = [
            integrate(one, method, t_end, rtol=rtol, atol=rtol * 1e-2)
            for one in (asked, replace(asked, quaternions=()))
        ]
        scaled, alone = (float(np.max(np.abs(run.y[-1] - exact))) for run in runs)
        assert scaled < 1.1 * alone
        counts = [run.counts["derivatives"] for run in runs]
        assert counts[0] <= 1.01 * counts[1]


def test_scaling_a_state() -> None:
    """To the nearest unit quaternion; other states, and what is not finite, stay as they are."""
    asked = problem("tumbling_body")
    (indices,) = asked.quaternions
    y = np.arange(1.0, len(asked.states) + 1)
    unit = asked.unit(y)
    np.testing.assert_allclose(unit[list(indices)], y[list(indices)] / np.sqrt(16 + 25 + 36 + 49))
    others = [i for i in range(len(y)) if i not in indices]
    np.testing.assert_array_equal(unit[others], y[others])
    y[list(indices)] = 1e200  # whose squares overflow
    np.testing.assert_allclose(asked.unit(y)[list(indices)], 0.5)
    y[indices[0]] = np.inf
    np.testing.assert_array_equal(asked.unit(y), y)
    y[list(indices)] = 0.0
    with pytest.raises(ArithmeticError):
        asked.unit(y)


@pytest.mark.parametrize("length", [0.0, 1e-170])
def test_a_quaternion_of_no_length_is_refused(length: float) -> None:
    """One line says which, before anything divides by it."""
    asked = problem("spinning_top")
    y = asked.initial.copy()
    y[list(asked.quaternions[0])] = [length, 0.0, 0.0, 0.0]
    message = (
        "initial: the quaternion that starts at tip_qw has no length; give 1, 0, 0, 0 for no "
        "rotation"
    )
    with pytest.raises(RunError) as caught:
        replace(asked, initial=y)
    assert str(caught.value) == message
