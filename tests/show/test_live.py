"""The page's mechanism and engine in node: against the Python module and `simulate`."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from campaign import FULL, some
from live import NODE, run_in_node
from scenes import effect, lone

import eomgen
from eomgen.api.given import model_of, read
from eomgen.language.formula import parse
from eomgen.model.elaborate import elaborate
from eomgen.model.interactive import OUTPUTS, interactive, switches_of
from eomgen.model.model import Model
from eomgen.pipeline import compile_program, python_module
from eomgen.run.module import GeneratedModule, load_module
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import parse_scene
from eomgen.show.live import live_table, velocity_rows
from eomgen.store import LiveCode, live_code

pytestmark = [
    pytest.mark.apart,
    pytest.mark.skipif(NODE is None, reason="node is not installed"),
]

STATES = 1000
SCENES = some(("two_body_forced", "spinning_top", "bouncing_two_body"), built_in_names())
RUNS = [
    ("pendulum", "leapfrog", 0.01),
    ("two_body", "euler", 0.001),
    ("cart_pole", "semi_implicit_euler", 0.002),
    ("spinning_top", "rk4", 0.002),
    ("tumbling_body", "implicit_midpoint", 0.02),
    ("furuta_pendulum", "gauss_4", 0.01),
    ("two_body_forced", "gauss_6", 0.02),
    ("bouncing_two_body", "rk4", 0.01),
    ("four_bar", "rk4", 0.005),
]
"""Scene, method, step in s; these motions are not chaotic within the time."""
TOLERANCE = 1e-9

ENGINE = """
const engine = makeEngine(mechanism, given.data);
const made = engine.advance(given.seconds);
return { t: engine.t, y: Array.from(engine.y), error: engine.error, made, events: engine.events };
"""


def page_of(name: str, **more: Any) -> tuple[LiveCode, dict[str, Any]]:
    """The code of a scene's page, and its data."""
    scene = read(name)
    model = model_of(scene, name)
    code = live_code(model)
    return code, live_table(model, code, scene.simulation) | more


def module_of(model: Model) -> GeneratedModule:
    """The Python module of a model, without Jacobian."""
    system = compile_program(model, jacobian=False, closed=False).system
    return load_module(python_module(system))


