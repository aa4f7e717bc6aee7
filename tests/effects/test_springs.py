"""Springs, ropes, joint springs, friction and stops: closed forms, the independent solver, energy.

Gravity acts along -y in the plane. "Exactly" is in 60 digits, with the derivatives taken there.
"""

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest
from campaign import some
from engine import MP, Engine, along, apart, engine, slopes
from scenes import WEIGHT, effect, free, lone, refusal
from scipy.integrate import solve_ivp
from spatial_trees import PLANE, SPACE

from eomgen.scene.effects.vectors import NEAREST
from eomgen.tables.outputs import OUTPUTS

EXACT = 1e-12
KEPT = ("applied_force", "kinetic_energy", "potential_energy", "momentum")
"""Outputs, besides those that every module has, that are looked at here."""
M = 2.0


# Scenes.

SLIDER = lone("prismatic", mass=M, axis=[1, 0], coordinate="x")
PENDULUM = lone("revolute", WEIGHT, mass=M, inertia_com=0.3, r_child=[-0.8, 0], coordinate="q")
BOB = lone("free", WEIGHT, mass=M, inertia_com=0.3)
PAIRS = {
    PLANE: free("a", "b", mass={"a": M, "b": 1.3}, inertia_com=0.3),
    SPACE: free("a", "b", mass={"a": M, "b": 1.3}, inertia_com=[0.3, 0.2, 0.25], dimensions=SPACE),
}


def between(first: str, second: str, *lines: str) -> str:
    """A spring's table."""
    return effect("spring", *lines, body_1=first, body_2=second)


def at_joint(kind: str, *lines: str) -> str:
    """A table of an effect at a joint."""
    return effect(kind, *lines, joint="j")


@cache
def made(text: str, route: str = "aba", *, jacobian: bool = True) -> Engine:
    """A scene, compiled."""
    left_out = tuple(name for name in OUTPUTS if name not in KEPT)
    left_out += () if jacobian else ("jacobian",)
    return engine(text, route, leave_out=left_out)


def run(text: str, y0: list[float], t_end: float) -> Callable[[float], np.ndarray]:
    """The motion from a state, by a solver that is good to 1e-10 or so."""
    module = made(text).module
    found = solve_ivp(
        module.derivative, (0.0, t_end), y0, "DOP853", rtol=1e-11, atol=1e-12, dense_output=True
    )
    assert found.success
    return found.sol


# Closed forms.


@pytest.mark.parametrize("damping", [3.0, 20.0, 45.0])
@pytest.mark.parametrize("kind", ["spring", "joint_spring"])
def test_a_damped_oscillator_moves_as_its_roots_say(kind: str, damping: float) -> None:
    """Under, critically and over: k = 50 N/m, m = 2 kg, from 0.3 m and 0.4 m/s."""
    numbers = "stiffness = 50.0", f"damping = {damping}"
    if kind == "spring":
        table = between("world", "b", "at_1 = [-1.0, 0]", "rest_length = 1.25", *numbers)
        rest = 0.25
    else:
        table, rest = at_joint(kind, "rest = 0.25", *numbers), 0.25
    motion = run(SLIDER + table, [rest + 0.3, 0.4], 2.0)
    a, w2 = damping / (2 * M), 50.0 / M
    for t in (0.1, 0.7, 2.0):
        root = np.sqrt(complex(w2 - a * a))
        ratio = np.sin(root * t) / root if root else t
        x = (math.exp(-a * t) * (0.3 * np.cos(root * t) + (0.4 + a * 0.3) * ratio)).real
        assert motion(t)[0] - rest == pytest.approx(x, abs=1e-9)


