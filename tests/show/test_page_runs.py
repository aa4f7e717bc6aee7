"""Live runs of pages, in node, have the bits of the same runs in Python.

The last digits of functions of the mathematical library differ by language: here all of them are
replaced by others, the same in both. So is the derivative: the page's, of whose program a module is
printed, too.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import other_functions
import pytest
from campaign import some
from crank_rocker import STOPPED
from falling_block import BLOCK
from live import NODE, run_in_node
from scenes import effect, lone

import eomgen.engine.taylor
import eomgen.native.taylor
from eomgen.api.given import model_of, read
from eomgen.base.errors import RunError
from eomgen.base.loading import load_source
from eomgen.codegen.interface import interface_of
from eomgen.codegen.live import live_system
from eomgen.engine.differences import differences
from eomgen.engine.methods import METHODS
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.run.problem import Problem
from eomgen.run.trajectory import Trajectory
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import parse_scene
from eomgen.show.live import live_table
from eomgen.store import live_code
from eomgen.tables.integrators import INTEGRATORS

pytestmark = [
    pytest.mark.apart,
    pytest.mark.skipif(NODE is None, reason="node is not installed"),
]

EXPLICIT = {
    **dict.fromkeys(("euler", "semi_implicit_euler"), 0.001),
    "linearly_implicit": 0.005,
    **dict.fromkeys(("rk4", "leapfrog", "leapfrog_4", "leapfrog_6"), 0.005),
}
IMPLICIT = {"implicit_midpoint": 0.005, "gauss_4": 0.01, "gauss_6": 0.02}
EQUAL = {**EXPLICIT, **IMPLICIT}
ADAPTIVE = {"DOP853": 0.01, "taylor": 0.01, "Rodas5P": 0.01}
"""The methods of pages, and the lengths of their steps or those at whose ends rows are, s."""
STIFF = ("human_figure", "ragdoll", "stiff_beam", "walker_motors")
"""Scenes of which 10 s by Rodas5P, with Jacobians by differences, take Python up to an hour."""

CORNERS = lone(
    "revolute",
    effect("motor", name="cam", joint="axle", torque="-3*step(cos(5*q) - cos(pi/40))"),
    effect("motor", name="stops", joint="axle", torque="-k*max(0, q - 9) + k*max(0, -4 - q)"),
    effect("joint_friction", name="friction", joint="axle", viscous=0.02, coulomb=0.1, speed=0.01),
    body="disc",
    on="axle",
    name="wheel",
    parameters={"k": 400.0},
    initial={"q": {"q": 0.3}, "v": {"q_dot": 5.0}},
    inertia_com=0.4,
    coordinate="q",
)
"""A wheel between springy stops, that a narrow cam brakes; long steps would pass over it."""
TIMES = """
name = "disc"
bodies = [{ name = "disc", mass = 1.0, inertia_com = 0.4 }]
joints = [{ name = "axle", type = "revolute", parent = "world", child = "disc", coordinate = "q" }]
initial = { q = { q = 0.3 }, v = { q_dot = 1.0 } }
[[effects]]
type = "motor"
name = "push"
joint = "axle"
torque = "-2*q + 3*step(1.1 - t) + 2*step(t - 2.3) + step(sin(3*t) - 0.4)"
"""
"""A disc on a spring that is pushed up to a time, from another one on, and again and again."""
RUN = """
const rows = [];
const engine = makeEngine(mechanism, given.data);
engine.onSample = (t, y) => rows.push([t, ...y]);
const loops = Boolean(mechanism.projectPosition);
const names = engine.methods.map((m) => m.name);
if (!names.includes(given.method)) return { names };
engine.setMethod(given.method, given.dt);
engine.reset(Float64Array.from(given.y));
engine.advance(given.seconds);
const { t, y, error, events } = engine;
return { names, rows, t, y: Array.from(y), error, events, loops };
"""


@pytest.fixture(autouse=True)
def other_logarithms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of series and of their steps."""

    def loaded(source: str, name: str) -> Any:
        return load_source(other_functions.with_others(source), name)

    monkeypatch.setattr(eomgen.native.taylor, "load_source", loaded)
    for name in ("exp", "log"):
        monkeypatch.setattr(eomgen.engine.taylor, name, getattr(other_functions, name))


def in_python(model: Model) -> Problem:
    """The problem of a page, whose Jacobian is by differences."""
    system = live_system(model).system
    module = load_module(other_functions.with_others(python_module(system)))
    problem = as_problem(module)
    ny = len(problem.states)

    def jacobian(t: float, y: np.ndarray) -> np.ndarray:
        found = np.empty((ny, ny))
        differences(problem, np.ones(ny), t, y, found)
        return found

    def series() -> Callable[..., np.ndarray]:
        of = interface_of(system)
        return eomgen.native.taylor.plain_series(system.program, of, module, None, None)

    return replace(problem, jacobian=jacobian, series={"taylor": series})


