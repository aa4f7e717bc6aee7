"""Derivations of mechanisms with constraints, followed in numbers beside module and solver."""

import re
from dataclasses import replace
from functools import cache
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy as sp
from campaign import some
from equation_numbers import Numbers, array, define, number
from followed import Instant, instant

import eomgen
from eomgen.derivation.constraints import DerivedConstraint, derived_constraints
from eomgen.derivation.dots import dotted
from eomgen.derivation.exposition import exposition_of
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.loops import by_independent_velocities, elimination_steps
from eomgen.derivation.poses import poses
from eomgen.dynamics.loops import constraints as solved
from eomgen.dynamics.loops.clusters import accelerations_at_rest, jacobian_of
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.assur import with_closed_form
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import parse_scene, read_scene

MIXED = """
name = "mixed"
dimensions = 3
parameters = { a = 0.5, k = 0.3 }
initial = { q = { swing = 0.2 } }
bodies = [
    { name = "arm", mass = 1.3, inertia_com = [0.1, 0.2, 0.15] },
    { name = "bar", mass = 0.7, inertia_com = [0.05, 0.03, 0.04] },
    { name = "slider", mass = 0.9, inertia_com = [0.02, 0.03, 0.04] },
    { name = "post", mass = 0.4, inertia_com = [0.02, 0.03, 0.02] },
]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "arm", axis = [0.6, 0.0, 0.8], \
r_child = [0, "-a", 0.1], coordinate = "swing" },
    { name = "wrist", type = "ball", parent = "arm", child = "bar", r_parent = [0.0, "a", 0.0], \
r_child = [-0.3, 0.0, 0.0] },
    { name = "base", type = "free", child = "slider" },
    { name = "rail", type = "prismatic", parent = "world", child = "post", axis = [0, 0, 1], \
r_parent = [1.0, 0.0, 0.0], coordinate = "lift" },
    { name = "{type}_loop", type = "{type}", loop = true, parent = "bar", child = "slider", \
r_parent = [0.3, 0.1, 0.0], r_child = [0.0, 0.0, 0.2]{more} },
]
constraints = [
    { type = "distance", name = "rod", body_1 = "post", at_1 = [0.0, 0.0, 0.1], body_2 = "slider", \
at_2 = [0.1, 0.0, 0.0], length = 1.1 },
    { type = "coupling", name = "screw", coordinate = "lift", equals = "k*sin(swing)" },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "motor", name = "drive", joint = "pin", torque = "input" },
]
"""
LOOPS = {"revolute": ", axis = [0, 1, 0]", "universal": "", "cylindrical": ", axis = [0, 0.6, 0.8]",
         "planar": "", "ball": "", "prismatic": ", axis = [1, 0, 0]", "weld": ""}  # fmt: skip
MIXTURES = {kind: MIXED.replace("{type}", kind).replace("{more}", more)
            for kind, more in LOOPS.items()}  # fmt: skip
SMALL = ("four_bar", "slider_crank")
SCENES = some((*SMALL, "peaucellier", "differential"), built_in_names())
ROUNDING = 1e-9


@cache
def model_of(scene: str) -> Model:
    """The model of a built-in scene, or of a mixture of constraints."""
    return assembled(
        elaborate(parse_scene(MIXTURES[scene]) if scene in MIXTURES else read_scene(scene))
    )


def followed(model: Model, seed: int = 0) -> tuple[Instant, tuple[DerivedConstraint, ...]]:
    """A closed state with all that the steps on constraints define."""
    at, found = instant(model, seed, 0.05, closed=True), derived_constraints(model)
    needed = dict.fromkeys(body for c in found for body in c.bodies)
    define(poses(linkage_of(model), needed)[0], at.known)
    for c in found:
        define((*c.definitions, *c.speeds), at.known)
    return at, found


def assert_close(ours: Any, theirs: Any) -> None:
    """Equal up to rounding, relative to the largest entry."""
    ours, theirs = np.ravel(ours), np.ravel(theirs)
    size = max(1.0, float(np.abs(theirs).max(initial=0.0)))
    assert ours.shape == theirs.shape
    assert float(np.abs(ours - theirs).max(initial=0.0)) < ROUNDING * size


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [*SCENES, *some(("prismatic",), LOOPS)])
def test_equations_of_constraints_and_their_solution(scene: str) -> None:
    """g, ġ, J, β, and v̇ and λ by the elimination."""
    model = model_of(scene)
    if not model.constraints:
        pytest.skip("a tree")
    at, found = followed(model)
    d, names = at.solver, [c.name for c in model.velocities]
    rows = [row for c in found for row in c.rows]
    g = [0.0 if row.position is None else number(row.position, at.known) for row in rows]
    assert_close(g, solved.residuals(d))
    assert_close([number(row.speed, at.known) for row in rows], solved.rates(d))
    J = np.array([[number(dict(row.slopes).get(name, 0 * row.speed), at.known) for name in names]
                  for row in rows])  # fmt: skip
    assert_close(J, jacobian_of(d))
    beta = np.array([number(row.bend, at.known) for row in rows])
    assert_close(beta, accelerations_at_rest(d))
    want = d.forward("ldl")(None)
    force = d.constrained("ldl").multipliers()
    for route in ("independent", "ldl"):
        named = replace(model, route=route)
        rates, multipliers = eliminated(named, found, at, J, beta)
        assert_close(rates, want)
        assert_close(multipliers, force)


