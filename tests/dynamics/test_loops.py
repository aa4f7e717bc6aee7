"""Mechanisms with loops: every route agrees with a solver in maximal coordinates, in the plane and
in space, over all joint types; and four-bars and slider-cranks with their closed formulas.

`campaigns/loops.py` tries 300 random ones.
"""

from dataclasses import replace

import judges
import linkages
import numpy as np
import planar_linkages
import pytest
import uneven_loops
from engine import apart, engine
from loop_routes import apart_by_route, model_of, solved
from scenes import refusal
from spatial_loops import Closed, random_loops
from spatial_trees import PLANE, SPACE

from eomgen.base.errors import SceneError
from eomgen.codegen.choice import choose
from eomgen.codegen.digits import Route, digits_lost
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.loops.constraints import rates, residuals
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.constraint_equations import ConstraintEquations
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import elaborate
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem
from eomgen.scalars.floats import ArrayScalars, FloatScalars
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.tables.outputs import OUTPUTS

CASES = [(PLANE, 5, 0), (PLANE, 7, 1), (PLANE, 8, 3), (SPACE, 5, 1), (SPACE, 6, 2), (SPACE, 6, 3)]
"""Dimensions, most bodies, seed."""
CLOSE, WELL = 1e-10, 1e-12
CONDITION = 100.0
"""That of a mechanism, see `Closed`, below which it is well-conditioned."""


def drawn(dimensions: int, most: int, seed: int) -> Closed:
    """A random mechanism with loops; the more bodies, the more loops."""
    return random_loops(seed, dimensions, most, 1 + seed % 6)


def assert_as_solved(case: Closed, seed: int) -> None:
    """Accelerations and the wrenches of all joints by every route."""
    model, (u, motion) = model_of(case), solved(case, seed)
    assert not model.notices
    bar = WELL if case.condition < CONDITION else CLOSE
    for route, off in apart_by_route(case, model, u, motion).items():
        assert max(off) < bar, route


@pytest.mark.every(2)
@pytest.mark.parametrize(("dimensions", "most", "seed"), CASES)
def test_every_route_is_the_solver(dimensions: int, most: int, seed: int) -> None:
    assert_as_solved(drawn(dimensions, most, seed), seed)


@pytest.mark.parametrize(("dimensions", "seed"), [(PLANE, 4), (SPACE, 1), (SPACE, 3)])
def test_every_route_is_mujoco(dimensions: int, seed: int) -> None:
    """Its mass matrix, bias and equality constraints, which are kept exactly."""
    kinds = ("revolute", "weld") if dimensions == PLANE else ("ball", "weld", "revolute")
    case = random_loops(seed, dimensions, 6, 1 + seed % 2, kinds)
    model, (u, motion) = model_of(case), solved(case, seed)
    other = judges.mujoco_constrained(case.tree, case.q, case.v, u)
    found = apart_by_route(case, model, u, replace(motion, accelerations=other))
    assert max(accelerations for accelerations, _ in found.values()) < CLOSE


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", [2, 5, 9])
def test_masses_over_12_decades(seed: int) -> None:
    """The route of last resort keeps every digit that the data have; the others do not."""
    found = uneven_loops.errors(uneven_loops.drawn(seed), seed, ("ldl", "orthogonal"))
    assert found["orthogonal"] < CLOSE < found["ldl"]


def test_digits_are_judged_without_articulated_bodies() -> None:
    """Of a single route too, as with many loops, where the others are not tried."""
    model = uneven_loops.drawn(2)

    def independent(values: Values) -> list[np.ndarray]:
        return Dynamics(model, values, ArrayScalars(), "own").forward("independent")(None)

    lost = digits_lost(model, {"independent": Route(independent, "own")})
    assert lost["independent"] > 4 + lost["orthogonal"]


ORIENTATIONS = {
    (2, "angle"): ('"tilt"', "orientation_deg = {degrees}"),
    (3, "angles"): ('["tilt", 0.3, "-tilt/2"]', "orientation = [{tilt}, 0.3, {half}]"),
    (3, "quaternion"): ('["cos(tilt/2)", "sin(tilt/2)", 0, 0]', "orientation = [{tilt}, 0, 0]"),
    (3, "matrix"): (
        '[["cos(tilt)", "-sin(tilt)", 0], ["sin(tilt)", "cos(tilt)", 0], [0, 0, 1]]',
        "orientation = [0, 0, {tilt}]",
    ),
}
"""Dimensions, kind: an orientation by formulas, and the same by numbers."""
SLIDE = """
name = "slide"
dimensions = {n}
[parameters]
tilt = {tilt}
[[bodies]]
name = "block"
mass = 1.3
inertia_com = {inertia}
[[joints]]
name = "free"
type = "free"
child = "block"
[[joints]]
name = "slope"
type = "prismatic"
loop = true
parent = "world"
child = "block"
axis = {axis}
{orientation}
[[effects]]
type = "gravity"
g = 9.81
"""


