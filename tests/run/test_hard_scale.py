"""Units of molecules and of planets: what comes out scales as the units do."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from bookkeeping import light
from campaign import some

from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.run.trajectory import Trajectory

Units = tuple[float, float, float]
"""Of mass, length and time."""

T_END = 1.375


def scene(units: Units) -> str:
    """A rod with a ball at each end falls on a floor, bounces and comes to rest, in air, a spring
    from its middle to the world; all numbers of 1 kg, 1 m, 1 s in other units.
    """
    kilogram, metre, second = units

    def number(value: float, *powers: int) -> str:
        mass, length, time = powers
        return repr(value * kilogram**mass * metre**length * second**time)

    radius, half = number(0.125, 0, 1, 0), number(0.5, 0, 1, 0)
    return f"""
name = "scaled"
route = "aba"
bodies = [{{ name = "b", mass = {number(2.0, 1, 0, 0)}, inertia_com = {number(0.25, 1, 2, 0)} }}]
joints = [{{ name = "j", type = "free", child = "b" }}]
points = [
    {{ name = "left", body = "b", at = ["-{half}", 0] }},
    {{ name = "right", body = "b", at = [{half}, 0] }},
]
[initial.q]
b_y = {number(1.0, 0, 1, 0)}
b_angle = 0.25
[initial.v]
b_x_dot = {number(0.5, 0, 1, -1)}
b_angle_dot = {number(1.0, 0, 0, -1)}
[[effects]]
type = "gravity"
g = {number(8.0, 0, 1, -2)}
[[effects]]
type = "spring"
name = "band"
body_1 = "world"
body_2 = "b"
at_1 = [0, {number(2.0, 0, 1, 0)}]
stiffness = {number(1.0, 1, 0, -2)}
damping = {number(0.125, 1, 0, -1)}
rest_length = {number(1.0, 0, 1, 0)}
[[effects]]
type = "contact"
name = "floor"
law = "impact"
points = ["left", "right"]
radius = {radius}
restitution = 0.5
friction = 0.25
slip_speed = {number(0.0625, 0, 1, -1)}
"""


@cache
def ran(units: Units, method: str, rtol: float | None = None) -> Trajectory:
    """Until most bounces are over, by the method's default tolerances, or `rtol`, or 1000 steps."""
    t_end = T_END * units[2]
    step = {"dt": t_end / 1024} if method == "rk4" else {}
    if rtol is not None:
        step = {"rtol": rtol}
    run = integrate(as_problem(light(scene(units)).module), method, t_end, samples=65, **step)
    assert run.finished, run.message
    return run


def in_ones(run: Trajectory, units: Units) -> tuple[np.ndarray, Sequence[tuple[float, str, str]]]:
    """States in kg, m and s, and events with their times."""
    _, metre, second = units
    speed = metre / second
    scale = np.array([metre, metre, 1, speed, speed, 1 / second])
    return run.y / scale, [(event.t / second, event.contact, event.kind) for event in run.events]


POWERS = some(
    [(2.0**-80, 2.0**-50, 2.0**-40), (2.0**80, 2.0**50, 2.0**-40)],
    [(2.0**a, 2.0**b, 2.0**c) for a in (-80, 0, 80) for b in (-50, 0, 50) for c in (-40, 0, 20)],
)


@pytest.mark.every(3)
@pytest.mark.parametrize("method", ["rk4", "DOP853"])
@pytest.mark.parametrize("units", POWERS)
def test_powers_of_two_change_no_bit(units: Units, method: str) -> None:
    """Not in a single row, nor in the time of any event, impacts and rests included. Of an adaptive
    method this holds for mass and length: SciPy's first step does not scale with time.
    """
    if method == "DOP853":
        units = (*units[:2], 1.0)
    expected = in_ones(ran((1.0, 1.0, 1.0), method), (1.0, 1.0, 1.0))
    found = in_ones(ran(units, method), units)
    assert len(expected[1]) > 5
    assert found[1] == expected[1]
    np.testing.assert_array_equal(found[0], expected[0])


@pytest.mark.parametrize("units", [(1e-26, 1e-15, 1e-12), (1e24, 1e15, 1e6)])
def test_powers_of_ten_change_rounding_alone(units: Units) -> None:
    """Molecules and planets bounce as a metre does, as often and, to 1e-9, when."""
    expected = in_ones(ran((1.0, 1.0, 1.0), "DOP853", 1e-11), (1.0, 1.0, 1.0))
    found = in_ones(ran(units, "DOP853", 1e-11), units)
    for (t, *what), (other, *same) in zip(found[1], expected[1], strict=True):
        assert what == same
        assert abs(t - other) < 1e-9
    assert np.max(np.abs(found[0][-1] - expected[0][-1])) < 1e-7
