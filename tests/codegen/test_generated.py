"""Generated modules, executed, against an independent solver in maximal coordinates."""

import ast
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from campaign import BUILT_IN, some
from engine import text_of
from mechanisms import SEEDS, Compiled, Scene, compiled, load, quarter_poses, random_tree
from spatial_newton_euler import SpatialMotion
from spatial_trees import SpatialTree

from eomgen.base.errors import SceneError
from eomgen.scene.reader import parse_scene
from eomgen.study.verification.states import random_state

TOLERANCE = 1e-12
MANY = some(150, 1000)
TREES = [random_tree(seed) for seed in SEEDS]
TRIES = some(6, 20)
"""Random states of each."""


def difference(actual: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference over the largest entry expected, or over 1 (m/s², N, …) if that is less.

    Where everything balances, as for a pendulum that hangs still, what is expected is only the
    rounding of a sum of terms of the size of g.
    """
    assert actual.shape == expected.shape
    if expected.size == 0:
        return 0.0
    return float(np.max(np.abs(actual - expected)) / max(1.0, np.max(np.abs(expected))))


def assert_agrees(
    c: Compiled,
    y: np.ndarray,
    u: Mapping[str, float] | None = None,
    p: Mapping[str, float] | None = None,
) -> SpatialMotion:
    """Accelerations, joint forces and poses of one state are the independent solver's."""
    tree, module = c.scene.tree, c.module
    motion = c.motion(y, u, p)
    rates = module.derivative(0.0, y, p, u)
    assert rates.shape == y.shape
    places, velocities = np.split(np.array(tree.places(module.STATES)), 2)
    assert np.array_equal(rates[places], y[velocities])
    assert difference(rates[velocities], motion.accelerations) <= TOLERANCE
    forces = module.joint_forces(0.0, y, p, u)
    assert difference(forces, motion.joint_forces[tree.rows(module.JOINTS)]) <= TOLERANCE
    poses = module.body_poses(0.0, y, p, u)
    assert difference(poses, motion.body_poses[tree.rows(module.BODIES)]) <= TOLERANCE
    return motion


@pytest.mark.every(4)
def test_random_states(built_in: Compiled) -> None:
    """At many states, with forces and torques if there are any, one by one and as columns.

    Inputs are given by name and in order; both mean the same.
    """
    tree, module = built_in.scene.tree, built_in.module
    rng = np.random.default_rng(20)
    states, inputs, expected = [], [], []
    assert sorted(module.INPUTS) == sorted(tree.inputs)
    for _ in range(MANY):
        y, u = built_in.random_state(rng), built_in.random_inputs(rng)
        motion = assert_agrees(built_in, y, u or None)
        ordered = np.array([u[name] for name in module.INPUTS])
        assert np.array_equal(
            module.derivative(0.0, y, u=ordered), module.derivative(0.0, y, None, u)
        )
        states.append(y)
        inputs.append(ordered)
        expected.append(motion)
    columns, u = np.array(states).T, np.array(inputs).T
    rates = module.derivative(0.0, columns, u=u)
    assert rates.shape == (len(module.STATES), MANY)
    forces = module.joint_forces(0.0, columns, u=u)
    assert forces.shape == (len(module.JOINTS), 3, MANY)
    for i, motion in enumerate(expected):
        _, accelerations = np.split(rates[tree.places(module.STATES), i], 2)
        assert difference(accelerations, motion.accelerations) <= TOLERANCE
        expected_forces = motion.joint_forces[tree.rows(module.JOINTS)]
        assert difference(forces[:, :, i], expected_forces) <= TOLERANCE


def test_quarter_poses(built_in: Compiled) -> None:
    """Every combination of angles at multiples of π/4, at rest, moving, and with inputs."""
    module, rng = built_in.module, np.random.default_rng(21)
    n = len(module.STATES) // 2
    angles = [i for i, name in enumerate(module.STATES) if module.UNITS[name] == "rad"]
    poses = quarter_poses(len(angles))
    assert len(poses) == 8 ** len(angles)
    for pose in poses:
        y = np.zeros(len(module.STATES))
        y[angles] = pose
        assert_agrees(built_in, y)
        y[n:] = rng.uniform(-8.0, 8.0, n)
        assert_agrees(built_in, y)
        assert_agrees(built_in, y, built_in.random_inputs(rng))


@pytest.mark.parametrize("tree", TREES, ids=lambda tree: tree.name)
@pytest.mark.every(4)
def test_random_trees(tree: Scene) -> None:
    """Chains, branches, several trees, point masses, pins anywhere: 20 states of each."""
    c = compiled(tree)
    rng = np.random.default_rng(22)
    assert dict(c.module.PARAMETERS) == dict(tree.tree.parameters)
    for _ in range(TRIES):
        assert_agrees(c, c.random_state(rng), c.random_inputs(rng))


# What is observed of a motion.


@pytest.fixture(params=[*BUILT_IN, *TREES], ids=lambda case: getattr(case, "name", case))
def c(request: pytest.FixtureRequest) -> Compiled:
    """The built-in scenes of the closed form, and the random trees."""
    return compiled(request.param)


def test_points() -> None:
    """Places, velocities and Jacobians of named points are those of the recursion, which are the
    solver's in `test_routes`.
    """
    tree, names = random_tree(9), ("point_positions", "point_velocities", "point_jacobians")
    text = tree.text.replace('outputs = "all"', f"outputs = {[*names]}")
    text += '\n[[points]]\nname = "p"\nbody = "b1"\nat = [0.3, "-l/2"]\n'
    closed, aba = (
        load(text_of(parse_scene(f'route = "{route}"\n{text}'))) for route in ("closed", "aba")
    )
    rng = np.random.default_rng(29)
    for _ in range(TRIES):
        y = random_state(aba, rng)
        for name in names:
            found, expected = (getattr(module, name)(0.0, y) for module in (closed, aba))
            assert difference(found, expected) <= TOLERANCE, name
            assert np.any(expected)


# State forms.


def in_momentum_form(
    tree: SpatialTree, module: object, motion: SpatialMotion
) -> tuple[np.ndarray, np.ndarray]:
    """A state and its derivative as a module in one of the handout's forms wants them."""
    state, rate = {}, {}
    for k, body in enumerate(tree.bodies):
        name, own = body.name, body.joint.coordinates
        x, y = own[:2] if body.joint.kind == "free" else (f"x_{name}", f"y_{name}")
        angle = own[-1] if body.joint.parent < 0 else f"angle_{name}"
        weights = (body.mass, body.mass, body.inertia[2])
        momenta = (f"P_{name}_x", f"P_{name}_y", f"L_{name}")
        for i, (place, momentum) in enumerate(zip((x, y, angle), momenta, strict=True)):
            state[place], rate[place] = motion.body_poses[k, i], motion.body_velocities[k, i]
            state[momentum] = weights[i] * motion.body_velocities[k, i]
            rate[momentum] = weights[i] * motion.body_accelerations[k, i]
    wanted = module.STATES
    return np.array([state[name] for name in wanted]), np.array([rate[name] for name in wanted])


@pytest.mark.every(4)
@pytest.mark.parametrize("form", ["momentum", "redundant"])
@pytest.mark.parametrize(
    "scene",
    ["two_body", "two_body_forced", "double_pendulum", random_tree(3), random_tree(9)],
    ids=lambda scene: getattr(scene, "name", scene),
)
def test_momentum_forms(scene: str | Scene, form: str) -> None:
    """The handout's states (1), reduced and redundant, of one motion: same rates, same outputs."""
    plain, c = compiled(scene), compiled(scene, form)
    tree, rng = plain.scene.tree, np.random.default_rng(23)
    starts = [(plain.module.initial_state(), dict.fromkeys(tree.inputs, 0.0))]
    starts += [(plain.random_state(rng), plain.random_inputs(rng)) for _ in range(100)]
    for i, (y, u) in enumerate(starts):
        state, rate = in_momentum_form(tree, c.module, plain.motion(y, u))
        if i == 0:
            assert difference(c.module.initial_state(), state) <= TOLERANCE
        # The equations of a momentum are a mass times an acceleration: compare within each kind.
        got = c.module.derivative(0.0, state, u=u)
        positions = np.isin(np.arange(len(state)), c.module.POSITIONS)
        assert difference(got[positions], rate[positions]) <= TOLERANCE
        assert difference(got[~positions], rate[~positions]) <= TOLERANCE
        for name in (
            "kinetic_energy",
            "potential_energy",
            "momentum",
            "joint_forces",
            "body_poses",
        ):
            ours = getattr(c.module, name)(0.0, state, u=u)
            assert difference(ours, getattr(plain.module, name)(0.0, y, u=u)) <= TOLERANCE


def test_handouts_states_are_eight_and_twelve() -> None:
    """(1): Y = [x_A, P_A, θ, L_A, x_B, P_B, θ+φ, L_B], and without x_B, P_B the eight of §3."""
    twelve = "x_A y_A P_A_x P_A_y theta L_A x_B y_B P_B_x P_B_y angle_B L_B"
    eight = "x_A y_A P_A_x P_A_y theta L_A angle_B L_B"
    for form, expected in (("redundant", twelve), ("momentum", eight)):
        assert list(compiled("two_body", form).module.STATES) == expected.split()


def test_momentum_forms_need_inertias() -> None:
    """A point mass has no angular momentum to be a state, and the message says what to do."""
    message = (
        "form: 'momentum' needs an angular momentum of body 'bob', whose inertia_com is 0; "
        "use form = 'velocity' or give it an inertia"
    )
    with pytest.raises(SceneError, match=f"^{re.escape(message)}$"):
        compiled("pendulum", "momentum")


# Parameters.


def test_other_parameter_values(built_in: Compiled) -> None:
    """Values given through `p`, by name and in order, are the ones the equations use."""
    parameters, module = built_in.scene.tree.parameters, built_in.module
    rng = np.random.default_rng(24)
    assert dict(module.PARAMETERS) == dict(parameters)
    for _ in range(40):
        y, u = built_in.random_state(rng), built_in.random_inputs(rng) or None
        p = {name: v * float(rng.uniform(0.5, 2.0)) for name, v in parameters.items()}
        assert_agrees(built_in, y, u, p)
        ordered = [p[name] for name in module.PARAMETERS]
        assert np.array_equal(
            module.derivative(0.0, y, ordered, u), module.derivative(0.0, y, p, u)
        )
        one = str(rng.choice(list(p)))
        assert_agrees(built_in, y, u, {one: p[one]})
    assert_agrees(built_in, y, u)  # and none of them has stuck


def test_initial_momenta_follow_the_parameters() -> None:
    """The scene gives velocities at the start; the momenta are the user's own masses times them."""
    plain, c = compiled("two_body"), compiled("two_body", "redundant")
    p = {**plain.scene.tree.parameters, "m_A": 1.7, "I_B": 0.3, "l_A": 0.9}
    y = plain.module.initial_state(p)
    assert np.array_equal(y, plain.module.initial_state())
    state, _ = in_momentum_form(plain.scene.numbers(p), c.module, plain.motion(y, p=p))
    assert difference(c.module.initial_state(p), state) <= TOLERANCE


Y = np.zeros(8)
NAMES = "m_A, I_A, m_B, I_B, l_A, l_B, d_A, d_B, g"
INPUTS = "f_A_x, f_A_y, f_B_x, f_B_y, tau"
STATES = "x_A, y_A, theta, phi, x_A_dot, y_A_dot, theta_dot, phi_dot"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, Y, {"m_C": 1.0}), f"unknown parameter 'm_C'; known: {NAMES}"),
        ((0.0, Y, [1.0] * 8), f"parameters have shape (8,), not (9,): {NAMES}"),
        ((0.0, Y, np.ones((9, 1))), f"parameters have shape (9, 1), not (9,): {NAMES}"),
        ((0.0, Y, {"g": np.nan}), "parameter 'g' is nan, not a finite number"),
        ((0.0, Y, {"l_A": -np.inf}), "parameter 'l_A' is -inf, not a finite number"),
        ((0.0, Y, {"m_B": 0.0}), "mass of B is not positive: change the parameters"),
        ((0.0, Y, {"m_A": -1.0}), "mass of A is not positive: change the parameters"),
        ((0.0, Y, {"I_A": 0.0}), "inertia_com of A is not positive: change the parameters"),
        ((0.0, Y, None, {"tau_": 1.0}), f"unknown input 'tau_'; known: {INPUTS}"),
        ((0.0, Y, None, [1.0]), f"inputs have shape (1,), not (5,): {INPUTS}"),
        ((0.0, Y, None, {"tau": np.inf}), "input 'tau' is inf, not a finite number"),
        (
            (0.0, np.zeros((8, 3)), None, np.zeros((5, 2))),
            f"inputs have shape (5, 2), not (5,) or (5, 3): {INPUTS}",
        ),
        ((0.0, np.zeros(7)), f"y has shape (7,), not (8,) or (8, k): {STATES}"),
        ((0.0, np.zeros((7, 2))), f"y has shape (7, 2), not (8,) or (8, k): {STATES}"),
        ((0.0, np.zeros((8, 2, 2))), f"y has shape (8, 2, 2), not (8,) or (8, k): {STATES}"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("function", ["derivative", "jacobian", "joint_forces"])
def test_errors(function: str, arguments: tuple, message: str) -> None:
    """What a user gives wrongly is reported by name, shape and value, by every function alike."""
    module = compiled("two_body_forced").module
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        getattr(module, function)(*arguments)


def test_errors_of_dynamics() -> None:
    """Forces and accelerations of the wrong length are reported too."""
    module = compiled("two_body").module
    with pytest.raises(ValueError, match=r"^tau has shape \(3,\), not \(4,\)$"):
        module.forward_dynamics(Y[:4], Y[4:], [0.0] * 3)
    with pytest.raises(ValueError, match=r"^vd has shape \(5,\), not \(4,\)$"):
        module.inverse_dynamics(Y[:4], Y[4:], [0.0] * 5)


def test_inertia_that_is_zero_by_its_parameter() -> None:
    """No scene that is accepted makes a module that refuses its own values."""
    text = """
    name = "bob"
    parameters = { I = 0.0 }
    bodies = [{ name = "A", mass = 2.0, inertia_com = "I" }]
    joints = [{ name = "a", type = "revolute", parent = "world", child = "A", r_child = [-0.5, 0] }]
    effects = [{ type = "gravity", g = 9.81 }]
    """
    module = load(text_of(parse_scene(text)))
    assert module.derivative(0.0, np.zeros(2))[1] == pytest.approx(-9.81 / 0.5, rel=1e-14)
    heavy = module.derivative(0.0, np.zeros(2), {"I": 0.5})[1]
    assert heavy == pytest.approx(-2.0 * 0.5 * 9.81 / (0.5 + 2.0 * 0.5**2), rel=1e-14)


def test_inertia_that_may_vanish() -> None:
    """A body held away from its centre of mass may be given no inertia of its own, but no less."""
    c, rng = compiled("two_body"), np.random.default_rng(26)
    for _ in range(TRIES):
        assert_agrees(c, c.random_state(rng), p={"I_B": 0.0})
    with pytest.raises(ValueError, match=r"^inertia_com of B is negative: change the parameters$"):
        c.module.derivative(0.0, Y, {"I_B": -0.1})
    with pytest.raises(ValueError, match=r"^the mass matrix is singular: change the parameters$"):
        c.module.derivative(0.0, Y, {"I_B": 0.0, "l_B": 0.0})


# The text of a module.


def test_straight_line_arithmetic(built_in: Compiled) -> None:
    """Nothing is solved, factored or inverted at run time, and only `math` and NumPy are needed.

    Every kernel is assignments of + - * / and sin, cos, tan, sqrt; elsewhere only functions that
    check and arrange arguments are called.
    """
    tree = ast.parse(built_in.source)
    imported = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(node.module)
    assert imported == {"math", "numpy", "functools"}
    of_numpy = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "np"
    }
    assert of_numpy <= {
        "abs", "array", "asarray", "concatenate", "dtype", "empty", "errstate", "flatnonzero",
        "float64", "frombuffer", "fromiter", "isfinite", "ma", "maximum", "ndarray", "ndim",
        "zeros", "sin", "cos", "tan", "sqrt",
    }  # fmt: skip
    assert not {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} & {
        "eval", "exec", "open", "compile", "getattr", "globals", "__import__",
    }  # fmt: skip
    functions = {f.name: f for f in tree.body if isinstance(f, ast.FunctionDef)}
    kernels = [functions[f"_{name}"] for name in built_in.system.program.outputs]
    assert {"_derivative", "_jacobian"} <= {kernel.name for kernel in kernels}
    for kernel in kernels:
        *lines, last = kernel.body[1:]  # after the docstring
        assert all(isinstance(line, ast.Assign) for line in lines)
        assert isinstance(last, ast.Return)
        for line in kernel.body[1:]:
            for node in ast.walk(line):
                assert isinstance(node, ALLOWED), ast.dump(node)
                if isinstance(node, ast.Call):
                    assert node.func.id in ("sin", "cos", "tan", "sqrt")


ALLOWED = (
    ast.Assign, ast.Return, ast.Tuple, ast.Name, ast.Load, ast.Store, ast.Constant, ast.Call,
    ast.BinOp, ast.UnaryOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub,
)  # fmt: skip


def test_no_place_and_no_date(built_in: Compiled) -> None:
    """The text has no path and no date in it."""
    assert "/home" not in built_in.source
    assert str(Path(__file__).parent.parent.parent) not in built_in.source
    assert not re.search(r"\b20\d\d-\d\d", built_in.source)
