"""Units and words of what acts at a joint: those of a hinge at a hinge, of a slide at a slide."""

import json

import pytest

from eomgen.base.errors import SceneError
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.scene.json_schema import json_schema
from eomgen.scene.reader import parse_scene

EFFECTS = """\
name = "cart"
bodies = [
    { name = "cart", mass = 2.0, inertia_com = 1.0 },
    { name = "pole", mass = 1.0, inertia_com = 1.0 },
]
joints = [
    { name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] },
    { name = "pin", type = "revolute", parent = "cart", child = "pole", r_child = [0, 1] },
]
effects = [
    { type = "motor", name = "drive", joint = "JOINT", torque = "input" },
    { type = "motor", name = "push", joint = "JOINT", torque = 1.0 },
    { type = "joint_spring", name = "spring", joint = "JOINT", stiffness = 1.0, damping = 1.0, \
rest = 1.0 },
    { type = "joint_stop", name = "stop", joint = "JOINT", low = 1.0, high = 2.0, stiffness = 1.0, \
damping = 1.0 },
    { type = "joint_friction", name = "rub", joint = "JOINT", viscous = 1.0, coulomb = 1.0, \
speed = 1.0 },
    { type = "pid", name = "hold", joint = "JOINT", target = 1.0, target_rate = 1.0, \
stiffness = 1.0, damping = 1.0, integral_gain = 1.0, limit = 1.0, lag = 1.0 },
    { type = "controller", name = "own", states = { z = { rate = 1.0, unit = "rad", \
about = "this | that" } }, torques = { pin = 1.0, rail = 1.0 } },
]
"""
UNITS = {
    "drive": ("N m", "N"), "push_torque": ("N m", "N"), "spring_stiffness": ("N m/rad", "N/m"),
    "spring_damping": ("N m s/rad", "N s/m"),
    "spring_rest": ("rad", "m"), "stop_low": ("rad", "m"), "stop_high": ("rad", "m"),
    "stop_stiffness": ("N m/rad", "N/m"), "stop_damping": ("N m s/rad", "N s/m"),
    "rub_viscous": ("N m s/rad", "N s/m"), "rub_coulomb": ("N m", "N"),
    "rub_speed": ("rad/s", "m/s"), "hold_target": ("rad", "m"),
    "hold_target_rate": ("rad/s", "m/s"), "hold_stiffness": ("N m/rad", "N/m"),
    "hold_damping": ("N m s/rad", "N s/m"),
    "hold_integral_gain": ("N m/(rad s)", "N/(m s)"),
    "hold_limit": ("N m", "N"), "hold_lag": ("s", "s"), "hold_integral": ("rad s", "m s"),
    "hold_torque": ("N m", "N"), "own_z_rate": ("1/s", "1/s"), "own_torques_pin": ("N m", "N m"),
    "own_torques_rail": ("N", "N"), "z": ("rad", "rad"),
}  # fmt: skip
"""Of every quantity, input and state of the effects, at the pin and at the rail."""


def at(joint: str) -> Model:
    """All of them at a joint."""
    return elaborate(parse_scene(EFFECTS.replace("JOINT", joint)))


@pytest.mark.parametrize(("joint", "kind"), [("pin", 0), ("rail", 1)])
def test_units_are_those_of_the_joint(joint: str, kind: int) -> None:
    """A controller's own states keep what the scene says of them."""
    model = at(joint)
    named = [*model.parameters, *model.inputs, *model.extra]
    held = {body.name for body in model.bodies} | {"rail", "pin"}
    units = {x.name: x.unit for x in named if x.name.partition("_")[0] not in held}
    assert units == {name: pair[kind] for name, pair in UNITS.items()}
    about = {x.name: x.about for x in named}
    word = ("torque", "force")[kind]
    assert about["drive"] == f"motor {word} at {joint}"
    assert about["push_torque"] == f"push: {word}"
    assert about["hold_torque"] == f"{word} of hold"
    assert about["own_torques_pin"] == "own: torque, pin"
    assert about["own_torques_rail"] == "own: force, rail"
    assert about["z"] == "this | that"


def test_messages_name_the_unit_of_the_joint() -> None:
    """So does what is asked for in place of a bad number."""
    for joint, unit in (("pin", "N m/rad"), ("rail", "N/m")):
        text = EFFECTS.replace("stiffness = 1.0", "stiffness = -1.0", 1).replace("JOINT", joint)
        with pytest.raises(SceneError, match=f"give a number >= 0 in {unit}$"):
            elaborate(parse_scene(text))


def test_the_schema_names_both() -> None:
    """An editor does not know the joint."""
    spring = json.loads(json_schema())["$defs"]["JointSpring"]["properties"]
    assert spring["stiffness"]["description"] == "stiffness (N m/rad or N/m)"
    assert " | " not in json_schema()
