"""Mechanisms with loops in compiled steps: the bits of Python's, also where steps stop or change
over; what a symplectic method keeps.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from campaign import some
from crank_rocker import four_bar
from test_compiled_runs import assert_same, both, compiler

import eomgen
from eomgen.native import equal_steps
from eomgen.run import singular
from eomgen.run.integrators.strides import Strides

pytestmark = compiler
TREE = "embedded"
"""A route on which a four-bar keeps all of its coordinates, so that it needs projection."""
BAR = four_bar(route=TREE)
TURNS: dict[str, Any] = {"state": {"theta": 629.3, "theta_dot": 6.0}}
TETHERED = """
name = "tethered"
dimensions = 3
bodies = [{ name = "box", mass = 2.0, inertia_com = [0.1, 0.2, 0.25] }]
joints = [{ name = "floats", type = "free", parent = "world", child = "box" }]
initial = { v = { box_wx = 3.0, box_wy = 1.0 } }
[[constraints]]
type = "distance"
name = "rope"
body_1 = "world"
at_1 = [0, 0, 1]
body_2 = "box"
at_2 = [0.1, 0.2, 0.3]
length = 0.8
[[effects]]
type = "gravity"
g = 9.81
"""
OTHERS = ("rattleback", "car_suspension", "differential", "bicycle", "stewart_platform")
METHODS: tuple[dict[str, Any], ...] = (
    {"integrator": "rk4", "dt": 2e-3, "unstable": True},
    {"integrator": "semi_implicit_euler", "dt": 2e-3, "unstable": True},
    {"integrator": "DOP853", "rtol": 1e-8, "samples": 53},
    {"integrator": "DOP853", "rtol": 1e-3},
    {"integrator": "Rodas5P", "rtol": 1e-5, "samples": 53},
    {"integrator": "gauss_4", "dt": 1e-2},
    *some(
        (),
        (
            {"integrator": "euler", "dt": 2e-3, "unstable": True},
            {"integrator": "gauss_6", "dt": 1e-2},
        ),
    ),
)
RK4, _, DOP853, _, RODAS, GAUSS, *_ = METHODS


@pytest.fixture
def compiled_steps(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The numbers of steps that C has made at once."""
    made: list[int] = []
    adaptive, equal = Strides._compiled, equal_steps.Call.made

    def adaptive_noted(*given: Any) -> Any:
        stride = adaptive(*given)
        made.append(len(stride.ends) if stride else 0)
        return stride

    def equal_noted(*given: Any) -> int:
        why = equal(*given)
        made.append(given[4].made)
        return why

    monkeypatch.setattr(Strides, "_compiled", adaptive_noted)
    monkeypatch.setattr(equal_steps.Call, "made", equal_noted)
    yield made


def assert_all_same(compiled: Any, python: Any) -> None:
    assert_same(compiled, python)
    assert compiled.trajectory.violations == python.trajectory.violations


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("scene", "options"),
    [
        *((BAR, options) for options in METHODS),
        *((scene, options) for scene in some((), OTHERS) for options in METHODS),
        (TETHERED, DOP853),
        *some((), ((TETHERED, GAUSS),)),
    ],
)
def test_the_bits_are_those_of_python(
    scene: str, options: dict[str, Any], compiled_steps: list[int]
) -> None:
    """Steps are projected, rows within them too, and the violations are the same."""
    start = TURNS if scene == BAR else {}
    compiled, python = both(scene, t_end=0.2, **options, **start)
    assert_all_same(compiled, python)
    largest = np.array([*python.trajectory.violations.values()])
    assert largest[:, 0].max() > 0 and largest[:, 1].max() < 1e-12
    steps = python.trajectory.counts["steps"]
    # Rodas5P in C does not look for branches of the derivative, which a suspension has.
    assert sum(compiled_steps) >= 0.8 * steps - 4 or (scene, options) == ("car_suspension", RODAS)


