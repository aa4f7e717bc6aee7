"""Exact derivatives: of v̇ by states, inputs and parameters, and of points by velocities.

What a program says is compared with central differences of its own `derivative` in 60 digits; what
a module says, with those too, to 1e-12 of the largest entry.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from engine import Engine, along, apart, engine, exact, slopes, varied
from spatial_trees import random_spatial_tree

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program, python_module
from eomgen.program.extended import evaluator
from eomgen.program.tape import TIME
from eomgen.run.module import load_module
from eomgen.scene.reader import read_scene
from eomgen.study.verification.hard_states import hard_states
from eomgen.tables.outputs import OUTPUTS

ROUNDING = 1e-12
EXACT = 1e-13
"""For 60 digits; what is left are doubles that should be sines or directions."""
DERIVATIVES = ("jacobian", "input_jacobian", "parameter_jacobian")

MACHINE = """
name = "machine"
dimensions = 3
parameters = { m = 0.8, l = 0.35 }
bodies = [
    { name = "base", mass = 2.5, inertia_com = [0.11, 0.12, 0.17, 0.01, -0.02, 0.015] },
    { name = "arm", mass = "m", \
inertia_com = ["m*l**2/12", "m*l**2/10", "m*l**2/11", "m*l**2/90", 0, 0.0007] },
    { name = "hand", mass = "m/2", inertia_com = [0.003, 0.004, 0.0035] },
    { name = "tail", mass = 0.6, inertia_com = 0 },
    { name = "head", mass = 0.7, inertia_com = [0.004, 0.005, 0.006] },
]
joints = [
    { name = "fly", type = "free", child = "base" },
    { name = "shoulder", type = "ball", parent = "base", child = "arm", \
r_parent = [0.2, -0.1, 0.15], r_child = ["-l/2", 0, 0.05], orientation_deg = [20, -35, 50] },
    { name = "wrist", type = "revolute", parent = "arm", child = "hand", axis = [0.6, 0.0, 0.8], \
r_parent = ["l/2", 0, 0], r_child = [0.02, -0.06, 0.04], motor_inertia = 0.0004, \
gear_ratio = 7.5 },
    { name = "rail", type = "prismatic", parent = "base", child = "tail", axis = [0, 1, 0], \
r_parent = [-0.1, 0, 0.1], orientation_deg = [0, 90, 0], motor_inertia = 0.02 },
    { name = "neck", type = "universal", parent = "base", child = "head", \
axes = [[1, 0, 0], [0, 1, 0]], r_parent = [0, 0.1, 0.3], r_child = [0, 0.03, -0.1] },
]
points = [{ name = "finger", body = "hand", at = [0.05, "l/3", -0.02] }]
effects = [
    { type = "gravity", g = 9.81 },
    { name = "push", type = "external_force", body = "hand", at = [0.03, -0.02, "l/4"], \
force = "input" },
    { name = "pull", type = "external_force", body = "head", at = [0.0, 0.0, 0.1], \
force = ["2*m", 0, -3.0] },
    { name = "twist", type = "motor", joint = "wrist", torque = "input" },
    { name = "drive", type = "motor", joint = "rail", torque = "input" },
]
"""


def tree(seed: int, dimensions: int) -> str:
    """A random tree of up to 4 bodies."""
    return random_spatial_tree(seed, dimensions, 4)[1]


ASIDE = tuple(o for o in OUTPUTS if o not in (*DERIVATIVES, "point_jacobians", "point_velocities"))
"""Outputs that this is not about."""
TREES = {f"space_{seed}": (seed, 3) for seed in (3, 11, 24)} | {"plane_5": (5, 2)}
CASES = [("chain", route) for route in ("aba", "ldl")]
CASES += [("machine", "aba")]
CASES += [(name, ("aba", "ldl")[i % 2]) for i, name in enumerate(TREES)]
CASES += [("furuta_pendulum", "aba"), ("tumbling_body", ""), ("spinning_top", "ldl")]
CASES += [("two_body_forced", route) for route in ("closed", "aba", "ldl")]
every_case = pytest.mark.parametrize(("name", "route"), CASES)


def made(name: str, route: str, *, tangents: bool = False) -> Engine:
    """A case; all outputs but those that this is not about."""
    text = MACHINE if name == "machine" else tree(*TREES[name]) if name in TREES else name
    return engine(text, route, leave_out=ASIDE, tangents=tangents)


def state(e: Engine, seed: int) -> tuple[np.ndarray, dict, dict]:
    """A state with quaternions of any length, inputs, and parameters off the scene's own."""
    rng = np.random.default_rng(seed)
    y, u = e.random_state(rng), e.random_inputs(rng)
    for indices in map(list, e.module.QUATERNIONS):
        y[indices] *= rng.uniform(0.7, 1.5)
    p = varied(e.model, rng, 0.9, 1.1)
    return y, u, p


