"""Angles with units, and orientations as angles, quaternions, matrices and formulas."""

import math
import re

import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.commands.main import main
from eomgen.language.conditions import value_of
from eomgen.language.formula import parse
from eomgen.scalars.exact import orientation

ARM = """\
name = "arm"
dimensions = 3
parameters = {{ tilt = 0.3, k = 2.0 }}
bodies = [{{ name = "rod", mass = 1, inertia_com = [1, 1.1, 1.2] }}]
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "rod"
r_child = [0.5, 0.1, 0]
{joint}
[[effects]]
type = "joint_spring"
name = "spring"
joint = "pin"
stiffness = 3.0
rest = {rest}
[initial]
q = {{ pin_angle = {start} }}
"""


def arm(joint: str = "", rest: str = "0.5", start: str = "0.1") -> str:
    """The scene with a joint, a rest angle and an initial angle."""
    return ARM.format(joint=joint, rest=rest, start=start)


def rotation(given: str) -> np.ndarray:
    """The fixed rotation of the scene's joint."""
    joint = eomgen.check(arm(given)).bodies[0].joint
    return np.array(orientation(joint.orientation_deg)).astype(float)


def test_an_orientation_may_be_written_in_several_ways() -> None:
    """Angles in rad and degrees, a quaternion of any length, a matrix: the same rotation."""
    quarter = rotation("orientation_deg = [0, 90, 0]")
    for text in ('[0, "90 deg", 0]', f"[0, {math.pi / 2!r}, 0]", "[2, 0, 2, 0]",
                 "[[0, 0, 1], [0, 1, 0], [-1, 0, 0]]"):  # fmt: skip
        assert rotation(f"orientation = {text}").tolist() == quarter.tolist()
    random = np.random.default_rng(1)
    for _ in range(20):
        q = random.normal(size=4)
        q /= np.linalg.norm(q)
        w, x = q[0], q[1:]
        cross = np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
        true = (w * w - x @ x) * np.eye(3) + 2 * np.outer(x, x) + 2 * w * cross
        assert np.abs(rotation(f"orientation = {(3 * q).tolist()}") - true).max() < 1e-14
        assert np.abs(rotation(f"orientation = {true.tolist()}") - true).max() < 1e-14
        angles = random.uniform(-3, 3, 3)
        degrees = rotation(f"orientation_deg = {np.degrees(angles).tolist()}")
        assert np.abs(rotation(f"orientation = {angles.tolist()}") - degrees).max() < 1e-15


TILTED = """
name = "tilted"
dimensions = {n}
parameters = {{ tilt = 0.3, side = 0.4 }}
bodies = [
    {{ name = "a", mass = 1.5, inertia_com = {inertia} }},
    {{ name = "b", mass = 0.7, inertia_com = {inertia} }},
    {{ name = "c", mass = 0.4, inertia_com = {inertia} }},
]
joints = [
    {{ name = "pin", type = "revolute", parent = "world", child = "a", r_child = {r}, {of_pin} }},
    {{ name = "weld", type = "weld", parent = "a", child = "b", r_parent = {r}, {of_weld} }},
    {{ name = "rail", type = "prismatic", parent = "b", child = "c", axis = {axis}, {of_rail} }},
]
effects = [{{ type = "gravity", g = 9.81 }}]
outputs = ["parameter_jacobian", "joint_forces", "body_poses"]
"""
IN_SPACE = {
    "pin": '["2*tilt", "90 deg", "tilt + 1"]',
    "weld": '["cos(tilt)", "sin(tilt)", "side", 0]',
    "rail": '[["cos(tilt)", "-sin(tilt)", 0], ["sin(tilt)", "cos(tilt)", 0], [0, 0, 1]]',
}
IN_PLANE = {"pin": '"2*tilt"', "weld": '"30 deg"', "rail": '"tilt + side"'}


def tilted(n: int, tilt: float | None = None) -> str:
    """A scene in n dimensions with orientations by formulas, or by their numbers at `tilt`."""

    def number(found: re.Match[str]) -> str:
        if "deg" in found[1]:
            return found[0]
        value = value_of(parse(found[1]), {"tilt": tilt or 0.0, "side": 0.4})
        return repr(value)

    words = {
        f"of_{name}": "orientation = "
        + (text if tilt is None else re.sub('"([^"]*)"', number, text))
        for name, text in (IN_SPACE if n == 3 else IN_PLANE).items()
    }
    return TILTED.format(
        n=n,
        inertia=[0.1, 0.12, 0.15] if n == 3 else 0.1,
        r=[0.1, 0.2, -0.3][:n],
        axis=[0.6, 0.8, 0][:n],
        **words,
    )


