"""The closed form of any small tree: what SymPy derives is what the recursions compute."""

import ast
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from campaign import FULL, some
from engine import MP, text_of
from spatial_trees import PLANE, SPACE, random_spatial_tree, random_state

import eomgen.derivation.projected
from eomgen.base.errors import SceneError
from eomgen.codegen.from_closed_form import from_closed_form, of_projected
from eomgen.codegen.from_recursion import from_recursion
from eomgen.codegen.recording import Recording
from eomgen.codegen.system import System
from eomgen.derivation.projected.derive import ProjectedEquations, derive_projected
from eomgen.derivation.projected.steps import projected_steps
from eomgen.derivation.projected.tree import Tree
from eomgen.derivation.rewriting import gathered, sum_of_squares
from eomgen.derivation.rotations import hat, rate
from eomgen.derivation.supported import MOST_GENERAL_BODIES, why_not_closed, why_not_tried
from eomgen.derivation.symbols import OF_SCENE, of_scene
from eomgen.dynamics.start.singularity import check_nonsingular
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program
from eomgen.program.extended import evaluator
from eomgen.run.module import load_module
from eomgen.scene.joints import Free
from eomgen.scene.reader import parse_scene, read_scene

REPORTED = ("cart_pole", "furuta_pendulum", "spinning_top", "babyboot", "tumbling_body")
DYNAMICS = (
    "forward_dynamics", "inverse_dynamics", "mass_matrix", "velocity_force", "gravity_force",
    "applied_force",
)  # fmt: skip
EXACT, ROUNDED = 1e-52, 1e-13
"""Relative errors: of exact rotations in 60 digits, and of those that doubles only come near to."""


def values(model: Model, rng: np.random.Generator) -> dict[str, Any]:
    """A random state, random inputs and forces, at the scene's parameters."""
    found = {p.name: MP.mpf(p.default) for p in model.parameters}
    for c in (*model.coordinates, *model.velocities, *model.inputs):
        found[c.name] = MP.mpf(float(rng.uniform(-2.0, 2.0)))
    for indices in model.quaternions:
        names = [model.coordinates[i].name for i in indices]
        length = MP.sqrt(sum(found[name] ** 2 for name in names))
        found |= {name: found[name] / length for name in names}
    for c in model.velocities:
        for prefix in ("tau", "vd"):
            found[f"{prefix}__{c.name}"] = MP.mpf(float(rng.uniform(-2.0, 2.0)))
    return found


def apart(one: System, other: System, output: str, given: dict[str, Any]) -> float:
    """Largest difference of an output over its largest entry."""
    a, b = (evaluator(s.program, output)(given) for s in (one, other))
    assert len(a) == len(b)
    size = max(map(abs, b), default=1) or 1
    return float(max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0) / size)


def squared(model: Model) -> Model:
    """The same tree with axes and orientations along coordinate axes: its rotations are exact.

    In the plane the recursions add angles, and no double is π/2: there nothing is turned at rest.
    """
    plane = model.dimensions == PLANE
    bodies = []
    for body in model.bodies:
        joint, changes = body.joint, {}
        if not isinstance(joint, Free):
            turned = joint.orientation_deg
            angles = turned if isinstance(turned, tuple) else (turned,)
            quarters = tuple(0.0 if plane else 90.0 * round(x / 90.0) for x in angles)
            changes["orientation_deg"] = quarters if isinstance(turned, tuple) else quarters[0]
            if getattr(joint, "axis", None) is not None:
                changes["axis"] = along(np.abs(joint.axis) if plane else joint.axis)
            if getattr(joint, "axes", None) is not None:
                first = along(joint.axes[0])
                rest = [0.0 if a else b for a, b in zip(first, joint.axes[1], strict=True)]
                changes["axes"] = (first, along(rest))
            joint = joint.replaced(**changes)
        bodies.append(replace(body, joint=joint))
    return replace(model, bodies=tuple(bodies))


def along(axis: Sequence[float] | np.ndarray) -> tuple[float, ...]:
    """The coordinate axis, or its opposite, that is nearest."""
    k = int(np.argmax(np.abs(axis)))
    return tuple(float(np.copysign(i == k, axis[k])) if i == k else 0.0 for i in range(len(axis)))


@cache
def tree(seed: int, dimensions: int, most: int) -> Model:
    """A random tree that asks for all of the dynamics."""
    model = elaborate(parse_scene(random_spatial_tree(seed, dimensions, most)[1]))
    return replace(model, route="auto", outputs=DYNAMICS)


