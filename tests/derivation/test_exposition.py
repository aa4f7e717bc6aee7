"""Derivations as they are shown: every scene, its effects, recursions, impacts, state forms."""

import re
import unicodedata
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy as sp
from campaign import some
from driven_trees import given
from effect_cases import CASES, TRIED, Case
from equation_numbers import array, define, number
from followed import follow_effects, follow_recursion, instant

import eomgen
from eomgen.api.derivation import Derivation
from eomgen.commands.main import main
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import derived_effects
from eomgen.derivation.exposition import exposition_of
from eomgen.derivation.impacts import impact_steps
from eomgen.derivation.prescribed import prescribed_motion
from eomgen.derivation.reading import at_detail
from eomgen.derivation.simplified import simplified
from eomgen.derivation.symbols import real
from eomgen.dynamics import impulses
from eomgen.dynamics.dynamics import Dynamics
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.reader import BUILT_IN, built_in_names, parse_scene, read_scene
from eomgen.show.body_diagrams import body_diagrams
from eomgen.show.derivation import as_html, as_latex, as_text
from eomgen.show.drawing import Label, Line
from eomgen.show.plain import printer
from eomgen.show.prose import blocks, pieces
from eomgen.show.sketches import mechanism_sketch
from eomgen.show.terms import explained
from eomgen.tables.details import DETAILS

ROUNDING = 1e-9
SHOWN = some(("two_body_forced", "bouncing_two_body", "furuta_pendulum", "walker_motors"),
             built_in_names())  # fmt: skip


def model_of(scene: str) -> Model:
    """The model of a built-in scene or of a scene's text."""
    text = "\n" in scene
    return elaborate(parse_scene(scene) if text else read_scene(scene))


@cache
def derived(scene: str) -> Derivation:
    """The derivation of a built-in scene."""
    return eomgen.derive(scene, detail="all")


def assert_close(ours: Any, theirs: Any, within: float = ROUNDING) -> None:
    """Vectors, relative to the largest entry."""
    ours, theirs = np.ravel(ours), np.ravel(theirs)
    assert ours.shape == theirs.shape
    size = max(1.0, float(np.max(np.abs(theirs), initial=0.0)))
    assert float(np.max(np.abs(ours - theirs), initial=0.0)) < within * size


@pytest.mark.every(6)
@pytest.mark.parametrize("scene", built_in_names())
def test_the_algorithm_followed_by_hand(scene: str) -> None:
    """Every equation in its order, from parameters to v̇ and F: what the numeric solver has."""
    model = model_of(scene)
    at = instant(model)
    rates, forces = follow_recursion(model, at.known)
    assert_close(rates, at.solver.articulated_forward(), 1e-7)  # light bodies on heavy ones
    assert_close(forces, at.solver.applied_force)


@pytest.mark.parametrize("case", TRIED[:: some(3, 1)], ids=lambda case: case.name)
def test_each_effect_by_its_formulas(case: Case) -> None:
    """Every type and key: forces and the rates of its states, by the formulas that are shown."""
    model = model_of(case.text())
    at = instant(model)
    rates, forces = follow_recursion(model, at.known)
    assert_close(forces, at.solver.applied_force)
    assert_close(rates, at.solver.articulated_forward())
    sampled = [e.states(model.dimensions) for e in model.effects if e.sampling()]
    held = {x.name for states in sampled for x in states}  # their rates are 0, and not written
    states = [0.0 if x.name in held else at.known[dotted(x.name)] for x in model.extra]
    assert_close(states, at.solver.state_rates)


SAMPLED = """
name = "sampled"
inputs = ["wish"]
bodies = [{ name = "cart", mass = 1.0, inertia_com = 0 }]
joints = [{ name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] }]
[[effects]]
type = "sampled_controller"
name = "hold"
period = 0.02
sensors.eye = { value = "rail_slide", noise = 0.01, quantum = 1e-3 }
states.before = { next = "eye" }
inputs.wish = "-3*eye - before"
torques.rail = "-2*eye"
"""


