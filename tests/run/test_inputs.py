"""Inputs of a run that are formulas, tables or functions of time; states given by name."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from scenes import effect, lone
from scipy.integrate import solve_ivp

import eomgen
from eomgen.commands.main import main
from eomgen.run.inputs import Table
from eomgen.run.intervals import Interval

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
CART = lone(
    "prismatic",
    effect("external_force", name="rotor", body="block", force=["3*thrust + wind", 0]),
    effect("motor", name="push", joint="rail", torque="input"),
    body="block",
    on="rail",
    name="cart",
    inputs=["thrust", {"name": "wind", "unit": "N", "about": "side wind"}],
    parameters={"m": 2.0},
    mass="m",
    inertia_com=0,
    axis=[1, 0],
    coordinate="x",
)


def test_inputs_of_a_scene_enter_its_formulas(tmp_path: Path) -> None:
    """x'' = (3 thrust + wind + push)/m for constants, formulas, functions and tables."""
    table = tmp_path / "inputs.csv"
    table.write_text("wind, t, thrust\n0, 0, 0\n4, 1, 2\n4, 2, -1\n")
    ways = {
        "constants": ({"thrust": 1.0, "wind": 2.0}, lambda t: 5.0),
        "formulas": (
            {"push": "m*sin(3*t) - 4*x", "thrust": "max(0, t - 1)", "wind": 1.0},
            lambda t, x: 2 * math.sin(3 * t) - 4 * x + 3 * max(0.0, t - 1) + 1,
        ),
        "functions": ({"push": math.cos, "wind": 1}, lambda t: math.cos(t) + 1),
        "a table": (
            str(table),
            lambda t: 3 * np.interp(t, [0, 1, 2], [0, 2, -1]) + np.interp(t, [0, 1], [0, 4]),
        ),
    }
    for way, (inputs, force) in ways.items():
        run = eomgen.simulate(
            CART, inputs=inputs, t_end=2.5, state={"x": 0.1, "x_dot": -1}, samples=26
        )
        assert run.finished and run.y[0].tolist() == [0.1, -1.0]

        def rate(t: float, y: np.ndarray, force=force, way=way) -> list[float]:
            return [y[1], (force(t, y[0]) if way == "formulas" else force(t)) / 2]

        true = solve_ivp(
            rate, (0, 2.5), [0.1, -1], t_eval=run.t, rtol=1e-10, atol=1e-12, max_step=0.01
        )
        assert np.abs(run.y - true.y.T).max() < 1e-7, way
    plain = eomgen.simulate(CART, inputs={"push": "1 + x"}, t_end=1)
    assert "push" not in eomgen.load(eomgen.generate(CART)).PARAMETERS
    assert "(x + 1.0)" in plain.module.source or "1.0 + x" in plain.module.source


def test_a_pulse_in_a_table_is_not_passed_over() -> None:
    """A hundredth of a second of force in a motion that takes one long step otherwise."""
    inputs = {"push": Table(np.array([0, 5, 5.005, 5.01]), np.array([0, 0, 4.0, 0]))}
    run = eomgen.simulate(CART, inputs=inputs, t_end=20)
    assert run.y[-1, 1] == pytest.approx(0.01, rel=1e-6)  # ∫ force dt / m


def test_a_table_encloses_its_values_and_knows_its_corners() -> None:
    """Over intervals, at the ends of which or in which its greatest value is."""
    table = Table(np.array([0.0, 1, 2, 3, 4]), np.array([1.0, 2, 3, 0, 0]))
    assert table.corners == [0, 2, 3]
    assert table.over(Interval(0.5, 2.5)) == Interval(1.5, 3.0)
    assert table.over(Interval(-2, -1)) == Interval(1.0, 1.0)


def test_what_is_wrong_with_inputs_and_states_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line each, with the option or the line of the table."""
    monkeypatch.chdir(tmp_path)
    Path("cart.toml").write_text(CART)
    files = {
        "none": "x,push\n1,2\n",
        "text": "t,push\n0,1\n1,up\n",
        "order": "t,push\n1,1\n0,1\n",
        "who": "t,pull\n1,1\n2,1\n",
    }
    for name, text in files.items():
        Path(f"{name}.csv").write_text(text)
    for option, message in {
        "--input pull=1": "--input: no input 'pull'; known: thrust, wind, push",
        "--input push=3*y": "--input push: unknown name 'y'",
        "--input push=3*": "--input push: '3*' is not a formula at column 3",
        "--input push=__import__('os')": "--input push: \"__import__('os')\" has '__import__'",
        "--input none.csv": "--input: none.csv:1: needs a first line with t and the names",
        "--input text.csv": "--input: text.csv:3: does not have 2 values, with finite numbers",
        "--input order.csv": "--input: order.csv: the times t must ascend",
        "--input who.csv": "--input: who.csv:1: none of its columns is an input",
        "--input missing.csv": "missing.csv: cannot be read",
        "--input push=push": "--input push: unknown name 'push'",
        "--state y=1": "--state: no state 'y'",
        "--state x=up": "--state x=up: gives no finite number",
        "--state x=1 --form momentum": "--state",
    }.items():
        assert main(["simulate", "cart.toml", "--no-pictures", *option.split()]) == 1, option
        assert message.replace('"', "'") in capsys.readouterr().err.replace('"', "'")
    for wrong, message in (
        (
            '["thrust", "wind", "m"]',
            "inputs[2]: 'm' would be the name of an input and of a parameter",
        ),
        ('["thrust", "wind", "t"]', "inputs[2]: 't' would be the name"),
        ('[{ unit = "N" }]', "inputs[0].name: missing"),
        ("[3]", "inputs[0]: 3 is not a text; give one"),
    ):
        text = CART.replace('["thrust", { name = "wind", unit = "N", about = "side wind" }]', wrong)
        with pytest.raises(eomgen.SceneError) as error:
            eomgen.check(text)
        assert message in str(error.value)
    for other in ({"accuracy": 1e-6}, {"estimate": True}, {"guard": "stop"}, {"backend": "c"}):
        with pytest.raises(eomgen.RunError, match="tables and functions of time do not go"):
            eomgen.simulate(CART, inputs={"push": math.sin}, **other)
    with pytest.raises(eomgen.RunError, match="inputs: Taylor series need constant inputs"):
        eomgen.simulate(CART, inputs={"push": math.sin}, integrator="taylor")