@pytest.mark.parametrize(("n", "kind"), ORIENTATIONS)
def test_a_loop_joint_turned_by_formulas(n: int, kind: str) -> None:
    """A block on a slope: as with numbers, and with other values of the parameter."""
    formulas, numbers = ORIENTATIONS[n, kind]
    of = {"n": n, "inertia": [0.1, 0.12, 0.15] if n == 3 else 0.1, "axis": [0.6, 0.8, 0][:n]}
    rng, rows = np.random.default_rng(0), []
    q, v = (rng.normal(size=k) for k in ((7, 6) if n == 3 else (3, 3)))
    for tilt in (0.3, 0.7):
        words = numbers.format(tilt=tilt, half=-tilt / 2, degrees=float(np.degrees(tilt)))
        found = []
        for orientation in (f"orientation = {formulas}", words):
            model = elaborate(parse_scene(SLIDE.format(tilt=0.3, orientation=orientation, **of)))
            d = Dynamics(model, Values({**model.defaults, "tilt": tilt}, {}, q, v), FloatScalars())
            found.append(np.vstack([[*residuals(d)], [*rates(d)]]))
        assert np.allclose(*found, rtol=0, atol=1e-14)
        rows.append(found[0])
    assert np.abs(rows[0] - rows[1]).max() > 1e-2


def left_out(*kept: str) -> tuple[str, ...]:
    """All outputs but some."""
    return ("jacobian", *(name for name in OUTPUTS if name not in kept))


@pytest.mark.every(2)
@pytest.mark.parametrize(("dimensions", "route"), [(PLANE, "independent"), (SPACE, "aba")])
def test_a_module_is_the_solver(dimensions: int, route: str) -> None:
    """As code: accelerations, wrenches, residuals, and projections that change nothing."""
    case = drawn(dimensions, 4, 2)
    module = engine(case.text, route, leave_out=left_out("joint_forces")).module
    u, motion = solved(case, 0)
    y = np.empty(len(module.STATES))
    y[case.tree.places(module.STATES)] = np.concatenate((case.q, case.v))
    expected = np.empty(len(y))
    rates = np.concatenate((motion.rates, motion.accelerations))
    expected[case.tree.places(module.STATES)] = rates
    forces = motion.joint_forces[case.tree.rows(module.JOINTS)]
    assert apart(module.derivative(0.0, y, None, u), expected) < WELL
    assert apart(module.joint_forces(0.0, y, None, u), forces) < WELL
    assert np.abs(module.constraint_residuals(0.0, y)).max() < 1e-14
    assert np.abs(module.constraint_rates(0.0, y)).max() < 1e-13
    nq = len(module.POSITIONS)
    assert apart(module.project_position(0.0, y), y[:nq]) < 1e-13
    assert apart(module.project_velocity(0.0, y), y[nq : nq + len(case.v)]) < 1e-13


REDUNDANT = {
    "four_bar_in_space": (5, 3, "loop0_z, loop0_angle_1, loop0_angle_2"),
    "bennett": (5, 3, ""),
    "bricard": (5, 1, "loop0_angle_2"),
}
"""Rows of each linkage's loop, how many of them follow from the others, and their names."""


@pytest.mark.parametrize("name", REDUNDANT)
def test_redundant_rows_are_dropped_and_named(name: str) -> None:
    """They follow from the others only where the loop is closed; the motion is the solver's."""
    case = getattr(linkages, name)()
    model, (u, motion) = model_of(case), solved(case, 0, redundant=True)
    rows, dropped, names = REDUNDANT[name]
    assert (len(model.rows), len(model.dropped)) == (rows - dropped, dropped)
    (notice,) = model.notices
    assert names in notice
    assert all(name in notice for name in model.dropped)
    assert "not unique" in notice
    for route, (accelerations, _) in apart_by_route(case, model, u, motion).items():
        assert accelerations < WELL, route


