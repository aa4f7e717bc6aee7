"""Derivations read to their end: Ẏ by nothing but the printed equations is that of the module."""

import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from campaign import FULL, some
from equation_numbers import number
from followed import LookedUp, instant

import eomgen
from eomgen.api.derivation import Derivation
from eomgen.derivation.dots import dotted
from eomgen.derivation.identity import identical
from eomgen.derivation.symbols import names_of_scene
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.assur import with_closed_form
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.tables.details import METHODS, NAMES, All, Method

ATWOOD = """
name = "atwood"
dimensions = 2
parameters = { m_1 = 2.0, m_2 = 1.5, m_3 = 0.8, R = 0.1, g = 9.81 }
bodies = [
    { name = "left", mass = "m_1", inertia_com = 0 },
    { name = "right", mass = "m_2", inertia_com = 0 },
    { name = "pulley", mass = "m_3", inertia_com = "m_3*R**2/2" },
]
joints = [
    { name = "rope_1", type = "prismatic", parent = "world", child = "left", axis = [0, 1], coordinate = "y" },
    { name = "rope_2", type = "prismatic", parent = "world", child = "right", axis = [0, 1], coordinate = "h" },
    { name = "axle", type = "revolute", parent = "world", child = "pulley", coordinate = "theta" },
]
constraints = [
    { type = "coupling", name = "rope", coordinate = "h", equals = "-y" },
    { type = "coupling", name = "grip", coordinate = "theta", equals = "y/R" },
]
effects = [{ type = "gravity", g = "g" }]
"""  # noqa: E501
SHAKEN = """
name = "shaken"
dimensions = 2
parameters = { m = 1.3, l = 0.4, A = 0.05, nu = 9.0, g = 9.81 }
bodies = [
    { name = "slide", mass = 0.5, inertia_com = 0 },
    { name = "bent", mass = "m", inertia_com = 0.02 },
    { name = "arm", mass = "m", inertia_com = 0.01 },
    { name = "tip", mass = "m", inertia_com = 0.03 },
]
joints = [
    { name = "shaker", type = "prismatic", parent = "world", child = "slide", axis = [0, 1], coordinate = "y" },
    { name = "pin", type = "revolute", parent = "slide", child = "arm", r_child = [0, "l"], coordinate = "theta" },
    { name = "bend", type = "revolute", parent = "arm", child = "bent", r_child = [0, "l"], coordinate = "beta" },
    { name = "end", type = "revolute", parent = "bent", child = "tip", r_child = [0, "l"], coordinate = "phi" },
]
effects = [
    { type = "gravity", g = "g" },
    { type = "driven", name = "shake", joint = "shaker", coordinate = "A*cos(nu*t)" },
    { type = "joint_spring", name = "spring", joint = "end", stiffness = 3.0, damping = 0.1 },
]
locked = { beta = 0.3 }
"""  # noqa: E501
SCENES_AT = Path(eomgen.__file__).parent / "scenes"
NAMED = ("rattleback", "four_bar", "peaucellier", "bicycle", "cart_pole", "puma560", "spinning_top")
LOOPS = ("four_bar", "slider_crank", "differential", "peaucellier", "rattleback", "bicycle",
         "car_suspension", "stewart_platform")  # fmt: skip
SCENES = some(
    (ATWOOD, SHAKEN, *LOOPS, "two_body_forced", "furuta_pendulum"),
    (ATWOOD, SHAKEN, *built_in_names()),
)
BY_METHOD = some(
    (SHAKEN, "two_body_forced", "spinning_top", "four_bar"), (ATWOOD, SHAKEN, *built_in_names())
)


@cache
def model_of(scene: str) -> Model:
    """The model of a built-in scene or of a text, as its derivation takes it."""
    found = parse_scene(scene) if "\n" in scene else read_scene(scene)
    return with_closed_form(assembled(elaborate(found)))