def test_what_samples_set() -> None:
    """Formulas of a sample use its readings, which are rounded."""
    (step,) = (s for s in eomgen.derive(SAMPLED).steps if "Effect `hold`" in s.title)
    assert [f"{e.left} = {e.right}" for e in step.equations[1:]] == [
        "eye^+ = hold_eye_quantum*round((hold_eye_noise*n_eye + s_rail)/hold_eye_quantum)",
        "before^+ = eye^+",
        "wish^+ = -before - 3*eye^+",
        "hold^+_rail = -2*eye^+",
    ]


HELD = """
name = "held"
bodies = [
    { name = "rod", mass = 2.0, inertia_com = 0.3 },
    { name = "tip", mass = 0.5, inertia_com = 0.1 },
]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "rod", r_child = [0.4, 0], \
coordinate = "q_1" },
    { name = "rail", type = "prismatic", parent = "rod", child = "tip", axis = [0.6, 0.8] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "spring", name = "rope", body_1 = "world", at_1 = [1, 0.2], body_2 = "tip", \
stiffness = 3.0, rest_length = 0.1 },
    { type = "joint_friction", name = "oil", joint = "pin", viscous = 0.7 },
]
"""


def test_generalised_forces_of_each_effect() -> None:
    """A row of `effect_forces` is F - G as derived of the scene with that effect alone."""
    scene = parse_scene(HELD)
    module: Any = eomgen.load(eomgen.generate(scene, outputs=["effect_forces"]))
    y = np.array([0.7, 0.3, -0.9, 0.4])
    for effect, row in zip(scene.effects, module.effect_forces(0.0, y), strict=True):
        derived = eomgen.derive(scene.replaced(effects=(effect,)))
        known = {**dict(zip(module.STATES, y.tolist(), strict=True)), **module.PARAMETERS}
        forces = derived.written_out(derived.F - derived.G)
        forces = forces.subs({symbol: known[symbol.name] for symbol in forces.free_symbols})
        assert_close(row, np.array(forces.evalf(), dtype=float), 1e-12)


STEERED = """
name = "steered"
dimensions = {n}
inputs = ["thrust", "wind"]
parameters = {{ k = 3.0, lean = 0.4 }}
definitions = {{ gust = "wind if q_1 > thrust else max(t, 0.2)" }}
bodies = [
    {{ name = "a", mass = "k", inertia_com = {inertia} }},
    {{ name = "b", mass = 1, inertia_com = {inertia} }},
]
joints = [
    {{ name = "pin", type = "revolute", parent = "world", child = "a", r_child = {r}, \
coordinate = "q_1", orientation = {turned} }},
    {{ name = "rail", type = "prismatic", parent = "a", child = "b", r_parent = {r}, \
axis = {axis}, orientation = {turned} }},
]
effects = [
    {{ type = "gravity", g = 9.81 }},
    {{ type = "external_force", name = "rotor", body = "b", axes = "body", force = {force} }},
    {{ type = "spring", name = "rope", body_1 = "world", body_2 = "b", at_2 = {r}, \
stiffness = 3.0, rest_length = 0.1 }},
    {{ type = "motor", name = "drive", joint = "pin", \
torque = "k*sin(t) + thrust*cos(q_1) - wind*abs(q_1_dot) + gust + tanh(rail_slide)" }},
]
"""


@pytest.mark.parametrize("n", some((2,), (2, 3)))
def test_formulas_of_inputs_and_time_beside_orientations_of_parameters(n: int) -> None:
    """Inputs of the scene, definitions, time and turned joints: what the numeric solver has."""
    text = STEERED.format(
        n=n,
        inertia=[0.1, 0.2, 0.15] if n == 3 else 0.1,
        r=[0.3, 0.1, -0.2][:n],
        axis=[0.6, 0.8, 0.0][:n],
        turned='["lean", "45 deg", "-k*lean"]' if n == 3 else '"-lean"',
        force=["3*thrust + wind", "thrust*sin(t)", "gust"][:n],
    )
    model = model_of(text)
    at = instant(model)
    rates, forces = follow_recursion(model, at.known)
    assert_close(forces, at.solver.applied_force)
    assert_close(rates, at.solver.articulated_forward())
    found = eomgen.derive(text)
    assert "thrust" in found.text() and "thrust" in found.latex() and "thrust" in found.html()