def agree(model: Model, seed: int, error: float) -> None:
    """Closed form and articulated bodies: every output of the dynamics."""
    closed = from_closed_form(of_projected(derive_projected(model)), model)
    aba = from_recursion(Recording(model, "aba"))
    given = values(model, np.random.default_rng(seed))
    for output in ("derivative", *DYNAMICS):
        assert apart(closed, aba, output, given) < error, output


# All but trees with inertias like -I/5, whose quotients the tape must round to doubles.
SMALL = [(seed, dims, 3) for seed in range(some(5, 8)) for dims in (PLANE, SPACE)]
if not FULL:  # the one that takes longest
    SMALL.remove((4, SPACE, 3))
FEW = [(2, SPACE, 3), (9, PLANE, 3)]
FEW += some([], [(1, SPACE, 3), (0, SPACE, 3), (3, SPACE, 3), (22, PLANE, 3), (6, PLANE, 5)])
FIVE = [(2, SPACE, 5), (6, PLANE, 5), (11, SPACE, 5)]


def is_regular(model: Model) -> bool:
    """Moved onto one axis, a massless body may have nothing left to resist it."""
    try:
        check_nonsingular(model)
    except SceneError:
        return False
    return True


SQUARED = [case for case in (*SMALL, *FIVE) if is_regular(squared(tree(*case)))]
assert len(SQUARED) >= some(10, 16)


@pytest.mark.every(6)
@pytest.mark.parametrize(("seed", "dimensions", "most"), SQUARED)
def test_closed_is_aba_in_60_digits(seed: int, dimensions: int, most: int) -> None:
    """Every joint type, rotations that are exact: to all digits but a few."""
    agree(squared(tree(seed, dimensions, most)), seed, EXACT)


@pytest.mark.every(2)
@pytest.mark.parametrize(("seed", "dimensions", "most"), FEW)
def test_closed_is_aba_about_any_axis(seed: int, dimensions: int, most: int) -> None:
    """Axes and orientations that no double is exactly: to what they are rounded to."""
    agree(tree(seed, dimensions, most), seed, ROUNDED)


@cache
def scene(name: str) -> ProjectedEquations:
    """A built-in scene's equations."""
    return derive_projected(replace(elaborate(read_scene(name)), route="auto"))


@pytest.mark.parametrize("name", REPORTED)
def test_built_in_scenes(name: str) -> None:
    """They too, exactly; and their Jacobian."""
    equations = scene(name)
    closed = from_closed_form(of_projected(equations), equations.model)
    aba = from_recursion(Recording(equations.model, "aba"))
    given = values(equations.model, np.random.default_rng(1))
    for output in ("derivative", "jacobian", *DYNAMICS):
        assert apart(closed, aba, output, given) < EXACT, output


# What is published.


def accelerations(equations: ProjectedEquations) -> list[sp.Expr]:
    """v̇ with all definitions put in, without forces beside the effects."""
    s, definitions = equations.symbols, equations.solution.definitions
    found = []
    for a in s.a:
        e = definitions[a]
        while not e.free_symbols.isdisjoint(definitions):
            e = e.xreplace(definitions)
        found.append(e.xreplace(dict.fromkeys(s.tau, sp.Integer(0))))
    return found


def named(equations: ProjectedEquations, names: str) -> list[sp.Expr]:
    """Symbols by name."""
    s = equations.symbols
    known = {**s.parameters, **s.inputs, **{x.name: x for x in (*s.q, *s.v)}}
    return [known[name] for name in names.split()]


def test_cart_pole_as_published() -> None:
    """R. Tedrake, Underactuated Robotics, chapter 3: a particle on a massless rod."""
    equations = scene("cart_pole")
    mc, mp, inertia, length, g, f, theta, rate_ = named(
        equations, "m_cart m_pole I_pole l g push theta theta_dot"
    )
    sin, cos = sp.sin(theta), sp.cos(theta)
    terms = equations.balance
    assert terms.M.subs(inertia, 0) == sp.Matrix(
        [[mc + mp, mp * length * cos], [mp * length * cos, mp * length**2]]
    )
    assert sp.Matrix([-mp * length * sin * rate_**2, 0]) == terms.V
    assert sp.Matrix([0, mp * g * length * sin]) == terms.G
    assert sp.Matrix([f, 0]) == terms.F
    below = mc + mp * sin**2
    published = [
        (f + mp * sin * (length * rate_**2 + g * cos)) / below,
        (-f * cos - mp * length * rate_**2 * cos * sin - (mc + mp) * g * sin) / (length * below),
    ]
    for found, expected in zip(accelerations(equations), published, strict=True):
        assert sp.simplify(found.subs(inertia, 0) - expected) == 0