@pytest.mark.every(2)
@pytest.mark.parametrize("options", [RK4, DOP853])
def test_change_points_are_passed_alike(options: dict[str, Any], compiled_steps: list[int]) -> None:
    """At the change point of a parallelogram."""
    start = "q = { theta = 1.0, psi = 1.0, phi = -1.0 }\nv = { theta_dot = 6.0 }"
    bar = four_bar((0.5, 0.7, 0.5, 0.7), start, route=TREE)
    compiled, python = both(bar, t_end=0.7, **options)
    assert_all_same(compiled, python)
    assert "went through 2 change points" in python.message
    assert sum(compiled_steps) > 0


def test_small_minima_are_left_to_python(
    monkeypatch: pytest.MonkeyPatch, compiled_steps: list[int]
) -> None:
    """At a sharp minimum of the margins Python looks for a singular position in the two steps
    around it, of which C may have made one.
    """
    searched: list[float] = []
    usual = singular._search

    def noted(held: Any, start: float, last: Any, advance: Any) -> None:
        searched.append(start)
        usual(held, start, last, advance)

    monkeypatch.setattr(singular, "_search", noted)
    start = "q = { theta = 1.0 }\nv = { theta_dot = 8.0 }"
    bar = four_bar((0.45, 0.8, 0.6, 0.9499), start, route=TREE)
    compiled, python = both(bar, t_end=1.0, **RK4)
    assert_all_same(compiled, python)
    half = len(searched) // 2
    assert half == 2 and searched[:half] == searched[half:]
    assert sum(compiled_steps) > 300


def test_contacts_close_alike(compiled_steps: list[int]) -> None:
    stop = '[[effects]]\ntype = "joint_stop"\nname = "stop"\njoint = "A"\nlow = 0.0\n'
    text = four_bar(effects=f"{stop}restitution = 0.8\n", route=TREE)
    compiled, python = both(text, t_end=0.8, rtol=1e-9)
    assert_all_same(compiled, python)
    assert python.trajectory.counts["impacts"] > 1 and sum(compiled_steps) > 5


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["leapfrog", "leapfrog_4", "leapfrog_6"])
def test_rattle_in_c(method: str, compiled_steps: list[int]) -> None:
    """All steps but the first and the last, with the bits of Python's."""
    start = {"theta": 0.3, "theta_dot": 0.0}
    compiled, python = both(BAR, t_end=0.08, integrator=method, dt=4e-3, state=start)
    assert_all_same(compiled, python)
    assert sum(compiled_steps) == 18


def test_rattle_keeps_constraints_and_energy() -> None:
    """Of a swinging four-bar; `campaigns/loops.py symplectic` shows it over 1e6 steps."""
    start = {"theta": 0.3, "theta_dot": 0.0}
    options: dict[str, Any] = {"integrator": "leapfrog", "dt": 4e-3, "state": start}
    run = eomgen.simulate(BAR, t_end=20.0, backend="c", **options)
    assert max(after for _, after in run.trajectory.violations.values()) < 1e-14
    energy = run.energy - run.energy[0]
    early = np.ptp(energy[: len(energy) // 10])
    trend = np.polynomial.Polynomial.fit(run.t, energy, 1).convert().coef[1] * run.t[-1]
    assert 1e-4 < np.ptp(energy) < 1.01 * early and abs(trend) < 0.02 * early


@pytest.mark.full
def test_energy_does_not_rise_with_the_turns_of_a_crank() -> None:
    """The energy of a crank that has gone round a hundred times is that of the same motion from the
    first turn on: what is rounding does not grow with the angle.
    """
    energies = []
    for turns in (0, 100):
        start = {"theta": 1.0 + 2 * np.pi * turns, "theta_dot": 6.0}
        run = eomgen.simulate(
            BAR, state=start, integrator="leapfrog_4", dt=0.01, t_end=10.0, backend="c"
        )
        energies.append(run.energy - run.energy[0])
    assert np.ptp(energies[0]) > 1e-3
    assert np.abs(energies[1] - energies[0]).max() < 1e-9
