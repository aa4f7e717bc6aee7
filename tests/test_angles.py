"""Angles with units, and orientations as angles, quaternions, matrices and formulas."""

import math

import numpy as np
import pytest

import eomgen
from eomgen.cli import main
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


def test_an_orientation_of_parameters_is_fixed() -> None:
    """It has the parameters' values, and a module refuses others instead of ignoring them."""
    text = arm('orientation = ["2*tilt", 0, "30 deg"]')
    turned = rotation('orientation = ["2*tilt", 0, "30 deg"]')
    assert np.abs(turned - rotation("orientation = [0.6, 0, 0.5235987755982988]")).max() < 1e-15
    module = eomgen.load(eomgen.generate(text))
    y = module.initial_state()
    assert np.isfinite(module.derivative(0.0, y, {"k": 3.0})).all()
    with pytest.raises(ValueError, match=r"parameters tilt: joints\[0\].orientation: a fixed"):
        module.derivative(0.0, y, {"tilt": 0.4})
    with pytest.raises(eomgen.EomgenError, match="generate again"):
        eomgen.simulate(text, parameters={"tilt": 0.4}, t_end=0.1)


def test_angles_have_units_wherever_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """Initial and locked coordinates, limits, rest angles, `--state`."""
    model = eomgen.check(arm('limits = ["-90 deg", "1.5 rad"]', '"30 deg"', '"-20 deg"'))
    assert model.defaults["spring_rest"] == math.radians(30)
    assert model.initial_q == (math.radians(-20),)
    assert model.bodies[0].joint.limits == (-math.pi / 2, 1.5)
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
