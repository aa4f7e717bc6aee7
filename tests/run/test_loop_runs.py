"""Runs of mechanisms with loops: no drift, energy, given starts, impacts, singular positions."""

import re
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from crank_rocker import A, B, C, D, four_bar, lengths
from numpy.typing import NDArray

import eomgen
from eomgen.api.given import check
from eomgen.base.errors import RunError, SceneError
from eomgen.commands.main import main
from eomgen.dynamics.start.assembly import closed_start
from eomgen.run.crossing import crossing
from eomgen.run.margins import stays_away
from eomgen.run.module import as_problem
from eomgen.run.projection import jacobian_of

TURNS = {"theta": 1.0, "theta_dot": 6.0}


def gap(y: Mapping[str, Any], a: float = A) -> NDArray[np.float64]:
    """The distance of the ends of coupler and rocker, m."""
    theta, phi, psi = (np.asarray(y[name]) for name in ("theta", "phi", "psi"))
    x = a * np.cos(theta) + B * np.cos(theta + phi) - D - C * np.cos(psi)
    z = a * np.sin(theta) + B * np.sin(theta + phi) - C * np.sin(psi)
    return np.hypot(x, z)


def test_violations_are_reported() -> None:
    """The residuals after projection are those of the rows, and of the loop's gap in the figure;
    before it they are those of the method's steps.
    """
    run = eomgen.simulate(four_bar(), t_end=2.0, backend="numpy", rtol=1e-7)
    before, after = np.array([*run.trajectory.violations.values()]).T
    assert tuple(run.trajectory.violations) == ("C_x", "C_y")
    loop = run.motion.joints.index("C")
    gaps = gap({name: run[name] for name in run.states})
    np.testing.assert_allclose(run.motion.joint_drift[:, loop], gaps, atol=1e-15)
    assert gaps.max() <= 1.5 * after.max() <= 1e-14
    assert 1e-10 < before.max() < 1e-5


def test_matrix_of_large_mechanisms() -> None:
    """Where a module has no `constraint_jacobian`, it is computed from the rates."""
    module: Any = eomgen.load(eomgen.generate(four_bar()))
    y = module.initial_state()
    rates = SimpleNamespace(**{n: x for n, x in vars(module).items() if n != "constraint_jacobian"})
    np.testing.assert_allclose(
        jacobian_of(rates)(0.0, y), module.constraint_jacobian(0.0, y), atol=1e-15
    )


def test_sizes_of_rows_with_names_of_parameters() -> None:
    """A constraint has the size of its own unit, not of that of a parameter."""
    scene = four_bar()
    named = scene.replace("mass = 1.0", 'mass = "C_x"').replace("1.0*a**2", "C_x*a**2")
    named = named.replace("[parameters]\n", '[parameters]\nC_x = { value = 1.0, unit = "kg" }\n')
    for text in (scene, named):
        projection = as_problem(eomgen.load(eomgen.generate(text))).projection
        assert projection and projection.sizes.tolist() == [B, B]


@pytest.mark.every(2)
@pytest.mark.parametrize("route", ["independent", "aba"])
def test_symmetric_projection_keeps_energy(route: str) -> None:
    """The implicit midpoint rule keeps the energy of a swinging four-bar in a band, and a run back
    ends where it began.
    """
    settings: dict[str, Any] = {"integrator": "implicit_midpoint", "dt": 0.02, "backend": "numpy"}
    run = eomgen.simulate(four_bar(route=route), t_end=16.0, **settings)
    first, last = np.array_split(run.energy - run.energy[0], 2)
    assert np.ptp(first) > 1e-3  # the method's own error, of which the band is made
    assert abs(last.mean() - first.mean()) < 0.02 * np.ptp(first)
    assert np.ptp(last) < 1.02 * np.ptp(first)
    assert gap({name: run[name] for name in run.states}).max() < 1e-12

    there = eomgen.simulate(four_bar(route=route), t_end=0.5, **settings)
    end = {name: float(there[name][-1]) for name in there.states}
    turned = {name: -x if name.endswith("_dot") else x for name, x in end.items()}
    back = eomgen.simulate(four_bar(route=route), t_end=0.5, state=turned, **settings)
    np.testing.assert_allclose(back.y[-1] * [1, 1, 1, -1, -1, -1], there.y[0], atol=1e-11)


