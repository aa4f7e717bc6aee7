"""`[definitions]`: what they mean, that they cost nothing, and how they may not be."""

import time

import numpy as np
import pytest
from engine import text_of
from scenes import refusal

from eomgen.codegen.recording import Recording
from eomgen.model.elaborate import elaborate
from eomgen.run.module import load_module
from eomgen.scene.reader import parse_scene

CART = """\
name = "cart"
outputs = "all"
[parameters]
a = 2.0
b = 0.5
{definitions}
[[bodies]]
name = "cart"
mass = {mass}
inertia_com = 0.1
[[bodies]]
name = "pole"
mass = 0.3
inertia_com = 0.01
[[joints]]
name = "rail"
type = "prismatic"
parent = "world"
child = "cart"
axis = [1, 0]
coordinate = "p"
[[joints]]
name = "pin"
type = "revolute"
parent = "cart"
child = "pole"
r_parent = {pin}
r_child = [-0.3, 0]
coordinate = "q"
[[points]]
name = "tip"
body = "pole"
at = {pin}
[[effects]]
type = "motor"
name = "push"
joint = "rail"
torque = {torque}
[[effects]]
type = "controller"
name = "own"
states = {{ z = {{ rate = {rate} }} }}
torques = {{ pin = {pull} }}
[[effects]]
type = "field"
name = "wind"
body = "pole"
force = {force}
[initial]
q = [0.2, 0.4]
v = [0.3, -0.5]
"""
DEFINITIONS = """\
[definitions]
error = "sin(t) - p"
command = "a*error - b*p_dot + z"
half = "a/4"
heavy = "a + half**2"
"""
NAMED = {"mass": '"heavy"', "pin": '["half", 0]', "torque": '"command"', "rate": '"error"',
         "pull": '"-command/heavy"', "force": '["x*half", "vy*error"]'}  # fmt: skip
WRITTEN = {
    "mass": '"(a + (a/4)**2)"',
    "pin": '["(a/4)", 0]',
    "torque": '"(a*(sin(t) - p) - b*p_dot + z)"',
    "rate": '"(sin(t) - p)"',
    "pull": '"-(a*(sin(t) - p) - b*p_dot + z)/(a + (a/4)**2)"',
    "force": '["x*(a/4)", "vy*(sin(t) - p)"]',
}


def cart(definitions: str = "", **fields: str) -> str:
    """The scene, with fields as they are written out but for those given."""
    return CART.format(definitions=definitions, **{**WRITTEN, **fields})


def test_a_definition_is_what_it_stands_for() -> None:
    """The same bytes as with every formula written out: no parameter, state or operation more."""
    assert text_of(parse_scene(cart(DEFINITIONS, **NAMED))) == text_of(parse_scene(cart()))
    assert text_of(parse_scene(cart(DEFINITIONS))) == text_of(parse_scene(cart()))


def test_what_is_shared_is_computed_once() -> None:
    """x2 = x1*x1, …, x9 = x8*x8 is p to the 256th in eight products, and no more is on the tape."""
    doubling = '[definitions]\nx1 = "p"\n' + "".join(
        f'x{i} = "x{i - 1}*x{i - 1}"\n' for i in range(2, 10)
    )
    plain = Recording(elaborate(parse_scene(cart(torque='"p"'))), "aba").tape
    made = Recording(elaborate(parse_scene(cart(doubling, torque='"x9"'))), "aba").tape
    assert len(made.steps) == len(plain.steps) + 8


def test_of_parameters_alone_the_closed_form_takes_them() -> None:
    """They follow no motion, so nothing changes about what a formula is."""
    text = cart('[definitions]\nhalf = "a/4"\n', torque='"half"')
    text = text[: text.index('[[effects]]\ntype = "controller"')] + text[text.index("[initial]") :]
    y = np.array([0.1, 0.4, 0.2, -0.7])
    closed, recursive = (
        load_module(text_of(parse_scene(f'route = "{route}"\n{text}'))).derivative(0.3, y)
        for route in ("closed", "aba")
    )
    assert closed == pytest.approx(recursive, rel=1e-12)