@pytest.mark.every(4)
@every_case
def test_derivatives_are_exact(name: str, route: str) -> None:
    """Written out, and along directions as for large models, by the program and by the module."""
    forms = [made(name, route)]
    if forms[0].system.route != "closed":
        forms.append(made(name, route, tangents=True))
    outputs = [name for name in DERIVATIVES if name in forms[0].system.program.outputs]
    assert [bool(e.system.tangents) for e in forms] == [False, True][: len(forms)]
    y, u, p = state(forms[0], 71)
    for output in outputs:
        expected = slopes(forms[0], output, y, u, p)
        assert expected.shape == forms[0].system.program.outputs[output].shape
        for e in forms:
            assert apart(e.exactly(output, y, u, p), expected) < EXACT, output
            assert apart(getattr(e.module, output)(0.0, y, p, u), expected) < ROUNDING, output


@pytest.mark.every(2)
@every_case
def test_entries_are_exact_one_by_one(name: str, route: str) -> None:
    """Small entries beside large ones too: each to 1e-12 of the largest in its own row."""
    e = made(name, route)
    y, u, p = state(e, 72)
    for output in DERIVATIVES:
        if output in e.system.program.outputs:
            expected = slopes(e, output, y, u, p)
            for row, wanted in zip(e.exactly(output, y, u, p), expected, strict=True):
                size = np.max(np.abs(wanted), initial=0)
                assert np.max(np.abs(row - wanted), initial=0) <= 1e-12 * size + 1e-30, output


@pytest.mark.every(4)
@every_case
def test_both_forms_for_columns_of_states(name: str, route: str) -> None:
    """Many states at once give each one's own matrix, written out or not; so does no input."""
    e = made(name, route)
    forms = [e] if e.system.route == "closed" else [e, made(name, route, tangents=True)]
    several = [state(e, seed) for seed in (73, 74, 75)]
    p = several[0][2]
    columns = np.array([y for y, _, _ in several]).T
    inputs = np.array([list(u.values()) for _, u, _ in several]).reshape(3, -1).T
    for output in DERIVATIVES:
        if output not in e.system.program.outputs:
            continue
        alone = [getattr(e.module, output)(0.0, y, p, u) for y, u, _ in several]
        unforced = getattr(e.module, output)(0.0, several[0][0])
        for other in forms:
            function = getattr(other.module, output)
            assert apart(function(0.0, columns, p, inputs), np.stack(alone, axis=-1)) < ROUNDING
            assert apart(function(0.0, several[0][0]), unforced) < ROUNDING
            for (y, u, _), wanted in zip(several, alone, strict=True):
                assert apart(function(0.0, y, p, u), wanted) < ROUNDING


@pytest.mark.full
@pytest.mark.every(2)
@pytest.mark.parametrize(("name", "route"), [("machine", "aba"), ("chain", "ldl"), ("space_3", "")])
def test_routes_have_one_derivative(name: str, route: str) -> None:
    """Both routes write down the same matrices."""
    first, other = made(name, "aba"), made(name, "ldl")
    y, u, p = state(first, 76)
    for output in DERIVATIVES:
        if output in first.system.program.outputs:
            found = [getattr(e.module, output)(0.0, y, p, u) for e in (first, other)]
            assert apart(*found) < ROUNDING


def test_what_must_vanish() -> None:
    """Of the state's rates: q̇ by nothing but q and v, and nothing by the place of a free body."""
    e = made("machine", "aba")
    y, u, p = state(e, 77)
    nv = len(e.model.velocities)
    nq = len(y) - nv
    place = [e.module.STATES.index(f"base_{axis}") for axis in "xyz"]
    J = e.module.jacobian(0.0, y, p, u)
    assert not np.any(J[:, place])
    assert not np.any(e.module.input_jacobian(0.0, y, p, u)[:nq])
    assert not np.any(e.module.parameter_jacobian(0.0, y, p, u)[:nq])
    for indices in map(list, e.module.QUATERNIONS):  # a longer quaternion is the same rotation
        assert np.max(np.abs(J[nq:, indices] @ y[indices])) < 1e-9
    M = engine(MACHINE, "aba", leave_out=DERIVATIVES).module.mass_matrix(0.0, y, p, u)
    drive = list(e.module.INPUTS).index("drive")
    row = [c.name for c in e.model.velocities].index("rail_slide_dot")
    answer = e.module.input_jacobian(0.0, y, p, u)[nq:, drive]
    assert apart(answer, np.linalg.solve(M, np.eye(nv)[row])) < 1e-11