@pytest.mark.parametrize("seed", range(some(4, 30)))
def test_driven_and_locked_joints(seed: int) -> None:
    """Trees of any joints: what is prescribed is a motion, not an unknown."""
    model = model_of(given(2 + seed % 2, seed, 6).text)
    for still in ((), ("velocity_forces",)):
        left = replace(model, leave_out=still)
        at = instant(left, seed)
        for symbol, value in prescribed_motion(left):
            assert_close(number(value, at.known), at.known[symbol.name])
        rates, _ = follow_recursion(left, at.known)
        assert_close(rates, at.solver.articulated_forward())


CLOSED = """\
name = "closed"
bodies = [
    {{ name = "a", mass = 1.1, inertia_com = 0.3 }},
    {{ name = "b", mass = 0.7, inertia_com = 0.12 }},
]
joints = [
    {{ name = "root", type = "free", child = "a" }},
    {{ name = "hinge", type = "{}", parent = "a", child = "b", r_parent = [0.3, 0.1], \
r_child = [-0.2, 0.05], coordinate = "c"{} }},
]
effects = [
    {{ type = "gravity", g = 9.81 }},
    {{ type = "spring", name = "tie", body_1 = "world", body_2 = "b", at_2 = [0.1, 0.2], \
stiffness = 40.0, damping = 2.0, rest_length = 0.3 }},
    {{ type = "drag", name = "air", bodies = "all", quadratic = 0.4, turning_linear = 0.1 }},
    {{ type = "pid", name = "servo", joint = "hinge", target = "0.3*sin(t)", stiffness = 8.0, \
integral_gain = 2.0, limit = 3.0, lag = 0.1 }},
    {{ type = "contact", name = "floor", law = "hunt_crossley", bodies = "all", radius = 0.4, \
offset = -0.1, stiffness = 300.0, dissipation = 0.2, friction = 0.4, slip_speed = 0.1 }},
]
"""


TOP = """
[[effects]]
type = "drag"
name = "air"
body = "top"
at = [0.1, 0.0, 0.2]
linear = 0.3
turning_linear = 0.2
turning_quadratic = 0.1
"""
BY = {
    "the handout's steps": CLOSED.format("revolute", ""),
    "Kane's method": CLOSED.format("prismatic", ", axis = [0.6, 0.8]"),
    "Kane's method in space": (BUILT_IN / "spinning_top.toml").read_text("utf-8") + TOP,
}


@pytest.mark.every(2)
@pytest.mark.parametrize("by", BY)
def test_m_v_g_do_not_depend_on_effects(by: str) -> None:
    """M v̇ + V + G = F and its solution, F written out."""
    model = model_of(BY[by])
    exposition, at = exposition_of(model), instant(model)
    bare = exposition_of(replace(model, effects=model.effects[:1], extra=()))
    found, other = exposition.matrices, bare.matrices
    assert found is not None and other is not None
    for letter in "MVG":
        assert getattr(found, letter) == getattr(other, letter)
    define(found.definitions, at.known)
    want = at.solver.articulated_forward()
    assert_close([at.known[a.name] for a in found.a], want)
    M, V, G, F = (array(x, at.known) for x in (found.M, found.V, found.G, found.F))
    assert_close(F, at.solver.applied_force)
    assert_close(M @ np.array(want) + (V + G - F).ravel(), np.zeros(len(want)))