def defined(*lines: str, **fields: str) -> str:
    """The cart with some definitions."""
    return cart("[definitions]\n" + "\n".join(lines) + "\n", **fields)


MISTAKES = [
    (defined('u = "w + 1"', 'w = "2*u"'),
     "definitions.u: is defined in terms of itself: u needs w, w needs u; break it"),
    (defined('u = "u + 1"'), "definitions.u: is defined in terms of itself: u needs u; break it"),
    (defined('r = "u"', 'u = "p*w"', 'w = "b + s"', 's = "max(u, 1)"'),
     "definitions.u: is defined in terms of itself: u needs w, w needs s, s needs u; break it"),
    (defined('error = "p_dott"'),
     "definitions.error: unknown parameter 'p_dott' (did you mean 'p_dot'?)"),
    (defined('error = "eror2 + p"', 'eror = "p"'),
     "definitions.error: unknown parameter 'eror2' (did you mean 'eror'?)"),
    (defined('error = "x + 1"'),
     "definitions.error: unknown parameter 'x'; give it a value in [parameters]"),
    (defined('error = "p"', torque='"2*eror"'),
     "effects[0].torque: unknown parameter 'eror' (did you mean 'error'?)"),
    (defined('error = "p"', force='["x", "erorr"]'),
     "effects[2].force[1]: unknown parameter 'erorr' (did you mean 'error'?)"),
    (defined('error = "p"', rate='"erorr"'),
     "effects[1].states.z.rate: unknown parameter 'erorr' (did you mean 'error'?)"),
    (defined('a = "p"'), "definitions.a: is also the name of a parameter; rename one of them"),
    (defined('p_dot = "p"'),
     "definitions.p_dot: is also the name of a quantity of the motion; rename one of them"),
    (defined('z = "p"'),
     "definitions.z: is also the name of a quantity of the motion; rename one of them"),
    (defined('pi = "3"'), "definitions.pi: is also the name of a number; rename one of them"),
    (defined('x = "p"', force='["x", "1"]'),
     "effects[2].force[0]: 'x' of definition 'x' is predefined here; "
     "rename it where it is defined"),
    (defined('far = "2*x"', force='["far", "1"]').replace('coordinate = "p"', 'coordinate = "x"')
     .replace(" - p", " - x").replace("p_dot", "x_dot"),
     "effects[2].force[0]: 'x' of definition 'far' is predefined here; "
     "rename it where it is defined"),
    (defined('far = "2*p"', mass='"far"'),
     "bodies[0].mass: 'p' changes with the motion, which this value must not; use parameters"),
    (defined('u = "p.real"'),
     "definitions.u: 'p.real' has '.real' at column 2, which is not allowed"),
    (defined('u = true'), "definitions.u: True is neither a number nor a formula; give one"),
    (defined('_u = "p"'), "definitions._u: '_u' is not an identifier; use letters a-z, digits, "
     "_ and -, starting with a letter"),
    (defined('u = "1/(a - 2)"', torque='"p*u"'),
     "effects[0].torque: its part '(1.0 / (a - 2.0))' is not a finite number; change it or its "
     "parameters"),
    (defined('x1 = "p"', *(f'x{i} = "x{i - 1}*x{i - 1}"' for i in range(2, 200))),
     "definitions.x11: has more than 2000 parts once its own definitions are expanded; "
     "make it simpler"),
    (defined('x1 = "p"', *(f'x{i} = "x{i - 1} + 1"' for i in range(2, 900))),
     "definitions.x152: is nested too deep once its own definitions are expanded; "
     "make it simpler"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), MISTAKES)
def test_mistakes(text: str, message: str) -> None:
    """One line, at once, whatever the definitions make of each other."""
    start = time.process_time()
    assert refusal(text) == message
    assert time.process_time() - start < 60.0
