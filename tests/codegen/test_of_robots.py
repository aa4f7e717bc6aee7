"""Outputs for robotics: beside Pinocchio for a robot file; beside one another for other scenes."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from robot_files import joint, link, written

import eomgen
from eomgen.api.given import check
from eomgen.codegen import jacobians
from eomgen.codegen.jacobians import matrices
from eomgen.codegen.recording import Recording
from eomgen.program.program import Output, finish, interpret
from eomgen.program.tape import TIME
from eomgen.scalars.floats import FloatScalars
from eomgen.tables.outputs import DYNAMICS, OUTPUTS

UNUSUAL = tuple(n for n, spec in OUTPUTS.items() if spec.builder.startswith("of_robots:"))
BESIDE = (
    *("forward_dynamics", "mass_matrix", "velocity_force", "bias_force", "momentum"),
    *("centre_of_mass", "point_velocities", "point_jacobians"),
)
TREE = """
name = "tree"
dimensions = {0}
[parameters]
m = 1.3
[[bodies]]
name = "cart"
mass = 2.0
inertia_com = {1}
[[bodies]]
name = "arm"
mass = "m"
inertia_com = {1}
[[bodies]]
name = "ball"
mass = 0.7
inertia_com = {1}
[[joints]]
name = "base"
type = "free"
parent = "world"
child = "cart"
[[joints]]
name = "shoulder"
type = "revolute"
parent = "cart"
child = "arm"
r_parent = {2}
r_child = {3}
{4}
[[joints]]
name = "elbow"
type = "{5}"
parent = "arm"
child = "ball"
r_parent = {2}
r_child = {3}
[[points]]
name = "tip"
body = "ball"
at = {2}
[[effects]]
type = "gravity"
name = "weight"
g = 9.81
[[effects]]
type = "spring"
name = "spring"
body_1 = "world"
at_1 = {3}
body_2 = "ball"
at_2 = {2}
stiffness = 7.0
damping = 0.4
rest_length = 0.1
"""
CHAIN = """
name = "chain"
dimensions = 3
[[chains]]
name = "link"
count = 8
mass = 1.0
inertia_com = [0.1, 0.2, 0.3]
r_parent = [0.1, 0.2, 0.3]
r_child = [-0.1, -0.2, -0.3]
axis = [1.0, 2.0, 3.0]
"""
PLANAR = (2, "0.3", "[0.2, 0.1]", "[-0.3, 0.2]", "", "revolute")
IN_SPACE = (
    3,
    "[0.3, 0.4, 0.5, 0.02, 0.01, -0.03]",
    "[0.2, 0.1, 0.3]",
    "[-0.3, 0.2, 0.1]",
    "axis = [1.0, 2.0, -0.5]",
    "ball",
)


@pytest.mark.parametrize("floating", [False, True])
def test_outputs_are_those_of_pinocchio(tmp_path: Path, floating: bool) -> None:
    """In all frames, of a branched robot with a gripper that mimics, rotated origins, full
    inertias.
    """
    pytest.importorskip("pinocchio")
    from robotics_peers import COMPARED, differences

    mimic = '<mimic joint="grip" multiplier="0.8" offset="0.05"/>'
    chain = ("base", "arm", "elbow", "wrist", "palm", "hand", "tool")
    path = written(
        tmp_path,
        *(link(name) for name in (*chain, "finger", "tail", "thumb")),
        *(
            joint(f"j_{b}", "revolute", a, b, axis)
            for a, b, axis in zip(
                chain,
                chain[1:],
                ("0 1 0", "1 2 0", "0.6 0 -0.8", "1 0 0", "0 0 1", "0 1 0"),
                strict=False,
            )
        ),
        joint("wag", "continuous", "base", "tail", "1 2 3"),
        joint("grip", "prismatic", "tool", "finger", "1 0 0"),
        joint("thumb-grip", "prismatic", "tool", "thumb", "-1 0 0", mimic),
    )
    _, found = differences(path, floating, 2, np.random.default_rng(1))
    assert {*found} == {*COMPARED}
    assert max(found.values()) < 1e-12, found


@pytest.fixture(scope="module", params=[PLANAR, IN_SPACE], ids=["plane", "space"])
def tree(request: Any) -> tuple[Any, np.ndarray]:
    """A free tree with a spring: its module with all outputs, and a state."""
    text = TREE.format(*request.param)
    module = eomgen.load(eomgen.generate(text, outputs=[*UNUSUAL, *BESIDE]))
    y = module.initial_state() + np.random.default_rng(3).normal(size=len(module.STATES))
    for indices in module.QUATERNIONS:
        y[list(indices)] /= np.linalg.norm(y[list(indices)])
    return module, y


def parts(module: Any, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q and v."""
    nq = len(module.POSITIONS)
    return y[:nq], y[nq:]