@pytest.mark.every(2)
@pytest.mark.parametrize(("method", "order"), [("leapfrog_4", 4), ("leapfrog_6", 6)])
def test_composed_rattle_has_its_order(method: str, order: int) -> None:
    """Against DOP853 at its tightest, and back to where it came from."""
    run = eomgen.simulate(four_bar(), state=TURNS, t_end=0.32, rtol=1e-13)
    names, true = run.states, run.y[-1]
    ends = []
    for dt in (0.016, 0.008):
        settings: dict[str, Any] = {"integrator": method, "dt": dt, "backend": "numpy"}
        ends.append(eomgen.simulate(four_bar(), state=TURNS, t_end=0.32, **settings).y[-1])
    first, last = (float(np.abs(end - true).max()) for end in ends)
    assert abs(np.log2(first / last) - order) < 0.5
    turned = dict(zip(names, ends[1] * [1, 1, 1, -1, -1, -1], strict=True))
    back = eomgen.simulate(four_bar(), state=turned, t_end=0.32, **settings)
    assert back.y[-1][0] == pytest.approx(1.0, abs=1e-11)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["leapfrog", "leapfrog_4", "leapfrog_6"])
def test_rattle_takes_all_coordinates(method: str) -> None:
    """Where other methods have the independent ones as their state."""
    scene = four_bar(loops="auto")
    assert len(eomgen.simulate(scene, t_end=0.01, integrator="rk4", dt=0.01).states) == 2
    assert len(eomgen.simulate(scene, t_end=0.01, integrator=method, dt=0.01).states) == 6


def test_given_states_are_kept_and_the_others_found() -> None:
    """Coordinates and velocities that are given stay; other parameters are assembled too."""
    run = eomgen.simulate(four_bar(), state={"psi_deg": -90, "theta_dot": 2.0}, t_end=0.01)
    first = {name: run[name][0] for name in run.states}
    assert first["psi"] == np.radians(-90) and first["theta_dot"] == 2.0
    assert gap(first) < 1e-14
    later = {name: first[name] + 1e-4 * first[f"{name}_dot"] for name in ("theta", "phi", "psi")}
    assert gap(later) < 1e-6  # the velocities keep the loop closed

    longer = eomgen.simulate(four_bar(), parameters={"a": 0.25}, t_end=0.01)
    first = {name: longer[name][0] for name in longer.states}
    assert first["theta"] == 0.3 and gap(first, 0.25) < 1e-14

    with pytest.raises(SceneError, match=r"with theta, psi as given.*open by .* m"):
        eomgen.simulate(four_bar(), state={"theta": 0.3, "psi": 0.2}, t_end=0.01)


