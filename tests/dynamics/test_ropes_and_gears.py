"""Ropes, pulleys, gears and belts against closed forms, and their messages.

The independent solver of `eomgen verify` knows constraints by their rows alone and differentiates
these by itself: it must find the accelerations of the books, and so must generated modules.
"""

import math
from typing import Any

import numpy as np
import pytest
from scenes import refusal

from eomgen.api.verifying import verify
from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate
from eomgen.model.model import Model
from eomgen.pipeline import generate
from eomgen.run.integrate import integrate
from eomgen.run.module import as_problem, load_module
from eomgen.scene.reader import parse_scene
from eomgen.study.precision.extended import doubles, extended_digits
from eomgen.study.verification.free_bodies import FreeBodies

G = 9.81


def scene(*tables: str, dimensions: int = 2, start: str = "") -> str:
    """A scene of such tables, with gravity."""
    head = f'name = "hoist"\ndimensions = {dimensions}\noutputs = ["constraint_forces"]\n'
    gravity = f'[[effects]]\ntype = "gravity"\ng = {G}\n'
    return head + "".join(tables) + gravity + start


def weight(name: str, mass: float, x: float) -> str:
    """A body on a vertical slider at x, with the coordinate y_NAME."""
    return (
        f'[[bodies]]\nname = "{name}"\nmass = {mass}\n[[joints]]\nname = "on_{name}"\n'
        f'type = "prismatic"\nparent = "world"\nchild = "{name}"\naxis = [0, 1]\n'
        f'r_parent = [{x}, 0]\ncoordinate = "y_{name}"\n'
    ).replace("mass =", "inertia_com = 0.1\nmass =")


def wheel(name: str, inertia: float, at: str = "[0, 2]", on: str = "world") -> str:
    """A body that turns about its centre, with the angle q_NAME."""
    return (
        f'[[bodies]]\nname = "{name}"\nmass = 1.5\ninertia_com = {inertia}\n[[joints]]\n'
        f'name = "axle_{name}"\ntype = "revolute"\nparent = "{on}"\nchild = "{name}"\n'
        f'r_parent = {at}\ncoordinate = "q_{name}"\n'
    )


def rope(*through: str, name: str = "cord", more: str = "") -> str:
    """A rope's table."""
    listed = ", ".join(f"{{ {each} }}" for each in through)
    return f'[[constraints]]\ntype = "rope"\nname = "{name}"\nthrough = [{listed}]\n{more}'


def disc(body: str, at: str, radius: float, winds: str = "clockwise", more: str = "") -> str:
    """What a rope goes round."""
    return f'body = "{body}", at = {at}, radius = {radius}, winds = "{winds}"{more}'


def linked(kind: str, one: str, other: str, more: str, name: str = "mesh") -> str:
    """A gear's or a belt's table."""
    return (
        f'[[constraints]]\ntype = "{kind}"\nname = "{name}"\nbody_1 = "{one}"\n'
        f'body_2 = "{other}"\n{more}\n'
    )


def torque(joint: str, size: float) -> str:
    """A motor's table."""
    return f'[[effects]]\ntype = "motor"\nname = "on_{joint}"\njoint = "{joint}"\ntorque = {size}\n'


def model_of(text: str) -> Model:
    """The assembled model of a scene."""
    return assembled(elaborate(parse_scene(text)))


def start_of(text: str) -> tuple[dict[str, float], list[float]]:
    """Accelerations by coordinate and multipliers at the start, by the independent solver and by
    the module, which must agree.
    """
    model = model_of(text)
    names = [c.name for c in model.coordinates]
    y = [*model.initial_q, *model.initial_v]
    with extended_digits():
        rates = doubles(FreeBodies(model, 0.0, np.array(y), {}).state_rates)[len(names) :]
    module = load_module(generate(model, jacobian=False).module, "hoist")
    y0 = module.initial_state()
    own = module.derivative(0.0, y0)
    found = dict(zip(names, rates.tolist(), strict=True))
    for name, rate in zip(module.STATES, own, strict=True):
        if name.endswith("_dot"):
            assert rate == pytest.approx(found[name.removesuffix("_dot")], rel=1e-12, abs=1e-13)
    return found, module.constraint_forces(0.0, y0).tolist()