def test_rates_are_those_of_motion(tree: tuple[Any, np.ndarray]) -> None:
    """J v and J v̇ + J̇ v, and those of the centre of mass, along the motion."""
    module, y = tree
    (_, v), rate, h = parts(module, y), module.derivative(0.0, y), 1e-5
    vd = parts(module, rate)[1]

    def along(name: str) -> np.ndarray:
        ahead, behind = (getattr(module, name)(0.0, y + s * rate) for s in (h, -h))
        return (ahead - behind) / (2 * h)

    linear = module.point_jacobians(0.0, y)[0]
    for end in ("", "_local", "_world"):
        J = getattr(module, f"frame_jacobians{end}")(0.0, y)[0]
        bias = getattr(module, f"frame_bias_accelerations{end}")(0.0, y)[0]
        assert_allclose(along(f"frame_jacobians{end}")[0] @ v, bias, atol=1e-7)
        mobility = J @ np.linalg.solve(module.mass_matrix(0.0, y), J.T)
        if not end:
            assert np.array_equal(J[: len(linear)], linear)
            assert_allclose(along("point_velocities")[0], (J @ vd + bias)[: len(linear)], atol=1e-7)
            assert_allclose(module.operational_mobilities(0.0, y)[0], mobility, rtol=1e-10)
            assert_allclose(
                module.operational_inertias(0.0, y)[0] @ mobility, np.eye(len(J)), atol=1e-9
            )
    n = module.DIMENSIONS
    assert_allclose(along("centre_of_mass"), module.centre_of_mass_jacobian(0.0, y) @ v, atol=1e-8)
    momentum = module.momentum(0.0, y)
    A, c, p = module.centroidal_momentum_matrix(0.0, y), module.centre_of_mass(0.0, y), momentum[:n]
    about = np.cross(np.resize([*c, 0.0], 3), np.resize([*p, 0.0], 3))
    assert_allclose(A @ v, [*p, *(momentum[n:] - about[n - 3 :][-len(momentum[n:]) :])], atol=1e-12)


def test_forces_are_linear_in_inertias_and_velocities(tree: tuple[Any, np.ndarray]) -> None:
    """C v = V, Ṁ - 2 C skew on velocities; Y π with π of the scene."""
    module, y = tree
    (q, v), rate, h = parts(module, y), module.derivative(0.0, y), 1e-5
    C = module.coriolis_matrix(0.0, y)
    assert_allclose(C @ v, module.velocity_force(0.0, y), atol=1e-12)
    ahead, behind = (module.mass_matrix(0.0, y + s * rate) for s in (h, -h))
    assert_allclose((ahead - behind) / (2 * h), C + C.T, atol=1e-7)
    vd = np.linspace(-1.0, 1.0, len(v))
    Y = module.regressor(q, v, vd)
    masses, arm = (2.0, 1.3, 0.7), np.array([-0.3, 0.2, 0.1][: module.DIMENSIONS])
    found = np.zeros(len(v))
    for body, (m, r) in enumerate(zip(masses, (0 * arm, arm, arm), strict=True)):
        h1 = -m * r  # the centre of mass from the joint's point
        if module.DIMENSIONS == 2:
            pi = [m, *h1, 0.3 + m * r @ r]
        else:
            J = np.array([[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.5]])
            J = J + m * (r @ r * np.eye(3) - np.outer(r, r))
            pi = [m, *h1, *np.diag(J), J[0, 1], J[0, 2], J[1, 2]]
        found += Y[:, body] @ pi
    M, V = module.mass_matrix(0.0, y), module.bias_force(0.0, y)
    assert_allclose(found, M @ vd + V, atol=1e-12)


