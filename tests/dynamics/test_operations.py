"""How many operations programs take, beside work by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.reader import parse_scene

AT_THE_JOINT = {"joint_friction": "viscous = 0.1", "joint_spring": "stiffness = 2.0\nrest = 0.3"}
ARM = (BUILT_IN / "chain.toml").read_text("utf-8").replace("count = 10", "count = 2")
OF_TIME = 'type = "external_{0}"\nname = "pull"\nbody = "link_2"\n{0} = {1}\n'
HOLD = 'type = "controller"\nname = "hold"\nstates = {{ z = {{ rate = "link_joint_2_angle" }} }}\n'
HOLD += "torques = {{ {} }}\n"
TOUCH = 'type = "contact"\nname = "floor"\nlaw = "{}"\nbodies = ["{}"]\nradius = 0.01\n'
ON_ARM = {  # what an effect adds to the 28 operations of the arm, by hand
    "contact": (TOUCH.format("impact", "link_2") + "offset = -1.0\nrestitution = 0.5\n", 0),
    "stop": (
        'type = "joint_stop"\njoint = "link_joint_2"\nhigh = 1.0\nrestitution = 0.5\nname = "s"\n',
        0,
    ),
    "state": (HOLD.format('link_joint_1 = "0"'), 0),
    "controller": (HOLD.format('link_joint_2 = "-z"'), 2),
    "shoulder": (HOLD.format('link_joint_1 = "-2*z"'), 2),
    "torque": (OF_TIME.format("torque", '"sin(t)"'), 2),
    # Three sines, and for each link two products and a sum.
    "force": (OF_TIME.format("force", '["2*sin(t)", 0]') + "at = [0.1, 0]\n", 9),
}
EVERY = """
[[effects]]
type = "spring"
name = "rope"
body_1 = "world"
body_2 = "{1}"
at_2 = {2}
stiffness = 9.0
damping = 0.3
tension_only = true
[[effects]]
type = "drag"
name = "air"
bodies = ["{0}", "{1}"]
linear = 0.2
[[effects]]
type = "external_force"
name = "jet"
body = "{1}"
axes = "body"
at = {2}
force = ["2*sin(3*t)", "{3}"]
[[effects]]
type = "controller"
name = "hold"
states = {{ z = {{ initial = 0.2, rate = "{3}" }} }}
torques = {{ {4} = "-3*z" }}
[[effects]]
type = "contact"
name = "soft"
law = "spring_damper"
bodies = ["{0}", "{1}"]
radius = 5.0
stiffness = 60.0
friction = 0.3
slip_speed = 0.1
[[effects]]
type = "contact"
name = "hard"
law = "impact"
bodies = ["{0}", "{1}"]
radius = 0.2
offset = -3.0
restitution = 0.6
"""
LOADS = (
    *(f'type = "{kind}"\n{rest}' for kind, rest in AT_THE_JOINT.items()),
    'type = "joint_friction"\ncoulomb = 0.1\nspeed = 0.01',
    'type = "joint_spring"\nlaw = "3*stretch**3 + 0.1*sqrt(abs(rate))*max(phi, 0.1*t)"',
    'type = "joint_stop"\nhigh = 0.2\nstiffness = 100.0\ndamping = 1.0',
    'type = "pd"\ntarget = "sin(t)"\nstiffness = 3.0\ndamping = 0.3\nlimit = 1.0',
    'type = "motor"\ntorque = "0.3*cos(t)*theta - phi_dot**2"',
    'type = "controller"\ntorques = { hinge = "-0.3*phi_dot*exp(-t)*atan(1)" }',
)


def loaded(name: str, joint: str, load: str) -> str:
    """A built-in scene with one more effect at a joint."""
    text = (BUILT_IN / f"{name}.toml").read_text("utf-8")
    where = f'joint = "{joint}"\n' * ("torques" not in load)
    return f'{text}\n[[effects]]\nname = "more"\n{where}{load}\n'


def model_of(text: str) -> Model:
    return replace(elaborate(parse_scene(text)), outputs=(), route="auto")


def operations(text: str) -> int:
    """Of one call of `derivative`."""
    return compile_program(model_of(text), jacobian=False).operations


def counts(model: Model) -> dict[str, int]:
    """Operations of all outputs but the Jacobian."""
    return dict(compile_program(model, jacobian=False).system.program.operations)


def test_small_mechanisms_take_what_they_take_by_hand() -> None:
    """By hand 27 for two uniform rods, 33 for two links whose parameters are all free."""
    rods, links = (
        (BUILT_IN / f"{x}.toml").read_text("utf-8") for x in ("double_pendulum", "chain")
    )
    assert counts(model_of(rods))["derivative"] == 27
    assert counts(model_of(links.replace("count = 10", "count = 2")))["derivative"] == 28


def test_an_arm_of_six_joints() -> None:
    """Regrouped inertias, and composite bodies in the links' own axes: 744 and 899 without them."""
    arm = model_of((BUILT_IN / "puma560.toml").read_text("utf-8"))
    found = counts(replace(arm, outputs=("mass_matrix",)))
    assert (found["mass_matrix"], found["derivative"]) == (193, 645)