def test_a_run_from_another_state_is_not_continued_as_if_it_were_the_scenes(
    tmp_path: Path,
) -> None:
    """Its tolerances are relative to its own start; the same start continues it exactly."""
    options = {"inputs": {"push": "-x"}, "t_end": 1.0}
    first = eomgen.simulate(CART, state={"x": 1.0}, **options)
    options["t_end"] = 2.0
    again = eomgen.simulate(CART, state={"x": 1.0}, resume=first, **options)
    assert "as if the run had not ended" in again.begun
    whole = eomgen.simulate(CART, state={"x": 1.0}, **options)
    assert again.y[-1].tobytes() == whole.y[-1].tobytes()
    assert "another initial state" in eomgen.simulate(CART, resume=first, **options).begun


@pytest.mark.skipif(CC is None, reason="there is no C compiler")
def test_formulas_are_compiled_and_functions_are_not_forgotten() -> None:
    """A formula gives the same bits in C; a later run cannot take a function for constants."""
    options = {"inputs": {"push": "sin(t) - x"}, "t_end": 5.0}
    run, compiled = (eomgen.simulate(CART, **options, backend=way) for way in ("numpy", "c"))
    assert compiled.compiled and run.y.tobytes() == compiled.y.tobytes()
    text = CART.replace('name = "wind"', 'name = "wind", default = 3.0')
    run, compiled = (eomgen.simulate(text, t_end=5.0, backend=way) for way in ("numpy", "c"))
    assert compiled.compiled and run.y.tobytes() == compiled.y.tobytes()
    assert run.y[-1, 1] == pytest.approx(3.0 / 2 * 5, rel=1e-9)
    varied = eomgen.simulate(CART, inputs={"push": math.sin}, t_end=1)
    assert "starts anew" in eomgen.simulate(CART, resume=varied, t_end=2).begun


def test_inputs_of_time_go_wherever_a_motion_is_computed(tmp_path: Path) -> None:
    """Sweeps, measurements and checks follow formulas and tables as a run does; linearisation
    takes constants only.
    """
    table = tmp_path / "inputs.csv"
    table.write_text("t, push\n0, 1\n0.3, -2\n1.7, 3\n")
    ways = ({"push": "m*sin(3*t) - x", "thrust": 0.5}, str(table))
    for inputs in some(ways[1:], ways):
        members = eomgen.ensemble(CART, {"m": [1.0, 2.5]}, inputs=inputs, t_end=2.0)
        for m, final in zip((1.0, 2.5), members.final, strict=True):
            run = eomgen.simulate(CART, inputs=inputs, parameters={"m": m}, t_end=2.0)
            assert run.y[-1].tobytes() == final.tobytes()
        found = eomgen.accuracy(CART, inputs=inputs, methods=["rk4"], quick=True, t_end=2.0)
        run = eomgen.simulate(CART, inputs=inputs, rtol=1e-11, atol=1e-13, t_end=2.0)
        assert np.abs(found.reference.y[-1] - run.y[-1]).max() < 1e-9
        assert eomgen.verify(CART, states=1, inputs=inputs).missed == ()
    # Without the motor the cart stays; with it x = push t²/2m.
    bill = eomgen.effects(CART, motion=2.0, each=True, inputs={"push": 6.0, "thrust": "0*t"})
    (change,) = [item.change for item in bill.items if "push" in item.label and item.change]
    assert change.distance == pytest.approx(6 / 2 / 2 * change.until**2)
    for wrong in ({"push": "3*t"}, {"push": math.sin}, str(table)):
        with pytest.raises(eomgen.RunError, match="linearise takes constant inputs"):
            eomgen.linearise(CART, at="initial", inputs=wrong)
    assert eomgen.linearise(CART, at="initial", inputs={"push": "2*3"}).u.tolist() == [0, 0, 6]
    with pytest.raises(eomgen.RunError, match="only simulate takes"):
        eomgen.ensemble(CART, {"m": [1.0]}, inputs={"push": math.sin})
    with pytest.raises(eomgen.RunError, match="push is also given a fixed value"):
        eomgen.ensemble(CART, {"push": [1.0]}, inputs=str(table))
    long = {"push": Table(np.arange(200.0), np.arange(200.0) % 2)}
    with pytest.raises(eomgen.RunError, match="has 200 corners"):
        eomgen.verify(CART, inputs=long)