def test_derivatives_are_those_of_the_module(tree: tuple[Any, np.ndarray]) -> None:
    """Those of forward dynamics are in `jacobian`; those of inverse dynamics follow from them."""
    module, y = tree
    q, v = parts(module, y)
    nv, M = len(v), module.mass_matrix(0.0, y)
    by_q, by_v = module.forward_dynamics_derivatives(q, v, None)
    assert_allclose(module.inverse_mass_matrix(0.0, y) @ M, np.eye(nv), atol=1e-11)
    J = module.jacobian(0.0, y)[len(q) :]
    assert_allclose(by_v, J[:, len(q) :], atol=1e-10)
    moves = np.column_stack(
        [module.derivative(0.0, np.concatenate((q, row)))[: len(q)] for row in np.eye(nv)]
    )
    assert_allclose(by_q, J[:, : len(q)] @ moves, atol=1e-10)
    vd = module.forward_dynamics(q, v)
    found = module.inverse_dynamics_derivatives(q, v, vd)
    assert_allclose(-np.linalg.solve(M, found), [by_q, by_v], atol=1e-10)


def test_compiled_outputs_are_the_same() -> None:
    """Those that take numbers beside the state, too."""
    scene = TREE.format(*PLANAR)
    made = eomgen.generate(scene, outputs=UNUSUAL)
    module, compiled = (
        eomgen.load(made),
        eomgen.load(eomgen.generate(scene, outputs=UNUSUAL, backend="c")),
    )
    y = module.initial_state() + 0.1
    q, v = parts(module, y)
    for name in UNUSUAL:
        given = (q, v, v + 0.2) if name in DYNAMICS else (0.0, y)
        assert np.array_equal(getattr(module, name)(*given), getattr(compiled, name)(*given)), name


def test_points_that_cannot_move_in_all_ways_are_refused() -> None:
    """As many velocities as rows, at least."""
    with pytest.raises(eomgen.SceneError, match="take 'operational_mobilities'"):
        eomgen.generate("cart_pole", outputs=["operational_inertias"])


def test_all_stands_for_usual_outputs() -> None:
    """Modules stay as they are."""
    module = eomgen.load(eomgen.generate("cart_pole", outputs="all"))
    assert not [name for name in UNUSUAL if hasattr(module, name)]


def test_names_in_the_docs_exist() -> None:
    """Each of the second column of the table of names."""
    text = (Path(__file__).parents[2] / "docs" / "howto" / "robotics.md").read_text("utf-8")
    rows = [line.split("|")[2] for line in text.splitlines() if line.startswith("| ")]
    names = {name for cell in rows for name in re.findall(r"`(\w+)`", cell)}
    assert names >= {*UNUSUAL}
    assert not [n for n in names if n not in (*OUTPUTS, "jacobian") and not hasattr(eomgen, n)]


@pytest.mark.parametrize("space", [PLANAR, IN_SPACE], ids=["plane", "space"])
def test_a_jacobian_by_the_recursion_is_the_same(
    space: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by inverse dynamics and the factors of M, with quaternions and effects; not along
    directions.
    """
    model = check(TREE.format(*space))
    by_factors = matrices(Recording(model, "aba"), with_jacobian=True)
    monkeypatch.setattr(jacobians, "_is_small", lambda record, name: False)
    by_recursion = matrices(Recording(model, "aba"), with_jacobian=True)
    assert not by_recursion.tangents
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    values = np.random.default_rng(2).normal(size=len(names))
    given = {**model.defaults, TIME: 0.0, **dict(zip(names, values, strict=True))}
    found = []
    for made in (by_factors, by_recursion):
        shape, nodes = made.nodes["jacobian"]
        output = Output(shape, tuple(node.index for node in nodes))
        program = finish(nodes[0].tape, {"jacobian": output}, ())
        found.append(interpret(program, "jacobian", given, FloatScalars()))
    assert_allclose(*found, atol=1e-11)


def test_the_recursion_of_fewer_operations_is_taken() -> None:
    """Articulated bodies for a chain in space, whatever is cheaper for a tree in the plane."""
    for text in (CHAIN, TREE.format(*PLANAR)):
        record = Recording(replace(check(text), outputs=()), "aba")
        ways = (jacobians._by_articulated_bodies, jacobians._by_factors)
        costs = [jacobians._operations(record, *way(record, record.vd)) for way in ways]
        still = [record.tape.constant(0.0)] * len(record.v)
        taken = jacobians.forward_derivatives(record, still)
        assert jacobians._operations(record, *taken) == min(costs)
        assert text != CHAIN or costs[0] < 0.9 * costs[1]
