"""Live runs of pages, in node, have the bits of the same runs in Python.

The last digits of functions of the mathematical library differ by language: here all of them are
replaced by others, the same in both. So is the derivative: the page's, of whose program a module is
printed, too.
"""

import numpy as np
import other_functions
import pytest
from campaign import some
from live import NODE, run_in_node

from eomgen.api.given import model_of, read
from eomgen.codegen.live import live_system
from eomgen.pipeline import python_module
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.built_in import built_in_names
from eomgen.show.live import live_table
from eomgen.store import live_code

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed")

METHODS = {"euler": 0.001, "semi_implicit_euler": 0.001, "rk4": 0.005, "leapfrog": 0.005}
"""The methods of pages with equal steps, and the lengths of these, s."""

ADVANCE = """
const engine = makeEngine(mechanism, given.data);
if (!engine.methods.some((m) => m.name === given.method)) return null;
engine.setMethod(given.method, given.dt);
engine.reset(Float64Array.from(given.y));
engine.advance(given.seconds);
return { t: engine.t, y: Array.from(engine.y), error: engine.error };
"""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", some(["bouncing_two_body", "four_bar"], built_in_names()))
def test_the_same_bits(name: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time and state at the end, or that both fail."""
    # Whether it may take the steps it checks by a Jacobian, which this module does not have.
    monkeypatch.setattr("eomgen.run.integrators.leapfrog._check", lambda *given: None)
    scene = read(name).replaced(loops="projected")
    model = model_of(scene, name)
    code, seconds = live_code(model), some(0.5, 2.0)
    problem = as_problem(
        load_module(other_functions.with_others(python_module(live_system(model).system)))
    )
    given = {
        "data": live_table(model, code, scene.simulation),
        "method": method,
        "dt": METHODS[method],
        "seconds": seconds,
        "y": problem.initial.tolist(),
    }
    found = run_in_node(other_functions.in_javascript() + code.source, ADVANCE, given)
    if found is None:
        pytest.skip("the page does not offer it here")
    run = integrate(problem, method, seconds, dt=METHODS[method], unstable=True)
    assert found["t"] == run.t[-1] or found["error"]
    if run.finished:
        assert found["error"] is None
        assert np.array_equal(np.array(found["y"]), run.y[-1])
