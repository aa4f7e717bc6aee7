"""All routes to a mechanism's motion agree: `closed`, `ldl`, `aba`, `orthogonal`, three outsiders.

The outsiders are the tests' own solver in maximal coordinates, MuJoCo and Pinocchio. Most trees
are run in plain floats, some as generated modules, some in 60 digits.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from itertools import product
from typing import Any

import judges
import numpy as np
import pytest
from campaign import some
from engine import Engine, along, apart, engine, exact
from mechanisms import compiled, random_tree
from spatial_newton_euler import SpatialMotion, solve
from spatial_trees import PLANE, SPACE, SpatialTree, random_spatial_tree, random_state

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.reactions import reactions
from eomgen.dynamics.regrouping import RegroupedDynamics
from eomgen.dynamics.tree import observables
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import generate
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.study.verification.routes import compiled as all_routes
from eomgen.tables.routes import ROUTES, RouteSpec

SEEDS = range(some(54, 150))
MOST = (6, 14, 30)
"""Bodies up to which every third tree has."""
SMALL = range(some(7, 14))
CLOSE = 1e-9
ROUNDING = 1e-11
"""What our own routes keep to; of 300 trees the worst is off by 2e-13."""


@cache
def drawn(seed: int, dimensions: int, most: int) -> tuple[SpatialTree, str]:
    """A random tree, and its scene."""
    return random_spatial_tree(seed, dimensions, most)


# In floats.


def in_floats(
    tree: SpatialTree, model: Model, q: np.ndarray, v: np.ndarray, u: Mapping[str, float], axes: Any
) -> Dynamics:
    """The recursions over floats; the model may have another order than the tree."""
    given = dict(zip((*tree.coordinates, *tree.velocities), (*q, *v), strict=True))
    positions = [given[c.name] for c in model.coordinates]
    velocities = [given[c.name] for c in model.velocities]
    values = Values(model.defaults, u, positions, velocities)
    return Dynamics(model, values, FloatScalars(), axes)


@pytest.mark.every(8)
@pytest.mark.parametrize(("dimensions", "seed"), [*product((PLANE, SPACE), SEEDS)])
def test_accelerations(dimensions: int, seed: int) -> None:
    """By both routes, in either kind of axes by turns, or in both, as three others have them."""
    tree, text = drawn(seed, dimensions, MOST[seed % 3])
    model = elaborate(parse_scene(text))
    rng = np.random.default_rng(seed)
    (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
    motion = solve(tree, q, v, u)
    place = [tree.velocities.index(c.name) for c in model.velocities]
    expected = motion.accelerations[place]
    for axes in some(("own", "world")[seed % 2 :][:1], ("own", "world")):
        dynamics = in_floats(tree, model, q, v, u, axes)
        found = dynamics.articulated_forward()
        assert apart(found, expected) < ROUNDING
        assert apart(dynamics.factored_forward(), expected) < ROUNDING
        if axes == "own":
            assert apart(dynamics.orthogonal_forward(), expected) < ROUNDING
        assert_observed(tree, model, dynamics, found, motion)
    joints = [body.joint.name for body in model.bodies if body.joint.type != "free"]
    wrenches = [(*f.force, *f.moment) for f in reactions(dynamics, expected)]
    forces = motion.joint_forces[tree.rows(joints)]
    assert apart(np.array(wrenches).reshape(-1, 6)[:, KEPT[dimensions]], forces) < ROUNDING
    for name, judge in (
        ("mujoco", judges.mujoco_accelerations),
        ("pinocchio", judges.pinocchio_accelerations),
    ):
        if find_spec(name) is not None:
            assert apart(judge(tree, q, v, u)[place], expected) < CLOSE


@pytest.mark.every(2)
@pytest.mark.parametrize(("dimensions", "seed"), [*product((PLANE, SPACE), SMALL)])
def test_regrouped_inertias(dimensions: int, seed: int) -> None:
    """They give the same mass matrix, bias and gravity forces; no body on a hinge has a mass."""
    tree, text = drawn(seed, dimensions, MOST[1])
    model = elaborate(parse_scene(text))
    rng = np.random.default_rng(seed)
    (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
    vd = rng.normal(size=len(model.velocities))
    for axes in ("own", "world"):
        plain = in_floats(tree, model, q, v, u, axes)
        fewer = RegroupedDynamics(model, plain.values, FloatScalars(), axes)
        for d in (fewer, plain):
            assert (d is plain) == (d.inertias is d.kinematics) == (d.weights is d.kinematics)
        found, expected = (
            [*d.mass_entries.values(), *d.inverse(vd), *d.bias(still=True), *d.factored_forward()]
            for d in (fewer, plain)
        )
        assert apart(found, expected) < ROUNDING
        for link in fewer.weights.links if axes == "own" else ():
            k, body, hinge = link.axes[0].unit, link.rigid, link.axes[0].angular
            assert hinge <= (body.mass == 0.0)
            if hinge and len(link.axes) == 1:
                across = [body.inertia[i][i] for i in range(3) if i != k]
                assert body.first_moment[k] == 0.0 == min(across) <= max(across)


KEPT = {PLANE: [0, 1, 5], SPACE: [0, 1, 2, 3, 4, 5]}
"""Components of a wrench or of momentum that the plane has, force first."""


def assert_observed(
    tree: SpatialTree, model: Model, d: Dynamics, accelerations: list[float], motion: SpatialMotion
) -> None:
    """Inverse dynamics, energies, momentum and places at the same state."""
    needed = np.array(d.inverse(accelerations)) - d.applied_force
    assert apart(needed, np.zeros(len(needed)), d.bias(), d.applied_force) < ROUNDING
    assert apart(d.kinetic_energy, motion.kinetic_energy) < ROUNDING
    assert apart(d.potential_energy, motion.potential_energy) < ROUNDING
    momentum = observables.momentum(d.kinematics, d.origins, d.twists, d.scalars)
    assert apart(np.concatenate(momentum)[KEPT[tree.dimensions]], motion.momentum) < ROUNDING
    poses = motion.body_poses[tree.rows([body.name for body in model.bodies])]
    expected = poses[:, :2] if tree.dimensions == PLANE else poses[:, :, 3]
    centres = np.array([d.centre(k) for k in range(len(poses))])
    assert apart(centres[:, : tree.dimensions], expected) < ROUNDING


def test_the_trees_have_everything() -> None:
    """Every joint type, and whatever else a recursion may stumble over, has occurred often."""
    seen: dict[str, int] = {}
    sizes = set()
    for dimensions, seed in product((PLANE, SPACE), SEEDS):
        tree, _ = drawn(seed, dimensions, MOST[seed % 3])
        sizes.add(len(tree.bodies))
        for feature in features(tree):
            name = f"{feature} of {dimensions}"
            seen[name] = seen.get(name, 0) + 1
    plane = "revolute prismatic planar weld free".split()
    space = [*plane, *"cylindrical universal ball".split()]
    for dimensions, kinds in ((PLANE, plane), (SPACE, space)):
        for feature in (*kinds, *FEATURES):
            assert seen.get(f"{feature} of {dimensions}", 0) >= some(5, 10), feature
    assert len(sizes) > 25
    assert max(sizes) == MOST[-1]
    for package in ("mujoco", "pinocchio"):
        if find_spec(package) is None:
            pytest.skip(f"{package} is not there to judge")


FEATURES = (
    "armature, oriented, particle, massless in the middle, weld to the world, weld that carries, "
    "several trees, branch, motor, push, no gravity, tilted axis"
).split(", ")


def features(tree: SpatialTree) -> Iterator[str]:
    """What there is in a tree, once each."""
    parents = [body.joint.parent for body in tree.bodies]
    found = {body.joint.kind for body in tree.bodies}
    for k, body in enumerate(tree.bodies):
        joint = body.joint
        welded = joint.kind == "weld"
        found |= {"armature"} if joint.armature else set()
        found |= {"oriented"} if any(joint.orientation_deg) else set()
        found |= {"particle"} if body.mass and not any(body.inertia) else set()
        found |= {"massless in the middle"} if not body.mass and k in parents else set()
        found |= {"weld to the world"} if welded and joint.parent < 0 else set()
        found |= {"weld that carries"} if welded and k in parents else set()
        found |= {"branch"} if parents.count(k) > 1 else set()
        found |= {"tilted axis"} if any(0 < abs(x) < 1 for x in joint.axes[0]) else set()
    found |= {"several trees"} if parents.count(-1) > 1 else set()
    found |= {"motor"} if tree.motor >= 0 else set()
    found |= {"push"} if tree.pushes else set()
    found |= {"no gravity"} if not tree.gravity else set()
    yield from sorted(found)


# As generated modules: small trees.

CASES = [
    (dimensions, seed, ("aba", "ldl")[(seed + dimensions) % 2])
    for dimensions, seed in product((PLANE, SPACE), SMALL)
]
by_module = pytest.mark.parametrize(("dimensions", "seed", "route"), CASES)


def made(dimensions: int, seed: int, route: str) -> tuple[SpatialTree, Engine]:
    """A small tree and its module, without the one output that `test_sensitivity` is about."""
    tree, text = drawn(seed, dimensions, 6)
    return tree, engine(text, route, leave_out=("parameter_jacobian",))


def as_module(tree: SpatialTree, module: Any, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A state, or rates of one, in the module's order."""
    y = np.empty(len(module.STATES))
    y[tree.places(module.STATES)] = np.concatenate((q, v))
    return y


