"""What is said and written in passing: hints, refusals, times, files."""

import re
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest
from scenes import refusal

from eomgen.base.errors import RunError, SceneError, nearest
from eomgen.model.elaborate import elaborate
from eomgen.pipeline import compile_program
from eomgen.program.program import cost
from eomgen.run.integrators import find_integrator
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.study.cost.bill import difference
from eomgen.tables.outputs import OUTPUTS

ROOT = Path(__file__).parent.parent.parent
POLE = """
name = "pole"
outputs = ["all"]
bodies = [{ name = "rod", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "pivot", type = "revolute", parent = "world", child = "rod", r_child = [-0.5, 0] }]
effects = [{ type = "gravity", g = 9.81 }]
"""  # noqa: E501


@pytest.mark.parametrize(("given", "meant"), [("rk45", "RK45"), ("RK4", "rk4"), ("radau", "Radau")])
def test_letters_small_or_capital_are_no_difference(given: str, meant: str) -> None:
    with pytest.raises(RunError, match=re.escape(f"'{given}' (did you mean '{meant}'?)")):
        find_integrator(given)
    assert nearest("xyz", ["abc"]) == ""


def test_all_outputs_in_a_list() -> None:
    """["all"] is "all"; beside others it is none."""
    model = elaborate(parse_scene(POLE))
    assert len(model.outputs) > 15 and set(model.outputs) < set(OUTPUTS)
    with pytest.raises(SceneError, match=r"outputs\[1\]: unknown value 'all'"):
        parse_scene(POLE.replace('["all"]', '["momentum", "all"]'))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"revolute", parent = "world"', '"free"', "effects[1].joint: 'pivot' is a free joint, "
         "which 'motor' does not act on; name a joint that moves and is not free"),
        ('child = "rod"', 'child = "world"', "joints[0].child: 'world' is the ground, which has "
         "no parent; name it as the parent, or give the joint loop = true if it closes a loop"),
        ("g = 9.81 }", 'g = 9.81, direction = [1, -1] }', "form: 'redundant' needs the closed "
         "form, and in momenta it takes no 'gravity' that it does not write out ('gravity'); leave "
         "it out"),
    ],
)  # fmt: skip
def test_refusals_say_what_is_wrong(old: str, new: str, message: str) -> None:
    form = "redundant" if "redundant" in message else "velocity"
    text = POLE.replace(old, new).replace('name = "pole"', f'name = "pole"\nform = "{form}"')
    if "motor" in message:
        text = text.replace(", r_child = [-0.5, 0]", "").replace(
            "9.81 }", '9.81 }, { type = "motor", name = "drive", joint = "pivot", torque = 1 }'
        )
    assert refusal(lambda: compile_program(elaborate(parse_scene(text)))) == message


def test_times_within_their_spread_are_no_times() -> None:
    """Of two times of one call on a busy machine the difference may be anything, -1 µs too."""
    assert difference(-1e-6, 1.2e-6) == "< 1.2"
    assert difference(3e-6, 1e-6) == "3.0"
    assert difference(-3e-6, 1e-6) == "-3.0"  # a drive takes states away
    assert difference(0.0, 0.0) == difference(-1e-8, 0.0) == "< 0.1"


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["tumbling_body", "pendulum", "furuta_pendulum"])
def test_routes_are_counted_alike(name: str) -> None:
    """The operations reported for a route are those that its module takes, where closed is
    tried.
    """
    model = replace(elaborate(read_scene(name)), route="auto")
    counts = {c.route: c.operations for c in compile_program(model, jacobian=False).candidates}
    for route in (route for route, count in counts.items() if count is not None):
        system = compile_program(replace(model, route=route), jacobian=False).system
        assert counts[route] == cost(system.program, "derivative")["total"], route
    assert counts["closed"] and counts["aba"]


def test_the_licence_is_packaged() -> None:
    """What is installed holds its own text beside those of what is vendored."""
    own = metadata.distribution("eomgen")
    (name,) = [file for file in own.files or () if file.match("*.dist-info/licenses/LICENSE")]
    assert own.metadata["License-Expression"] == "MIT AND BSD-2-Clause"
    assert Path(own.locate_file(name)).read_bytes() == (ROOT / "LICENSE").read_bytes()