def random_states(module: GeneratedModule, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and states (n, ny) around the initial state, quaternions of length 1; of loops
    closed ones, away from singular positions.
    """
    random = np.random.default_rng(7)
    first = module.initial_state()
    spread = np.maximum(0.3, 0.3 * np.abs(first))
    y = first + random.normal(size=(count, len(first))) * spread
    for four in map(list, module.QUATERNIONS):
        y[:, four] = random.normal(size=(count, 4))
        y[:, four] /= np.linalg.norm(y[:, four], axis=1, keepdims=True)
    t = random.uniform(0, 5, count)
    if constraints := getattr(module, "CONSTRAINTS", ()):
        made: Any = module
        nq = len(module.POSITIONS)
        for _ in range(30):
            y[:, :nq] = made.project_position(t, y.T).T
            for four in map(list, module.QUATERNIONS):
                y[:, four] /= np.linalg.norm(y[:, four], axis=1, keepdims=True)
        v = made.project_velocity(t, y.T).T
        y[:, nq : nq + v.shape[1]] = v
        closed = np.abs(made.constraint_residuals(t, y.T)).max(axis=0) < 1e-12
        good = closed & (made.constraint_margins(t, y.T).min(axis=0) > 1e-2)
        assert good.sum() > count / 20, (constraints, good.sum())
        t, y = t[good], y[good]
    return t, y


def in_page(code: LiveCode, name: str, t: Any, y: Any, table: dict[str, Any]) -> np.ndarray:
    """The results of a function of the mechanism at each time and state."""
    script = """
    const list = (x) => (typeof x === "number" ? [x] : Array.from(x));
    return given.y.map((y, i) => list(mechanism[given.name](given.t[i], y, given.p, given.u)));
    """
    given = {
        "name": name,
        "t": t.tolist(),
        "y": y.tolist(),
        "p": [p["value"] for p in table["parameters"]],
        "u": [i["value"] for i in table["inputs"]],
    }
    return np.array(run_in_node(code.source, script, given))


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SCENES)
def test_functions_equal_those_of_the_module(name: str) -> None:
    """Errors of the rates of positions, and of those of the other states, are relative to the
    largest of these rates at the same state; with loops, also to how independent their rows are
    there, since rounding of a row is divided by that.
    """
    scene = read(name).replaced(loops="projected")  # the page has all coordinates as states
    module = module_of(replace(model_of(scene, name), outputs=OUTPUTS))
    code, table = page_of(name)
    t, y = random_states(module, STATES)
    expected = np.array([module.derivative(*pair) for pair in zip(t, y, strict=True)])
    found = in_page(code, "derivative", t, y, table)
    made: Any = module
    if getattr(module, "CONSTRAINTS", ()):
        least = made.constraint_margins(t, y.T).min(axis=0)[:, np.newaxis]
    else:
        least = np.ones((len(t), 1))
    positions = np.isin(np.arange(y.shape[1]), module.POSITIONS)
    for group in (positions, ~positions):
        scale = np.abs(expected[:, group]).max(axis=1, keepdims=True)
        assert (np.abs(found - expected)[:, group] <= 1e-13 * scale / least).all()
    for of, own in (("bodyPoses", "body_poses"), ("kineticEnergy", "kinetic_energy")):
        expected = np.array(
            [getattr(module, own)(*pair) for pair in zip(t[:20], y[:20], strict=True)]
        ).reshape(20, -1)
        found = in_page(code, of, t[:20], y[:20], table)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.every(4)
@pytest.mark.parametrize(("name", "method", "dt"), RUNS)
def test_a_live_run_ends_where_simulate_does(name: str, method: str, dt: float) -> None:
    """Same method, same step; scenes that are not chaotic within the time."""
    seconds = 10.0 if FULL else 3.0 if name == "bouncing_two_body" else 2.0
    code, table = page_of(name, liveMethod=method, liveStep=dt, span=seconds)
    found = run_in_node(code.source, ENGINE, {"data": table, "seconds": seconds})
    explicit = method in ("euler", "leapfrog", "rk4")
    run = eomgen.simulate(
        read(name).replaced(loops="projected"),  # the page has all coordinates as states
        integrator=method,
        dt=dt,
        t_end=seconds,
        form="velocity",
        unstable=explicit,
    )
    assert found["error"] is None and found["t"] == pytest.approx(seconds)
    assert found["made"] == round(seconds / dt)
    expected = run.trajectory.y[-1]
    scale = np.maximum(1.0, np.abs(expected))
    assert np.abs((np.array(found["y"]) - expected) / scale).max() <= TOLERANCE
    kinds = [(event.kind, event.contact) for event in run.trajectory.events]
    assert [(event["kind"], event["contact"]) for event in found["events"]] == kinds


STOP = lone(
    "prismatic",
    effect("external_force", name="push", body="block", force=["-8 + 14*sin(t/2)**2", 0]),
    effect("joint_stop", name="end", joint="rail", low=0.0, restitution=0.4),
    body="block",
    on="rail",
    name="held",
    initial={"q": {"x": 0.2}},
    mass=2.0,
    inertia_com=1.0,
    axis=[1, 0],
    coordinate="x",
)


def test_a_stop_holds_and_lets_go() -> None:
    """It strikes, rests, and is left when the force turns, as in `simulate`."""
    scene = parse_scene(STOP)
    model = elaborate(scene)
    code = live_code(model)
    table = live_table(model, code, scene.simulation)
    table |= {"liveMethod": "implicit_midpoint", "liveStep": 0.01, "span": 5.0}
    found = run_in_node(code.source, ENGINE, {"data": table, "seconds": 5.0})
    expected = eomgen.simulate(scene, integrator="implicit_midpoint", dt=0.01, t_end=5.0).trajectory
    assert found["error"] is None
    np.testing.assert_allclose(found["y"], expected.y[-1], rtol=0, atol=1e-9)
    events = [(event.kind, event.t, event.speed) for event in expected.events]
    assert {"impact", "rest", "lift"} == {kind for kind, _, _ in events}
    assert [e["kind"] for e in found["events"]] == [kind for kind, _, _ in events]
    np.testing.assert_allclose([e["t"] for e in found["events"]], [t for _, t, _ in events])


PUSHED = """
name = "pushed"
dimensions = 3
parameters = { k = 20.0 }
bodies = [
    { name = "hull", mass = 2.0, inertia_com = [0.3, 0.4, 0.5] },
    { name = "arm", mass = 0.5, inertia_com = [0.02, 0.03, 0.04] },
]
[[joints]]
name = "base"
type = "free"
child = "hull"
[[joints]]
name = "elbow"
type = "revolute"
parent = "hull"
child = "arm"
axis = [0, 1, 0]
r_parent = [0.2, 0, 0.1]
r_child = [-0.3, 0, 0]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "external_force"
name = "jet"
body = "arm"
axes = "body"
at = [0.1, 0.05, 0]
force = [1, 2, 3]
[[effects]]
type = "external_torque"
name = "wheel"
body = "hull"
axes = "body"
torque = [0.3, -0.2, 0.5]
[[effects]]
type = "external_torque"
name = "wind"
body = "arm"
torque = [0.1, 0.4, -0.6]
[[effects]]
type = "spring"
name = "cord"
body_1 = "hull"
at_1 = [0, 0.1, 0]
body_2 = "world"
stiffness = "k"
rest_length = 0.2
[[effects]]
type = "joint_spring"
name = "hinge"
joint = "elbow"
stiffness = 3.0
"""
"""A scene whose effects have loads of every kind: at a point or not, in both axes, at a joint."""


def test_a_switched_effect_is_left_out() -> None:
    """Off, each effect has no influence: the derivative and the potential energy are those of the
    scene without it.
    """
    scene = parse_scene(PUSHED)
    model = elaborate(scene)
    code = live_code(model)
    table = live_table(model, code, scene.simulation)
    script = """
    const p = given.data.parameters.map((x) => x.value);
    return given.data.effects.map((effect, k) => {
      const off = p.map((x, i) => (i === effect.switch ? 0 : x));
      return given.y[k].map((y) => [
        ...mechanism.derivative(0, y, off, given.u),
        mechanism.potentialEnergy(0, y, off, given.u),
      ]);
    });
    """
    names = [acting["name"] for acting in table["effects"]]
    less = [replace_effects(scene, name) for name in names]
    modules = [module_of(replace(elaborate(scene), outputs=OUTPUTS)) for scene in less]
    states = [random_states(module, 10)[1] for module in modules]
    given = {"data": table, "y": [y.tolist() for y in states], "u": [0.0] * len(table["inputs"])}
    found = np.array(run_in_node(code.source, script, given))
    for k, (module, own) in enumerate(zip(modules, states, strict=True)):
        expected = [[*module.derivative(0, y), module.potential_energy(0, y)] for y in own]
        np.testing.assert_allclose(found[k], expected, rtol=1e-11, atol=1e-11)
    assert sum(acting["operations"] > 0 for acting in table["effects"]) > 3


def replace_effects(scene: Any, name: str) -> Any:
    """The scene without an effect, in form [q, v]."""
    effects = tuple(e for e in scene.effects if e.name != name)
    return scene.replaced(effects=effects, form="velocity", route="auto")


DRIVEN = PUSHED + effect("driven", name="swing", joint="elbow", coordinate="sin(3*t)")


def test_driven_joints_move_with_time() -> None:
    """They have no switch; derivative and poses depend on time as in the module."""
    scene = parse_scene(DRIVEN)
    model = replace(elaborate(scene), outputs=OUTPUTS)
    code, module = live_code(model), module_of(model)
    table = live_table(model, code, scene.simulation)
    assert [e["name"] for e in table["effects"] if e["switch"] is None] == ["swing"]
    t, y = random_states(module, 20)
    for of, name in (("derivative", "derivative"), ("bodyPoses", "body_poses")):
        own = getattr(module, name)
        expected = np.array([own(a, b) for a, b in zip(t, y, strict=True)]).reshape(20, -1)
        found = in_page(code, of, t, y, table)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_names_of_switches_and_pulls_are_new() -> None:
    """No name of a scene contains two underscores."""
    model = model_of(read("ragdoll"), "ragdoll")
    live = interactive(model)
    old = [x.name for x in (*model.parameters, *model.inputs, *model.coordinates)]
    new = [x.name for x in (*live.parameters, *live.inputs)]
    assert len(set(new)) == len(new) and not any("__" in name for name in old)
    assert set(switches_of(model)) == {e.name for e in model.effects}


def test_loads_have_the_power_of_their_effects() -> None:
    """Σ F·v of the points of application, plus τ·ω, is the power of each effect."""
    scene = parse_scene(PUSHED)
    model = elaborate(scene)
    module: Any = module_of(replace(model, outputs=("effect_powers",)))
    code = live_code(model)
    table = live_table(model, code, scene.simulation)
    t, y = random_states(module, 10)
    loads = in_page(code, "loads", t, y, table).reshape(10, -1, 9)
    poses = in_page(code, "bodyPoses", t, y, table).reshape(10, -1, 3, 4)
    speeds = in_page(code, "bodyVelocities", t, y, table).reshape(10, -1, 6)
    powers = np.array([module.effect_powers(a, b) for a, b in zip(t, y, strict=True)])
    for k, acting in enumerate(table["effects"]):
        total = np.zeros(10)
        for i, load in enumerate(table["loads"]):
            if load["effect"] == acting["name"]:
                body = table["bodies"].index(load["body"])
                point, force, torque = np.split(loads[:, i], 3, axis=1)
                velocity, turning = np.split(speeds[:, body], 2, axis=1)
                velocity = velocity + np.cross(turning, point - poses[:, body, :, 3])
                if acting["type"] == "joint_spring":  # it turns the parent back
                    turning = turning - np.split(speeds[:, body - 1], 2, axis=1)[1]
                total += (force * velocity + torque * turning).sum(axis=1)
        np.testing.assert_allclose(total, powers[:, k], rtol=1e-10, atol=1e-10)


TERMS = """
const terms = makeTerms(mechanism, given.data);
return given.y.map((y, k) => {
  const state = { t: given.t[k], y: Float64Array.from(y), p: given.p, u: given.u };
  const rates = Float64Array.from(mechanism.derivative(state.t, state.y, state.p, state.u));
  const vd = rates.filter((_, k) => given.data.states[k].kind === "velocity");
  return { vd: Array.from(vd), equations: Array.from(vd, (_, i) => terms.at(i, state, rates)) };
});
"""


@pytest.mark.every(3)
@pytest.mark.parametrize("name", ["four_bar", "two_body_forced", "spinning_top"])
def test_terms_of_the_equations_balance(name: str) -> None:
    """Σ M_ij v̇_j is the sum of all other terms, with loops, inputs and a pull on a body; M is the
    module's.
    """
    model = model_of(read(name), name)
    whole = replace(model, outputs=("mass_matrix",), loops_kept="projected")
    module: Any = module_of(whole)
    code, table = page_of(name)
    t, y = random_states(module, 40)
    u = [i["value"] for i in table["inputs"]]
    first = table["pointer"]["first"]
    u[first : first + 3] = [3.0, -2.0, 0.5]
    p = [p["value"] for p in table["parameters"]]
    given = {"data": table, "t": t.tolist(), "y": y.tolist(), "p": p, "u": u}
    found = run_in_node(code.source, TERMS, given, scripts=("terms.js",))
    kinds = set()
    for k, at in enumerate(found):
        vd, M = np.array(at["vd"]), module.mass_matrix(t[k], y[k])
        largest = max(abs(x["value"]) for terms in at["equations"] for x in terms)
        for i, terms in enumerate(at["equations"]):
            left = np.array([x["value"] for x in terms if x["kind"] == "inertia"])
            right = np.array([x["value"] for x in terms if x["kind"] != "inertia"])
            assert abs(left.sum() - right.sum()) <= 1e-12 * largest
            assert np.abs(left - M[i] * vd).max() <= 1e-11 * np.abs(M * vd).max()
            kinds |= {x["kind"] for x in terms if x["value"]}
    assert {"inertia", "velocity", "effect", "pull"} <= kinds
    assert ("constraint" in kinds) == bool(table["constraints"])


@pytest.mark.every(2)
@pytest.mark.parametrize("form", ["momentum", "redundant"])
def test_rows_of_momenta_are_converted(form: Any) -> None:
    """A run in momenta, converted, has the poses and the energy of that run, but for the error of
    its constraints, which the redundant form integrates.
    """
    run = eomgen.simulate("two_body", form=form, t_end=1.0, samples=11)
    trajectory, module = run.trajectory, eomgen.load(run.module)
    rates = module.derivative(trajectory.t, trajectory.y.T).T
    y = velocity_rows(run.model, trajectory.states, trajectory.y, rates)
    code = live_code(run.model)
    table = live_table(run.model, code, read("two_body").simulation)
    poses = in_page(code, "bodyPoses", trajectory.t, y, table)
    np.testing.assert_allclose(poses, run.motion.poses.reshape(len(y), -1), atol=1e-9)
    kinetic = in_page(code, "kineticEnergy", trajectory.t, y, table)[:, 0]
    np.testing.assert_allclose(kinetic, run.motion.kinetic_energy, rtol=1e-9)


def test_geometry_is_evaluated() -> None:
    """Formulas of parameters and time."""
    model = model_of(read("pendulum"), "pendulum")
    length = model.parameters[1].name
    code = live_code(model, (parse(f"2*{length} + t"), parse(f"sin({length})")))
    script = "return Array.from(mechanism.geometry(given.p, 3));"
    values = [p.default for p in interactive(model).parameters]
    expected = [2 * values[1] + 3, np.sin(values[1])]
    assert run_in_node(code.source, script, {"p": values}) == pytest.approx(expected, rel=1e-15)


def test_a_body_is_pulled_and_thrown() -> None:
    """A free body follows the pointer without overshooting, and keeps its speed when released."""
    code, table = page_of("tumbling_body", liveMethod="rk4", liveStep=0.002)
    script = """
    const e = makeEngine(mechanism, given.data);
    const all = (name) => Array.from(mechanism[name](e.t, e.y, e.p, e.u));
    const place = () => all("bodyPoses").filter((_, i) => i % 4 === 3);
    const speed = () => all("bodyVelocities").slice(0, 3);
    const from = place();
    const target = from.map((x, i) => x + given.by[i]);
    e.pull(0, [0, 0, 0], target);
    let most = 0;
    e.onSample = () => { most = Math.max(most, (place()[0] - from[0]) / given.by[0]); };
    e.advance(0.1);
    e.release();
    const [thrown, idle] = [speed(), Array.from(e.u)];
    e.advance(0.1);
    const kept = speed();
    e.pull(0, [0, 0, 0], target);
    e.advance(3);
    return { thrown, kept, idle, most, there: place(), target, error: e.error };
    """
    found = run_in_node(code.source, script, {"data": table, "by": [0.05, -0.02, 0.03]})
    assert found["error"] is None and not any(found["idle"])
    assert np.linalg.norm(found["thrown"]) > 0.1
    np.testing.assert_allclose(found["kept"], found["thrown"], rtol=1e-9)
    np.testing.assert_allclose(found["there"], found["target"], atol=1e-6)


def test_a_pull_has_the_power_of_its_force() -> None:
    """At a point beside the centre of mass: the rate of the kinetic energy is F·v of the point."""
    scene = parse_scene(PUSHED)
    model = elaborate(scene.replaced(effects=()))
    code = live_code(model)
    table = live_table(model, code, scene.simulation)
    y = random_states(module_of(model), 1)[1][0]
    script = """
    const e = makeEngine(mechanism, given.data);
    e.reset(given.y);
    e.pull(1, [0.1, -0.2, 0.3], [1, 2, 3]);
    const { force } = e.grip;
    const rate = Array.from(mechanism.derivative(0, e.y, e.p, e.u));
    const at = (h) => {
      const y = e.y.map((x, k) => x + h * rate[k]);
      e.pull(1, [0.1, -0.2, 0.3], [1, 2, 3]);
      const energy = mechanism.kineticEnergy(0, y, e.p, e.u);
      const pose = mechanism.bodyPoses(0, y, e.p, e.u).slice(12);
      const place = [0, 4, 8].map(
        (r) => pose[r] * 0.1 - pose[r + 1] * 0.2 + pose[r + 2] * 0.3 + pose[r + 3]);
      return { energy, place };
    };
    const [a, b] = [at(-1e-6), at(1e-6)];
    const power = force.reduce((sum, f, i) => sum + f * (b.place[i] - a.place[i]) / 2e-6, 0);
    return { power, rate: (b.energy - a.energy) / 2e-6, error: e.error };
    """
    found = run_in_node(code.source, script, {"data": table, "y": y.tolist()})
    assert found["error"] is None and abs(found["power"]) > 1
    assert found["rate"] == pytest.approx(found["power"], rel=1e-6)


def test_what_fails_is_a_sentence() -> None:
    """Nothing is thrown: neither by a step that is too large nor by a negative mass."""
    code, table = page_of("chain", liveMethod="euler", liveStep=0.02)
    script = """
    const e = makeEngine(mechanism, given.data);
    e.advance(10);
    const [first, t] = [e.error, e.t];
    const more = [e.advance(1), e.step()];
    e.reset();
    e.setMethod("rk4", 0.001);
    const again = e.advance(0.1);
    e.p.fill(-1);
    e.advance(0.1);
    return { first, t, more, again, second: e.error, energy: e.energy() };
    """
    found = run_in_node(code.source, script, {"data": table})
    assert found["first"] == "the state overflows or is not a number: take a smaller step"
    assert 0 < found["t"] < 10 and found["more"] == [0, 0] and found["again"] == 100
    assert found["second"].startswith("mass of link") and "change the parameters" in found["second"]
    assert found["energy"] == {"kinetic": None, "potential": None}


def test_a_stored_page_is_the_derived_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """Equal models give equal bytes, from the store or not; a damaged entry is derived anew."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    model = model_of(read("two_body"), "two_body")
    first = live_code(model)
    (entry,) = (tmp_path / "store").glob("*.entry")
    assert live_code(model) == first
    entry.write_bytes(entry.read_bytes()[:-3])
    assert live_code(model) == first


HARD_PULLS = [("rattleback", 7920), ("four_bar", 261328), ("rattleback", 380113)]
PULLED = """
let seed = given.seed;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
const { size, bodies, dimensions } = given.data;
const point = (far) => [...Array(dimensions)].map(() => (random() - 0.5) * far * size);
const engine = makeEngine(mechanism, given.data);
for (let k = 0; k < 20 && !engine.error; k += 1) {
  engine.pull(Math.floor(random() * bodies.length), point(0.5), point(4));
  engine.advance(0.3);
  if (random() < 0.5) engine.release();
}
return { error: engine.error, t: engine.t, y: Array.from(engine.y) };
"""


@pytest.mark.every(2)
@pytest.mark.parametrize(("name", "seed"), HARD_PULLS)
def test_hard_pulls_do_not_end_the_page(name: str, seed: int) -> None:
    """Where steps become unstable or loops do not move on, it goes back to before that."""
    code, table = page_of(name)
    found = run_in_node(code.source, PULLED, {"data": table, "seed": seed})
    assert found["error"] is None and found["t"] > 5.9
    assert np.abs(found["y"]).max() < 1e4