def test_guess_chooses_the_branch(capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    """The two ways to close a four-bar, by start values; `check --assemble` tells them apart."""
    signs = []
    for guess in (1.3, -2.0):
        text = four_bar(initial=f"q = {{ theta = 1.0 }}\nguess = {{ psi = {guess} }}")
        path = tmp_path / "four_bar.toml"
        path.write_text(text)
        assert main(["check", str(path), "--assemble"]) == 0
        said = capsys.readouterr().out
        assert "given: theta = 1 rad" in said and "1 degree of freedom" in said
        signs.append(said.partition("branch      ")[2][0])
        model = check(text)
        psi = dict(zip((c.name for c in model.coordinates), model.initial_q, strict=True))["psi"]
        assert abs(psi - guess) < 0.5
    assert set(signs) == {"+", "-"}
    with pytest.raises(SceneError, match=r"initial\.guess\.theta: initial\.q gives it"):
        check(four_bar(initial="q = { theta = 1.0 }\nguess = { theta = 0.1 }"))


def test_linearised_on_the_constraints() -> None:
    """A and B are those of the motion as a function of the crank's angle and rate alone; at an
    equilibrium no small change of the angle changes the potential energy.
    """
    push = '[[effects]]\ntype = "motor"\nname = "push"\njoint = "A"\ntorque = "input"\n'
    text = four_bar(initial="q = { theta = 1.0 }\nv = { theta_dot = 3.0 }", effects=push)
    found = eomgen.linearise(text, at="initial").reduced()
    assert found.state_names == ("theta", "theta_dot")
    model, module = check(text), eomgen.load(eomgen.generate(text))

    def acceleration(theta: float, rate: float, torque: float = 0.0) -> float:
        q, v = (theta, *model.initial_q[1:]), (rate, *model.initial_v[1:])
        q, v, _ = closed_start(model, q, v, ("theta", "theta_dot"))
        return float(module.derivative(0.0, np.array([*q, *v]), None, [torque])[3])

    h = 1e-4
    expected = [
        (acceleration(1.0 + h, 3.0) - acceleration(1.0 - h, 3.0)) / (2 * h),
        (acceleration(1.0, 3.0 + h) - acceleration(1.0, 3.0 - h)) / (2 * h),
    ]
    np.testing.assert_allclose(found.A, [[0.0, 1.0], expected], rtol=1e-6, atol=1e-9)
    torque = (acceleration(1.0, 3.0, h) - acceleration(1.0, 3.0, -h)) / (2 * h)
    np.testing.assert_allclose(found.B, [[0.0], [torque]], rtol=1e-6, atol=1e-12)

    rest = eomgen.linearise(text, at="rest")
    assert gap(dict(zip(rest.state_names, rest.y, strict=True))) < 1e-13
    assert np.abs(rest.rates).max() < 1e-9
    assert rest.stability == "marginal" and rest.modes[0].angular_frequency > 1.0


def test_impacts_keep_energy_and_constraints() -> None:
    """A rigid stop with restitution 1 reverses the crank's rate, and nothing opens the loop; a
    plastic one takes energy.
    """
    stop = '[[effects]]\ntype = "joint_stop"\nname = "stop"\njoint = "A"\nlow = 0.0\n'
    text = four_bar(effects=f"{stop}restitution = 1.0\n")
    for restitution in (1.0, 0.0):
        bounce = {"stop_restitution": restitution}
        run = eomgen.simulate(text, t_end=1.0, rtol=1e-11, parameters=bounce, backend="numpy")
        assert run.finished and run.trajectory.counts["impacts"] >= 1
        assert gap({name: run[name] for name in run.states}).max() < 1e-13
        hit = int(np.flatnonzero(run.trajectory.struck)[0])
        before, after = run["theta_dot"][hit - 1], run["theta_dot"][hit]
        assert before < -0.5
        np.testing.assert_allclose(after, -restitution * before, atol=1e-9)
        change = run.energy[hit - 1] - run.energy[hit]
        assert abs(change) < 1e-9 if restitution else change > 0.1
        assert abs(run.energy[hit - 1] - run.energy[0]) < 1e-8


def test_a_driven_crank_moves_the_loop() -> None:
    """With a driven crank a four-bar has no freedom left; a constraint more is refused in one line.
    With a rod in place of the last pin it has a freedom, and the rod keeps its length.
    """
    drive = '[[effects]]\ntype = "driven"\nname = "motor"\njoint = "A"\ncoordinate = "1 + 2*t"\n'
    more = '[[constraints]]\ntype = "coupling"\nname = "more"\ncoordinate = "phi"\nequals = "{}"\n'
    phi = check(four_bar(initial="q = {}", effects=drive)).initial_q[0]
    with pytest.raises(SceneError, match=r"cannot be met while theta moves on: the loops hold"):
        check(four_bar(initial="q = {}", effects=drive + more.format(phi)))
    slack = '[[constraints]]\ntype = "distance"\nname = "rod"\nbody_1 = "coupler"\n'
    slack += 'at_1 = ["b/2", 0]\nbody_2 = "rocker"\nat_2 = ["c/2", 0]\nlength = 0.2\n'
    text = four_bar(initial="q = {}", effects=drive + slack)
    pin = text.index('[[joints]]\nname = "C"')
    text = text[:pin] + text[text.index("[[effects]]") :]
    run = eomgen.simulate(text, t_end=1.0)
    assert run.finished
    y = {name: run[name] for name in run.states} | {"theta": 1 + 2 * run.t}
    assert np.abs(gap(y) - 0.2).max() < 1e-13


START = "q = { theta = 1.0, psi = 1.0, phi = -1.0 }\nv = { theta_dot = 6.0 }"
DEAD = {"theta": 0.2, "theta_dot": 3.0}
PARALLELOGRAM = (0.5, 0.7, 0.5, 0.7)
SETTINGS: tuple[dict[str, Any], ...] = ({"integrator": "DOP853"}, {"integrator": "rk4", "dt": 0.01})


@pytest.mark.every(4)
@pytest.mark.parametrize("route", ["independent", "aba", "orthogonal"])
@pytest.mark.parametrize("settings", [*SETTINGS, {"integrator": "leapfrog", "dt": 0.005}])
def test_change_points_are_passed(route: str, settings: dict[str, Any]) -> None:
    """A parallelogram goes twice through where all bars are in line, and stays one;
    `campaigns/change_points.py` shows it for a hundred turns, and for chains.
    """
    run = eomgen.simulate(
        four_bar(PARALLELOGRAM, START, route=route), t_end=1.0, backend="numpy", **settings
    )
    assert run.finished and run["theta"][-1] > 2.5 * np.pi
    assert "2 change points at t = 0.34" in run.message
    assert np.abs(run["theta"] - run["psi"]).max() < 1e-12
    assert max(after for _, after in run.trajectory.violations.values()) < 1e-14
    loose = {"DOP853": 1e-6, "rk4": 1e-5, "leapfrog": 0.05}
    assert np.ptp(run.energy) < loose[settings["integrator"]]


@pytest.mark.every(2)
@pytest.mark.parametrize("longer", [1e-3, -1e-5, 1e-7])
def test_near_change_points_nothing_jumps(longer: float) -> None:
    """Where the bars of a four-bar come nearly into line, no change point is passed: the motion is
    continuous, and the other way of closing the loop is not taken.
    """
    scene = four_bar((0.5, 0.7, 0.5, 0.7 + longer), START, route="aba")
    run = eomgen.simulate(scene, t_end=1.0, samples=20_001, backend="numpy")
    assert "went through" not in run.message
    assert np.ptp(run.energy) < 1e-5
    steps = np.diff(run["psi"]) - np.diff(run.t) * (run["psi_dot"][1:] + run["psi_dot"][:-1]) / 2
    assert np.abs(steps).max() < 1e-3


def test_change_points_where_the_motion_is_not_determined() -> None:
    """At rest nothing leads on, and none is found where there is none."""
    module = eomgen.load(eomgen.generate(four_bar(route="aba")))
    for bars, initial in (
        (PARALLELOGRAM, "q = { theta = 3.0, psi = 3.0, phi = -3.0 }"),
        ((0.5, 0.7, 0.5, 0.7 + 1e-8), START.replace("1.0", "3.0")),
        ((A, B, C, D), "q = { theta = 0.2 }\nv = { theta_dot = 3.0 }"),
    ):
        model = check(four_bar(bars, initial))
        problem = as_problem(module, lengths(*bars))
        start = np.array([*model.initial_q, *model.initial_v])
        assert crossing(problem, 0.0, start) is None


@pytest.mark.every(3)
@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize(("route", "loops"), [("independent", "projected"), ("aba", "closed")])
def test_dead_points_change_coordinates(route: Any, loops: str, settings: dict[str, Any]) -> None:
    """At a dead point of the crank, which was taken as independent, a run goes on with all
    coordinates: it is that of a route that takes none. A run that continues an earlier one has the
    coordinates of that.
    """
    bars = {"a": 0.5, "b": 0.3, "c": 0.3}
    given: dict[str, Any] = {"parameters": bars, "state": DEAD, "backend": "numpy", **settings}
    dead, all_of_them = four_bar(route=route, loops=loops), four_bar(route="aba")
    run, other = (eomgen.simulate(text, t_end=1.0, **given) for text in (dead, all_of_them))
    assert run.finished and "taken as independent" in run.warnings[-1]
    assert len(run.states) == 6
    assert all(text.startswith("state: to meet the constraints") for text in other.warnings)
    np.testing.assert_allclose(run.y[-1], other.y[-1], atol=1e-4)
    begun = eomgen.simulate(dead, t_end=0.4, **given)
    del given["state"]
    longer = eomgen.simulate(dead, t_end=1.0, resume=begun, **given)
    assert longer.states == begun.states
    assert longer.finished


def test_runs_of_sweeps_say_what_has_a_dead_point() -> None:
    """They keep their coordinates; that the mechanism is singular would be wrong."""
    found = eomgen.ensemble(
        four_bar(route="independent"),
        {"a": [0.5], **{name: [value] for name, value in DEAD.items()}},
        parameters={"b": 0.3, "c": 0.3},
        t_end=1.0,
        backend="numpy",
    )
    assert "taken as independent is at a dead point" in found.messages[0]
    assert "mechanism is singular" not in found.messages[0]


def test_margins_that_stay_away_from_0() -> None:
    """A margin that comes to 0 does so with a slope, wherever it lies between the samples; one with
    a smooth minimum above 0 is told from it once samples are near.
    """
    times = np.linspace(0.0, 1.0, 5)
    for zero in np.linspace(0.26, 0.74, 20):
        margins = np.abs(times - zero) * (1.0 + 0.3 * times)
        assert not stays_away(float(margins.min()), times, margins)
    for width, away in ((2.0, False), (0.05, True)):
        near = width * (times - 0.4)
        smooth = 0.01 + near**2
        assert stays_away(float(smooth.min()), near, smooth) == away


def test_sweeps_close_each_member() -> None:
    """Members with other parameters are assembled; multistep methods are refused."""
    cranks = [0.25, 0.3]
    found = eomgen.ensemble(four_bar(), {"a": cranks}, t_end=0.2, backend="numpy")
    assert [*found.status] == ["finished"] * 2
    for y, a in zip(found.final, cranks, strict=True):
        assert gap(dict(zip(found.states, y, strict=True)), a) < 1e-13
    with pytest.raises(RunError, match="continues from earlier steps"):
        eomgen.simulate(four_bar(), integrator="BDF", t_end=0.1)


@pytest.mark.every(2)
@pytest.mark.parametrize("loops", ["projected", "closed"])
@pytest.mark.parametrize("rate", ["", "_dot"])
def test_given_starts_are_kept_or_refused(loops: str, rate: str) -> None:
    """A start that gives all coordinates, or all velocities, is not replaced by another: one that
    meets the constraints but for its rounding is taken, all others are refused. So it is with all
    that take a start; what had to move beside is said.
    """
    text = four_bar(loops=loops)
    model = check(text)
    names, values = model.coordinates, model.initial_q
    if rate:
        own = eomgen.simulate(text, t_end=0.01, state={"theta_dot": 1.0}, backend="numpy")
        names, values = model.velocities, own.model.initial_v
        assert any("phi_dot = " in text for text in own.warnings)
    rounded = {c.name: float(f"{x:.6g}") for c, x in zip(names, values, strict=True)}
    run = eomgen.simulate(text, t_end=0.01, state=rounded, backend="numpy")
    theta = run[f"theta{rate}"][0]
    assert abs(theta - rounded[f"theta{rate}"]) < 1e-5 and run.finished
    wrong = {**rounded, f"phi{rate}": rounded[f"phi{rate}"] + 0.3}
    said = rf"theta{rate}, .* do not meet .*: \w+ would be moved by 0\.\d+ rad"
    with pytest.raises(SceneError, match=rf"^state: .*{said}"):
        eomgen.simulate(text, t_end=0.01, state=wrong)
    with pytest.raises(SceneError, match=said):
        eomgen.linearise(text, at="initial", state=wrong)
    if loops == "projected":
        both = {name: [rounded[name], wrong[name]] for name in wrong}
        runs = eomgen.ensemble(text, both, t_end=0.01, backend="numpy")
        assert runs.status == ["finished", "refused"]
        assert re.search(rf"^vary: .*{said}", runs.messages[1])


def test_starts_of_scenes_that_had_to_move_are_told() -> None:
    """A scene that gives all coordinates is moved onto its constraints at other lengths, and each
    run says so: a single one, and that of a sweep.
    """
    model = check(four_bar())
    q = ", ".join(
        f"{c.name} = {x!r}" for c, x in zip(model.coordinates, model.initial_q, strict=True)
    )
    text, said = four_bar(initial=f"q = {{ {q} }}"), "initial.q: moved to meet the constraints, by"
    run = eomgen.simulate(text, t_end=0.01, parameters={"a": 0.31}, backend="numpy")
    assert any(text.startswith(said) for text in run.warnings)
    assert not eomgen.simulate(text, t_end=0.01, backend="numpy").warnings
    runs = eomgen.ensemble(text, {"a": [0.3, 0.31]}, t_end=0.01, backend="numpy")
    assert runs.messages[0] == "" and runs.messages[1].startswith(said)
    assert runs.status == ["finished", "finished"]


@pytest.mark.every(2)
@pytest.mark.parametrize(("equals", "end"), [("asin(u)", 1.0), ("sqrt(u)", 0.0)])
@pytest.mark.parametrize("loops", ["auto", "projected"])
def test_formulas_of_limited_domain_in_constraints(equals: str, end: float, loops: str) -> None:
    """What the search along the motion meets beyond the domain is no place of the mechanism; a run
    towards its end stops there in a sentence.
    """
    text = f"""
name = "limited"
loops = "{loops}"
bodies = [
    {{ name = "a", mass = 1.0, inertia_com = 0.1 }},
    {{ name = "b", mass = 1.0, inertia_com = 0.1 }},
]
joints = [
    {{ name = "p", type = "revolute", parent = "world", child = "a", coordinate = "u" }},
    {{ name = "q", type = "revolute", parent = "world", child = "b", coordinate = "w" }},
]
constraints = [{{ type = "coupling", name = "g", coordinate = "w", equals = "{equals}" }}]
initial = {{ q = {{ u = 0.7 }} }}
"""
    assert eomgen.simulate(text, t_end=0.1, backend="numpy").finished
    push = {"u_dot": 2.0 if end > 0.7 else -2.0}
    run = eomgen.simulate(text, t_end=9.0, state=push, backend="numpy")
    assert not run.finished and abs(run["u"][-1] - end) < 1e-3