@pytest.mark.parametrize("n", some((2,), (2, 3)))
def test_an_orientation_of_parameters_follows_them(n: int) -> None:
    """A module at another value is the one of a scene with the numbers of that value, by every
    route; its derivative with respect to the parameter is that of its values.
    """
    y, p = np.random.default_rng(1).normal(size=4), {"tilt": 0.7}
    fixed = eomgen.load(eomgen.generate(tilted(n, 0.7)))
    for route in some(("aba",), ("closed", "ldl", "aba", "orthogonal")):
        own = eomgen.load(eomgen.generate(tilted(n), route=route))
        for name in ("derivative", "jacobian", "joint_forces", "body_poses"):
            pair = getattr(own, name)(0.0, y, p), getattr(fixed, name)(0.0, y)
            assert np.allclose(*pair, rtol=1e-12, atol=1e-12)
        there, h = own.parameter_jacobian(0.0, y, p)[:, [*own.PARAMETERS].index("tilt")], 1e-6
        near = [own.derivative(0.0, y, {"tilt": 0.7 + x}) for x in (h, -h)]
        assert np.allclose(there, (near[0] - near[1]) / (2 * h), rtol=1e-7, atol=1e-7)
    assert n == 2 or eomgen.verify(tilted(n), states=1).missed == ()


def test_formulas_of_an_orientation_stay_a_rotation() -> None:
    """A module refuses values of parameters for which they are none."""
    module = eomgen.load(eomgen.generate(arm('orientation = ["tilt", "tilt", 0, 0]')))
    with pytest.raises(ValueError, match=r"joints\[0\].orientation: the quaternion has no length"):
        module.derivative(0.0, module.initial_state(), {"tilt": 0.0})
    turned = arm('orientation = [["k/3", 0, 0], [0, 1, 0], [0, 0, 1]]')
    at = r"joints\[0\].orientation: is not a rotation"
    with pytest.raises(eomgen.EomgenError, match=at):
        eomgen.simulate(turned, parameters={"k": 3.001}, t_end=0.1)


def test_angles_have_units_wherever_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """Initial and locked coordinates, limits, rest angles, parameters, `--state`."""
    model = eomgen.check(arm('limits = ["-90 deg", "1.5 rad"]', '"30 deg"', '"-20 deg"'))
    assert model.defaults["spring_rest"] == math.radians(30)
    assert model.initial_q == (math.radians(-20),)
    assert model.bodies[0].joint.limits == (-math.pi / 2, 1.5)
    steep = eomgen.check(
        arm('orientation = [0, "tilt", 0]').replace("tilt = 0.3", 'tilt = "40 deg"')
    )
    assert steep.defaults["tilt"] == math.radians(40)
    held = eomgen.check('locked = { pin_angle = "90 deg" }\n' + TWO)
    assert held.locked_deg == (("pin_angle", 90.0),)
    run = ["linearise", "cart_pole", "--at", "initial", "--state"]
    shown = []
    for state in ("theta=90 deg", "theta_deg=90"):
        assert main([*run, state]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]


TWO = """\
name = "two"
bodies = [
    { name = "a", mass = 1, inertia_com = 1 },
    { name = "b", mass = 1, inertia_com = 1 },
]
joints = [
    { name = "pin", type = "revolute", parent = "world", child = "a" },
    { name = "rail", type = "prismatic", parent = "a", child = "b", axis = [1, 0] },
]
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (arm(rest='"30 kg"'), "effects[0].rest: '30 kg' is not a formula"),
        (arm().replace("mass = 1", 'mass = "3 deg"'), "mass: is an angle; give a number, in kg"),
        (arm(start='"1 m"'), "initial.q.pin_angle: '1 m' is not a number"),
        (TWO + '[initial.q]\nrail_slide = "3 deg"\n', "rail_slide_deg: no coordinate"),
        (TWO.replace("axis = [1, 0]", 'axis = [1, 0], limits = ["1 deg", 2]'), "is not a number"),
        (arm('orientation_deg = [0, 0, 1]\norientation = [0, 0, "1 deg"]'), "is also given"),
        (arm("orientation = 0.3"), "joints[0].orientation: is one angle; space takes 3"),
        (arm("orientation = [0, 0, 0, 0]"), "the quaternion has no length"),
        (arm("orientation = [[1, 0, 0], [0, 1, 0.1], [0, 0, 1]]"), "is not a rotation"),
        (arm("orientation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]"), "is not a rotation"),
        (arm('orientation = ["tild", 0, 0]'), "unknown parameter 'tild' (did you mean 'tilt'?)"),
        (TWO.replace('"a" }', '"a", orientation = [0, 0, 1] }'), "the plane takes one angle"),
    ],
)
def test_what_is_no_angle_is_said(text: str, message: str) -> None:
    """With the location."""
    with pytest.raises(eomgen.SceneError) as error:
        eomgen.check(text)
    assert message in str(error.value)