M1, M2 = 2.0, 3.0
ATWOOD = weight("a", M1, -0.2) + weight("b", M2, 0.2)


def test_atwood() -> None:
    """Two weights on a rope: over a disc without mass, through rings, over a disc that it turns."""
    a, tension = (M2 - M1) * G / (M1 + M2), 2 * M1 * M2 * G / (M1 + M2)
    over = rope('body = "a"', disc("world", "[0, 2]", 0.2), 'body = "b"')
    rings = rope(
        'body = "a"',
        'body = "world", at = [-0.2, 1]',
        'body = "world", at = [0.2, 1]',
        'body = "b"',
    )
    for text in (over, rings, over.replace("through", "length = 4.628318530717959\nthrough")):
        found, forces = start_of(scene(ATWOOD, text))
        assert found["y_a"] == pytest.approx(a, rel=1e-12)
        assert forces == pytest.approx([tension], rel=1e-12)
    inertia, r = 0.03, 0.2
    turned = linked("pulley", "a", "b", 'body = "disc"\nradius = 0.2', "cord")
    found, forces = start_of(scene(ATWOOD, wheel("disc", inertia), turned))
    a = (M2 - M1) * G / (M1 + M2 + inertia / r**2)
    assert found == pytest.approx({"y_a": a, "y_b": -a, "q_disc": -a / r}, rel=1e-12)
    assert forces == pytest.approx([M1 * (G + a), M2 * (G - a)], rel=1e-12)


def test_compound_atwood_and_tackle() -> None:
    """A weight against a pulley from which two others hang; a load on four parts of a rope."""
    block = weight("block", 1.0, 0.4)
    upper = rope('body = "a"', disc("world", "[0, 3]", 0.4), 'body = "block"', name="upper")
    lower = rope('body = "b"', disc("block", "[0, 0]", 0.1), 'body = "c"', name="lower")
    start = "[initial]\nq = { y_b = -1.0, y_c = -1.0, y_block = 0.5, y_a = 0.0 }\n"
    text = scene(
        weight("a", 5.0, -0.4),
        weight("b", 2.0, 0.3),
        weight("c", 3.0, 0.5),
        block,
        upper,
        lower,
        start=start,
    )
    found, _ = start_of(text)
    # With x down for the block and z up for b from it: T = ½ (m_a + m) ẋ² + ½ m_b (ż - ẋ)² + ….
    matrix = np.array([[5 + 1 + 2 + 3, 3 - 2], [3 - 2, 2 + 3]], dtype=float)
    x, z = np.linalg.solve(matrix, np.array([(1 + 2 + 3 - 5) * G, (3 - 2) * G]))
    assert found == pytest.approx({"y_a": x, "y_block": -x, "y_b": z - x, "y_c": -z - x}, rel=1e-12)
    above, below = 'body = "world", at = [{}, 2]', 'body = "load", at = [{}, 0.1]'
    parts = [above.format(0.0), below.format(0.0), above.format(0.0), below.format(0.0)]
    parts += [above.format(0.0), above.format(0.7), 'body = "hand"']
    found, (tension,) = start_of(
        scene(weight("load", 8.0, 0.0), weight("hand", 3.0, 0.7), rope(*parts))
    )
    a = (4 * 3.0 - 8.0) * G / (16 * 3.0 + 8.0)
    assert (found["y_load"], found["y_hand"]) == pytest.approx((a, -4 * a), rel=1e-12)
    assert tension == pytest.approx(8.0 * (G + a) / 4, rel=1e-12)


