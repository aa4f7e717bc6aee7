"""Mechanisms that all but stand in line: right, or refused.

What a scene fixes 1e-17 from alignment is not aligned: nothing of it may be folded away or rounded
to nothing. Accelerations of the generated steps are held against 100 digits from the numbers of the
scene (`aligned_trees`), relative to their largest component, however small that is.
"""

from collections.abc import Sequence
from typing import Any

import aligned_trees
import mpmath
import numpy as np
import pytest
from aligned_trees import Case, case, exactly, names, nearby, scene
from campaign import some

from eomgen.base.errors import SceneError
from eomgen.codegen.choice import ENOUGH, FEWEST
from eomgen.codegen.digits import Route, digits_lost
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, generate
from eomgen.program.program import interpreter
from eomgen.program.tape import TIME
from eomgen.run.module import GeneratedModule, load_module
from eomgen.scalars import exact
from eomgen.scalars.floats import ArrayScalars, FloatScalars
from eomgen.scene.reader import find_scene, parse_scene
from eomgen.study.precision.extended import doubles, extended_digits
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.truth import Truth

BOUND, TIMES = 1e-10, 1e3
"""Of v̇ relative to its largest component, or that of ω v; and of what half a unit in the last place
of all numbers changes it by."""
NUDGES = 3
WELL = ("right", "reported", "refused", "singular")
"""What may come of a case: 'reported' where it is as far off as is said of its digits; a state
where the mass matrix is singular has no accelerations.
"""


def tried(given: Case, *, closed: bool = False, **more: object) -> str:
    """What came of a case, in a word, or an error that is too large, in several; with the closed
    form among the routes, or without.
    """
    try:
        model = elaborate(parse_scene(scene(given, **more)))
        check_nonsingular(model)
        made = compile_program(model, jacobian=False, closed=closed)
    except SceneError:
        return "refused"
    try:
        true, *near = exactly(given), *(nearby(given, seed) for seed in range(NUDGES))
    except ZeroDivisionError:
        return "singular"
    q, v = names(given)
    values = {**model.defaults, **dict(zip((*q, *v), (*given.q, *given.v), strict=True)), TIME: 0.0}
    rates = interpreter(made.system.program, "derivative", FloatScalars())
    try:
        found = dict(zip((s.name for s in made.system.states), rates(values), strict=True))
    except (ArithmeticError, ValueError):
        return "gives no number"
    units = {c.name: c.unit for c in model.velocities}
    turning = [abs(x) for x, name in zip(given.v, v, strict=True) if units[name] == "rad/s"]
    size = max(turning, default=0.0) * max(map(abs, given.v))
    size = max(size, *(float(abs(x)) for x in true))

    def off(rates: Sequence[Any]) -> float:
        return float(np.max([float(abs(a - b)) for a, b in zip(rates, true, strict=True)]))

    error = off([found[name] for name in v])
    if size < aligned_trees.NOTHING:
        return "right" if error <= BOUND else f"off by {error:.1e}, where all is 0"
    error, allowed = error / size, BOUND + TIMES * max(map(off, near)) / size
    if made.choice.digits is not None and allowed < error <= allowed + 10.0**-made.choice.digits:
        return "reported"
    return "right" if error <= allowed else f"off by {error:.1e}, allowed {allowed:.1e}"


def test_right_or_refused() -> None:
    """Some of the cases that `campaigns/by_number.py` tries twenty thousand of."""
    for number in range(some(8, 2000)):
        outcome = tried(case(number), closed=number % 10 == 0)
        assert outcome in WELL, (number, outcome)


ONCE_SILENT = {
    32: "an axis of a slide 4e-9 from the horizontal",
    89: "an axis 9e-10 from another after half a turn less 3e-5 degrees",
    135: "a slide whose axis, turned by 90 degrees less 4e-11, leaves 1e-12 of its weight",
    415: "a pin's axis 1e-10 from gravity, and a weld turned by 9e-11 degrees",
    554: "a pin's axis 4e-13 from gravity, and a coordinate locked at a quarter turn",
    559: "an axis 9e-9, a slide turned by 6e-14 degrees, gravity 2e-12 from a coordinate axis",
    618: "axes of 1e-6, and half a turn less 2e-4 degrees",
}


@pytest.mark.parametrize("number", ONCE_SILENT)
def test_not_silent_again(number: int) -> None:
    """What the campaign found."""
    assert tried(case(number)) == "right", ONCE_SILENT[number]