def test_a_joint_spring_raises_a_pendulum_s_frequency() -> None:
    """ω² = (k + m g l)/(I + m l²) about hanging straight down."""
    spring = at_joint("joint_spring", "stiffness = 7.0", 'rest = "-pi/2"')
    module = made(PENDULUM + spring).module
    values = np.linalg.eigvals(module.jacobian(0.0, np.array([-math.pi / 2, 0.0])))
    expected = math.sqrt((7.0 + M * 9.81 * 0.8) / (0.3 + M * 0.64))
    assert sorted(values.imag) == pytest.approx([-expected, expected], rel=EXACT)
    assert values.real == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_rope_pulls_when_taut_and_never_pushes() -> None:
    """Slack: free fall; taut: k s + c ṡ; taut but coming back too fast: nothing."""
    numbers = "stiffness = 80.0", "damping = 5.0", "rest_length = 1.5", "tension_only = true"
    module = made(BOB + between("world", "b", *numbers)).module

    def lift(y: float, speed: float) -> float:
        rate = module.derivative(0.0, np.array([0.0, y, 0.0, 0.0, speed, 0.0]))
        assert rate[3] == rate[5] == 0.0
        return M * (rate[4] + 9.81)

    assert lift(-1.4, -3.0) == pytest.approx(0.0, abs=1e-13)
    assert lift(0.0, -3.0) == pytest.approx(0.0, abs=1e-13)
    assert lift(-1.7, 0.0) == pytest.approx(80.0 * 0.2)
    assert lift(-1.7, -2.0) == pytest.approx(80.0 * 0.2 + 5.0 * 2.0)
    assert lift(-1.7, 4.0) == pytest.approx(0.0, abs=1e-13)
    for y, energy in ((-1.4, 0.0), (-1.7, 40.0 * 0.2**2)):
        state = np.array([0.0, y, 0.0, 0.0, 0.0, 0.0])
        assert module.potential_energy(0.0, state) - M * 9.81 * y == pytest.approx(energy)


def test_a_law_stands_for_stiffness() -> None:
    """Cubic between points, and at a hinge; it may use parameters and the time."""
    table = between("world", "b", "rest_length = 1.0", 'law = "k3*stretch**3 + 2*rate + t"')
    module = made(BOB + table + "[parameters]\nk3 = 40.0\n").module
    rate = module.derivative(3.0, np.array([0.0, -1.2, 0.0, 0.7, 0.5, 0.0]))
    assert M * (rate[4] + 9.81) == pytest.approx(40.0 * 0.2**3 - 2 * 0.5 + 3.0)
    law = at_joint("joint_spring", 'law = "9*stretch**3 + rate"', "rest = 0.2", "damping = 0.5")
    force = made(SLIDER + law).module.applied_force(0.0, np.array([0.7, 0.3]))
    assert force == pytest.approx([-(9 * 0.5**3 + 1.5 * 0.3)])


def test_coulomb_friction_holds_and_slips_as_smoothed() -> None:
    """Below the threshold: creep at speed artanh(F/C); above: (F - C)/m; sliding stops in time."""
    table = at_joint("joint_friction", "coulomb = 6.0", "speed = 0.001")
    pushed = partial(effect, "motor", name="push", joint="j")
    creep = run(SLIDER + table + pushed(torque=5.4), [0.0, 0.0], 0.05)
    assert creep(0.05)[1] == pytest.approx(0.001 * math.atanh(0.9), rel=1e-8)
    slip = run(SLIDER + table + pushed(torque=6.6), [0.0, 0.5], 1.0)
    assert slip(1.0)[1] == pytest.approx(0.5 + 0.6 / M, abs=1e-8)
    # m v̇ = -C tanh(v/v0): sinh(v/v0) falls as exp(-C t/(m v0)).
    stop = run(SLIDER + table, [0.0, 0.02], 0.01)
    t = 0.007
    assert stop(t)[1] == pytest.approx(
        0.001 * math.asinh(math.sinh(20.0) * math.exp(-6.0 * t / (M * 0.001))), abs=1e-10
    )
    both = at_joint("joint_friction", "viscous = 4.0", "coulomb = 6.0", "speed = 0.5")
    force = made(SLIDER + both).module.applied_force(0.0, np.array([0.0, 0.5]))
    assert force == pytest.approx([-(2.0 + 6.0 * math.tanh(1.0))])


def test_a_stop_holds_and_gives_back_what_it_took() -> None:
    """Half an oscillation beyond the limit, out as fast as in; then a load rests F/k beyond."""
    k, v = 800.0, 1.5
    stop = at_joint("joint_stop", "low = -0.2", "high = 0.3", f"stiffness = {k}")
    contact = math.pi * math.sqrt(M / k)
    for sign, limit in ((1, 0.3), (-1, -0.2)):
        motion = run(SLIDER + stop, [limit, sign * v], contact)
        deepest = motion(contact / 2)
        assert deepest == pytest.approx([limit + sign * v * math.sqrt(M / k), 0.0], abs=1e-8)
        assert motion(contact) == pytest.approx([limit, -sign * v], abs=1e-8)
    module = made(SLIDER + stop).module
    for x in (-0.2, 0.0, 0.3):
        assert module.applied_force(0.0, np.array([x, 9.0])) == [0.0]
    assert module.applied_force(0.0, np.array([0.35, 0.0])) == pytest.approx([-k * 0.05])
    assert module.potential_energy(0.0, np.array([-0.3, 0.0])) == pytest.approx(k / 2 * 0.1**2)


