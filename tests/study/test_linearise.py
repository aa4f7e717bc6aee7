"""Linearisation, equilibria, modes: against textbooks and closed forms."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from engine import text_of
from scipy.linalg import expm

from eomgen.base.errors import RunError
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.run.integrate import integrate
from eomgen.run.module import GeneratedModule, as_problem, load_module
from eomgen.scene.reader import parse_scene, read_scene
from eomgen.scene.schema import SHOWN
from eomgen.study.linear.equilibrium import equilibrium
from eomgen.study.linear.linearise import linearise
from eomgen.study.linear.modes import controllable_rank, modes, stability


@cache
def module_of(scene: str, text: str = "", outputs: bool = True) -> GeneratedModule:
    """The module of a built-in scene or of a text, by `aba`, which is fast to derive."""
    model = elaborate(parse_scene(text) if text else read_scene(scene))
    wanted = ("input_jacobian",) if outputs and model.inputs else ()
    model = replace(model, outputs=(*SHOWN, *wanted), route="aba")
    return load_module(text_of(model), scene)


def accelerations(module: GeneratedModule, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """v̇ at the state."""
    return module.derivative(0.0, y, None, u)[len(module.POSITIONS) :]


def test_cart_and_pole_as_in_textbooks() -> None:
    """Upright, from a bad guess: A and B as in Franklin, Powell, Emami-Naeini, rank 4."""
    module = module_of("cart_pole")
    p = module.PARAMETERS
    m, cart, inertia, arm, g = (p[name] for name in ("m_pole", "m_cart", "I_pole", "l", "g"))
    found = equilibrium(module, np.array([0.7, 2.6, 0.3, -1.0]))
    np.testing.assert_allclose(found.y, [0.7, math.pi, 0.0, 0.0], atol=1e-12)
    linear = linearise(module, found.y)
    assert linear.state_names == ("x", "theta", "x_dot", "theta_dot")
    assert linear.input_names == ("push",)
    total = inertia * (m + cart) + cart * m * arm**2
    a = np.zeros((4, 4))
    a[0, 2] = a[1, 3] = 1.0
    a[2, 1] = m**2 * arm**2 * g / total
    a[3, 1] = m * g * arm * (m + cart) / total
    b = np.array([[0.0], [0.0], [inertia + m * arm**2], [m * arm]]) / total
    np.testing.assert_allclose(linear.A, a, atol=1e-12)
    np.testing.assert_allclose(linear.B, b, atol=1e-12)
    assert linear.reduced() is linear
    found_modes = modes(linear.A)
    assert stability(found_modes) == "unstable"
    assert found_modes[0].rate == pytest.approx(math.sqrt(a[3, 1]))
    assert controllable_rank(linear.A, linear.B) == 4


def test_a_hanging_chain_has_the_roots_of_laguerre() -> None:
    """Ten equal beads on massless links: ω² = (g/l) x over the roots of L_10(x)."""
    text = """
    name = "beads"
    effects = [{ type = "gravity", g = 9.81 }]
    [[chains]]
    name = "bead"
    count = 10
    mass = 0.3
    inertia_com = 0
    r_parent = [0, 0]
    r_child = [-0.2, 0]
    """
    module = module_of("beads", text)
    start = np.random.default_rng(7).uniform(-1.0, 1.0, 20)
    resting = equilibrium(module, start, settle=True)
    np.testing.assert_allclose(resting.y[0], -math.pi / 2, atol=1e-9)
    np.testing.assert_allclose(resting.y[1:], 0.0, atol=1e-9)
    roots = np.polynomial.laguerre.lagroots([0.0] * 10 + [1.0])
    turns = [mode.angular_frequency for mode in modes(linearise(module, resting.y).A)]
    np.testing.assert_allclose(turns, np.sqrt(9.81 / 0.2 * roots), rtol=1e-8)


@pytest.mark.parametrize("scene", ["cart_pole", "acrobot", "furuta_pendulum", "spinning_top"])
def test_equilibria_from_bad_guesses(scene: str) -> None:
    """From 20 random guesses: at rest, cyclic coordinates unchanged; settled ones are stable."""
    module = module_of(scene)
    rng = np.random.default_rng(11)
    for _ in range(20):
        guess = rng.uniform(-6.0, 6.0, len(module.STATES))
        for settle in (False, True):
            y, u = equilibrium(module, guess, settle=settle)
            assert np.max(np.abs(accelerations(module, y, u))) < 1e-8
            assert not y[len(module.POSITIONS) :].any()
            if settle:
                assert stability(modes(linearise(module, y).reduced().A)) == "marginal"
            elif scene in ("cart_pole", "furuta_pendulum"):
                assert abs(y[0] - guess[0]) < 1e-12


def test_the_nearest_equilibrium_is_near() -> None:
    """From half a radian away, each equilibrium of a pendulum is found, and not the other."""
    module = module_of("acrobot")
    for upright in (0.0, math.pi):
        for turn in (-0.5, 0.5):
            y, _ = equilibrium(module, np.array([upright + turn, 0.0, 0.0, 0.0]))
            np.testing.assert_allclose(y, [upright, 0.0, 0.0, 0.0], atol=1e-9)


def test_the_sleeping_top() -> None:
    """Upright it sleeps while I_3 ω > 2 √(I m g h): Goldstein, Classical Mechanics, section 5.7."""
    module = module_of("spinning_top")
    p = module.PARAMETERS
    about_tip = p["I_1"] + p["m"] * p["h"] ** 2
    critical = 2 * math.sqrt(about_tip * p["m"] * p["g"] * p["h"]) / p["I_3"]
    for factor, verdict in ((0.99, "unstable"), (1.01, "marginal")):
        y = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, factor * critical])
        assert stability(modes(linearise(module, y).reduced().A)) == verdict


def test_reduced_linearisation_against_the_motion_itself() -> None:
    """Motions near a top that spins upright, a steady motion, diverge from it like exp(A t)."""
    module = module_of("spinning_top")
    y = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 70.0])
    a = linearise(module, y).reduced().A
    problem = as_problem(module)

    def after(start: np.ndarray) -> np.ndarray:
        moved = replace(problem, initial=start)
        return integrate(moved, "DOP853", 0.05, rtol=1e-13, atol=1e-15, samples=2).y[-1]

    def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
        return np.concatenate([[w], v])

    steady, step = after(y), 1e-5
    columns = []
    for i in range(6):
        ends = []
        for sign in (1, -1):
            start = y.copy()
            if i < 3:
                turn = np.zeros(4)
                turn[0], turn[1 + i] = math.cos(step / 2), sign * math.sin(step / 2)
                start[:4] = times(y[:4], turn)
            else:
                start[4 + i - 3] += sign * step
            end = after(start)
            conjugate = steady[:4] * [1, -1, -1, -1]
            turned = 2 * times(conjugate, end[:4])[1:]
            ends.append(np.concatenate([turned, end[4:] - steady[4:]]))
        columns.append((ends[0] - ends[1]) / (2 * step))
    np.testing.assert_allclose(np.array(columns).T, expm(0.05 * a), atol=1e-8)


def test_inputs_are_trimmed_and_coordinates_held() -> None:
    """The elbow motor holds the acrobot with its shoulder at 20 degrees, its mass below the pin."""
    module = module_of("acrobot")
    guess = np.array([math.radians(20.0), 0.0, 0.0, 0.0])
    y, u = equilibrium(module, guess, hold=("theta_1",), trim=("tau",))
    assert y[0] == guess[0]
    p = module.PARAMETERS
    below = p["m_1"] * p["c_1"] + p["m_2"] * p["l_1"]
    offset = below * math.sin(y[0]) + p["m_2"] * p["c_2"] * math.sin(y[0] + y[1])
    assert offset == pytest.approx(0.0, abs=1e-10)
    torque = p["m_2"] * p["c_2"] * p["g"] * math.sin(y[0] + y[1])
    assert u == pytest.approx([torque], abs=1e-8)
    np.testing.assert_allclose(accelerations(module, y, u), 0.0, atol=1e-9)


def test_messages() -> None:
    """Each says what is wrong and what to do."""
    cart, top = module_of("cart_pole"), module_of("spinning_top")
    falling = module_of("two_body")
    cases = [
        (lambda: equilibrium(falling, falling.initial_state()), "y_A_dot still changes by -9.8"),
        (lambda: equilibrium(cart, cart.initial_state(), hold=("thta",)), "did you mean 'theta'"),
        (lambda: equilibrium(cart, cart.initial_state(), trim=("pus",)), "did you mean 'push'"),
        (lambda: equilibrium(cart, cart.initial_state(), {"push": 1.0}), "no equilibrium"),
        (lambda: equilibrium(cart, np.full(4, np.nan)), "not finite"),
        (
            lambda: equilibrium(cart, cart.initial_state(), trim=("push",), settle=True),
            "for the nearest",
        ),
        (lambda: linearise(cart, np.zeros(3)), "shape"),
        (lambda: linearise(cart, np.zeros(4), {"pull": 1.0}), "no input 'pull'; known: push"),
        (lambda: linearise(cart, np.zeros(4), [1.0, 2.0]), "shape"),
        (lambda: linearise(cart, np.zeros(4), p={"m_cart": -1.0}), "linearise: "),
        (lambda: linearise(top, np.zeros(7)), "tip_qw has length 0"),
        (
            lambda: linearise(module_of("cart_pole", outputs=False), np.zeros(4)),
            "--outputs input_jacobian",
        ),
    ]
    for call, text in cases:
        with pytest.raises(RunError) as error:
            call()
        assert text in str(error.value) and "\n" not in str(error.value)


def test_modes_and_control_of_plain_matrices() -> None:
    """A damped oscillator, an unstable real mode, drift; and the controllable rank."""
    assert modes(np.zeros((0, 0))) == [] and stability([]) == "stable"
    (mode,) = modes(np.array([[0.0, 1.0], [-4.0, -0.4]]))
    assert (mode.rate, mode.damping) == pytest.approx((-0.2, 0.1))
    assert mode.angular_frequency == pytest.approx(2 * math.sqrt(1 - 0.01))
    assert stability([mode]) == "stable"
    rates = [mode.rate for mode in modes(np.diag([-3.0, 0.0, 2.0]))]
    assert rates == [2.0, 0.0, -3.0]
    double = modes(np.array([[0.0, 1.0], [0.0, 0.0]]))
    assert [(mode.rate, mode.angular_frequency) for mode in double] == [(0.0, 0.0)] * 2
    chain = np.diag([1.0] * 5, k=1)  # six integrators in a row, driven at the end or the start
    assert controllable_rank(chain, np.eye(6)[:, 5:]) == 6
    assert controllable_rank(chain, np.eye(6)[:, :1]) == 1
    twins = np.diag([-1.0, -1.0])
    assert controllable_rank(twins, np.ones((2, 1))) == 1
    assert controllable_rank(twins, np.zeros((2, 0))) == 0


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its output, and its files, which other programs can load."""
    command = ["linearise", "furuta_pendulum", "--route", "aba"]
    target = tmp_path / "furuta.npz"
    assert main([*command, "-o", str(target)]) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    lines = shown.out.splitlines()
    assert lines[0] == "furuta_pendulum: linearised about an equilibrium"
    assert lines[1] == "state       theta = 0, phi = 3.14159 (180 deg)"
    assert lines[3].startswith("note        at rest, without the initial theta_dot = 1.5;")
    assert lines[4].split() == ["A", "theta", "phi", "theta_dot", "phi_dot"]
    assert lines[9].split() == ["B", "tau"]
    assert "stability   unstable: a small deviation grows" in lines
    assert "control     rank 4 of 4: controllable" in lines
    with np.load(target, allow_pickle=False) as kept:
        assert kept["state_names"].tolist() == ["theta", "phi", "theta_dot", "phi_dot"]
        assert kept["input_names"].tolist() == ["tau"]
        assert kept["A"].shape == (4, 4) and kept["B"].shape == (4, 1)
        a = kept["A"]
    table = tmp_path / "furuta.csv"
    for _ in range(2):  # its own file it replaces
        assert main([*command, "-o", str(table)]) == 0
    rows = [line.split(",") for line in table.read_text("utf-8").splitlines()]
    corner = "eomgen linearisation of furuta_pendulum"
    assert rows[0] == [corner, "theta", "phi", "theta_dot", "phi_dot", "tau"]
    np.testing.assert_array_equal([[float(x) for x in row[1:5]] for row in rows[1:]], a)
    capsys.readouterr()
    table.write_text("mine")
    assert main([*command, "-o", str(table)]) == 1
    assert "was not written by eomgen" in capsys.readouterr().err