def test_furuta_pendulum_as_published() -> None:
    """B. S. Cazzolato and Z. Prime, On the Dynamics of the Furuta Pendulum, J. Control Sci. Eng.
    (2011), (33), (34): slender links, without friction; here with the motor's rotor.
    """
    equations = scene("furuta_pendulum")
    m1, l1, m2, l2, rotor, gear, g, tau, phi, w1, w2 = named(
        equations, "m_arm l_arm m_pendulum l_pendulum J_rotor gear g tau phi theta_dot phi_dot"
    )
    sin, cos = sp.sin(phi), sp.cos(phi)
    arm = m1 * l1**2 / 3 + rotor * gear**2  # Ĵ₁
    pendulum = m2 * l2**2 / 3  # Ĵ₂
    root = arm + m2 * l1**2  # Ĵ₀
    half = l2 / 2
    M = sp.Matrix(
        [[root + pendulum * sin**2, m2 * l1 * half * cos], [m2 * l1 * half * cos, pendulum]]
    )
    V = sp.Matrix(
        [
            w1 * w2 * sp.sin(2 * phi) * pendulum - m2 * l1 * half * sin * w2**2,
            -(w1**2) * sp.sin(2 * phi) * pendulum / 2,
        ]
    )
    G = sp.Matrix([0, g * m2 * half * sin])
    F = sp.Matrix([tau, 0])
    terms = equations.balance
    for found, expected in ((terms.M, M), (terms.V, V), (terms.G, G), (terms.F, F)):
        assert (found - expected).applyfunc(sp.simplify).is_zero_matrix
    residual = M * sp.Matrix(accelerations(equations)) + V + G - F
    s, c = sp.symbols("s c")
    for row in residual:
        top = sp.fraction(sp.together(sp.expand_trig(row).xreplace({sin: s, cos: c})))[0]
        assert sp.reduced(sp.expand(top), [c**2 + s**2 - 1], c)[1] == 0


def test_tumbling_body_is_eulers() -> None:
    """I₁ ω̇₁ = (I₂ - I₃) ω₂ ω₃ and so on, and no force on its centre."""
    equations = scene("tumbling_body")
    i1, i2, i3, x, y, z = named(equations, "I_1 I_2 I_3 nut_wx nut_wy nut_wz")
    euler = [(i2 - i3) * y * z / i1, (i3 - i1) * z * x / i2, (i1 - i2) * x * y / i3]
    for found, expected in zip(accelerations(equations), [0, 0, 0, *euler], strict=True):
        assert sp.simplify(found - expected) == 0


# What the solution divides by.


def is_positive(expression: sp.Expr, given: dict[sp.Expr, sp.Expr], masses: set[str]) -> bool:
    """Built of masses, moments and even powers by sums, products and quotients alone."""
    e = given.get(expression, expression)
    if e.is_Number:
        return bool(e > 0)
    if e.is_Symbol:
        return e.name.removesuffix(OF_SCENE) in masses
    if e.is_Add or e.is_Mul:
        return all(is_positive(part, given, masses) for part in e.args)
    if e.is_Pow and e.exp.is_Integer:
        return e.exp % 2 == 0 or is_positive(e.base, given, masses)
    return False


@pytest.mark.parametrize("case", [*REPORTED, *SMALL[:12:2], *SMALL[11:16:2]], ids=str)
@pytest.mark.every(2)
def test_pivots_are_sums_of_weighted_squares(case: str | tuple[int, int, int]) -> None:
    """No pivot is a difference; weights of rotation are those of LᵀDL of a body's inertia."""
    equations = scene(case) if isinstance(case, str) else derive_projected(tree(*case))
    model, definitions = equations.model, dict(equations.solution.definitions)
    masses = {p.name for p in model.parameters if "mass" in p.name or "inertia" in p.name}
    masses |= {symbol.name for symbol in definitions if symbol.name.startswith("weight__")}
    masses |= {"m", "I"} | {"m_cart", "m_pole", "m_arm", "m_pendulum", "m_A", "m_B", "J_rotor"}
    masses |= {"I_pole", "I_1", "I_2", "I_3", "I_A", "I_Bx", "I_By", "I_Bz"}
    definitions = {s: e for s, e in definitions.items() if not s.name.startswith("weight__")}
    assert equations.solution.pivots or not model.velocities
    for pivot in equations.solution.pivots:
        assert is_positive(pivot, definitions, masses), (pivot, definitions.get(pivot))