def test_digits_reported_are_those_of_accelerations() -> None:
    """Two slides 9e-15 from each other: 5e-7 off, over a thousand times what half a unit in the
    last place of the data does. Eight digits were reported for it.
    """
    assert tried(case(13863)) == "refused"


def test_it_can_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Entries of rotations that are less than 1e-8 taken for nothing, as rounding did."""
    monkeypatch.setattr(exact, "SMALLEST", exact.mpfr(1e-8))
    for function in (exact.orientation, exact.to_axis, exact.axis_rotations):
        function.cache_clear()
    assert any(tried(case(number)) not in WELL for number in (32, 89, 554, 559))
    for function in (exact.orientation, exact.to_axis, exact.axis_rotations):
        function.cache_clear()


# By name.

TILTED = """
name = "tilted"
dimensions = 3
outputs = ["gravity_force"]
bodies = [{ name = "b", mass = 1.0, inertia_com = [0.1, 0.1, 0.1] }]
"""
PIN = 'type = "revolute", parent = "world", child = "b", r_child = [-0.5, 0, 0]'
STRAIGHT = 'effects = [{ type = "gravity", g = 10.0 }]'
ASKEW = 'effects = [{ type = "gravity", g = 10.0, direction = [0, -1e-9, -2] }]'
TILTS = {
    "orientation": ("orientation_deg = [180.0000005, 0, 0]", STRAIGHT, 180.0000005 - 180.0),
    "tiny orientation": ("orientation_deg = [1e-40, 0, 0]", STRAIGHT, 1e-40),
    "axis": ("axis = [0, 1.4e-8, 1]", STRAIGHT, np.degrees(1.4e-8)),
    "axis of length 3": ("axis = [0, 4.2e-17, 3]", STRAIGHT, np.degrees(1.4e-17)),
    "gravity": ("axis = [0, 0, 1]", ASKEW, np.degrees(5e-10)),
}
"""Pins on an axis that stands off the vertical by this many degrees."""


def modules(text: str, *routes: str) -> dict[str, GeneratedModule]:
    """A scene's modules, by routes."""
    found = {}
    for route in routes:
        model = elaborate(parse_scene(f'route = "{route}"\n{text}'))
        found[route] = load_module(generate(model, jacobian=False).module, model.name)
    return found


@pytest.mark.parametrize("what", TILTS)
def test_small_tilts_stay(what: str) -> None:
    """m g l sin of a tilt, whose cosine is 1 in doubles: neither more nor less."""
    keys, effects, degrees = TILTS[what]
    text = f'{TILTED}joints = [{{ name = "j", {PIN}, {keys} }}]\n{effects}'
    routes = ("aba", "ldl", "orthogonal", *(["closed"] if effects == STRAIGHT else []))
    with mpmath.workdps(60):
        sine = float(mpmath.sin(mpmath.radians(mpmath.mpf(float(degrees)))))
    for route, module in modules(text, *routes).items():
        force = float(module.gravity_force(0.0, [0.0, 0.0])[0])
        assert abs(force) == pytest.approx(5.0 * sine, rel=1e-15), route


def test_small_tilts_in_the_plane() -> None:
    """A slide that rises by 1.4e-8, and one that is turned by as much and a half turn."""
    text = """
name = "slides"
outputs = ["gravity_force"]
bodies = [{ name = "a", mass = 1, inertia_com = 0 }, { name = "b", mass = 1, inertia_com = 0 }]
joints = [
    { name = "s", type = "prismatic", parent = "world", child = "a", axis = [2, 2.8e-8] },
    { name = "t", type = "prismatic", parent = "world", child = "b", axis = [-1, 0] ANGLE },
]
effects = [{ type = "gravity", g = 10.0 }]
"""
    text = text.replace("ANGLE", ", orientation_deg = 180.0000005")
    turned = np.radians(180.0000005 - 180.0)
    for route, module in modules(text, "aba", "ldl", "orthogonal", "closed").items():
        found = module.gravity_force(0.0, [0.0] * 4)
        np.testing.assert_allclose(found, [1.4e-7, 10.0 * turned], rtol=1e-15, err_msg=route)