def test_drums() -> None:
    """A yo-yo falls with g/(1 + I/(m r²)); a rope that swings and winds keeps its power and length
    through many turns.
    """
    text = scene(
        '[[bodies]]\nname = "yoyo"\nmass = 0.2\ninertia_com = 1e-4\n[[joints]]\nname = "fly"\n'
        'type = "free"\nchild = "yoyo"\n',
        rope('body = "world", at = [0.01, 1]', disc("yoyo", "[0, 0]", 0.01)),
    )
    found, (tension,) = start_of(text)
    a = G / (1 + 1e-4 / (0.2 * 0.01**2))
    assert tension == pytest.approx(0.2 * (G - a), rel=1e-12)
    assert sorted(found.values()) == pytest.approx(sorted([0.0, -a, a / 0.01]), abs=1e-12)


SWINGING = scene(
    wheel("winch", 0.05, "[-0.6, 1.8]"),
    wheel("disc", 0.02, "[0.5, 2.1]"),
    '[[bodies]]\nname = "bob"\nmass = 1.2\ninertia_com = 0.01\n[[joints]]\nname = "fly"\n'
    'type = "free"\nchild = "bob"\n',
    rope(
        disc("winch", "[0, 0]", 0.15),
        disc("disc", "[0, 0]", 0.2, more=", grips = true"),
        'body = "world", at = [0.9, 1.5]',
        disc("world", "[0.8, 1.2]", 0.1, "counterclockwise"),
        'body = "bob", at = [0.05, 0.1]',
    ),
    torque("axle_winch", 1.5),
    start="[initial]\nq = { bob_x = 1.4, bob_y = 0.2, bob_angle = 0.3 }\n"
    "v = { bob_angle_dot = 0.4 }\n",
)


def test_rates_of_a_rope_are_those_of_its_length() -> None:
    """Along a motion in general position the power of the tensions' loads is the rate of the
    residuals, by differences, and both stay 0 while the winch makes most of a turn.
    """
    module = load_module(generate(model_of(SWINGING), jacobian=False).module, "hoist")
    nq, y = len(module.POSITIONS), module.initial_state()
    rng = np.random.default_rng(2)
    for _ in range(4):
        v = rng.uniform(-1, 1, nq)
        here = np.concatenate([y[:nq] + rng.uniform(-0.1, 0.1, nq), v])
        step = np.concatenate([v, np.zeros(nq)]) * 1e-6
        ahead, behind = (module.constraint_residuals(0.0, here + k * step) for k in (1, -1))
        rates = module.constraint_rates(0.0, here)
        assert (ahead - behind) / 2e-6 == pytest.approx(rates, abs=1e-8)
    run = integrate(as_problem(module), "DOP853", 1.5, rtol=1e-9, atol=1e-11)
    states = dict(zip(module.STATES, run.y.T, strict=True))
    assert np.ptp(states["q_winch"]) > math.pi
    assert max(abs(module.constraint_residuals(0.0, y)).max() for y in run.y[::100]) < 1e-9


def test_a_run_ends_where_a_rope_leaves_its_disc() -> None:
    """Without a word it would go on with an arc of a turn more."""
    text = scene(
        '[[bodies]]\nname = "bob"\nmass = 1.0\n[[joints]]\nname = "fly"\ntype = "particle"\n'
        'parent = "world"\nchild = "bob"\n',
        weight("b", 1.0, -0.2),
        rope('body = "b"', disc("world", "[0, 0]", 0.2), 'body = "bob"'),
        start="[initial]\nq = { bob_x = 0.2, bob_y = -1.0, y_b = -1.0 }\nv = { bob_x_dot = 6 }\n",
    )
    module = load_module(generate(model_of(text), jacobian=False).module, "hoist")
    run = integrate(as_problem(module), "DOP853", 3.0)
    assert not run.finished and "rope leaves its disc" in run.message


