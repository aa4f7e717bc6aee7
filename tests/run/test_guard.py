"""Guarded runs: stopped or repaired where digits are lost, otherwise unchanged."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.program.program import Program
from eomgen.run.guard import LOST, Guard, RoundingMonitor
from eomgen.run.integrate import integrate
from eomgen.run.integrators import StepFailure
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Problem
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.study.precision.guarding import guard_of

pytestmark = pytest.mark.usefixtures("blank_figures")

HEAVY = """
name = "heavy_tip"
route = "aba"
effects = [{ type = "gravity", g = 9.81 }]
bodies = [{ name = "tip", mass = 1e12, inertia_com = 1e11 }]
initial = { q = { link_joint_1_angle = 0.3, link_joint_3_angle = 1.1 } }
simulation = { t_end = 0.1, integrator = "rk4", dt = 0.01 }
[[chains]]
name = "link"
count = 5
mass = 1
inertia_com = 0.1
r_parent = [0.5, 0]
r_child = [-0.5, 0]
[[joints]]
name = "last"
type = "revolute"
parent = "link_5"
child = "tip"
r_parent = [0.5, 0]
r_child = [-0.5, 0]
"""
"""A chain of six whose tip weighs 1e12 kg."""


@cache
def heavy(route: str) -> tuple[Any, Program]:
    """The module of the heavy chain by a route, and its program."""
    model = replace(elaborate(parse_scene(HEAVY)), route=route)
    system = compile_program(model, jacobian=False).system
    return load_module(python_module(system)), system.program


def run(module: Any, guard: Guard | None) -> Any:
    """Ten steps, too long for stability over a longer time."""
    return integrate(unchecked(module), "rk4", 0.1, dt=0.01, guard=guard)


def unchecked(module: Any) -> Problem:
    """The problem without the check of stability, by a zero Jacobian."""
    return replace(as_problem(module), jacobian=lambda t, y: np.full((len(y), len(y)), np.nan))


@pytest.mark.parametrize("route", ["aba", "ldl"])
def test_a_run_that_loses_digits_is_stopped_and_says_what_to_do(route: str) -> None:
    """Before the next step, so that no row is wrong."""
    module, program = heavy(route)
    guard = guard_of(module, program)
    y = module.initial_state()
    exact, found = guard.exact(0.0, y)[6:], module.derivative(0.0, y)[6:]
    lost = float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))
    assert lost > 100 * LOST
    stopped = run(module, guard)
    assert not stopped.finished and stopped.t[-1] == 0.0
    assert stopped.message.startswith("stopped at t = 0, link_joint_1_angle=0.3")
    assert f"(relative error {lost:.2g}, allowed 1e-08)" in stopped.message
    assert "take --guard repair, or --route orthogonal if" in stopped.message


def test_a_repaired_run_is_right() -> None:
    """It agrees with a run in extended precision, and with a route that loses no digits."""
    module, program = heavy("aba")
    guard = guard_of(module, program, repairs=True)
    repaired, plain = run(module, guard), run(module, None)
    problem = replace(unchecked(module), derivative=guard.exact)
    true = integrate(problem, "rk4", 0.1, dt=0.01).y
    scale = np.max(np.abs(true), axis=0)
    assert repaired.finished and "were repaired in extended precision" in repaired.message
    assert np.max(np.abs(repaired.y - true) / scale) < 1e-13
    assert np.max(np.abs(plain.y - true) / scale) > 1e-8
    sound, program = heavy("orthogonal")
    healthy = run(sound, guard_of(sound, program))
    assert healthy.finished and not healthy.message
    assert np.max(np.abs(healthy.y - true) / scale) < 1e-11


@pytest.mark.parametrize("integrator", ["rk4", "DOP853", "LSODA"])
def test_a_healthy_run_is_the_same_with_and_without(integrator: str) -> None:
    """To the byte, including counts, whether the guard would stop or repair."""
    model = elaborate(read_scene("babyboot"))
    system = compile_program(replace(model, outputs=())).system
    module = load_module(python_module(system))
    problem = as_problem(module)
    options: dict[str, Any] = {"dt": 0.01} if integrator == "rk4" else {}
    plain = integrate(problem, integrator, 0.3, samples=11, **options)
    for repairs in (False, True):
        guard = guard_of(module, system.program, repairs=repairs)
        same = integrate(problem, integrator, 0.3, samples=11, guard=guard, **options)
        assert same.y.tobytes() == plain.y.tobytes() and same.t.tobytes() == plain.t.tobytes()
        assert same.counts == plain.counts and same.message == plain.message == ""


def spiky(bad: tuple[float, float]) -> tuple[Problem, Guard]:
    """x' = 1, which doubles get wrong by 1e-3 while x is between two values."""

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([1.001 if bad[0] < y[0] < bad[1] else 1.0])

    problem = Problem("x", ("x",), (0,), derivative, lambda t, y: np.zeros((1, 1)), np.zeros(1))
    return problem, Guard(lambda t, y: np.ones(1), ((0,),), repairs=True)


