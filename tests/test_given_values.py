"""What a module is given: taken exactly as it is, or refused in one line; never half understood."""

import math
from itertools import permutations

import numpy as np
import pytest
from engine import quick

from eomgen.backends.python import python_module
from eomgen.build import build_model
from eomgen.language.formula import Constant, Floats, Formula, evaluate, parse
from eomgen.program.route import routed
from eomgen.program.tape import Tape
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene

TURNED = """
name = "turned"
parameters = {{ a = {a}, b = 0.0 }}
bodies = [{{ name = "bob", mass = 1.0, inertia_com = 0.1 }}]
joints = [{{ name = "pivot", type = "revolute", parent = "world", child = "bob", r_child = [-1.0, 0] }}]
effects = [{{ type = "motor", name = "tq", joint = "pivot", torque = "{torque}" }}]
"""  # noqa: E501
STILL = np.zeros(2)


# Values that are equal and compute differently: no table of the program takes one for the other.


@pytest.mark.parametrize("order", list(permutations([0.0, -0.0, 1.0])))
def test_answers_do_not_depend_on_earlier_calls(order: tuple[float, ...]) -> None:
    """atan2 tells 0.0 from -0.0, though they are equal: so does what keeps constants by value."""
    source = quick(TURNED.format(a=1.0, torque="atan2(b, a)")).source
    module = load_module(source)
    for a in order:
        ordered = [*{**module.PARAMETERS, "a": a}.values()]
        for p in ({"a": a}, ordered, np.array(ordered)):
            torque = module.derivative(0.0, STILL, p)[1] * 1.1
            assert torque == pytest.approx(math.atan2(0.0, a), abs=1e-15), (order, a)


def test_whole_numbers_and_truths_are_the_numbers_that_they_are() -> None:
    """1, True and 1.0 are one key of a table: whichever comes first, all give a float's answer."""
    module = load_module(quick(TURNED.format(a=2.0, torque="a*atan2(1, a)")).source)
    wanted = module.derivative(0.0, STILL, {"a": 1.0})
    for a in (1, True, np.int8(1), np.float32(1.0), np.True_, 1.0):
        found = module.derivative(0.0, STILL, {"a": a})
        assert found.dtype == np.float64
        assert found.tolist() == wanted.tolist()


@pytest.mark.parametrize("route", ["closed", "aba"])
def test_zeros_of_a_scene_have_no_sign(route: str) -> None:
    """Formulas that differ in the sign of a zero are equal: so they mean the same, in any order."""
    assert Constant(-0.0) == Constant(0.0)
    assert math.copysign(1.0, Constant(-0.0).value) == 1.0
    for zeros in permutations(["-0.0", "0.0", "-(0)", "a"]):
        torques = [f"atan2(b, {zero})" for zero in zeros]
        scene = parse_scene(TURNED.format(a=-0.0, torque=" + ".join(torques)))
        model = build_model(scene.replaced(route=route))
        assert math.copysign(1.0, model.defaults["a"]) == 1.0
        module = load_module(python_module(routed(model, jacobian=False).system))
        assert module.derivative(0.0, STILL)[1] == 0.0
    assert evaluate(parse("atan2(b, -0.0)"), {"b": 0.0}, Floats()) == 0.0


def test_constants_of_a_tape_and_of_formulas_are_floats() -> None:
    """What interns numbers by value interns floats alone."""
    tape = Tape()
    one = [tape.constant(x) for x in (1, True, 1.0)]
    assert {node.index for node in one} == {one[0].index}
    assert type(one[0].step.value) is float
    found: list[Formula] = [Constant(1), Constant(True), Constant(1.0)]
    assert {type(x.value) for x in found if isinstance(x, Constant)} == {float}