FORMULAS = {
    "slider_crank": (planar_linkages.slider_crank, "theta bend x"),
    "four_bar": (planar_linkages.four_bar, "theta bend gamma"),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_closed_formulas(name: str) -> None:
    """Positions, velocities and accelerations around the whole circle, and the branch kept along a
    run: those of the closed formulas and of the reduced equation of motion.
    """
    formulas, words = FORMULAS[name]
    text = getattr(planar_linkages, f"{name}_scene")(1.5, 3.0)
    module = engine(text, "independent", leave_out=left_out()).module
    own = [module.STATES.index(word) for word in words.split()]
    expected, start = formulas(1.5, 3.0), module.initial_state()
    assert apart(start[:3][own], expected.q) < WELL  # assembled from the angle alone
    assert apart(start[3:][own], 3.0 * expected.by_angle) < WELL
    rng = np.random.default_rng(0)
    for angle in np.linspace(-3.0, 3.0, 31).tolist():
        rate = float(rng.uniform(-5.0, 5.0))
        expected, y = formulas(angle, rate), np.zeros(6)
        y[own] = expected.q + np.array([0.0, *rng.uniform(-0.01, 0.01, 2)])
        for _ in range(6):
            y[:3] = module.project_position(0.0, y)
        assert apart(y[own], expected.q) < WELL
        y[3 + own[0]] = rate
        y[3:] = module.project_velocity(0.0, y)
        assert apart(y[3:][own], rate * expected.by_angle) < WELL
        rates = module.derivative(0.0, y)
        assert apart(rates[:3], y[3:]) == 0.0
        assert apart(rates[3:][own], expected.accelerations(rate)) < WELL
    run = integrate(as_problem(module), "rk4", 1.0, dt=2e-3)
    assert run.finished
    ends = [formulas(float(y[own[0]]), 0.0).q for y in run.y[::50]]
    # Angles may have gone around.
    apart_by = (run.y[::50, own] - ends + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(apart_by).max() < WELL


# Bad input.


def bars(*more: str, ground: float = 0.75, closing: str = "loop = true", start: str = "") -> str:
    """A four-bar, with more tables."""
    pin = planar_linkages.pin
    tables = [planar_linkages.head("bad")]
    tables += [planar_linkages.body(name, 1.0, 0.1) for name in ("crank", "coupler", "rocker")]
    close = pin("close", "coupler", (0.4, 0), "rocker", (0.275, 0), loop=True)
    tables += [
        pin("theta", "world", (0, 0), "crank", (-0.125, 0)),
        pin("bend", "crank", (0.125, 0), "coupler", (-0.4, 0)),
        pin("gamma", "world", (ground, 0), "rocker", (-0.275, 0)),
        close.replace("loop = true", closing),
    ]
    return "\n".join([*tables, *more, f"[initial]\n{start}"])


def another(parent: str, at: tuple[float, float], child: str, own: tuple[float, float]) -> str:
    """One more loop joint."""
    return planar_linkages.pin("more", parent, at, child, own, loop=True)


def constraint(kind: str, *lines: str) -> str:
    """A constraint as TOML."""
    return "\n".join(["[[constraints]]", f'type = "{kind}"', 'name = "rule"', *lines, ""])


BAD = {
    "it cannot close": (bars(ground=3.0), "pin_close_x stays open by 2.5 m; change lengths"),
    "nor where it is held": (
        bars(ground=1.9, start="q = { theta = 3.14 }"),
        "cannot be met with theta as given: pin_close_x stays open by 0.806 m",
    ),
    "it holds everything": (
        bars(another("world", (0.25, 0), "crank", (0.125, 0))),
        "the loops hold everything: 3 independent constraints on 3 velocities",
    ),
    "two more hold everything": (
        bars(constraint("equation", 'position = "theta - 1"')),
        "the loops hold everything: 3 independent constraints on 3 velocities",
    ),
    "it restricts nothing": (
        planar_linkages.head("bad")
        + planar_linkages.body("crank", 1.0, 0.1)
        + planar_linkages.pin("theta", "world", (0, 0), "crank", (-0.125, 0))
        + another("world", (0, 0), "crank", (-0.125, 0)),
        "pin_more restricts nothing that the other joints do not restrict already; leave it out",
    ),
    "velocities contradict it": (
        bars(start="q = { theta = 1.0 }\nv = { theta_dot = 1.0, gamma_dot = 5.0 }"),
        "initial.v: the velocities given contradict the constraints; give fewer of them",
    ),
    "it does not say that it is a loop": (
        bars(closing=""),
        "'rocker' is the child of joints[2] too; in a tree each body has one joint to its parent; "
        "give one of the two loop = true",
    ),
    "a body is held to itself": (
        bars(another("crank", (0, 0), "crank", (0, 0))),
        "joints[4].child: 'crank' is also the parent; a loop joint holds two bodies together",
    ),
    "a joint holds nothing": (
        bars(another("world", (0, 0), "crank", (0, 0)).replace("revolute", "planar")),
        "a 'planar' joint holds nothing here, so it closes no loop; leave the joint out",
    ),
    "it has a coordinate": (
        bars(closing='loop = true\ncoordinate = "x"'),
        "joints[3].coordinate: a joint with loop = true has no coordinates, so this has no effect",
    ),
    "it has a rotor": (
        bars(closing="loop = true\nmotor_inertia = 0.1"),
        "joints[3].motor_inertia: a joint with loop = true has no coordinates",
    ),
    "a key is wrong": (
        bars(closing="loops = true"),
        "joints[3].loops: unknown key (did you mean 'loop'?)",
    ),
    "a rod is too long": (
        bars(constraint("distance", 'body_1 = "world"', 'body_2 = "crank"', "length = 5.0")),
        "rule stays open by 4.88 m",
    ),
    "a coordinate is unknown": (
        bars(constraint("coupling", 'coordinate = "thet"', 'equals = "gamma"')),
        "constraints[0].coordinate: no coordinate is named 'thet' (did you mean 'theta'?)",
    ),
    "a formula of positions has a velocity": (
        bars(constraint("equation", 'position = "theta - gamma_dot"')),
        "constraints[0].position: 'gamma_dot' is no coordinate",
    ),
    "a formula is not linear in velocities": (
        bars(constraint("equation", 'velocity = "theta_dot**2 - 1"')),
        "rule is not linear in the velocities",
    ),
    "a formula is never met": (
        bars(constraint("equation", 'position = "1"')),
        "rule stays open by 1 rad",
    ),
    "numbers overflow": (
        bars(constraint("coupling", 'coordinate = "theta"', 'equals = "1e300*gamma**2 + 1e300"')),
        "rule stays open by",
    ),
    "a name is taken": (
        bars(constraint("equation", 'position = "theta"').replace("rule", "pin_close")),
        "constraints[0].name: 'pin_close' is also the name of joints[3]; give each its own",
    ),
}


def test_a_link_without_mass_is_refused() -> None:
    """The message says what will do."""
    text = planar_linkages.four_bar_scene(1.0, 2.0)
    own = planar_linkages.body("coupler", 2.2, 0.11)
    assert own in text
    model = elaborate(parse_scene(text.replace(own, planar_linkages.body("coupler", 0.0, 0.0))))
    with pytest.raises(SceneError, match=r"'coupler'.*loops are cut.*a millionth"):
        check_nonsingular(model)


@pytest.mark.parametrize("name", BAD)
def test_bad_input_gets_one_clear_line(name: str) -> None:
    text, message = BAD[name]
    assert message in refusal(lambda: assembled(elaborate(parse_scene(text))))


def test_a_loop_joint_that_is_there_twice_is_dropped_and_named() -> None:
    twice = another("coupler", (0.4, 0), "rocker", (0.275, 0))
    model = assembled(elaborate(parse_scene(bars(twice))))
    assert model.dropped == ("pin_more_x", "pin_more_y")


@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
def test_recorded_constraints_are_those_of_floats(dimensions: int) -> None:
    """The same bits, so that walks along closed positions are what they were."""
    equations = ConstraintEquations.of(model_of(random_loops(3, dimensions, 4, 1)))
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = np.array(equations.model.initial_q) + rng.uniform(
            -1.0, 1.0, len(equations.model.initial_q)
        )
        found, matrix = equations.both(q)
        assert np.array_equal(found, equations.residuals(q))
        assert np.array_equal(matrix, equations.jacobian(q))


@pytest.mark.parametrize("name", ["four_bar", "car_suspension"])
def test_the_range_space_is_tried_where_no_velocities_are_independent(name: str) -> None:
    model = assembled(elaborate(read_scene(name)))
    tried = {c.route: c.operations is not None for c in choose(model).candidates}
    assert tried["independent"] != tried["aba"] == tried["ldl"]