# Parts.


@pytest.mark.parametrize("seed", range(6))
def test_rotations_turn_as_they_are_said_to(seed: int) -> None:
    """[ω]x = Qᵀ Q', with Q' by the coordinates' own rates, for every joint of a random tree."""
    model = tree(seed, SPACE, 3)
    stated = Tree.of(model, 20, 160)
    symbols, ledger = stated.symbols, stated.ledger
    rng = np.random.default_rng(seed)
    numbers = {s: float(rng.uniform(-1, 1)) for s in (*symbols.q, *symbols.v)}
    for four in model.quaternions:
        length = np.sqrt(sum(numbers[symbols.q[i]] ** 2 for i in four))
        for i in four:
            numbers[symbols.q[i]] /= length
    numbers |= {symbol: float(x) for x, symbol in symbols.numbers.items()}
    coordinates = {*symbols.q, *symbols.numbers.values()}
    for c in stated.constraints:
        written = c.rotation
        while not written.free_symbols <= coordinates:
            written = written.xreplace(ledger.definitions)
        rates = {s: r for s, r in ledger.rates.items() if s in coordinates}
        moved = (written.T * rate(written, rates)).xreplace(numbers)
        turning = hat(c.relative_omega).xreplace(numbers)
        np.testing.assert_allclose(np.array(moved, float), np.array(turning, float), atol=1e-14)


def test_gathering() -> None:
    """Pythagoras, constants that cancel, and pivots that are positive at sight."""
    x, y, arm = sp.symbols("x y arm", real=True)
    m, i = sp.symbols("m i", positive=True)
    fixed = {arm, m, i}
    assert gathered(m * sp.cos(x) ** 2 + m * sp.sin(x) ** 2, fixed) == m
    assert gathered(arm * y - arm * y * sp.sin(x) ** 2, fixed) == arm * y * sp.cos(x) ** 2
    d = sp.Symbol("d", positive=True)
    sums = {d: i + m * arm**2}
    assert gathered(y - m * arm**2 * y / d, fixed, sums) == i * y / d
    total = i * sp.cos(x) ** 2 + m * sp.cos(x) ** 2 + m * sp.sin(x) ** 2
    assert sum_of_squares(total, fixed, {}, 100) == m + i * sp.cos(x) ** 2


def test_independent_of_the_recursions() -> None:
    """Nothing of the derivation comes from the routes that it is to prove."""
    for path in sorted(Path(eomgen.derivation.projected.__file__).parent.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert "dynamics" not in str(node.module), path
                assert not str(node.module).startswith("eomgen.program"), path


def test_joints_are_read_in_one_place() -> None:
    """No derivation but the linkage asks for the primitives of a joint; symbols are named there."""
    package = Path(eomgen.derivation.projected.__file__).parents[1]
    readers = {
        path.name
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Attribute) and node.attr == "primitives"
    }
    assert readers == {"linkage.py", "symbols.py"}


# Routes, modules, and the derivation shown.


def test_route_closed_and_auto() -> None:
    """`closed` takes any small tree; `auto` tries it on few velocities and takes what is least."""
    for name in REPORTED:
        choice = compile_program(elaborate(read_scene(name)))
        assert choice.system.route == "closed", name
    puma = elaborate(read_scene("puma560"))
    assert why_not_closed(puma) == "" and "velocities" not in why_not_tried(puma)
    assert compile_program(puma).system.route == "ldl"
    figure = elaborate(read_scene("quadruped"))
    assert why_not_closed(figure).startswith(f"it is for {MOST_GENERAL_BODIES} bodies at most")
    floating = tree(1, SPACE, 4)
    many = replace(floating, bodies=(*floating.bodies, replace(floating.bodies[0], name="more")))
    assert len(floating.velocities) == 15 and why_not_closed(floating) == ""
    assert why_not_closed(many).startswith("it is for 15 velocities at most")
    with pytest.raises(SceneError, match="needs the closed form"):
        compile_program(replace(figure, route="closed"))
    with pytest.raises(SceneError, match="form: 'momentum' needs the closed form"):
        compile_program(replace(elaborate(read_scene("cart_pole")), form="momentum"))


