"""How many operations programs take, beside work by hand."""

from dataclasses import replace

import numpy as np
import pytest

import eomgen
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import compile_program
from eomgen.scene.built_in import BUILT_IN
from eomgen.scene.reader import parse_scene

AT_THE_JOINT = {
    "joint_friction": "viscous = 0.1",
    "joint_spring": "stiffness = 2.0\nrest = 0.3",
}
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
