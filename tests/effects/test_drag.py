"""Drag: exact solutions, an independent solver, energy, Jacobians at rest, and mistakes."""

import numpy as np
import pytest
from bookkeeping import differences, powers
from engine import Engine, apart, motion, quick
from scenes import WEIGHT, effect, free, refusal
from spatial_trees import PLANE, SPACE

from eomgen.model.elaborate import elaborate
from eomgen.scene.reader import parse_scene

MASS, INERTIA, G = 0.7, 0.03, 9.81
DRAG = effect("drag", name="air")
BODY = effect("drag", name="air", body="drop")


def drop(effects: str, dimensions: int = PLANE) -> Engine:
    """A free body under some effects."""
    return quick(falling(effects, dimensions))


def falling(effects: str, dimensions: int = PLANE) -> str:
    """Its scene."""
    return free("drop", mass=MASS, inertia_com=INERTIA, dimensions=dimensions) + effects


@pytest.mark.every(2)
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("law", ["linear", "quadratic", "made"])
def test_a_fall_from_rest_is_the_exact_one(dimensions: int, law: str) -> None:
    """v = v∞ (1 - e^(-t/T)) of linear drag, v∞ tanh(g t/v∞) of quadratic; v∞ in the end."""
    k = 0.4
    keys = {"made": "density = 1.6\narea = 0.25\ncoefficient = 2.0\n"}
    made = drop(WEIGHT + BODY + keys.get(law, f"{law} = {k}\n"), dimensions)
    down = made.module.STATES.index("drop_y_dot" if dimensions == PLANE else "drop_z_dot")
    times = np.array([0.0, 0.1, 0.5, 1.5, 40.0])
    found = motion(made, times)
    if law == "linear":
        last = MASS * G / k
        speeds = last * -np.expm1(-k * times / MASS)
    else:
        last = np.sqrt(MASS * G / k)
        speeds = last * np.tanh(G * times / last)
    assert apart(-found[down], speeds) < 1e-10
    assert abs(speeds[-1] / last - 1) < 1e-9
    ending = made.module.initial_state()
    ending[down] = -last
    assert abs(made.module.derivative(0.0, ending)[down]) < 1e-14 * G


@pytest.mark.every(2)
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_named_points_are_places_like_others(dimensions: int) -> None:
    """Drag at two named points is drag at those two places."""
    places = ([0.1, -0.2, 0.3][:dimensions], [-0.4, 0.1, 0.2][:dimensions])
    points = "".join(
        f'[[points]]\nname = "{name}"\nbody = "drop"\nat = {place}\n'
        for name, place in zip(("tip", "tail"), places, strict=True)
    )
    named = drop(f'{points}{DRAG}points = ["tip", "tail"]\nquadratic = 0.4\n', dimensions)
    placed = drop(
        "".join(
            f'{DRAG.replace("air", f"air_{i}")}body = "drop"\nat = {place}\nquadratic = 0.4\n'
            for i, place in enumerate(places)
        ),
        dimensions,
    )
    y = named.random_state(np.random.default_rng(5))
    found, expected = (made.module.derivative(0.0, y) for made in (named, placed))
    assert apart(found, expected) < 1e-14
    assert apart(found, drop("", dimensions).module.derivative(0.0, y)) > 0.01


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_turning_dies_down_as_it_must(dimensions: int) -> None:
    """ω of a linear and quadratic drag together, I ω̇ = -(a + b |ω|) ω, solved by hand."""
    a, b, w = 0.02, 0.05, 6.0
    made = drop(f"{BODY}turning_linear = {a}\nturning_quadratic = {b}\n", dimensions)
    spin = [made.module.STATES.index("drop_angle_dot")] if dimensions == PLANE else [10, 11, 12]
    start = made.module.initial_state()
    axis = np.array([1.0]) if dimensions == PLANE else np.array([2.0, -1.0, 2.0]) / 3
    start[spin] = w * axis
    times = np.linspace(0, 4, 9)
    found = motion(made, times, start)
    decay = np.exp(-a * times / INERTIA)
    expected = a * w * decay / (a + b * w * (1 - decay))
    assert apart(found[spin], np.outer(axis, expected)) < 1e-10


def test_a_wind_carries_along() -> None:
    """Linear drag in a wind that turns with time: v follows it as a filter of first order."""
    k, f = 0.7, 2.0
    made = drop(f'{BODY}linear = {k}\nwind = ["sin(2*t)", 3]\n')
    times = np.linspace(0, 5, 11)
    found = motion(made, times)
    c = k / MASS
    fade = np.exp(-c * times)
    swung = c * (c * np.sin(f * times) - f * np.cos(f * times) + f * fade) / (c * c + f * f)
    assert apart(found[3:5], [swung, 3 * (1 - fade)]) < 1e-10