def eliminated(
    model: Model, found: tuple[DerivedConstraint, ...], at: Instant, J: Any, beta: Any
) -> tuple[Any, Any]:
    """v̇ and λ by the equations of the steps, in numbers."""
    d, n = at.solver, len(model.velocities)
    order = list(range(n))
    known: Numbers = {}
    if by_independent_velocities(model):
        dependent = [j for _, j in model.pivots]
        order = [*dependent, *(j for j in order if j not in dependent)]
        m = len(dependent)
        known |= {"J_d": J[:, dependent], "J_i": J[:, order[m:]]}
    mass = np.zeros((n, n))
    for (i, j), x in d.mass_entries.items():
        mass[i, j] = mass[j, i] = x
    known |= {"M": mass[np.ix_(order, order)], "J": J}
    known["beta"] = beta.reshape(-1, 1)
    known["h_0"] = (np.array(d.bias()) - np.array(d.applied_force))[order].reshape(-1, 1)
    for line in (line for step in elimination_steps(model, found) for line in step.equations):
        if isinstance(line.left, sp.MatrixSymbol) and not line.right.has(sp.Symbol):
            known[line.left.name] = array(line.right, known)
    rates = np.empty(n)
    rates[order] = known[dotted("v")].ravel()
    return rates, known["lambda"]


@pytest.mark.parametrize("scene", SMALL)
def test_matrices_of_the_freedoms_against_the_module(scene: str) -> None:
    """M u̇ + V + G = F and u̇, with all that follows from the freedoms put in."""
    found, model = eomgen.derive(scene), with_closed_form(model_of(scene))
    module = eomgen.load(eomgen.generate(scene))
    assert [x.name for x in (*found.matrices.q, *found.matrices.v)] == list(module.STATES)
    for seed in range(3):
        at = instant(model, seed, 0.05, closed=True)
        y = [at.known[state] for state in module.STATES]
        (want,) = module.derivative(0.4, np.array(y))[1:]
        known = dict(zip(module.STATES, y, strict=True)) | {"t": 0.4, **model.defaults}
        define(found.matrices.definitions, known)
        assert_close([known[a.name] for a in found.matrices.a], want)
        M, V, G, F = (array(x, known) for x in (found.M, found.V, found.G, found.F))
        assert_close(M * want, F - V - G)


@pytest.mark.parametrize("scene", ("rattleback",))
def test_matrices_where_positions_are_not_closed(scene: str) -> None:
    """M u̇ + V + G = F of the independent velocities, over all states and named quantities."""
    found, model = eomgen.derive(scene), with_closed_form(model_of(scene))
    module = eomgen.load(eomgen.generate(scene))
    assert len(found.M) == (len(model.velocities) - len(model.rows)) ** 2
    at = instant(model, 0, 0.05, closed=True)
    rates = module.derivative(0.4, np.array([at.known[name] for name in module.STATES]))
    want = [rates[module.STATES.index(v.name)] for v in found.matrices.v]
    known = {name: x for name, x in at.known.items() if name not in found.matrices.a}
    define(found.matrices.definitions, known)
    assert_close([known[a.name] for a in found.matrices.a], want)
    M, V, G, F = (array(x, known) for x in (found.M, found.V, found.G, found.F))
    assert_close(M @ want, F - V - G)
    first = found.written_out(found.M[0, 0])
    assert {s.name for s in first.free_symbols} <= {*model.states, *model.defaults}


def test_three_formats_and_sketches() -> None:
    """The steps in text, HTML and LaTeX; the loop's force at both bodies."""
    found = eomgen.derive("four_bar", detail="all")
    text, page, paper = found.text(), found.html(), found.latex()
    titles = [step.title for step in found.steps]
    assert "Constraint `rocker_pin`: velocities" in titles
    assert "One equation for each freedom" in titles
    assert (
        "− θ" in next(x for x in text.split("\n") if "φ = " in x and "atan2" in x)
        and "λ_rocker_pin,x" in text
    )
    assert paper.isascii() and r"\lambda" in paper
    drawings = page.split("<svg")[1:]
    shown = [ElementTree.fromstring("<svg" + d[: d.index("</svg>") + 6]) for d in drawings]
    labels = ["".join(tree.itertext()) for tree in shown]
    assert sum("rockerpin" in re.sub("[^a-z]", "", label) for label in labels[1:]) >= 2
    with pytest.raises(eomgen.SceneError, match="form"):
        eomgen.derive("four_bar", form="momentum")


def test_large_mechanisms_with_loops_are_derived_by_algorithms() -> None:
    """Seven bars: positions in closed form, M by composite bodies, one equation."""
    found = exposition_of(model_of("peaucellier"))
    titles = [step.title for step in found.steps]
    assert found.matrices is None and "One equation for each freedom" in titles
    assert "Inwards: the mass matrix M" in titles
    found = exposition_of(replace(model_of("peaucellier"), loops_kept="projected", route="aba"))
    assert "The accelerations that meet the constraints" in [step.title for step in found.steps]