def assert_as_solved(
    tree: SpatialTree, module: Any, y: np.ndarray, motion: SpatialMotion, *given: Any
) -> None:
    """All that the solver knows about a state, from the module."""
    expected: dict[str, Any] = {
        "derivative": as_module(tree, module, motion.rates, motion.accelerations),
        "body_poses": motion.body_poses[tree.rows(module.BODIES)],
        "body_velocities": motion.body_velocities[tree.rows(module.BODIES)],
        "joint_forces": motion.joint_forces[tree.rows(module.JOINTS)],
        "kinetic_energy": motion.kinetic_energy,
        "potential_energy": motion.potential_energy,
        "momentum": motion.momentum,
        "centre_of_mass": motion.centre_of_mass,
    }
    if tree.points:
        expected["point_positions"] = motion.point_positions
        expected["point_velocities"] = motion.point_velocities
    for name, value in expected.items():
        assert apart(getattr(module, name)(0.0, y, *given), value) < ROUNDING, name


@by_module
@pytest.mark.every(7)
def test_module_at_its_own_parameters(dimensions: int, seed: int, route: str) -> None:
    """Every output of a module against the solver; joint space against the accelerations."""
    tree, e = made(dimensions, seed, route)
    module, rng = e.module, np.random.default_rng([seed, dimensions])
    assert dimensions == module.DIMENSIONS
    assert (tuple(module.INPUTS), module.POINTS) == (tree.inputs, tuple(p[0] for p in tree.points))
    assert sorted(module.BODIES) == sorted(body.name for body in tree.bodies)
    assert sorted(module.JOINTS) == sorted(tree.joints)
    for _ in range(3):
        (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
        motion, y = solve(tree, q, v, u), as_module(tree, module, q, v)
        assert_as_solved(tree, module, y, motion, None, u)
        assert_as_solved(tree, module, y, motion, None, [u[name] for name in module.INPUTS])
        joint_space(module, y, u, rng)


def joint_space(
    module: Any, y: np.ndarray, u: Mapping[str, float], rng: np.random.Generator
) -> None:
    """M, V, G, h and F belong to forward and inverse dynamics."""
    nv = len(module.mass_matrix(0.0, y))
    q, v = y[: len(y) - nv], y[len(y) - nv :]
    M, V, G, h, F = (
        getattr(module, name)(0.0, y, u=u)
        for name in ("mass_matrix", *("velocity_force gravity_force bias_force".split()), FORCE)
    )
    vd = module.derivative(0.0, y, u=u)[len(q) :]
    tau = rng.uniform(-5.0, 5.0, nv)
    size = 1 + np.abs(M) @ np.abs(vd) + np.abs(h) + np.abs(F)
    assert apart(M @ vd + h, F, size) < ROUNDING
    assert apart(V + G, h, size) < ROUNDING
    assert apart(module.forward_dynamics(q, v, u=u), vd) < ROUNDING
    pushed = module.forward_dynamics(q, v, tau, u=u)
    size = size + np.abs(M) @ np.abs(pushed)
    assert apart(M @ pushed + h, F + tau, size) < ROUNDING
    assert apart(module.inverse_dynamics(q, v, pushed, u=u), tau, size) < ROUNDING
    assert apart(module.inverse_dynamics(q, v, 0 * v, u=u), h - F, size) < ROUNDING
    if module.POINTS:
        J = module.point_jacobians(0.0, y)
        assert apart(J @ v, module.point_velocities(0.0, y)) < ROUNDING


FORCE = "applied_force"


@by_module
@pytest.mark.every(4)
def test_module_at_other_parameters(dimensions: int, seed: int, route: str) -> None:
    """Parameters by name and in order: as the solver has a tree of other numbers."""
    tree, e = made(dimensions, seed, route)
    rng = np.random.default_rng([seed, dimensions, 1])
    assert dict(e.module.PARAMETERS) == {
        name: tree.parameters[name] for name in e.module.PARAMETERS
    }
    assert len(e.module.PARAMETERS) == len(tree.parameters)
    # The entries of an inertia grow alike: then it stays one.
    stems = {name: re.sub("_[xyz][xyz]$", "", name) for name in tree.parameters}
    factors = {stem: rng.uniform(0.8, 1.25) for stem in dict.fromkeys(stems.values())}
    p = {name: value * factors[stems[name]] for name, value in tree.parameters.items()}
    other, _ = random_spatial_tree(seed, dimensions, 6, given=p)
    (q, v), u = random_state(tree, rng), tree.random_inputs(rng)
    y = as_module(tree, e.module, q, v)
    motion = solve(other, q, v, u)
    pairs = zip(tree.bodies, other.bodies, strict=True)
    assert all(a.mass != b.mass for a, b in pairs if a.mass)
    assert_as_solved(other, e.module, y, motion, p, u)
    assert_as_solved(other, e.module, y, motion, [p[name] for name in e.module.PARAMETERS], u)
    chosen = list(factors)[::2]
    few = {name: value for name, value in p.items() if stems[name] in chosen}
    motion = solve(random_spatial_tree(seed, dimensions, 6, given=few)[0], q, v, u)
    assert_as_solved(other, e.module, y, motion, few, u)


@pytest.mark.every(4)
@by_module
def test_columns_are_one_by_one(dimensions: int, seed: int, route: str) -> None:
    """Many states at once, inputs for each or for all: what each state gives alone."""
    tree, e = made(dimensions, seed, route)
    module, rng = e.module, np.random.default_rng([seed, dimensions, 2])
    states = [as_module(tree, module, *random_state(tree, rng)) for _ in range(4)]
    columns = np.array(states).T
    inputs = rng.uniform(-5.0, 5.0, (len(module.INPUTS), 4))
    nv = len(module.mass_matrix(0.0, states[0]))
    q, v = columns[:-nv], columns[-nv:]
    for name in e.system.program.outputs:
        if name == "initial_state":
            continue
        function = getattr(module, name)
        for u in (inputs, inputs[:, 0], dict(zip(module.INPUTS, inputs[:, 0], strict=True))):
            each = u.T if np.ndim(u) == 2 else [u] * 4
            if name in ("forward_dynamics", "inverse_dynamics"):
                extra = rng.uniform(-5.0, 5.0, (nv, 4))
                together = function(q, v, extra, u=u)
                alone = [function(q[:, i], v[:, i], extra[:, i], u=each[i]) for i in range(4)]
            else:
                together = function(0.0, columns, u=u)
                alone = [function(0.0, y, u=w) for y, w in zip(states, each, strict=True)]
            assert apart(together, np.stack(alone, axis=-1)) < 1e-12, name


# In 60 digits.

FEW = range(20, some(23, 25))
CLOSED = [(seed, 4) for seed in some((3, 7), (3, 5, 6, 7, 9, 16, 22))]
CLOSED += some([], [(4, 5), (8, 5)])
OUTPUTS = (
    "derivative mass_matrix velocity_force gravity_force bias_force applied_force kinetic_energy "
    "potential_energy momentum centre_of_mass joint_forces body_poses body_velocities "
    "forward_dynamics inverse_dynamics"
).split()


def assert_equal_programs(a: Engine, b: Engine, seed: int, digits: int) -> None:
    """Every output of two routes, at two states."""
    rng = np.random.default_rng(seed)
    assert a.module.STATES == b.module.STATES
    for _ in range(2):
        y, u = a.random_state(rng), a.random_inputs(rng)
        extra = list(rng.uniform(-5.0, 5.0, len(a.model.velocities)))
        for output in OUTPUTS:
            more = {"extra": extra} if output.endswith("_dynamics") else {}
            found, other = (e.exactly(output, y, u, **more) for e in (a, b))
            assert apart(found, other) < 10.0**-digits, output


@pytest.mark.every(3)
@pytest.mark.parametrize(("seed", "most"), CLOSED)
def test_closed_is_aba(seed: int, most: int) -> None:
    """SymPy's own solution and the recursion, to 50 digits, on planar trees of up to 5 bodies."""
    scene = random_tree(seed, most)
    left = ("input_jacobian", "parameter_jacobian")
    aba, ldl = (engine(scene.text, route, leave_out=left) for route in ("aba", "ldl"))
    closed = engine(scene.text, "closed", leave_out=left) if most == 5 else compiled(scene)
    assert [e.system.route for e in (closed, aba, ldl)] == ["closed", "aba", "ldl"]
    assert_equal_programs(closed, aba, seed, 50)
    assert_equal_programs(ldl, aba, seed, 50)


@pytest.mark.parametrize("dimensions", (PLANE, SPACE))
@pytest.mark.parametrize("seed", FEW)
@pytest.mark.every(6)
def test_ldl_is_aba(dimensions: int, seed: int) -> None:
    """Over all joint types: to 50 digits but for rotations that the scene gives in degrees.

    These are doubles that turn lengths by a part in 1e16; a route may divide by them or not.
    """
    tree, text = drawn(seed, dimensions, 5)
    left = ("input_jacobian", "parameter_jacobian")
    ldl, aba = (engine(text, route, leave_out=left) for route in ("ldl", "aba"))
    turned = [b.joint for b in tree.bodies if np.any(np.array(b.joint.orientation_deg) % 90)]
    tilted = [b.joint for b in tree.bodies for a in b.joint.axes if any(0 < abs(x) < 1 for x in a)]
    assert_equal_programs(ldl, aba, seed, 14 if turned or tilted else 50)


def test_accelerations_are_those_of_the_velocities() -> None:
    """What a module calls v̇ is how the velocities of its bodies change, in 60 digits."""
    tree, e = made(SPACE, 3, "aba")
    rng = np.random.default_rng(3)
    y = as_module(tree, e.module, *random_state(tree, rng))
    u = tree.random_inputs(rng)
    rates = e.exactly("derivative", y, u)
    flow = along(lambda z: e.exactly("body_velocities", z, u), exact(y), rates)
    places = tree.places(e.module.STATES)
    motion = solve(tree, *np.split(y[places], [len(tree.coordinates)]), u)
    assert apart(flow.astype(float), motion.body_accelerations[tree.rows(e.module.BODIES)]) < 1e-11


def test_a_route_is_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """A route of another name, by a recursion that is there, is an entry in the table."""
    monkeypatch.setitem(ROUTES, "twin", RouteSpec("as aba", "articulated"))
    model = elaborate(read_scene("bouncing_two_body"))
    texts = [
        re.sub(r"\b(aba|twin)\b", "", generate(replace(model, route=route)).module)
        for route in ("aba", "twin")
    ]
    assert texts[0] == texts[1]
    made, missing = all_routes(replace(model, route="twin"), "twin")
    assert {"aba", "ldl", "orthogonal"} <= {*made} and "twin" not in missing
    assert "twin" in all_routes(model, "aba")[0]