@pytest.mark.every(6)
@pytest.mark.parametrize("form", ["redundant", "momentum", "velocity"])
@pytest.mark.parametrize("scene", ["two_body", "two_body_forced"])
def test_the_derivative_of_a_state_form(scene: str, form: Any) -> None:
    """Ẏ as it is written out is the module's `derivative` in this form: 12 numbers, 8, [q, v]."""
    module: Any = eomgen.load(eomgen.generate(scene, form=form))
    last = exposition_of(model_of(scene), form).steps[-1]
    first, second, *lines = last.equations
    assert len(first.right) == {"redundant": 12, "momentum": 8, "velocity": 8}[form]
    rng = np.random.default_rng(5)
    y = rng.uniform(-1.0, 1.0, len(module.STATES))
    u = {name: float(rng.uniform(-2.0, 2.0)) for name in module.INPUTS}
    if form == "redundant":  # the joint holds
        y = np.array(module.initial_state())
    known = {**module.PARAMETERS, **u}
    known |= {s.name: float(x) for s, x in zip(first.right, y, strict=True)}
    rates = {line.left.name: line.right for line in lines}

    def value(name: str) -> float:
        if name not in known:
            for symbol in rates[name].free_symbols:
                value(symbol.name)
            known[name] = number(rates[name], known)
        return float(known[name])

    found = [value(symbol.name) for symbol in second.right]
    assert_close(found, module.derivative(0.3, y, None, u), 1e-12)


def test_from_the_handouts_m_to_the_symmetric_one() -> None:
    """T M is symmetric, and the page says so; T has an inverse."""
    steps = derived("two_body_forced").steps
    by_name = {str(e.left): e.right for step in steps for e in step.equations}
    rng = np.random.default_rng(9)
    symbols = {x for name in ("T", "M", "V", "G", "F") for x in by_name[name].free_symbols}
    known = {name: float(rng.uniform(0.5, 2.0)) for name in sorted(x.name for x in symbols)}
    T, M, whole = (array(by_name[name], known) for name in ("T", "M", "M_sym"))
    assert_close(T @ M, whole)
    assert_close(whole, whole.T)
    assert np.max(np.abs(M - M.T)) > 0.1 and abs(np.linalg.det(T)) > 0.9
    for letter in "VGF":
        assert_close(T @ array(by_name[letter], known), array(by_name[f"{letter}_sym"], known))
    words = " ".join(step.words for step in steps)
    assert "`mass_matrix()`" in words and "not symmetric" in words


def test_the_impulse_equations() -> None:
    """Gap, opening speed and slip of each contact, against the solver's rows."""
    model = model_of("bouncing_two_body")
    at = instant(model)
    effects = derived_effects(model)
    follow_effects(model, effects, at.known)
    steps = list(impact_steps(model, effects))
    assert len(steps) == 4 and {"v^+", "P_II"} <= {e.left.name for e in steps[0].equations}
    solver: Dynamics = at.solver
    for step, contact in zip(steps[1:], solver.contacts, strict=True):
        define(((e.left, e.right) for e in step.equations), at.known)
        name = contact.name
        assert_close(at.known[f"g_{name}"], contact.gap)
        assert_close(at.known[f"u_{name},n"], solver.power_of(contact.normal))
        (tangent,) = contact.tangents
        assert_close(at.known[f"u_{name},t"], solver.power_of(tangent))
        row = impulses.generalised(solver, contact.normal)
        assert_close(at.known[f"u_{name},n"], np.dot(row, solver.v))


ENDING_IN_D = """
name = "names"
parameters = { load = 1.0, polkadot = 0.5 }
bodies = [
    { name = "rod", mass = "load", inertia_com = 0.1 },
    { name = "lid", mass = 2.0, inertia_com = 0.3 },
]
effects = [{ type = "gravity", g = 9.81 }]
joints = [
    { name = "elbow", type = "revolute", parent = "world", child = "rod", \
r_child = [0, "polkadot"], coordinate = "bend" },
    { name = "rail", type = "prismatic", parent = "rod", child = "lid", coordinate = "speed", \
axis = [1, 0] },
]
"""