@pytest.mark.parametrize("limits", ["both", "low", "high"])
def test_a_damped_stop_never_pulls(limits: str) -> None:
    """k x + c v pushed back, cut off at 0; nothing within; one limit may be left out."""
    given = [line for line in ("low = -0.2", "high = 0.3") if limits in ("both", line.split()[0])]
    stop = at_joint("joint_stop", *given, "stiffness = 100.0", "damping = 20.0")
    module = made(SLIDER + stop).module
    cases = {"high": [(0.4, 0.0, -10.0), (0.4, 1.0, -30.0), (0.4, -0.2, -6.0), (0.4, -3.0, 0.0)]}
    cases["low"] = [(-0.3, -v, -force) for _, v, force in cases["high"]]
    for x, v, force in [*cases["high"], *cases["low"], (0.1, 5.0, 0.0), (0.1, -5.0, 0.0)]:
        beyond = "high" if x > 0.3 else "low"
        expected = force if limits in ("both", beyond) else 0.0
        found = module.applied_force(0.0, np.array([x, v]))[0]
        assert found == pytest.approx(expected, abs=1e-12), (x, v)


# Equal and opposite.


@pytest.mark.every(3)
@pytest.mark.parametrize("dimensions", [PLANE, SPACE])
@pytest.mark.parametrize("more", [(), ("tension_only = true",), ('law = "9*stretch + 2*rate"',)])
def test_a_spring_between_free_bodies_keeps_momentum(
    dimensions: int, more: tuple[str, ...]
) -> None:
    """Linear and angular, damped or not, to all digits."""
    ends = ("at_1 = [0.2, 0.3]", "at_2 = [-0.1, 0.4]")
    if dimensions == SPACE:
        ends = ("at_1 = [0.2, 0.3, -0.5]", "at_2 = [-0.1, 0.4, 0.2]")
    own = () if any("law" in line for line in more) else ("stiffness = 30.0",)
    numbers = ("damping = 4.0", "rest_length = 0.3", *own, *more)
    found = made(PAIRS[dimensions] + between("a", "b", *ends, *numbers))
    rng = np.random.default_rng(3)
    for _ in range(3):
        y = np.array([MP.mpf(x) for x in found.random_state(rng)])
        change = along(lambda z: found.exactly("momentum", z), y, found.exactly("derivative", y))
        assert np.max(np.abs(change)) < 1e-14  # the state is a double's, its quaternions too
        assert np.max(np.abs(found.exactly("applied_force", y))) > 0.1


# Points that meet.