@pytest.fixture
def deep() -> Iterator[None]:
    """What is looked up needs what is looked up in turn. Other tests expect Python's own limit."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(20_000)
    yield
    sys.setrecursionlimit(limit)


@pytest.mark.every(3)
@pytest.mark.usefixtures("deep")
@pytest.mark.parametrize("scene", SCENES)
def test_the_last_step_by_the_printed_equations(scene: str) -> None:
    """Each entry of Ẏ looked up, and what it needs looked up in turn; Y is the module's state."""
    _follow(scene, eomgen.derive(scene))


@pytest.mark.every(2)
@pytest.mark.usefixtures("deep")
@pytest.mark.parametrize("method", (*METHODS, "all"))
@pytest.mark.parametrize("scene", BY_METHOD)
def test_the_same_by_each_method(scene: str, method: Method | All) -> None:
    """Energies, partial velocities, free bodies, and all of them side by side give the derivative
    of the module.
    """
    _follow(scene, eomgen.derive(scene, method=method))


@pytest.mark.parametrize("scene", some(("cart_pole",), ("cart_pole", "four_bar", "chain")))
def test_methods_side_by_side(scene: str) -> None:
    """The same numbers in all columns, which end in the same equations; what all share stands once,
    in three formats.
    """
    found = eomgen.derive(scene, method="all")
    places = [[s.number.partition(".")[0].strip("()") for s in found.steps if s.way == way]
              for way in METHODS]  # fmt: skip
    assert all(set(x) == set(places[0]) and x == sorted(x, key=int) for x in places)
    shared = [(s.title, s.equations) for s in found.steps if s.way is None]
    assert len(shared) == len({title for title, _ in shared})
    titles = [title for title, _ in shared]
    assert titles.index("What agrees") < titles.index("What differs") < len(titles) - 1
    text, paper, page = found.text(), found.latex(), found.html()
    for name in (*NAMES.values(), "All methods"):
        assert text.count(f"\n{name}\n{'-' * len(name)}\n") == 1
        assert paper.count(rf"\section*{{{name}}}") == 1
    assert page.count('<div class="ways"') == 1 and page.count("<h3") == sum(map(len, places))
    ends = [s for s in found.steps if s.way and s.title == "Velocity forces"]
    assert all(s.equations == ends[0].equations for s in ends)


def test_identities_in_exact_arithmetic() -> None:
    """What follows from sin² + cos² = 1 is the same, near misses are not."""
    a, b, x, r = sp.symbols("a b x r")
    sin, cos = sp.sin, sp.cos
    same = [
        (sin(a) ** 2 + cos(a) ** 2, sp.S.One),
        (sin(a + 2 * b), sin(a) * (1 - 2 * sin(b) ** 2) + 2 * cos(a) * sin(b) * cos(b)),
        ((x**2 - 1) / (x - 1), x + 1),
        (sp.sqrt(x**2 * r), x * sp.sqrt(r)),
    ]
    assert identical(same) and identical([(r, sin(x))], [(r, sin(x))])
    for left, right in same:
        assert not identical([(left, right + sp.Rational(1, 10**6) * x)])
        assert not identical([(left, -right)])


LETTERS = (
    "M V G F K J Q q v h_0 a_0 A beta kappa T Y M_r J_d v_i u lambda_end I_crank psi_bar U S X p"
)
"""Names of the derivation itself."""


def with_names(scene: str, names: Sequence[str]) -> str:
    """A scene with parameters of these names, on which the masses of its bodies depend."""
    text = scene if "\n" in scene else (SCENES_AT / f"{scene}.toml").read_text()
    more = "".join(f" + 0.001*{name}" for name in names)
    text = re.sub(r'mass = "?([^",\n]+)"?', rf'mass = "\1{more}"', text)
    given = [f"{name} = {1 + i / 16}" for i, name in enumerate(names)]
    if "parameters = {" in text:
        return text.replace("parameters = {", f"parameters = {{ {', '.join(given)},", 1)
    return text.replace("[parameters]", "\n".join(["[parameters]", *given]), 1)