def test_dots_are_over_whole_names() -> None:
    """Over those that end in d as over others, and none over a name that ends in dot."""
    for found in (eomgen.derive(parse_scene(ENDING_IN_D)), eomgen.derive("two_body")):
        model, steps = found.model, found.steps
        named = "bend" if model.name == "names" else "θ"
        text, paper, page = (
            write(model, steps, found.exposition.effects) for write in (as_text, as_latex, as_html)
        )
        one, two = ("˙", "¨") if named == "bend" else ("\u0307", "\u0308")
        assert named + one in text and named + two in text
        over = r"\mathrm{bend}" if named == "bend" else r"\theta"
        assert rf"\dot{{{over}}}" in paper and rf"\ddot{{{over}}}" in paper
        for mark in "˙¨":
            assert re.search(rf"<mover><mi[^>]*>{named}</mi><mo>{mark}</mo>", page)
        for shown in (text, paper, page):
            words = re.findall(r"\b(ben|loa|spee|ro|polka|polkad)\b", shown)
            assert not words, words


@pytest.mark.every(3)
@pytest.mark.parametrize("scene", SHOWN)
def test_three_formats(scene: str) -> None:
    """No refusal. In prose no markup, in formulas no hyphen for a minus, in LaTeX plain ASCII."""
    found = derived(scene)
    long = len(found.steps) > 40
    steps = tuple(s for i, s in enumerate(found.steps) if s.figure or not long or i % 5 == 1)
    page, paper, text = (
        write(found.model, steps, found.exposition.effects)
        for write in (as_html, as_latex, as_text)
    )
    assert paper.isascii()
    formulas = [line for line in text.splitlines() if line.startswith("    ")]
    assert formulas and not any("-" in line for line in formulas)
    for step in found.steps:
        for kind, words in (p for b in blocks(step.words) for item in b.items for p in item):
            assert kind != "word" or not re.search(r"[`_^]", words), words
    for formula in re.findall(r"<math.*?</math>", page):
        tree = ElementTree.fromstring(formula)
        assert "-" not in "".join(tree.itertext())
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(drawings) == 1 + len(found.model.bodies)
    for drawing in drawings:
        ElementTree.fromstring(drawing)
    assert paper.count(r"\begin{tikzpicture}") == len(drawings)
    assert "src=" not in page and not re.search(r'href="[^#]', page)
    assert "nan" not in page and "zoo" not in page


def test_no_character_is_lost_on_paper() -> None:
    """Descriptions of all effects have LaTeX for every letter: a question mark would be a loss."""
    for case in CASES[:: some(4, 1)]:
        model = model_of(case.text())
        for derived in derived_effects(model):
            paper = as_latex(model, (report_words(derived.words),), ())
            assert "?" not in paper, derived.effect.type


def report_words(words: str) -> Any:
    """A step of words alone."""
    from eomgen.derivation.steps import Step

    return Step("effect", "", words, ())


def test_forces_in_sketches_have_the_names_of_the_equations() -> None:
    """Weights, joint forces, external forces, the motor's torque on both bodies."""
    page = derived("two_body_forced").html()
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    texts = [
        re.sub("<title>.*?</title>|<[^>]*>|\u200b", "", d.replace("</text>", "|")) for d in drawings
    ]
    assert {"rA", "rB", "θ", "φ"} <= set(labels(texts[0]))
    assert {"mA\u2009g", "fj", "fA", "−τ"} <= set(labels(texts[1]))
    assert {"mB\u2009g", "−fj", "fB", "τ"} <= set(labels(texts[2]))


def labels(text: str) -> list[str]:
    """The labels of a drawing."""
    return [part.strip() for part in text.split("|")]