ZERO_CASES = {
    "no length": ("stiffness = 30.0",),
    "damped": ("stiffness = 30.0", "damping = 4.0"),
    "of a length": ("stiffness = 30.0", "damping = 4.0", "rest_length = 0.5"),
    "a length of 0 by a parameter": ("stiffness = 30.0", 'rest_length = "0*g0"'),
    "law": ('law = "30*stretch"', "damping = 4.0"),
    "slack rope": ("stiffness = 30.0", "rest_length = 0.5", "tension_only = true"),
    "rope": ("stiffness = 30.0", "damping = 4.0", "tension_only = true"),
}


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("case", "dimensions"),
    [
        *((case, PLANE) for case in ZERO_CASES),
        *((case, SPACE) for case in some(list(ZERO_CASES)[::3], ZERO_CASES)),
    ],
)
def test_points_may_meet(case: str, dimensions: int) -> None:
    """At zero distance and 0.3 ε from it all is finite, and so is every derivative; k d, c ḋ."""
    lines = ZERO_CASES[case]
    found = made(PAIRS[dimensions] + between("a", "b", *lines) + "[parameters]\ng0 = 1.0\n")
    module = found.module
    names = list(module.STATES)
    y = np.zeros(len(names))
    for indices in map(list, module.QUATERNIONS):
        y[indices[0]] = 1.0
    for x, vx in ((0.0, 0.0), (0.0, 0.7), (0.3 * NEAREST, 0.7), (-1e-200, 0.7), (1e-5, 0.2)):
        y[names.index("b_x")], y[names.index("b_x_dot")] = x, vx
        rate, jacobian = module.derivative(0.0, y), module.jacobian(0.0, y)
        assert np.all(np.isfinite(rate)) and np.all(np.isfinite(jacobian))
        assert math.isfinite(module.potential_energy(0.0, y))
        if dimensions == PLANE or x == 0.0:
            expected = slopes(found, "jacobian", y).astype(float)
            assert apart(jacobian, expected) < 1e-11
        if x == 0.0 and case != "slack rope":
            damping = 4.0 if "damping = 4.0" in lines else 0.0
            pull = rate[names.index("a_x_dot")] * M
            assert pull == pytest.approx(damping * vx)
            row, across = names.index("a_x_dot"), names.index("a_y_dot")
            for index, velocity, column in ((row, "b_x_dot", "b_x"), (across, "b_y_dot", "b_y")):
                assert M * jacobian[index, names.index(velocity)] == pytest.approx(damping)
                if case != "of a length":
                    assert M * jacobian[index, names.index(column)] == pytest.approx(30.0)
        if case == "slack rope":
            assert not np.any(rate[len(names) // 2 + 1 :])


def test_the_energy_of_points_that_meet_has_the_force_for_a_slope() -> None:
    """From 2 ε to 0, with and without a length: nothing jumps."""
    for length in ("", "rest_length = 0.5"):
        found = made(BOB.replace("9.81", "0") + between("world", "b", "stiffness = 30.0", length))
        for x in (2.0, 1.01, 0.99, 0.4, 0.0):
            y = np.array([MP.mpf(z) for z in (x * NEAREST, 0.0, 0.0, 0.0, 0.0, 0.0)])
            way = np.array([MP.mpf(z) for z in (1, 0, 0, 0, 0, 0)])
            slope = along(partial(found.exactly, "potential_energy"), y, way)
            force = found.exactly("applied_force", y)[0]
            assert abs(slope + force) < 1e-15


# Only what is there.


def test_nothing_is_computed_that_a_spring_does_not_have() -> None:
    """No square root without length, no tanh without Coulomb friction, no parameter unused."""
    assert "sqrt" not in made(BOB + between("world", "b", "stiffness = 30.0")).source
    source = made(SLIDER + at_joint("joint_friction", "viscous = 2.0")).source
    assert "tanh" not in source and "e_speed" not in source
    assert "e_damping" not in made(SLIDER + at_joint("joint_spring", "stiffness = 2.0")).source


# Bad input.

STOP = "effects[0].low: {} is not below high, {}; make low < high"
BAD = {
    between("b", "b", "stiffness = 1"): (
        "effects[0].body_2: 'b' is also body_1, whose points keep their distance; name another body"
    ),
    between("world", "b"): "effects[0].stiffness: missing; give it, or damping or a law",
    between("world", "b", "stiffness = 1", 'law = "stretch"'): (
        "effects[0].stiffness: a law replaces it; give only one of them"
    ),
    at_joint("joint_spring"): "effects[0].stiffness: missing; give it, or damping or a law",
    at_joint("joint_friction"): "effects[0].viscous: missing; give it, or coulomb and speed",
    at_joint("joint_friction", "coulomb = 1"): (
        "effects[0].speed: missing; coulomb is smoothed as tanh(rate/speed); give a small value"
    ),
    at_joint("joint_friction", "viscous = 1", "speed = 1"): (
        "effects[0].speed: it smooths coulomb, which is missing; give both"
    ),
    at_joint("joint_stop", "low = 1", "high = 1", "stiffness = 1"): STOP.format(1, 1),
    at_joint("joint_stop", 'low = "pi"', "high = 1", "stiffness = 1"): STOP.format(3.14159, 1),
    at_joint("joint_stop", "stiffness = 1"): (
        "effects[0].low: missing, as is high; give one of them or both"
    ),
    at_joint("joint_stop", "low = 0"): ("effects[0].stiffness: missing; give it or a restitution"),
}


@pytest.mark.parametrize("table", BAD)
def test_bad_input_gets_one_clear_line(table: str) -> None:
    """Place, value, remedy."""
    assert refusal(SLIDER + table) == BAD[table]