def test_an_equilibrium_says_that_it_is_at_rest(capsys: pytest.CaptureFixture[str]) -> None:
    """A message if the top spins in the scene, since the linearisation does not; none if it is at
    rest.
    """
    spins = "note        at rest, without the initial tip_wz = 60; --at initial keeps the motion\n"
    for more, reported in (([], True), (["--at", "rest"], True), (["--at", "initial"], False)):
        assert main(["linearise", "spinning_top", "--route", "aba", *more]) == 0
        assert (spins in capsys.readouterr().out) == reported
    assert main(["linearise", "acrobot", "--route", "aba"]) == 0
    assert "note" not in capsys.readouterr().out


def test_an_input_found_to_be_zero_is_shown_as_zero(capsys: pytest.CaptureFixture[str]) -> None:
    """Without the rounding errors of the search; a given input is shown as it is."""
    assert main(["linearise", "cart_pole", "--route", "aba", "--trim", "push"]) == 0
    assert "inputs      push = 0\n" in capsys.readouterr().out
    command = ["linearise", "cart_pole", "--route", "aba", "--at", "initial"]
    assert main([*command, "--input", "push=1e-12"]) == 0
    assert "inputs      push = 1e-12\n" in capsys.readouterr().out


def test_the_command_on_quaternions_and_states(capsys: pytest.CaptureFixture[str]) -> None:
    """Small rotations for quaternions; a notice if one was normalised; degrees."""
    options = ["--state", "tip_qw=2", "--state", "tip_qx=0", "--at", "initial"]
    assert main(["linearise", "spinning_top", "--route", "aba", *options]) == 0
    shown = capsys.readouterr()
    assert shown.err.startswith(
        "eomgen: note: spinning_top.toml: --state: the quaternion that starts at"
    )
    assert "    A       tip_rx  tip_ry  tip_rz  tip_wx  tip_wy  tip_wz" in shown.out
    assert "control" not in shown.out
    options = ["--state", "theta_deg=90", "--state", "x_dot=2", "--at", "initial"]
    assert main(["linearise", "cart_pole", "--route", "aba", *options]) == 0
    assert "note        no equilibrium: theta_dot changes by -" in capsys.readouterr().out
    options = ["--state", "theta_1_deg=20", "--hold", "theta_1", "--trim", "tau"]
    assert main(["linearise", "acrobot", "--route", "aba", *options]) == 0
    assert "inputs      tau = -5.0277" in capsys.readouterr().out