def test_a_module_observes_what_the_recursions_do() -> None:
    """Energies, places, joint forces and Jacobians of a generated module, in doubles."""
    drawn, text = random_spatial_tree(1, SPACE, 3)
    model = replace(elaborate(parse_scene(text.replace("outputs =", "# outputs ="))))
    closed, aba = (load_module(text_of(replace(model, route=r))) for r in ("closed", "aba"))
    rng = np.random.default_rng(3)
    q, v = random_state(drawn, rng)
    y = np.empty(len(closed.STATES))
    y[drawn.places(closed.STATES)] = [*q, *v]
    u = drawn.random_inputs(rng)
    for output in ("derivative", "jacobian", *model.outputs):
        if output in ("forward_dynamics", "inverse_dynamics"):
            continue
        a, b = (getattr(module, output)(0.0, y, None, u) for module in (closed, aba))
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-10, err_msg=output)
    doubled = y.copy()
    for four in closed.QUATERNIONS:
        doubled[list(four)] *= 2.0
    names = [s for s in closed.STATES if s.endswith(("_dot", "_wx", "_wy", "_wz"))]
    rows = [closed.STATES.index(name) for name in names]
    np.testing.assert_allclose(
        closed.derivative(0.0, doubled, None, u)[rows],
        closed.derivative(0.0, y, None, u)[rows],
        rtol=1e-11,
        atol=1e-11,
    )


@pytest.mark.parametrize("name", REPORTED)
def test_every_symbol_is_reported(name: str) -> None:
    """What stands on the right of an equation is given, or stands on the left of one before."""
    equations = scene(name)
    s = equations.symbols
    known = {x.name for x in (*s.parameters.values(), *s.inputs.values(), *s.q)}
    steps = projected_steps(equations)
    assert steps[-1].title == "Closed form"
    for step in steps:
        for equation in step.equations:
            used = {x.name for x in equation.right.free_symbols}
            assert not any("__" in x for x in (*used, equation.left.name))
            if step.title == "State":
                known |= used
            assert used <= known, (step.title, equation.left, used - known)
            known.add(equation.left.name)


@pytest.mark.parametrize("name", REPORTED)
def test_what_is_reported_is_true(name: str) -> None:
    """In numbers every equation gives what the recursions do, to the digits that are shown: places
    of the bodies along the tree, and accelerations at the end.
    """
    equations = scene(name)
    model = equations.model
    given = values(model, np.random.default_rng(2))
    found = {x: float(given[name]) for name in given for x in (name, of_scene(name).name)}
    recording = from_recursion(Recording(replace(model, outputs=("body_poses",)), "aba"))
    rates, poses = (evaluator(recording.program, x)(given) for x in ("derivative", "body_poses"))
    state, *steps = projected_steps(equations)
    moving = (*model.coordinates, *model.velocities)
    numbers = [*(given[c.name] for c in moving), *rates[-len(model.velocities) :]]
    symbols = [x for line in state.equations for x in line.right]
    found |= {x.name: float(z) for x, z in zip(symbols, numbers, strict=True)}
    matrices: dict[str, Any] = {}
    checked = 0
    for step in steps:
        for line in step.equations:
            by = {x: found[x.name] for x in line.right.free_symbols}
            right, left = line.right.xreplace(by), line.left.name
            if isinstance(right, sp.MatrixBase):
                matrices[left] = np.array(right.evalf().tolist(), dtype=float)
                continue
            if left in found:
                assert float(right) == pytest.approx(found[left], rel=1e-4, abs=1e-4), left
                checked += 1
            found[left] = float(right)
    assert checked >= len(model.velocities)
    n = model.dimensions
    places, turns = [np.zeros(n)], [np.eye(n)]
    for k, body in enumerate(model.bodies):
        up = body.parent + 1
        place = matrices[f"r_{body.name}"].ravel()[:n]
        places.append(places[up] + turns[up] @ place)
        turns.append(turns[up] @ matrices.get(f"R_{body.name}", np.eye(n)))
        expected = np.array(poses, dtype=float).reshape(len(model.bodies), -1)[k]
        if n == SPACE:
            expected = expected.reshape(3, 4)
            np.testing.assert_allclose(turns[-1], expected[:, :3], atol=1e-5)
            expected = expected[:, 3]
        np.testing.assert_allclose(places[-1], expected[:n], rtol=1e-5, atol=1e-5)