def both_runs(of: str, method: str, dt: float, seconds: float) -> tuple[Any, Trajectory]:
    """The page's run and the one in Python of a scene, with rows at the same times."""
    scene = read(of).replaced(loops="projected")
    model = model_of(scene, of)
    model = replace(model, outputs=(*model.outputs, *INTEGRATORS[method].outputs))
    code, problem = live_code(model, series=method == "taylor"), in_python(model)
    given: dict[str, Any] = {
        "data": live_table(model, code, scene.simulation),
        "method": method,
        "dt": dt,
        "seconds": seconds,
        "y": problem.initial.tolist(),
    }
    if method in ADAPTIVE:  # how long steps may be where their branches are not seen
        given["data"] |= {"span": 1.5 * seconds}
    source = other_functions.in_javascript() + code.source
    found = run_in_node(source, RUN, given, some(300, 3600))
    try:
        if method in ADAPTIVE:  # the end of a run shortens its last steps
            options = {"rtol": 1e-9, "atol": 1e-12, "samples": round(1.5 * seconds / dt) + 1}
            run = integrate(problem, method, 1.5 * seconds, **options)
        else:
            run = integrate(problem, method, seconds, dt=dt, unstable=True)
    except RunError:
        assert method not in found["names"]
        pytest.skip("the method does not suit the scene")
    assert method in found["names"]
    return found, run


def test_every_method_but_scipys_is_printed() -> None:
    """The engine has them all, and pages and units take theirs from its table."""
    own = {name for name, spec in INTEGRATORS.items() if "from_scipy" not in spec.method}
    assert own == set(METHODS) == {*EQUAL, *ADAPTIVE}


@pytest.mark.every(3)
@pytest.mark.parametrize("method", [*EQUAL, *ADAPTIVE])
@pytest.mark.parametrize(
    "name", some(["bouncing_two_body", "four_bar", "pendulum"], built_in_names())
)
def test_the_same_bits(name: str, method: str) -> None:
    """Time and state at the end, or that both fail. On pages implicit steps of trees keep factors,
    so that their iterations end elsewhere within roundoff; and contacts are located between the
    page's own times, so that steps by tolerance are the same up to the first.
    """
    is_short = method in IMPLICIT or (method == "Rodas5P" and name in STIFF)
    seconds = 0.5 if is_short else some(0.5, 10.0)  # no longer than it is not chaotic
    found, run = both_runs(name, method, {**EQUAL, **ADAPTIVE}[method], seconds)
    if method in ADAPTIVE:
        end = min((event.t for event in run.events), default=np.inf)
        rows = np.array([row for row in found["rows"] if row[0] < end])
        assert len(rows) or found["error"]
        for row, t, y in zip(rows, run.t[1:], run.y[1:], strict=False):
            assert row[0] == t and np.array_equal(row[1:], y)
        return
    assert found["t"] == run.t[-1] or found["error"]
    if not run.finished:
        return
    assert found["error"] is None
    if method in IMPLICIT and not found["loops"]:
        y = run.y[-1]
        np.testing.assert_allclose(found["y"], y, rtol=1e-12, atol=1e-12 * np.abs(y).max())
    else:
        assert np.array_equal(np.array(found["y"]), run.y[-1])


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [STOPPED, BLOCK])
def test_contacts_strike_and_are_held(scene: str) -> None:
    """At the same times, with the same speeds, to the same state."""
    found, run = both_runs(scene, "rk4", 0.005, 1.5)
    events = [
        (event["t"], event["contact"], event["kind"], event["speed"]) for event in found["events"]
    ]
    assert events == [(event.t, event.contact, event.kind, event.speed) for event in run.events]
    assert {"impact", "rest"} <= {event.kind for event in run.events}
    assert found["error"] is None and np.array_equal(found["y"], run.y[-1])


@pytest.mark.parametrize("method", ["DOP853", pytest.param("Rodas5P", marks=pytest.mark.full)])
def test_steps_end_where_forces_jump(method: str) -> None:
    """At given times, which both find to the last digit."""
    found, run = both_runs(TIMES, method, 0.0625, 4.0)  # shorter than its steps
    rows = np.array(found["rows"])
    assert rows[:, 0].tolist() == run.t[1:65].tolist()
    assert np.array_equal(rows[:, 1:], run.y[1:65])


def test_dop853_passes_over_no_corner() -> None:
    """The states at the page's marks are those of Python's steps, which are repeated where they
    have passed over a cam, a stop or a jump of friction.
    """
    scene = parse_scene(CORNERS)
    model = elaborate(scene)
    code = live_code(model)
    module = load_module(other_functions.with_others(python_module(live_system(model).system)))
    table = live_table(model, code, scene.simulation)
    given = {"data": table, "method": "DOP853", "dt": 0.5, "seconds": 10.0}
    given |= {"y": module.initial_state().tolist()}
    found = run_in_node(other_functions.in_javascript() + code.source, RUN, given)
    assert found["error"] is None
    # The end of a run shortens its last steps.
    options = {"rtol": 1e-9, "atol": 1e-12}
    run = integrate(as_problem(module), "DOP853", 20.0, samples=41, **options)
    rows = np.array(found["rows"])
    assert run.counts["cut"] > 5
    assert rows[:, 0].tolist() == run.t[1:21].tolist()
    assert np.array_equal(rows[:, 1:], run.y[1:21])