@pytest.mark.usefixtures("deep")
@pytest.mark.parametrize("scene", some((ATWOOD,), (ATWOOD, SHAKEN, *NAMED)))
def test_parameters_with_the_names_of_the_derivation(scene: str) -> None:
    """What has a name of the scene is of the scene, and nothing else has it."""
    names = {*some(LETTERS.split()[:9], LETTERS.split())}
    if FULL:
        found = eomgen.derive(scene).steps
        lines = [e for step in found for line in step.equations for e in (line.left, line.right)]
        names |= {s.name for e in lines for s in e.free_symbols if s.name.isidentifier()}
    model = model_of(scene)
    own = (c.name for body in model.bodies for c in (*body.positions, *body.velocities))
    taken = {*names_of_scene(model), *own}
    ordered = sorted(names - taken - {"t"})
    for chosen in (ordered[k : k + 12] for k in range(0, len(ordered), 12)):
        text = with_names(scene, chosen)
        found = eomgen.derive(text)
        _follow(text, found)
        kept = {x.name for x in found.model.parameters}
        lines = (line for step in found.steps for line in step.equations)
        assert not {getattr(line.left, "name", "") for line in lines} & kept


def _follow(scene: str, found: Derivation) -> None:
    """The last step at random states, beside the module."""
    model = model_of(scene)
    module = eomgen.load(eomgen.generate(scene))
    for seed in range(2):
        at = instant(model, seed, 0.02, closed=bool(model.constraints))
        start = {name: x for name, x in at.known.items() if not _follows(model, name)}
        known = LookedUp(model, found.steps, start)
        own, rates = (list(line.right) for line in found.steps[-1].equations[:2])
        assert len(own) == len(module.STATES)
        y = np.array([at.known[name] for name in module.STATES])
        inputs = {i.name: at.known[i.name] for i in model.inputs}
        want = module.derivative(0.4, y, None, inputs) if inputs else module.derivative(0.4, y)
        ours = np.array([float(np.ravel(known[rate.name])[0]) for rate in rates])
        order = [[s.name for s in own].index(_read(model, name)) for name in module.STATES]
        size = max(1.0, float(np.abs(want).max()))
        assert float(np.abs(ours[order] - want).max()) < 1e-6 * size


def _follows(model: Model, name: str) -> bool:
    """Whether a coordinate or velocity follows from others."""
    every = {c.name for c in (*model.coordinates, *model.velocities)}
    return name in every - {*model.states}


def _read(model: Model, name: str) -> str:
    from eomgen.derivation.reading import reading_names

    return reading_names(model).get(name, name)


def test_atwood_as_in_textbooks() -> None:
    """ÿ = (m₂ - m₁) g / (m₁ + m₂ + m₃/2), and no multiplier in M, V, G, F and the solution."""
    found = eomgen.derive(ATWOOD)
    (rate,) = found.solution.values()
    m_1, m_2, m_3, g = (found.symbols[x] for x in ("m_1", "m_2", "m_3", "g"))
    assert sp.simplify(rate - (m_2 - m_1) * g / (m_1 + m_2 + m_3 / 2)) == 0
    assert found.M.shape == (1, 1)
    text = found.text()
    assert "g⋅(m_2 − m_1)" in text.split(") Solved")[1]


@pytest.mark.parametrize("scene", some(("four_bar",), ("four_bar", "slider_crank", "differential")))
def test_no_multiplier_is_left_in_a_solution(scene: str) -> None:
    """M, V, G, F and the accelerations are free of λ; λ stands in the step on forces only."""
    found = eomgen.derive(scene)
    parts: list[Any] = [found.M, found.V, found.G, found.F, *found.matrices.definitions]
    names = {s.name for e in parts for s in sp.sympify(e).free_symbols}
    assert not any(name.startswith("lambda_") for name in names)
    before = [step for step in found.steps if "forces of the constraints" not in step.title]
    solved = next(step for step in before if step.title == "Solved")
    used = {s.name for line in solved.equations for s in line.right.free_symbols}
    assert not any(name.startswith("lambda") for name in used), used
    assert any(dotted("x", 2).partition("x")[2] in line.left.name for line in solved.equations)