@pytest.mark.parametrize(("key", "sine"), [("90", 0.0), ("90.0000005", -np.radians(5e-7))])
def test_locked_in_degrees(key: str, sine: float) -> None:
    """A quarter turn is one, and no more than one if it is more: m g l sine of what hangs on it."""
    text = f"""
name = "locked"
outputs = ["gravity_force"]
bodies = [{{ name = "a", mass = 1, inertia_com = 1 }}, {{ name = "b", mass = 1, inertia_com = 1 }}]
joints = [
    {{ name = "j", type = "revolute", parent = "world", child = "a" }},
    {{ name = "k", type = "prismatic", parent = "a", child = "b", axis = [0, 1] }},
]
effects = [{{ type = "gravity", g = 10.0 }}]
locked = {{ j_angle_deg = {key} }}
"""
    for route, module in modules(text, "aba", "ldl", "orthogonal").items():
        found = module.gravity_force(0.0, [0.0, 0.0])
        np.testing.assert_allclose(found, [10.0 * sine], rtol=2e-8, err_msg=route)
        assert (found[0] == 0.0) == (sine == 0.0)


@pytest.mark.every(2)
@pytest.mark.parametrize("seed", range(some(20, 500)))
def test_fixed_rotations_are_rounded_once(seed: int) -> None:
    """Every entry within half a unit in its own last place, 0 where it is 0: of a row of turns, of
    which the last undoes the others but for so little.
    """
    r = np.random.default_rng(seed)
    angles = [float(x) for x in r.choice((20.0, 10.0, 90.0, 33.0, 1e-9), 3)]
    k, rest = int(r.integers(3)), float(r.choice((0.0, 1e-10, 1e-13)))
    row = [*angles, -sum(angles) + rest]
    found, true = exact.EYE, mpmath.eye(3)
    with mpmath.workdps(120):
        for angle in row:
            degrees = [0.0, 0.0, 0.0]
            degrees[k] = angle
            found = exact.product(found, exact.orientation((degrees[0], degrees[1], degrees[2])))
            true = true * about(k, mpmath.radians(mpmath.mpf(angle)))
        for i in range(3):
            for j in range(3):
                x, exactly = float(found[i][j]), true[i, j]
                if abs(exactly) < mpmath.mpf(10) ** -100:
                    assert x == 0.0
                else:
                    assert abs(x - exactly) <= np.spacing(abs(x)) * (0.5 + 1e-9)
    assert len(exact.axis_rotations(found) or ()) == (abs(true[(k + 2) % 3, (k + 1) % 3]) > 1e-100)


def about(k: int, angle: Any) -> Any:
    """The rotation about a coordinate axis, in extended precision."""
    turned, (i, j) = mpmath.eye(3), ((k + 1) % 3, (k + 2) % 3)
    turned[i, i] = turned[j, j] = mpmath.cos(angle)
    turned[j, i] = mpmath.sin(angle)
    turned[i, j] = -turned[j, i]
    return turned


def test_two_solvers_of_60_digits_tell_on_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `verify` holds the recursions against has rotations of its own, from the scene's
    numbers: a fault in those of the recursions shows, in 60 digits.
    """
    text = f'{TILTED}joints = [{{ name = "j", {PIN}, axis = [0, 1.4e-8, 1] }}]\n{STRAIGHT}'
    y = np.array([0.3, 0.2])

    def apart() -> float:
        model = elaborate(parse_scene(text))
        with extended_digits():
            one = FreeBodies(model, 0.0, y).vd
            other = Truth(model).extended(0.0, y, {}, {})
            return float(np.max(doubles(abs(one - other)) / np.max(doubles(abs(one)))))

    assert apart() < 1e-50
    monkeypatch.setattr(exact, "to_axis", lambda axis: (exact.EYE, 2))
    assert apart() > 1e-9


OBLIQUE = """
name = "oblique"
bodies = [{ name = "a", mass = 0.0, inertia_com = 0 }, { name = "b", mass = 1.0, inertia_com = 0 }]
joints = [
    { name = "x", type = "prismatic", parent = "world", child = "a", axis = [1.0, 0.0] },
    { name = "y", type = "prismatic", parent = "a", child = "b", axis = AXIS },
]
effects = [{ type = "joint_spring", name = "k", joints = "all", stiffness = 1.0 }]
""".replace("AXIS", "[0.99999999, 1.4142135588375514e-4]")


def test_routes_are_judged_by_the_steps_that_are_written() -> None:
    """Two slides 1.4e-4 from parallel: articulated bodies lose seven digits in the world's axes,
    which are those that they are written in here, and none in the frames' own.
    """
    made = compile_program(elaborate(parse_scene(OBLIQUE)))
    assert made.system.route == "orthogonal"
    lost = {line.split()[0]: line for line in made.explanation()}
    assert lost["aba"].endswith("would lose 7 digits") and lost["orthogonal"].endswith("<- taken")
    module = modules(OBLIQUE, "auto")["auto"]
    found = module.derivative(0.0, [-0.6, -0.9, 0.0, 0.0])[2]
    assert found == pytest.approx(-14999999.62500020606, rel=1e-15)


def test_trial_states_come_near_alignment() -> None:
    """A route that is wrong where an angle is slight, but not where it is 0, does not pass."""
    model = elaborate(parse_scene(find_scene("double_pendulum").read_text()))

    def wrong(values: Values) -> Sequence[Any]:
        rates = Dynamics(model, values, ArrayScalars(), "own").articulated_forward()
        slight = (values.q[1] != 0.0) & (abs(values.q[1]) < 1e-4)
        return [rate * np.where(slight, 1.0 + 1e-9, 1.0) for rate in rates]

    assert digits_lost(model, {"aba": Route(wrong, None)})["aba"] > 6


def test_trial_states_are_at_rest_too() -> None:
    """Where what velocities do hides what is lost of all else."""
    model = elaborate(parse_scene(find_scene("double_pendulum").read_text()))

    def wrong(values: Values) -> Sequence[Any]:
        rates = Dynamics(model, values, ArrayScalars(), "own").articulated_forward()
        return [rate * np.where(values.v[1] == 0.0, 1.0 + 1e-9, 1.0) for rate in rates]

    assert digits_lost(model, {"aba": Route(wrong, None)})["aba"] > 6


UNEVEN = """
name = "uneven"
bodies = [
    { name = "a", mass = 1.4, inertia_com = MOMENT },
    { name = "b", mass = 4.6, inertia_com = 1e-6 },
]
effects = [{ type = "gravity", g = 9.81 }]

