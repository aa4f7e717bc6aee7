"""Loops in closed form: positions to 50 digits, motion as by projection, and where they end."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import planar_linkages
import pytest
from campaign import some
from engine import apart, engine
from gmpy2 import mpfr

import eomgen
from eomgen.api.given import check
from eomgen.base.errors import SceneError
from eomgen.codegen.derive import derive, record
from eomgen.codegen.system import optimised
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.start.assembly import assembled
from eomgen.dynamics.start.assur import completed, with_closed_form
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scalars.extended import Bits, sixty_digits
from eomgen.scene.reader import parse_scene
from eomgen.study.whole import viewed

WELL = 1e-12


def joint(kind: str, name: str, parent: str, child: str, at: Any, own: Any, more: str = "") -> str:
    """A joint as TOML, oriented by 20 degrees; `more` follows, or its coordinate."""
    last = more or f'coordinate = "{name}"'
    return (
        f'[[joints]]\nname = "j_{name}"\ntype = "{kind}"\nparent = "{parent}"\nchild = "{child}"\n'
        f"r_parent = {[*map(float, at)]}\nr_child = {[*map(float, own)]}\norientation_deg = 20\n"
        f"{last}\n"
    )


def turn(name: str, parent: str, child: str, at: Any, own: Any, more: str = "") -> str:
    return joint("revolute", name, parent, child, at, own, more)


def slide(
    name: str, parent: str, child: str, at: Any, own: Any, more: str = "", x: Any = (1, 0)
) -> str:
    axis = f"axis = {[*map(float, x)]}\n"
    return joint(
        "prismatic", name, parent, child, at, own, axis + (more or f'coordinate = "{name}"')
    )


def rod(first: str, second: str, length: float) -> str:
    return (
        f'[[constraints]]\ntype = "distance"\nname = "rod"\nbody_1 = "{first}"\n'
        f'at_1 = [0.05, 0.02]\nbody_2 = "{second}"\nat_2 = [0.1, -0.05]\nlength = {length}\n'
    )


LOOP = "loop = true"
CRANK = turn("theta", "world", "crank", (0, 0), (-0.05, 0))
BEND = turn("bend", "crank", "bar", (0.05, 0.01), (-0.3, 0.02))
POLYGONS = {
    "two bars on one side": BEND + turn("elbow", "bar", "end", (0.3, 0.05), (-0.25,
     0.0)) + turn("close", "end", "world", (0.25, 0.1), (0.6, 0.2), LOOP),
    "two bars": BEND + turn("swing", "world", "end", (0.6, 0.1), (-0.25, 0.05)) + turn("close",
     "bar", "end", (0.3, 0.05), (0.25, 0), LOOP),
    "a bar and a guide": BEND + slide("x", "world", "end", (0.1, 0.05), (0.02,
     0.01)) + turn("close", "bar", "end", (0.3, 0.05), (0.05, 0.0), LOOP),
    "a guide, then a bar": slide("x", "world", "bar", (0.3, 0.05), (0.02, 0.01)) + turn("elbow",
     "bar", "end", (0.05, 0.05), (-0.1, 0.02)) + turn("close", "crank", "end", (0.05, 0.05), (0.3,
     0.0), LOOP),
    "a guide that turns, then a bar": slide("x", "crank", "bar", (0.05, 0.01), (0, 0), x=(1,
     2)) + turn("elbow", "bar", "end", (0.05, 0.05), (-0.1, 0.02)) + turn("close", "world", "end",
     (-0.3, 0.05), (0.6, 0.0), LOOP),
    "a bar with a guide": BEND + slide("x", "bar", "end", (0.1, 0.05), (0.02, 0.01), x=(2,
     1)) + turn("close", "end", "world", (0.03, 0.05), (0.6, 0.2), LOOP),
    "two guides": slide("x", "world", "bar", (0.1, 0.05), (0.02, 0.01)) + slide("y", "bar", "end",
     (0.1, 0.05), (0.02, 0.01), x=(1, 3)) + turn("close", "crank", "end", (0.05, 0.03), (0.02,
     0.0), LOOP),
    "a slider at two bars": BEND + turn("elbow", "bar", "end", (0.3, 0.05), (-0.05,
     0.0)) + slide("close", "world", "end", (0.3, 0.1), (0.02, 0.03), LOOP, x=(3, 1)),
    "a slider at a bar and a guide": BEND + slide("x", "world", "end", (0.1, 0.05), (0.02, 0.01),
     x=(1, 3)) + slide("close", "end", "bar", (0.1, 0.05), (0.02, 0.01), LOOP),
    "a slider between bars": BEND + turn("swing", "world", "end", (0.6, 0.1), (-0.25,
     0.05)) + slide("close", "end", "bar", (0.0, 0.05), (0.3, 0.02), LOOP),
    "a rod to a bar": turn("swing", "world", "end", (0.6, 0.1), (-0.25, 0.05)) + rod("crank",
     "end", 0.5),
    "a rod to a guide": slide("x", "world", "end", (0.1, 0.05), (0.02, 0.01)) + rod("end", "crank",
     0.4),
    "a gear and a bar on it": turn("wheel", "world", "bar", (0.3, 0), (0, 0)) + turn("swing",
     "world", "end", (0.6, 0.1), (-0.25, 0.05)) + rod("bar", "end",
     0.5) + '[[constraints]]\ntype = "coupling"\nname = "gear"\ncoordinate = "wheel"\n'
     'equals = "0.1 - 2*theta"\n',
}  # fmt: skip
"""Loops on a crank that goes round."""


def scene(name: str, loops: str = "closed") -> str:
    """A mechanism of `POLYGONS`."""
    parts = POLYGONS[name]
    bodies = [
        planar_linkages.body(n, 1.0, 0.02)
        for n in ("crank", "bar", "end")
        if f'"{n}"' in parts + CRANK
    ]
    start = "[initial]\nq = { theta = 0.4 }\nv = { theta_dot = 2.0 }\n"
    return "\n".join(
        [f'loops = "{loops}"', planar_linkages.head("polygon"), *bodies, CRANK, parts, start]
    )


@cache
def closed_model(text: str) -> Model:
    return with_closed_form(assembled(elaborate(parse_scene(text))))


def test_two_freedoms_with_couplings() -> None:
    """The angles that follow are those that couplings give, whichever the assembly solved for."""
    turns = (turn(name, "world", name, (0, 0), (0, 0)) for name in ("alpha", "beta", "gamma"))
    bodies = (planar_linkages.body(name, 1.0, 0.1) for name in ("alpha", "beta", "gamma"))
    gear = '[[constraints]]\ntype = "coupling"\nname = "gear"\ncoordinate = "gamma"\n'
    text = "\n".join((planar_linkages.head("gears"), *bodies, *turns, gear))
    model = closed_model(f"loops = 'closed'\n{text}equals = 'sin(alpha) - 0.3*beta'\n")
    assert model.states == ("alpha", "beta", "alpha_dot", "beta_dot")


def at_digits(model: Model, q: Any) -> Dynamics:
    values = {name: mpfr(x) for name, x in model.defaults.items()}
    still = [mpfr(0)] * len(model.velocities)
    return Dynamics(model, Values(values, {}, list(q), still, {}, mpfr(0)), Bits())


@pytest.mark.every(8)
@pytest.mark.parametrize("name", POLYGONS)
def test_polygons_close_to_50_digits(name: str) -> None:
    """All round, on the branch of the start and without a jump of an angle."""
    model = closed_model(scene(name))
    assert model.groups and len(model.state_coordinates) == 1
    with sixty_digits():
        start = [mpfr(x) for x in model.initial_q]
        (own,) = model.state_coordinates
        last = np.array(model.initial_q)
        for n in range(1, 32):
            q = [x if i == own else mpfr(0) for i, x in enumerate(start)]
            q[own] = start[own] + mpfr(n) / 5
            q = completed(lambda at: at_digits(model, at), model.groups, q)
            residuals = constraints.residuals(at_digits(model, q))
            assert max(abs(g) for g in residuals) < mpfr(10) ** -50
            here = np.array([float(x) for x in q])
            assert np.abs(here - last).max() < 1.2
            last = here


MODULES = ("two bars", "a guide that turns, then a bar")


@pytest.mark.every(2)
@pytest.mark.parametrize("name", some(MODULES, tuple(POLYGONS)))
def test_modules_move_as_by_projection(name: str) -> None:
    """All coordinates, velocities and accelerations, and the Jacobian by that of deviations."""
    model, text = closed_model(scene(name)), scene(name, "projected")
    outputs = ("coordinates", "velocities", "accelerations", "joint_forces")
    closed = load(scene(name), outputs)
    other = load(text, outputs)
    y = integrate(as_problem(other), "DOP853", 0.7, rtol=1e-12, atol=1e-12).y[-1]
    own = [other.STATES.index(state) for state in closed.STATES]
    seen = viewed(closed, model)
    assert apart(seen.derivative(0.0, y), other.derivative(0.0, y)) < 1e-11
    assert apart(closed.coordinates(0.0, y[own]), y[: len(y) // 2]) < WELL
    assert apart(closed.velocities(0.0, y[own]), y[len(y) // 2 :]) < 1e-11
    assert apart(closed.joint_forces(0.0, y[own]), other.joint_forces(0.0, y)) < 1e-11
    state = dict(zip(other.STATES, y.tolist(), strict=True))
    found = eomgen.linearise(text, at="initial", state=state).reduced()
    if found.state_names == closed.STATES:  # else others are the independent ones
        np.testing.assert_allclose(closed.jacobian(0.0, y[own]), found.A, rtol=1e-7, atol=1e-7)


def load(text: str, outputs: Any) -> Any:
    return eomgen.load(eomgen.generate(text, outputs=outputs))


FORMULAS = {
    "slider_crank": (planar_linkages.slider_crank, "theta bend x", 80),
    "four_bar": (planar_linkages.four_bar, "theta bend gamma", 120),
}


@pytest.mark.every(2)
@pytest.mark.parametrize("name", FORMULAS)
def test_closed_formulas(name: str) -> None:
    """Positions, velocities and accelerations around the circle are those of the closed formulas,
    in few operations, those of the positions among them.
    """
    formulas, words, most = FORMULAS[name]
    text = getattr(planar_linkages, f"{name}_scene")(1.5, 3.0)
    made = engine(f'loops = "closed"\n{text}', "independent", leave_out=("jacobian",))
    module, model = made.module, made.model
    assert module.STATES == ("theta", "theta_dot")
    assert module.COST["derivative"]["total"] <= most
    names = [c.name for c in model.coordinates]
    order = [names.index(word) for word in words.split()]
    for angle in np.linspace(-3.0, 3.0, 31).tolist():
        rate = 5.0 * np.sin(7 * angle)
        expected, y = formulas(angle, rate), np.array([angle, rate])
        turned = (module.coordinates(0.0, y)[order] - expected.q + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(turned).max() < WELL
        assert apart(module.velocities(0.0, y)[order], rate * expected.by_angle) < WELL
        assert apart(module.accelerations(0.0, y)[order], expected.accelerations(rate)) < WELL
        assert np.abs(module.constraint_residuals(0.0, y)).max() < 1e-15


def test_peaucellier_has_one_coordinate_and_draws_its_line() -> None:
    run = eomgen.simulate("peaucellier", integrator="rk4", dt=1e-2, t_end=1.0, backend="numpy",
                          save=["points"])  # fmt: skip
    assert run.states == ("theta", "theta_dot") and run.finished
    x, y = run.saved["point_positions"][:, 0].T
    assert np.ptp(x) > 0.1
    assert np.abs(y + (0.5**2 - 0.3**2) / 0.3).max() < 1e-13
    assert np.abs(run["right"] - run["left"]).max() > 0.1  # and they are kept


def four_bar(
    start: str = "theta = 0.4", loops: str = "auto", lengths: str = "0.1, 0.6, 0.5, 0.6"
) -> str:
    """A four-bar with its lengths as parameters."""
    a, b, c, d = lengths.split(", ")
    text = f'loops = "{loops}"\n{planar_linkages.head("bars")}[parameters]\n'
    text += f"a = {a}\nb = {b}\nc = {c}\nd = {d}\n"
    pins = [
        ("theta", "world", "crank", "[0, 0]", '["-a/2", 0]'),
        ("phi", "crank", "coupler", '["a/2", 0]', '["-b/2", 0]'),
        ("psi", "world", "rocker", '["d", 0]', '["-c/2", 0]'),
        ("", "coupler", "rocker", '["b/2", 0]', '["c/2", 0]'),
    ]
    for name, parent, child, at, own in pins:
        if name:
            text += planar_linkages.body(child, 1.0, 0.05)
        text += f'[[joints]]\nname = "pin{name}"\ntype = "revolute"\nparent = "{parent}"\n'
        text += f'child = "{child}"\nr_parent = {at}\nr_child = {own}\n'
        text += f'coordinate = "{name}"\n' if name else "loop = true\n"
    return f"{text}[initial]\nq = {{ {start} }}\nv = {{ theta_dot = 6.0 }}\n"


@pytest.mark.every(2)
@pytest.mark.parametrize("settings", [{"integrator": "DOP853"}, {"integrator": "rk4", "dt": 0.01}])
def test_singular_positions_change_the_coordinates(settings: dict[str, Any]) -> None:
    """With other lengths the crank comes to a dead point, or to a change point."""
    change_point, dead_point = {"a": 0.3, "b": 0.6, "c": 0.3}, {"a": 0.5, "b": 0.3, "c": 0.3}
    for lengths in (change_point, *some((), (dead_point,))):
        run = eomgen.simulate(four_bar(), parameters=lengths, t_end=1.0, **settings)
        assert run.finished and len(run.states) == 6
        assert "taken as independent" in run.warnings[-1]
        assert ("went through 3 change points" in run.message) == (lengths["b"] == 0.6)
        assert np.ptp(run.energy) < (1e-6 if settings["integrator"] == "DOP853" else 0.03)


def test_angles_do_not_jump_in_silence() -> None:
    """A rocker whose angle is counted from where it comes past."""
    model = check(four_bar(loops="closed", lengths="0.1, 0.6, 0.5, 0.45"))
    (group,) = with_closed_form(model).groups
    names = [model.coordinates[i].name for i in group.coordinates]
    cuts = list(group.cuts)
    cuts[names.index("psi")] = (-1, 1)  # from -90 to 270 degrees
    made = replace(with_closed_form(model), groups=(replace(group, cuts=tuple(cuts)),))
    system = optimised(record(derive(made, "independent")))
    module: Any = load_module(python_module(system))
    run = integrate(as_problem(module), "DOP853", 3.0, rtol=1e-9, atol=1e-9)
    assert not run.finished and "psi, which follows" in run.outcome.reason
    assert "loops = 'projected'" in run.outcome.remedy
    psi = module.coordinates(0.0, run.y.T)[[c.name for c in model.coordinates].index("psi")]
    assert np.abs(np.cos(psi[-1])) < 0.2


def test_what_cannot_be_is_told() -> None:
    """A start on the other branch; a crank that cannot go round; and what is kept by projection."""
    text = four_bar()
    run = eomgen.simulate(text, state={"theta": 1.0}, t_end=0.01)
    assert run.states == ("theta", "theta_dot")
    given = eomgen.simulate(text, state={"psi": run["psi"][0]}, t_end=0.01)
    assert abs(given["theta"][0] - 1.0) < 1e-9
    model = check(text)
    (psi,) = (q for c, q in zip(model.coordinates, model.initial_q, strict=True) if c.name == "psi")
    turn = 2 * np.arctan2(-0.1 * np.sin(0.4), 0.6 - 0.1 * np.cos(0.4))  # across the diagonal
    with pytest.raises(SceneError, match="another branch of its loop, or in another turn"):
        eomgen.simulate(text, state={"theta": 0.4, "psi": turn - psi}, t_end=0.01)
    dead = four_bar(lengths="0.5, 0.3, 0.3, 0.7", loops="closed", start="theta = 0.2")
    with pytest.raises(SceneError, match="loops: 'closed' cannot be: pin"):
        eomgen.generate(dead)
    module = eomgen.load(eomgen.generate(dead.replace('"closed"', '"auto"')))
    assert len(module.STATES) == 6
    assert len(eomgen.load(eomgen.generate(four_bar(loops="projected"))).STATES) == 6
    lines = eomgen.generate(text).explanation
    assert any("operations a step, by projection" in line for line in lines)