def test_weights_point_down_and_forces_along_rails() -> None:
    """In free-body diagrams, also where other forces act at the same point, and on both bodies."""
    held = """
    name = "held"
    initial = { q = { swing_deg = 35, reach = 0.3 } }
    bodies = [
        { name = "arm", mass = 2.0, inertia_com = 0 },
        { name = "hand", mass = 1.0, inertia_com = 0 },
    ]
    effects = [
        { type = "gravity", g = 9.81 },
        { type = "pd", name = "servo", joint = "rail", target = 0.5, stiffness = 9.0 },
    ]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "arm", r_child = [0, 1], \
coordinate = "swing" },
    { name = "rail", type = "prismatic", parent = "arm", child = "hand", axis = [0, -1], \
coordinate = "reach" },
]
"""
    disc = """
    name = "disc"
    initial = { q = { a = 0.1, c_deg = 50 } }
    bodies = [{ name = "disc", mass = 1.0, inertia_com = 0.1 }]
effects = [
    { type = "pd", name = "servo", joint = "table", coordinate = "b", target = 0.5, \
stiffness = 9.0 },
]
joints = [
    { name = "table", type = "planar", parent = "world", child = "disc", orientation_deg = 20, \
coordinates = ["a", "b", "c"] },
]
"""
    expected = {
        held: {
            "g*m_arm": -90.0,
            "g*m_hand": -90.0,
            "tau_servo": -55.0,
            "-tau_servo": 125.0,
        },
        disc: {"tau_servo": 110.0},
        disc + "[locked]\nb = 0.3": {"tau_servo": 110.0},
    }
    for text, directions in expected.items():
        model, angles = model_of(text), {}
        for drawing in body_diagrams(model, derived_effects(model)):
            for line, label in zip(drawing.items, drawing.items[1:], strict=False):
                if isinstance(line, Line) and line.arrow and isinstance(label, Label):
                    (x0, y0), (x1, y1) = line.points
                    angles[str(label.text)] = np.degrees(np.arctan2(y1 - y0, x1 - x0))
        for name, degrees in directions.items():
            assert angles[name] == pytest.approx(degrees, abs=1e-6), name


def test_one_name_for_a_mass_in_all_steps() -> None:
    """A mass without a name is m_<body>, in sketches and in every step."""
    text = eomgen.derive(
        {
            "name": "slider",
            "bodies": [{"name": "cart", "mass": 2.0, "inertia_com": 0}],
            "joints": [
                {
                    "name": "rail",
                    "type": "prismatic",
                    "parent": "world",
                    "child": "cart",
                    "axis": [0.6, 0.8],
                }
            ],
            "effects": [{"type": "gravity", "g": 9.81}],
        }
    ).text()
    assert "m_cart" in text and "cart_mass" not in text


def test_levels_go_by_kind() -> None:
    """What is shown depends on what a step is, whatever its title; each level has all before it."""
    steps = derived("two_body_forced").steps
    kinds = [[s.kind for s in at_detail(steps, detail)] for detail in DETAILS]
    assert kinds == [[k for k in kinds[-1] if k in some] for some in map(set, kinds)]
    assert {"equations", "solution", "form"} <= set(kinds[0]) < set(kinds[1]) < set(kinds[2])
    other = [replace(step, title="Solved") for step in steps]
    assert [[s.kind for s in at_detail(other, detail)] for detail in DETAILS] == kinds