@pytest.mark.every(3)
@pytest.mark.parametrize("route", ["aba", "ldl"])
@pytest.mark.parametrize("name", ["machine", "furuta_pendulum", "spinning_top", "acrobot"])
def test_jacobians_of_points(name: str, route: str) -> None:
    """J v is the velocity of each point, whatever v; and J is how that changes with v."""
    e = made(name, route)
    assert e.module.POINTS
    rng = np.random.default_rng(78)
    y, _, p = state(e, 78)
    nv = len(e.model.velocities)
    J = e.module.point_jacobians(0.0, y, p)
    assert J.shape == (len(e.module.POINTS), e.model.dimensions, nv)
    for _ in range(3):
        y[-nv:] = rng.uniform(-3.0, 3.0, nv)
        assert apart(J @ y[-nv:], e.module.point_velocities(0.0, y, p)) < ROUNDING
        assert np.array_equal(e.module.point_jacobians(0.0, y, p), J)
    for i in range(nv):
        y[-nv:] = np.eye(nv)[i]
        assert apart(J[:, :, i], e.module.point_velocities(0.0, y, p)) < ROUNDING


@pytest.mark.parametrize("route", ["aba", "ldl"])
def test_an_acceleration_that_is_a_parameter(route: str) -> None:
    """A weight on a post falls with g: what is solved for is a parameter too."""
    text = """
name = "weight"
dimensions = 3
[[bodies]]
name = "stone"
mass = 2.0
inertia_com = 0
[[joints]]
name = "post"
type = "prismatic"
parent = "world"
child = "stone"
axis = [0, 0, 1]
[[effects]]
type = "gravity"
g = 9.81
"""
    for tangents in (False, True):
        e = made(text, route, tangents=tangents)
        assert list(e.module.PARAMETERS) == ["stone_mass", "gravity_g"]
        assert e.module.derivative(0.0, np.zeros(2)).tolist() == [0.0, -9.81]
        slopes = e.module.parameter_jacobian(0.0, np.zeros(2))
        assert slopes.tolist() == [[0.0, 0.0], [0.0, -1.0]]


def test_large_models_are_not_written_out() -> None:
    """A chain of 70 links: tangents of its own accord, and as exact."""
    text = """
name = "long"
[[chains]]
name = "link"
count = 70
mass = 0.3
inertia_com = 0.002
r_parent = [0.1, 0]
r_child = [-0.1, 0.01]
[[effects]]
type = "gravity"
g = 9.81
"""
    e = engine(text, "aba", leave_out=tuple(OUTPUTS))
    assert e.system.tangents == {"jacobian"}
    y = e.random_state(np.random.default_rng(79)) * 0.5
    J = e.module.jacobian(0.0, y)
    for i in (0, 3, 69, 70, 100, 139):
        way = exact(np.eye(len(y))[i])
        column = along(lambda x: e.exactly("derivative", x), exact(y), way)
        assert apart(J[:, i], column) < ROUNDING


@pytest.mark.full
def test_weights_that_vanish_refuse_nothing() -> None:
    """`orthogonal` weighs some rows by 1e-200: their products may vanish, and no derivative is
    refused for that.
    """
    text = random_spatial_tree(2, 3, 5)[1]
    one, other = (engine(text, route, tangents=True).module for route in ("orthogonal", "aba"))
    y = engine(text, "orthogonal", tangents=True).random_state(np.random.default_rng(2))
    for name in DERIVATIVES:
        assert apart(getattr(one, name)(0.4, y), getattr(other, name)(0.4, y)) < 1e-9


@pytest.mark.full
def test_the_jacobian_of_light_limbs_on_a_heavy_body_keeps_its_digits() -> None:
    """That of the hanging figure, whose M has a condition of 5e5, along a direction against the
    same program in 60 digits, at a state at random.
    """
    model = replace(assembled(elaborate(read_scene("hanging_figure"))), outputs=())
    system = compile_program(model).system
    assert "jacobian" in system.tangents
    names = [state.name for state in system.states]
    module: Any = load_module(python_module(system), "hanging_figure")
    states = hard_states(module, len(model.velocities), 1, 0, 1.0)
    state = next(one for one in states if one.kind == "random")
    given = {**dict(zip(names, state.y.tolist(), strict=True)), **model.defaults, TIME: state.t}
    given |= {i.name: state.u.get(i.name, 0.0) for i in model.inputs}
    column = names.index("elbow_right_flexion_dot")
    way = dict(zip(system.extra["jacobian"], np.eye(len(names))[column].tolist(), strict=True))
    true = np.array(evaluator(system.program, "jacobian")({**given, **way}))
    found = module.jacobian(state.t, state.y, None, state.u or None)[:, column]
    off = np.abs((found - true).astype(float)).max() / np.abs(true.astype(float)).max()
    assert off < 1e-14