@pytest.mark.parametrize(("name", "joint"), [("two_body", "hinge"), ("double_pendulum", "elbow")])
def test_a_load_at_a_joint_adds_four_operations(name: str, joint: str) -> None:
    """By hand: a product and a difference or two, and a sum on either side of the joint."""
    alone = operations((BUILT_IN / f"{name}.toml").read_text("utf-8"))
    for kind, values in AT_THE_JOINT.items():
        assert operations(loaded(name, joint, f'type = "{kind}"\n{values}')) <= alone + 4, kind


@pytest.mark.every(2)
@pytest.mark.parametrize("what", ON_ARM)
def test_an_effect_costs_its_own_terms_and_no_route(what: str) -> None:
    """Contacts and states add no term to v̇, and a load adds those that it has by hand."""
    table, more = ON_ARM[what]
    found = compile_program(model_of(f"{ARM}\n[[effects]]\n{table}"), jacobian=False)
    assert (found.system.route, found.operations) == ("closed", 28 + more)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("two_body", ("A", "B", "[0.1, -0.2]", "phi", "hinge")),
        ("cart_pole", ("cart", "pole", "[0.1, -0.2]", "theta", "pin")),
    ],
)
def test_closed_takes_every_effect(name: str, names: tuple[str, ...]) -> None:
    """Loads of bodies, states and contacts at once, by both derivations, as by articulated
    bodies.
    """
    text = (BUILT_IN / f"{name}.toml").read_text("utf-8") + EVERY.format(*names)
    text = text.replace('type = "gravity"', 'type = "gravity"\ndirection = [3, -4]')
    closed, aba = (
        eomgen.load(eomgen.generate(parse_scene(text), route=route)) for route in ("closed", "aba")
    )
    y = closed.initial_state() + np.linspace(0.1, 0.4, len(closed.STATES))
    given: dict[str, Any] = {"held": ([3.0, 2.0],), "impact": (1,)}
    names = ("derivative", "jacobian", "applied_force", "joint_forces", "potential_energy")
    for output in (*names, "effect_powers", "gap_rates", *given):
        one, other = (
            getattr(module, output)(0.3, y, *given.get(output, ())) for module in (closed, aba)
        )
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11, err_msg=output)


@pytest.mark.every(9)
@pytest.mark.parametrize("load", LOADS)
def test_closed_takes_loads_at_joints(load: str) -> None:
    """The derivative, the power of the load, and what else depends on it, as by articulated bodies;
    in momenta the same rates.
    """
    text = loaded("two_body", "hinge", load)
    closed, aba, momenta = (
        eomgen.load(eomgen.generate(parse_scene(text), route=route, form=form))
        for route, form in (("closed", None), ("aba", None), (None, "redundant"))
    )
    y, t = closed.initial_state() + 0.1, 0.3
    np.testing.assert_allclose(closed.derivative(t, y), aba.derivative(t, y), rtol=1e-12)
    for name in ("jacobian", "applied_force", "potential_energy", "effect_powers", "joint_forces"):
        found, right = getattr(closed, name)(t, y), getattr(aba, name)(t, y)
        np.testing.assert_allclose(found, right, rtol=1e-11, atol=1e-11, err_msg=name)
    rate = momenta.derivative(0.0, momenta.initial_state())
    rates = closed.derivative(0.0, closed.initial_state())
    spin = rate[momenta.STATES.index("L_B")] / momenta.PARAMETERS["I_B"]
    assert spin == pytest.approx(rates[6] + rates[7], rel=1e-12)


def test_a_spring_at_a_ball_joint_has_a_closed_form() -> None:
    text = loaded("spinning_top", "tip", 'type = "joint_spring"\nstiffness = 0.1\ndamping = 0.01')
    closed, aba = (
        eomgen.load(eomgen.generate(parse_scene(text), route=route)) for route in ("closed", "aba")
    )
    y = closed.initial_state() + 0.1
    np.testing.assert_allclose(closed.derivative(0.0, y), aba.derivative(0.0, y), rtol=1e-12)