def test_forms_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`derive --form`, and what has no such state."""
    assert main(["derive", "bouncing_two_body", "--form", "redundant"]) == 0
    end = capsys.readouterr().out.split("State form redundant")[1]
    assert "12 numbers" in end and "Ṗ_A,x = f_j,x" in end and "L̇_B" in end
    assert main(["derive", "furuta_pendulum", "--form", "momentum"]) == 1
    assert "derived in the plane; use velocity" in capsys.readouterr().err


ROPE = """
name = "rope"
effects = [{ type = "gravity", g = 9.81 }]
chains = [
    { name = "link", count = 7, mass = 1, inertia_com = 1, r_parent = [0.1, 0], \
r_child = [-0.1, 0] },
]
"""


def test_large_mechanisms_have_steps_and_no_matrices() -> None:
    """What is said instead can be copied: it gives the numbers of M, V, G and F."""
    found = eomgen.derive(ROPE)
    assert len(found.steps) > 10
    with pytest.raises(eomgen.SceneError, match="not written out") as error:
        _ = found.M
    _, code, _ = str(error.value).split("`")
    *statements, last = code.split("; ")
    names = {"eomgen": eomgen, "scene": ROPE}
    exec("; ".join(statements), names)
    M, V, G, F = eval(last, names)
    assert M.shape == (7, 7) and np.linalg.eigvalsh(M).min() > 0
    y = names["m"].initial_state()
    left = M @ names["m"].derivative(0.0, y)[-7:] + V + G
    assert np.abs(left - F).max() < 1e-9 * np.abs(G).max()
    with pytest.raises(eomgen.SceneError, match="there are 7; use velocity; a module has it"):
        eomgen.derive(ROPE, form="momentum")


def test_words() -> None:
    """Names in prose are formulas, minus signs are minus signs, ranges have dashes."""
    assert pieces("The force f_j, -f_j at `r_a`, d^1.5 (29)-(34), a - b") == (
        ("word", "The force "), ("name", "f_j"), ("word", ", −"), ("name", "f_j"),
        ("word", " at "), ("code", "r_a"), ("word", ", d"), ("power", "1.5"),
        ("word", " (29)–(34), a − b"),
    )  # fmt: skip


def test_the_handouts_equations_stand_where_the_table_says() -> None:
    """(1) to (36), each in its step of `derive two_body`, or `two_body_forced` from (29) on."""
    page = (Path(__file__).parent.parent.parent / "docs" / "derivation.md").read_text("utf-8")
    rows = re.findall(r"^\| \((\d+)\) \| .* \| (\([^|]*) \| (`.*) \|$", page, re.MULTILINE)
    assert [int(number) for number, _, _ in rows] == list(range(1, 37))
    for scene, some_rows in (("two_body", rows[:28]), ("two_body_forced", rows[28:])):
        text = derived(scene).text()
        sections = re.split(r"^(\([\d., ()-]*\)) ", text, flags=re.MULTILINE)
        by_number = dict(zip(sections[1::2], sections[2::2], strict=True))
        for equation, step, lines in some_rows:
            for line in re.findall(r"`([^`]*)`", unicodedata.normalize("NFC", lines)):
                assert line in by_number[step], f"({equation}): {line}"


def test_each_line_of_code_names_its_term(capsys: pytest.CaptureFixture[str]) -> None:
    """Every assignment of every kernel, and what it is or is part of; the same in `--explain`."""
    source = eomgen.generate("two_body").source
    lines = list(explained(source))
    assert len(lines) == len(
        re.findall(r"^    (?!.*\bk = |.* = [ky]$)[\w]+ = ", kernels(source), re.M)
    )
    terms = {(line.kernel, line.line.split(" = ")[0]): line.term for line in lines}
    assert terms["derivative", "alpha_A"] == "angular acceleration α of A"
    assert terms["derivative", "coupling_B_A"].startswith("coupling of B A: c of the closed form")
    assert terms["fixed", "pivot_B"].startswith("pivot of B: d of the closed form (37)")
    assert "M_1,3" in " ".join(t for (kernel, _), t in terms.items() if kernel == "mass_matrix")
    assert all(term and "part of ;" not in term for term in terms.values())


def kernels(source: str) -> str:
    """The kernels of a generated module, without what checks its arguments."""
    fixed, rest = source[source.index("def _fixed") :].split("def _constants(")
    return fixed + rest[rest.index("def _initial_state") : rest.index("def _numbers")]


SLIDING = """
name = "sliding"
dimensions = 2
parameters = { m = 1.0, k = 100.0, c = 0.5, l = 0.4 }
bodies = [
    { name = "first", mass = "m", inertia_com = 0 },
    { name = "second", mass = "2*m", inertia_com = 0 },
    { name = "bob", mass = "m", inertia_com = 0 },
]
joints = [
    { name = "a", type = "prismatic", parent = "world", child = "first", axis = [1, 0] },
    { name = "b", type = "prismatic", parent = "world", child = "second", axis = [1, 0] },
    { name = "pin", type = "revolute", parent = "second", child = "bob", r_child = [0, "l"] },
]
effects = [
    { type = "spring", name = "s", body_1 = "first", body_2 = "second", stiffness = "k", damping = "c" },
    { type = "motor", name = "drive", joint = "a", torque = "input" },
]
initial = { q = { b_slide = 1.0 } }
"""  # noqa: E501


def test_what_is_plain_is_put_in() -> None:
    """Poses that are a number or a coordinate are not lines of their own, and names by default are
    letters; a spring along a rail has one component. Each step has the next number.
    """
    found = eomgen.derive(SLIDING)
    text = found.text()
    assert [s.number for s in found.steps] == [f"({i})" for i in range(1, len(found.steps) + 1)]
    assert "ψ_" not in text and "s_b − s_a" in text and "θ_pin" in text
    assert "s_a is the coordinate a_slide" in text and "ḋ_s,x" in text
    assert "A force on the joint's child" in text and "drive is an input" in text
    assert text.count("s̈_a =") == 1
    assert "- second: " in text and "Given: m (1); k (100)" in text


def test_signs_and_factors_as_a_person_writes_them() -> None:
    """Lengths before angles and rates, a positive term first, one number in front."""
    R, r, g, theta, omega = (real(x) for x in ("R", "r", "g", "theta", "omega"))
    pretty = printer(use_unicode=True)
    written = {
        "R⋅θ": theta * R,
        "r - R": r - R,
        "3⋅(r - R)": sp.Mul(3, r - R, evaluate=False),
        "r⋅ω": omega * r,
        "-2⋅g⋅r": sp.Mul(-1, 2, g, r, evaluate=False),
    }
    assert {text: pretty.doprint(e) for text, e in written.items()} == {x: x for x in written}
    assert simplified(2 * g / (-3 * R + 3 * r)) == sp.Rational(2, 3) * g / (r - R)


@pytest.mark.parametrize("scene", ["cart_pole", "four_bar", "furuta_pendulum", "two_body_forced"])
def test_labels_of_sketches_are_clear(scene: str) -> None:
    """No label covers another, nor the middle of a line."""
    model = model_of(scene)
    effects = derived_effects(model)
    for drawing in (mechanism_sketch(model, effects), *body_diagrams(model, effects)):
        labels = [x for x in drawing.items if isinstance(x, Label)]
        for i, one in enumerate(labels):
            for other in labels[:i]:
                apart = abs(one.at[0] - other.at[0]), abs(one.at[1] - other.at[1])
                assert apart[0] > 9 or apart[1] > 9, (drawing.title, one.text, other.text)
            for line in (x for x in drawing.items if isinstance(x, Line)):
                ends = np.array(line.points)
                points = np.vstack([np.linspace(a, b, 40) for a, b in pairwise(ends)])
                away = np.abs(points - one.at)
                assert not (away.max(axis=1) < 3).any(), (drawing.title, one.text)


def test_forces_and_torques_in_body_axes() -> None:
    """The accelerations of a derivation are the module's, whatever way the body lies."""
    push = {"body": "a", "axes": "body"}
    torque = {**push, "type": "external_torque", "name": "turn", "torque": [1, 2, 3]}
    force = {**push, "type": "external_force", "name": "push", "force": [1, -2, 3]}
    pushed = {
        "name": "pushed",
        "dimensions": 3,
        "bodies": [{"name": "a", "mass": 2.0, "inertia_com": [0.3, 0.4, 0.5]}],
        "joints": [{"name": "flight", "type": "free", "child": "a"}],
        "effects": [torque, {**force, "at": [0.1, 0.2, 0.3]}],
    }
    found, module = eomgen.derive(pushed), eomgen.load(eomgen.generate(pushed))
    y = np.random.default_rng(5).normal(size=13)
    y[3:7] /= np.linalg.norm(y[3:7])
    known = {**dict(zip(module.STATES, y, strict=True)), **module.PARAMETERS}
    at = {symbol: known[name] for name, symbol in found.symbols.items() if name in known}
    accelerations = [float(value.subs(at)) for value in found.solution.values()]
    np.testing.assert_allclose(accelerations, module.derivative(0.0, y)[7:], atol=1e-12)