[[joints]]
name = "p"
type = "planar"
parent = "world"
child = "a"
r_child = [0, -1.2]

[[joints]]
name = "q"
type = "revolute"
parent = "a"
child = "b"
r_parent = [7e-6, 0]
r_child = [-1, 0]
"""


def test_what_digits_are_right_is_reported() -> None:
    """A moment of inertia of 1e-14 beside masses on arms: run, with a report of what it costs; one
    of 1e-6: run, and nothing said.
    """
    few = compile_program(elaborate(parse_scene(UNEVEN.replace("MOMENT", "1e-14"))), jacobian=False)
    assert few.choice.digits is not None and FEWEST <= few.choice.digits < ENOUGH
    assert f"{few.choice.digits} of 16 digits of accelerations are right" in few.choice.notices()[0]
    many = compile_program(elaborate(parse_scene(UNEVEN.replace("MOMENT", "1e-6"))), jacobian=False)
    assert many.system.route == "orthogonal" and not many.choice.notices()


NEEDLE = """
name = "needle"
dimensions = 3
bodies = [
    { name = "base", mass = 1, inertia_com = [1, 1, 1] },
    { name = "needle", mass = 1.0, inertia_com = [0.7, 0.7, 1e-13] },
]
joints = [
    { name = "turn", type = "revolute", parent = "world", child = "base" },
    { name = "spin", type = "revolute", parent = "base", child = "needle" },
]
effects = [
    { type = "driven", name = "wind", joint = "turn", coordinate = "0.35*t**2" },
    { type = "motor", name = "push", joint = "spin", torque = "3e-14" },
]
"""


def test_slight_moments_of_inertia() -> None:
    """A needle on a base that turns faster and faster about the needle's own axis, which resists by
    1e-13 of what the others do: 0.3 rad/s² less 0.7 rad/s².
    """
    assert compile_program(elaborate(parse_scene(NEEDLE))).choice.digits is None
    for route, module in modules(NEEDLE, "aba", "ldl", "orthogonal").items():
        found = module.derivative(0.0, [0.2, 0.4])[1]
        assert found == pytest.approx(-0.4, rel=1e-14), route


def test_nearly_parallel_axes_are_two() -> None:
    """A universal joint's axes cross where they cross at all; the last digits of an axis do not."""
    for slant, refused in ((1e-7, False), (1e-12, False), (1e-16, True)):
        keys = f'type = "universal", parent = "world", axes = [[1, 0, 0], [1, {slant}, 0]]'
        text = f'{TILTED}joints = [{{ name = "j", child = "b", {keys} }}]\n{STRAIGHT}'
        if refused:
            with pytest.raises(SceneError, match="are parallel"):
                elaborate(parse_scene(text))
            continue
        system = compile_program(elaborate(parse_scene(text)), jacobian=False, closed=False).system
        assert system.route