def test_digits_lost_for_a_while_are_repaired_for_a_while() -> None:
    """The step that loses digits is repeated; later the run returns to doubles."""
    problem, guard = spiky((0.45, 0.65))
    calls = []
    exact = guard.exact

    def counted(t: float, y: np.ndarray) -> np.ndarray:
        calls.append(t)
        return exact(t, y)

    found = integrate(problem, "rk4", 1.0, dt=0.1, guard=replace(guard, exact=counted))
    assert found.finished and np.max(np.abs(found.y[:, 0] - found.t)) < 1e-15
    assert len(found.t) == 11 and len(calls) < 11 + 1 + 1 + 4 * 4
    assert "digits lost between t = 0.4 and 0.7 s" in found.message
    assert "relative error up to 0.001" in found.message


def test_tight_tolerances_ask_for_more_digits() -> None:
    """A derivative with an error of 1e-9 suffices for rtol 1e-9, but not for 1e-12."""
    problem, guard = spiky((-1.0, 2.0))
    slightly = replace(problem, derivative=lambda t, y: np.array([1.0 + 1e-9]))
    guard = replace(guard, repairs=False)
    assert integrate(slightly, "DOP853", 1.0, rtol=1e-9, guard=guard).finished
    tight = integrate(slightly, "DOP853", 1.0, rtol=1e-12, guard=guard)
    assert not tight.finished and "allowed 1e-11" in tight.message


def test_a_domain_that_is_left_and_a_quaternion_that_drifts_are_reported() -> None:
    """Each with its own message."""
    problem, guard = spiky((2.0, 3.0))
    gone = replace(guard, exact=lambda t, y: np.array([np.nan if y[0] > 0.5 else 1.0]))
    found = integrate(problem, "rk4", 1.0, dt=0.1, guard=replace(gone, repairs=False))
    assert not found.finished and found.t[-1] == 0.5
    assert "the step has left the domain" in found.message
    spun = Problem(
        "q",
        ("w", "x", "y", "z"),
        (0, 1, 2, 3),
        lambda t, y: np.zeros(4),
        lambda t, y: np.zeros((4, 4)),
        np.array([1.0, 0.0, 0.0, 0.0]),
        quaternions=((0, 1, 2, 3),),
    )
    monitor = RoundingMonitor(Guard(lambda t, y: np.zeros(4), ((0, 1, 2, 3),)), spun, LOST)
    assert monitor.loss(0.0, spun.initial) == 0.0
    with pytest.raises(StepFailure, match="quaternion that starts at w differs from 1 by 1e-06"):
        monitor.loss(0.0, np.array([1.000001, 0.0, 0.0, 0.0]))


def test_what_doubles_cannot_evaluate_counts_as_lost() -> None:
    """A nan or an error of the derivative counts as a loss of all digits."""
    problem, guard = spiky((2.0, 3.0))
    for wrong in (lambda t, y: np.array([np.nan]), lambda t, y: np.array([1.0 / 0.0])):
        monitor = RoundingMonitor(guard, replace(problem, derivative=wrong), LOST)
        assert monitor.loss(0.0, np.zeros(1)) == np.inf


def test_contacts_cannot_be_repaired() -> None:
    """A message says so, and what to do instead."""
    model = elaborate(read_scene("bouncing_two_body"))
    system = compile_program(replace(model, outputs=()), jacobian=False).system
    module = load_module(python_module(system))
    careful = guard_of(module, system.program, repairs=True)
    with pytest.raises(RunError, match="cannot be repaired; let it stop instead"):
        integrate(as_problem(module), "DOP853", 1.0, guard=careful)
    assert integrate(
        as_problem(module), "DOP853", 0.7, guard=guard_of(module, system.program)
    ).finished


def test_simulate_guarded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A healthy scene writes the same trajectory; a heavy tip ends with exit code 1 and a line."""
    for name, option in (("a", []), ("b", ["--guard"])):
        arguments = ["simulate", "pendulum", "--t-end", "0.2", "-o", str(tmp_path / name)]
        assert main([*arguments, *option]) == 0
    for kind in ("npz", "csv", "py"):
        first, second = ((tmp_path / name / f"pendulum.{kind}").read_bytes() for name in "ab")
        assert first == second
    scene = tmp_path / "heavy.toml"
    scene.write_text(HEAVY)
    capsys.readouterr()
    assert main(["simulate", str(scene), "--guard", "-o", str(tmp_path)]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "digits lost" in err and "--route orthogonal" in err