def test_a_top_in_euler_angles_as_in_textbooks() -> None:
    """Goldstein, Classical Mechanics, section 5.7: energies, momenta, effective potential, and
    steady precession, symbol by symbol; said where the angles are singular.
    """
    found = eomgen.derive("spinning_top", method="lagrange")
    steps = [s for s in found.steps if s.title.startswith("In Euler angles")]
    lines = {str(e.left): _plain(e.right) for s in steps for e in s.equations}
    A, C, m, g, h, theta, T, U = sp.symbols("A I_3 m g h theta T U")
    phi_dot, theta_dot, psi_dot = (sp.Symbol(dotted(x)) for x in ("phi", "theta", "psi"))
    p_phi, p_psi = sp.symbols("p_phi p_psi")
    sin, cos = sp.sin(theta), sp.cos(theta)
    assert lines["A"] == sp.Symbol("I_1") + m * h**2
    spin = psi_dot + phi_dot * cos
    assert lines["T"] == A * (theta_dot**2 + phi_dot**2 * sin**2) / 2 + C * spin**2 / 2
    assert lines["U"] == m * g * h * cos and lines["E"] == T + U
    assert lines["p_psi"] == C * spin and lines["p_phi"] == A * phi_dot * sin**2 + p_psi * cos
    assert lines[dotted("p_psi")] == lines[dotted("p_phi")] == 0
    gyroscopic = A * phi_dot**2 * sin * cos - p_psi * phi_dot * sin + m * g * h * sin
    assert lines[dotted("p_theta")] == gyroscopic
    barrier = (p_phi - p_psi * cos) ** 2 / (2 * A * sin**2)
    assert lines["U_e"] == barrier + p_psi**2 / (2 * C) + m * g * h * cos
    steady = _plain(steps[-1].equations[-1].left)
    assert steady == A * phi_dot**2 * cos - p_psi * phi_dot + m * g * h
    assert "singular" in steps[0].words and "gyroscopic" in steps[1].words


def _plain(e: Any) -> Any:
    return e.xreplace({s: sp.Symbol(s.name) for s in e.free_symbols})


@pytest.mark.parametrize("scene", ["spinning_top", "tumbling_body"])
def test_euler_angles_beside_the_quaternion(scene: str) -> None:
    """ω̇ by the equations in Euler angles is that of the module, at random angles and rates, and the
    momenta that are said to be constant are.
    """
    found = eomgen.derive(scene, method="lagrange")
    lines = [e for s in found.steps if s.title.startswith("In Euler angles") for e in s.equations]
    module = eomgen.load(eomgen.generate(scene))
    names = ("phi", "theta", "psi")
    for seed in range(3):
        rng = np.random.default_rng(seed)
        at = dict(zip(names, rng.uniform(0.3, 2.0, 3), strict=True)) | found.model.defaults
        at |= dict(zip(map(dotted, names), rng.uniform(-2.0, 2.0, 3), strict=True))
        for line in lines:  # the quaternion and ω by the angles, and the momenta in their order
            if line.left.is_Symbol and line.left.name not in at:
                at[line.left.name] = number(line.right, at)
        y = np.array([at.get(_read(found.model, name), 0.3) for name in module.STATES])
        rate = dict(zip(module.STATES, module.derivative(0.0, y), strict=True))
        turned = [_read(found.model, c.name) for c in found.model.velocities[-3:]]
        spin = [rate[c.name] for c in found.model.velocities[-3:]]
        step = 1e-6
        moved = dict(at)
        for name in names:
            moved[name] = at[name] + step * at[dotted(name)]
        ahead = dict(zip(turned, [at[x] + step * w for x, w in zip(turned, spin, strict=True)],
                         strict=True))  # fmt: skip
        moved |= ahead
        known = {**found.model.defaults, **{x: moved[x] for x in (*names, *turned)}}
        known["A"] = at.get("A", 0.0)
        for name in ("theta", "phi", "psi"):
            known[dotted(name)] = number(_first_of(lines, dotted(name)), known)
        for name in ("psi", "phi", "theta"):
            known[f"p_{name}"] = number(_first_of(lines, f"p_{name}"), known)
            slope = (known[f"p_{name}"] - at[f"p_{name}"]) / step
            assert abs(slope - at[dotted(f"p_{name}")]) < 1e-4 * max(1.0, abs(slope))


def _first_of(lines: list[Any], name: str) -> Any:
    return next(e.right for e in lines if str(e.left) == name)