CHAIN = """\
name = "rope"
outputs = "all"
route = "aba"
[[chains]]
name = "link"
count = 3
mass = 0.2
inertia_com = 1e-3
r_parent = [0.2, 0]
r_child = [-0.2, 0]
[[effects]]
type = "gravity"
g = 9.81
"""


@pytest.mark.every(2)
@pytest.mark.parametrize("tangents", [False, True])
def test_jacobians_are_right_at_rest(tangents: bool) -> None:
    """Against differences of the module; quadratic drag has no slope at all, exactly."""
    still = CHAIN + f'{DRAG}bodies = "all"\nlinear = 0.05\nturning_linear = 0.01\n'
    both = still + "quadratic = 0.3\nturning_quadratic = 0.02\n"
    made, plain = (quick(text, tangents=tangents) for text in (both, still))
    y = made.random_state(np.random.default_rng(3))
    y[3:] = 0.0
    found = made.module.jacobian(0.0, y)
    assert np.isfinite(found).all()
    assert apart(found, plain.module.jacobian(0.0, y)) < 1e-15
    assert apart(found, differences(made, y, 0.0)) < 1e-4  # |v| v of a step is not linear
    np.testing.assert_array_equal(
        made.module.derivative(0.0, y)[3:], plain.module.derivative(0.0, y)[3:]
    )


def test_rest_in_space_is_smooth() -> None:
    """Three components of speed and of turning."""
    made = drop(f"{BODY}quadratic = 0.4\nturning_quadratic = 0.3\n", SPACE)
    y = made.module.initial_state()
    found = made.module.jacobian(0.0, y)
    assert np.isfinite(found).all()
    assert np.abs(found[7:]).max() < 1e-140


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("linear = 0.1", "effects[0].body: is missing; give one of body, bodies, points"),
        (
            'body = "drop"\nbodies = "all"\nlinear = 0.1',
            "effects[0].body: is given in addition to 'bodies'; give one of body, bodies, points",
        ),
        (
            'points = ["tip"]\nlinear = 0.1',
            "effects[0].points[0]: no point is named 'tip'; known: none",
        ),
        (
            'points = ["tip"]\nat = [0, 1]\nlinear = 0.1',
            "effects[0].at: named points have their own positions; leave it out",
        ),
        (
            'bodies = ["drop", "drop"]\nlinear = 0.1',
            "effects[0].bodies[1]: 'drop' is listed twice; leave one out",
        ),
        (
            'bodies = ["drop", "drip"]\nlinear = 0.1',
            "effects[0].bodies[1]: no body is named 'drip' (did you mean 'drop'?)",
        ),
        (
            'body = "drop"',
            "effects[0].linear: there is no drag at all; give linear, quadratic, turning_linear or "
            "turning_quadratic",
        ),
        (
            'body = "drop"\ndensity = 1.2\narea = 0.1',
            "effects[0].coefficient: is missing; give density, area and coefficient together",
        ),
        (
            'body = "drop"\nquadratic = 0.1\ndensity = 1.2\narea = 0.1\ncoefficient = 1',
            "effects[0].quadratic: is given in addition to 'density'; leave one of them out",
        ),
        (
            'body = "drop"\nlinear = 1\nwind = ["gust*vx", 0]',
            "effects[0].wind[0]: unknown parameter 'vx'",
        ),
    ],
)
def test_mistakes(text: str, message: str) -> None:
    """Each in one line, with its place and what to do."""
    assert message in refusal(falling(f"[parameters]\ngust = 3.0\n{DRAG}{text}\n"))


def test_a_parameter_may_not_hide_a_place() -> None:
    """`x` is the point's own place in a wind."""
    scene = falling(f"[parameters]\nx = 3.0\n{BODY}linear = 1\n")
    elaborate(parse_scene(scene))
    assert "wind[0]: 'x' is predefined here; rename" in refusal(scene + 'wind = ["x", 0]\n')


def test_negative_drag_if_asked_for() -> None:
    """It then puts energy in."""
    made = drop(f"{BODY}linear = -0.5\nallow_active = true\n")
    y = made.module.initial_state()
    y[3] = 2.0
    assert powers(made, y) == [pytest.approx(2.0)]