def test_gears_and_belts() -> None:
    """A train's reduced inertia; Willis's ratio of a planetary gear, whose ring is the world."""
    train = [
        wheel(name, inertia, f"[{x}, 0]")
        for name, inertia, x in (("a", 0.01, 0), ("b", 0.08, 0.3), ("c", 0.5, 1))
    ]
    text = scene(
        *train,
        linked("gear", "a", "b", "teeth_1 = 12\nteeth_2 = 24"),
        linked("belt", "b", "c", "radius_1 = 0.1\nradius_2 = 0.3", "drive"),
        torque("axle_a", 2.0),
    )
    found, forces = start_of(text)
    a = 2.0 / (0.01 + 0.08 / 4 + 0.5 / 36)
    assert found == pytest.approx({"q_a": a, "q_b": -a / 2, "q_c": -a / 6}, rel=1e-12)
    assert forces == pytest.approx([0.01 * a - 2.0, -0.5 * a / 6 / 0.3 * -1], rel=1e-12)
    crossed, _ = start_of(text.replace("radius_1 = 0.1", "radius_1 = 0.1\ncrossed = true"))
    assert crossed["q_c"] == pytest.approx(a / 6, rel=1e-12)
    sun, planet, ring = 20, 15, 50
    text = scene(
        wheel("carrier", 0.3, "[0, 0]"),
        wheel("sun", 0.02, "[0, 0]"),
        wheel("planet", 0.01, "[0.35, 0]", "carrier"),
        linked(
            "gear", "planet", "sun", f'carrier = "carrier"\nteeth_1 = {planet}\nteeth_2 = {sun}'
        ),
        linked(
            "gear",
            "planet",
            "world",
            f'carrier = "carrier"\nratio = {ring / planet}\ninside = true',
            "ring",
        ),
        torque("axle_sun", 1.0),
    ).replace(f"g = {G}", "g = 0")
    found, _ = start_of(text)
    assert found["q_sun"] / found["q_carrier"] == pytest.approx(1 + ring / sun, rel=1e-12)
    assert found["q_planet"] / found["q_carrier"] == pytest.approx(-ring / planet, rel=1e-12)


STRAIGHT = scene(ATWOOD, rope('body = "a"', disc("world", "[0, 2]", 0.2), 'body = "b"'))


@pytest.mark.full
@pytest.mark.parametrize("text", [SWINGING, STRAIGHT], ids=["swinging", "straight"])
def test_verify_agrees(text: str) -> None:
    """The independent solver finds the module's digits, also where the Jacobian is 0."""
    assert not verify(parse_scene(text)).missed


ON = "constraints[0]"
WRONG: dict[str, tuple[Any, str]] = {
    "radius without sense": (
        rope('body = "a"', 'body = "world", radius = 0.2', 'body = "b"'),
        f"{ON}.through[1].winds: is missing",
    ),
    "unknown body": (rope('body = "a"', 'body = "c"'), f"{ON}.through[1].body: no body is named"),
    "length of a drum": (
        rope('body = "a"', disc("world", "[0, 2]", 0.2), more="length = 2\n"),
        f"{ON}.length: a rope that ends on a drum",
    ),
    "centre within the disc": (
        rope('body = "a"', disc("world", "[-0.2, 0.1]", 0.2), 'body = "b"'),
        "constraint 'cord' has no direction at this start",
    ),
    "too short": (
        rope('body = "a"', 'body = "b"', more="length = 0.1\n"),
        "cord stays open by",
    ),
    "gear on a slider": (
        linked("gear", "a", "b", "ratio = 2"),
        f"{ON}.body_1: 'a' does not turn on 'world'",
    ),
    "two sizes": (
        linked("gear", "a", "b", "ratio = 2\nteeth_1 = 3"),
        f"{ON}.ratio: is given in addition to 'teeth_1'",
    ),
    "hinge among constraints": (
        linked("hinge", "a", "b", ""),
        f"{ON}.type: unknown value 'hinge'; that is a table [[joints]] with type = 'revolute'",
    ),
}


@pytest.mark.parametrize("which", WRONG)
def test_messages(which: str) -> None:
    """What is wrong, where, and what to do."""
    text, told = WRONG[which]
    assert told in refusal(lambda: model_of(scene(ATWOOD, text)))


def test_a_gear_needs_a_carrier() -> None:
    """If its bodies are joined to different ones, or turn about several axes."""
    two = wheel("a", 0.1), wheel("b", 0.1, "[0.2, 0]", "a")
    told = refusal(scene(*two, linked("gear", "b", "a", "ratio = 2")))
    assert f"{ON}.carrier: missing" in told
