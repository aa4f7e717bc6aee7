"""Live runs of pages, in node, have the bits of the same runs in Python.

The last digits of functions of the mathematical library differ by language: here all of them are
replaced by others, the same in both. So is the derivative: the page's, of whose program a module is
printed, too.
"""

from typing import Any

import numpy as np
import other_functions
import pytest
from campaign import some
from live import NODE, run_in_node

from eomgen.api.given import model_of, read
from eomgen.codegen.live import live_system
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import parse_scene
from eomgen.show.live import live_table
from eomgen.store import live_code

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed")

EXPLICIT = {
    **dict.fromkeys(("euler", "semi_implicit_euler"), 0.001),
    **dict.fromkeys(("rk4", "leapfrog", "leapfrog_4", "leapfrog_6"), 0.005),
}
IMPLICIT = {"implicit_midpoint": 0.005, "gauss_4": 0.01, "gauss_6": 0.02}
"""The methods of pages with equal steps, and the lengths of these, s."""

CORNERS = """
name = "wheel"
parameters = { k = 400.0 }
bodies = [{ name = "disc", mass = 1.0, inertia_com = 0.4 }]
[[joints]]
name = "axle"
type = "revolute"
parent = "world"
child = "disc"
coordinate = "q"
[[effects]]
type = "motor"
name = "cam"
joint = "axle"
torque = "-3*step(cos(5*q) - cos(pi/40))"
[[effects]]
type = "motor"
name = "stops"
joint = "axle"
torque = "-k*max(0, q - 9) + k*max(0, -4 - q)"
[[effects]]
type = "joint_friction"
name = "friction"
joint = "axle"
viscous = 0.02
coulomb = 0.1
speed = 0.01
[initial]
q = { q = 0.3 }
v = { q_dot = 5.0 }
"""
"""A wheel between springy stops, that a narrow cam brakes; long steps would pass over it."""
BY_TOLERANCE = """
const rows = [];
const engine = makeEngine(mechanism, given.data);
engine.onSample = (t, y) => rows.push([t, ...y]);
engine.advance(given.seconds);
return { rows, error: engine.error, method: engine.method };
"""
ADVANCE = """
const engine = makeEngine(mechanism, given.data);
if (!engine.methods.some((m) => m.name === given.method)) return null;
engine.setMethod(given.method, given.dt);
engine.reset(Float64Array.from(given.y));
engine.advance(given.seconds);
const loops = Boolean(mechanism.projectPosition);
return { t: engine.t, y: Array.from(engine.y), error: engine.error, loops };
"""


def both_runs(name: str, method: str, dt: float, seconds: float) -> tuple[Any, Any]:
    """The end of the page's run and the run in Python."""
    scene = read(name).replaced(loops="projected")
    model = model_of(scene, name)
    code = live_code(model)
    problem = as_problem(
        load_module(other_functions.with_others(python_module(live_system(model).system)))
    )
    given = {
        "data": live_table(model, code, scene.simulation),
        "method": method,
        "dt": dt,
        "seconds": seconds,
        "y": problem.initial.tolist(),
    }
    found = run_in_node(other_functions.in_javascript() + code.source, ADVANCE, given)
    if found is None:
        pytest.skip("the page does not offer it here")
    return found, integrate(problem, method, seconds, dt=dt, unstable=True)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", EXPLICIT)
@pytest.mark.parametrize(
    "name", some(["bouncing_two_body", "four_bar", "pendulum"], built_in_names())
)
def test_the_same_bits(name: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time and state at the end, or that both fail."""
    # Whether it may take the steps it checks by a Jacobian, which this module does not have.
    monkeypatch.setattr("eomgen.run.integrators.leapfrog._check", lambda *given: None)
    found, run = both_runs(name, method, EXPLICIT[method], some(0.5, 2.0))
    assert found["t"] == run.t[-1] or found["error"]
    if run.finished:
        assert found["error"] is None
        assert np.array_equal(np.array(found["y"]), run.y[-1])


@pytest.mark.parametrize("method", IMPLICIT)
@pytest.mark.parametrize("name", some(["bouncing_two_body", "spinning_top"], built_in_names()))
def test_implicit_methods(name: str, method: str) -> None:
    """The same to 1e-12 of the largest state: the page keeps factors of a Jacobian by differences,
    and so its iterations end elsewhere within roundoff. No longer than motions are not chaotic.
    """
    found, run = both_runs(name, method, IMPLICIT[method], 0.5)
    if found["loops"]:
        pytest.skip("pages project at the ends of steps alone")
    if run.finished:
        assert found["error"] is None and found["t"] == run.t[-1]
        y = run.y[-1]
        np.testing.assert_allclose(found["y"], y, rtol=1e-12, atol=1e-12 * np.abs(y).max())


def test_dop853_passes_over_no_corner() -> None:
    """The states at the page's marks are those of Python's steps, which are repeated where they
    have passed over a cam, a stop or a jump of friction.
    """
    scene = parse_scene(CORNERS)
    model = elaborate(scene)
    code = live_code(model)
    module = load_module(other_functions.with_others(python_module(live_system(model).system)))
    table = live_table(model, code, scene.simulation)
    given = {"data": {**table, "liveMethod": "DOP853", "liveStep": 0.5}, "seconds": 10.0}
    found = run_in_node(other_functions.in_javascript() + code.source, BY_TOLERANCE, given)
    assert found["error"] is None and found["method"] == "DOP853"
    # The end of a run shortens its last steps.
    options = {"rtol": 1e-9, "atol": 1e-12}
    run = integrate(as_problem(module), "DOP853", 20.0, samples=41, **options)
    rows = np.array(found["rows"])
    assert run.counts["cut"] > 5
    assert rows[:, 0].tolist() == run.t[1:21].tolist()
    assert np.array_equal(rows[:, 1:], run.y[1:21])