def test_faults_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1, one line, what to do."""
    for words, text in (
        ("two_body", "eomgen: two_body.toml: no equilibrium"),
        ("cart_pole --state thta=3", "--state: no state 'thta' (did you mean 'theta'?)"),
        ("cart_pole --state x_dot=3", "an equilibrium is at rest"),
        ("cart_pole --state theta=up", "gives no finite number"),
        ("acrobot --set g=1e308", "parameter 'g' is 1e+308, larger than 1e+100"),
        ("acrobot --set g=1e100", "the result overflows at this state"),
        ("cart_pole --hold phi", "hold: no coordinate 'phi'; known: x, theta"),
        ("cart_pole --hold x --at initial", "leave out --at initial"),
        ("cart_pole --trim tau", "trim: no input 'tau'; known: push"),
        ("cart_pole --at rest --trim push", "trimmed for the nearest equilibrium only"),
        (f"cart_pole -o {tmp_path}/a.txt", "ends in .npz or .csv"),
        ("spinning_top --state tip_qw=0 --state tip_qx=0", "has no length"),
    ):
        assert main(["linearise", *words.split(), "--route", "aba"]) == 1, words
        err = capsys.readouterr().err
        assert text in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


# --- controllers with states --------------------------------------------------------------------

ROD = """
name = "rod"
bodies = [{ name = "rod", mass = 1, inertia_com = 0.02 }]
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "rod"
r_child = [-0.25, 0]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
name = "c"
"""
LAW = 'joint = "pin"\ntarget = "-0.6"\nstiffness = 20\n'
CONTROLLED = {
    "pid": f'{ROD}type = "pid"\n{LAW}damping = 2\nintegral_gain = 10',
    "lag": f'{ROD}type = "pd"\n{LAW}damping = 2\nlag = 0.05',
    "own": f'{ROD}type = "controller"\n'
    'states = { z = { initial = 0.0, rate = "5*(2 - z)" } }\ntorques = { pin = "z" }',
    "never": f'{ROD}type = "controller"\n'
    'states = { z = { initial = 0.0, rate = "1 + z**2" } }\ntorques = { pin = "z" }',
}
WEIGHT, ABOUT_PIN = 9.81 * 0.25, 0.02 + 0.25**2


@pytest.mark.parametrize("settle", [False, True])
@pytest.mark.parametrize("controller", ["pid", "lag", "own"])
def test_states_of_controllers_come_to_rest_too(controller: str, settle: bool) -> None:
    """At the balance of moments, and A by hand: I q'' = M - m g l cos q with the law of M."""
    module = module_of(controller, CONTROLLED[controller])
    y, _ = equilibrium(module, np.array([0.3, 5.0, -1.0]), settle=settle)
    q, v, x = y
    load = WEIGHT * math.cos(q)
    steep = WEIGHT * math.sin(q)
    a = np.array([[0.0, 1.0, 0.0], [steep, 0.0, 0.0], [0.0, 0.0, 0.0]])
    if controller == "pid":  # M = 20 (-0.6 - q) - 2 v + 10 x, x' = -0.6 - q
        np.testing.assert_allclose([q, 10 * x], [-0.6, load], atol=1e-12)
        a[1] += [-20.0, -2.0, 10.0]
        a[2] = [-1.0, 0.0, 0.0]
    elif controller == "lag":  # M = x, 0.05 x' = 20 (-0.6 - q) - 2 v - x
        np.testing.assert_allclose([20 * (-0.6 - q), x], [load, load], atol=1e-11)
        a[1] += [0.0, 0.0, 1.0]
        a[2] = np.array([-20.0, -2.0, -1.0]) / 0.05
    else:  # M = x, x' = 5 (2 - x)
        np.testing.assert_allclose([x, load], [2.0, 2.0], atol=1e-12)
        a[1] += [0.0, 0.0, 1.0]
        a[2] = [0.0, 0.0, -5.0]
    a[1] /= ABOUT_PIN
    assert v == 0.0
    np.testing.assert_allclose(linearise(module, y).A, a, rtol=1e-12, atol=1e-12 * np.abs(a).max())


def test_what_of_a_controller_never_rests_is_named() -> None:
    module = module_of("never", CONTROLLED["never"])
    with pytest.raises(RunError, match=r"no equilibrium: z still changes by 1 1/s, and no free"):
        equilibrium(module, np.array([0.3, 0.0, 0.0]))


def test_states_of_controllers_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Given, found, and with their units."""
    scene = tmp_path / "rod.toml"
    scene.write_text(CONTROLLED["pid"])
    assert main(["linearise", str(scene), "--state", "c_integral=3"]) == 0
    assert "pin_angle = -0.6 (-34.3775 deg), c_integral = 0.202414 rad s" in capsys.readouterr().out
    here = ["--at", "initial", "--state", "pin_angle=-0.5", "--state", "c_integral=3"]
    assert main(["linearise", str(scene), *here]) == 0
    said = capsys.readouterr().out
    assert "c_integral = 3 rad s" in said and "no equilibrium: pin_angle_dot changes by" in said
    scene.write_text(CONTROLLED["lag"])
    assert main(["linearise", str(scene), "--at", "initial"]) == 0
    assert "c_torque changes by -240 N m/s" in capsys.readouterr().out


def test_a_steady_motion_is_reported_from_one_that_is_not(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A sleeping top is steady; a leaning one is not, nor is a state in passing."""
    top = ["linearise", "spinning_top", "--at", "initial", "--state", "tip_wz=70"]
    assert main([*top, "--state", "tip_qw=1", "--state", "tip_qx=0"]) == 0
    assert "note        a steady motion: no velocity changes" in capsys.readouterr().out
    assert main(top) == 0
    assert "steady" not in capsys.readouterr().out
    cart = ["linearise", "cart_pole", "--at", "initial", "--state", "x_dot=1"]
    assert main([*cart, "--state", "theta=0", "--state", "theta_dot=0"]) == 0
    assert "a steady motion" in capsys.readouterr().out
    assert main([*cart, "--state", "theta=0", "--state", "theta_dot=1e-7"]) == 0
    assert "steady" not in capsys.readouterr().out
