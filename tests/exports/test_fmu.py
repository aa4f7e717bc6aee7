"""Units for co-simulation: valid, and their motions and derivatives are those of our own runs."""

import io
import math
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from crank_rocker import four_bar
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from importer import begun, exchanged, instance

import eomgen
from eomgen.base.errors import RunError, SceneError
from eomgen.commands.main import main
from eomgen.engine.methods import METHODS
from eomgen.exports.fmu_unit import ENERGIES
from eomgen.exports.units import exponents, rate_of
from eomgen.native import compiler
from eomgen.run.integrators import Adaptive, find_integrator

pytestmark = pytest.mark.apart

BALL = """
name = "thrown_ball"
title = "Ball & <floor>, \\"--> é"
initial = { q = { ball_y = 0.3 }, v = { ball_x_dot = 1.0, ball_angle_dot = -3.0 } }
simulation = { t_end = 1.6, dt = 4e-3 }
bodies = [{ name = "ball", mass = 0.2, inertia_com = 2e-4 }]
joints = [{ name = "flight", type = "free", child = "ball" }]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "contact"
name = "floor"
law = "impact"
body = "ball"
radius = 0.05
restitution = 0.4
friction = 0.3
slip_speed = 0.01
"""
STIFF = """
name = "stiff_pendulum"
bodies = [{ name = "bob", mass = 1.0, inertia_com = 0.1 }]
initial = { q = { pivot_angle = 1.0 }, v = { pivot_angle_dot = 3.0 } }
joints = [
    { name = "pivot", type = "revolute", parent = "world", child = "bob", r_child = [0.0, 1.0] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "joint_friction", name = "bearing", joint = "pivot", viscous = 900.0 },
]
"""
SCENES = {
    "ball": BALL,
    "contacts": "bouncing_two_body",
    "stiff": STIFF,
    "pendulum": "pendulum",
    "top": "spinning_top",
    "loop": four_bar(),
    "rolling": "rattleback",
}
RUNS = [
    *(("cart_pole", 2.0), ("tumbling_body", 3.0), (BALL, 0.45), (BALL, 1.6)),
    pytest.param("four_bar", 0.5, marks=pytest.mark.full),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of units that are exported once."""
    return tmp_path_factory.mktemp("units")


@cache
def unit(folder: Path, scene: str) -> Path:
    """The unit of a scene."""
    path = folder / f"{eomgen.read(scene).name}.fmu"
    return eomgen.export(scene, "fmu", path)[0]


def stepped(path: Path, run: Any) -> list[float]:
    """The last state of a unit in co-simulation, at the end of a run."""
    t_end = run.t[-1]
    found = simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        stop_time=t_end,
        output_interval=t_end / 4,
        relative_tolerance=1e-12,
        output=list(run.states),
    )
    return [found[name][-1] for name in run.states]


@pytest.mark.every(2)
@pytest.mark.parametrize(("scene", "t_end"), RUNS)
def test_a_unit_moves_as_our_own_run(scene: str, t_end: float, folder: Path) -> None:
    """Plane, space, a loop, and impacts until a contact is held: both kinds, to 1e-8."""
    path = unit(folder, scene)
    assert validate_fmu(str(path)) == []
    run = eomgen.simulate(scene, t_end=t_end, rtol=1e-12, atol=1e-14, samples=2)
    assert run.finished
    assert (t_end == 1.6) == any(event.kind == "rest" for event in run.trajectory.events)
    np.testing.assert_allclose(stepped(path, run), run.y[-1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(exchanged(path, t_end), run.y[-1], rtol=1e-8, atol=1e-8)


@pytest.mark.every(15)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", METHODS)
def test_each_method_moves_as_our_own_run(scene: str, method: str, tmp_path: Path) -> None:
    """Impacts, a stiff motion, a quaternion, a loop, rolling; equal steps to the bit."""
    source, t_end = SCENES[scene], {"ball": 1.6, "contacts": 0.9, "rolling": 0.04}.get(scene, 0.2)
    try:
        path = eomgen.export(source, "fmu", tmp_path / "unit.fmu", integrator=method)[0]
        refused = ""
    except RunError as error:
        refused = str(error)
    assert refused.startswith("integrator: ") == is_refused(scene, method), refused
    if refused:
        return
    adapts = isinstance(find_integrator(method), Adaptive)
    unstable = {"unstable": True} if method in ("euler", "rk4", "semi_implicit_euler") else {}
    own: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14} if adapts else unstable
    run = eomgen.simulate(source, t_end=t_end, samples=2, integrator=method, backend="numpy", **own)
    assert run.finished
    if adapts:
        np.testing.assert_allclose(stepped(path, run), run.y[-1], rtol=1e-8, atol=1e-8)
    else:
        assert stepped(path, run) == run.y[-1].tolist()


CAM = """
name = "cam"
parameters = { a = 6.1 }
bodies = [{ name = "disc", mass = 1.0, inertia_com = 0.4 }]
joints = [{ name = "axle", type = "revolute", parent = "world", child = "disc", coordinate = "q" }]
effects = [
    { type = "motor", name = "cam", joint = "axle", torque = "-9*step(q - a)*step(a + 0.02 - q)" },
]
initial = { v = { q_dot = 3.0 } }
"""


def test_steps_pass_over_no_brief_force(tmp_path: Path) -> None:
    """A cam that brakes for 7 ms in a communication step of 4 s."""
    path = eomgen.export(CAM, "fmu", tmp_path / "unit.fmu")[0]
    found = simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        stop_time=4.0,
        output_interval=4.0,
        relative_tolerance=1e-9,
        output=["q_dot"],
    )
    right = math.sqrt(9.0 - 2 * 9 * 0.02 / 0.4)  # what the work of the cam leaves
    assert found["q_dot"][-1] == pytest.approx(right, abs=1e-7)


def is_refused(scene: str, method: str) -> bool:
    """Whether steps of a scene cannot be made by a method."""
    if method == "linearly_implicit":
        return scene in ("ball", "contacts")
    return "leapfrog" in method and scene not in ("pendulum", "loop")


def test_the_units_own_solver_of_an_importer_agrees(folder: Path) -> None:
    """FMPy's solver, of order 5 at most, finds the events of the ball."""
    path = unit(folder, BALL)
    run = eomgen.simulate(BALL, rtol=1e-12, atol=1e-14, samples=2)
    found = simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=1.6,
        output_interval=0.01,
        relative_tolerance=1e-11,
        output=list(run.states),
    )
    last = [found[name][-1] for name in run.states]
    np.testing.assert_allclose(last, run.y[-1], rtol=1e-8, atol=1e-8)


def test_values_and_directional_derivatives_are_those_of_the_module(folder: Path) -> None:
    """By states and inputs they are columns of the generated Jacobians; outputs by differences."""
    module: Any = eomgen.load(eomgen.generate("cart_pole", outputs="all"))
    states, inputs, parameters = module.STATES, tuple(module.INPUTS), tuple(module.PARAMETERS)
    y = np.array([0.3, 0.7, -0.4, 1.1])
    with instance(unit(folder, "cart_pole"), "ModelExchange") as (fmu, refs):
        fmu.setFloat64([refs[name] for name in (*states, *inputs)], [*y, 0.8])
        fmu.setFloat64([refs[parameters[0]]], [1.7])
        begun(fmu, 1.0)
        p, u = {parameters[0]: 1.7}, {inputs[0]: 0.8}
        rates = [refs[f"der({name})"] for name in states]
        outputs = [refs[name] for name in ("energy.kinetic", "energy.potential", "pole.x")]
        np.testing.assert_array_equal(fmu.getFloat64(rates), module.derivative(0.0, y, p, u))
        energies = [getattr(module, name)(0.0, y, p, u) for name in ENERGIES]
        np.testing.assert_array_equal(fmu.getFloat64(outputs[:2]), energies)
        exact = {
            **dict(zip(states, module.jacobian(0.0, y, p, u).T, strict=True)),
            **dict(zip(inputs, module.input_jacobian(0.0, y, p, u).T, strict=True)),
            **dict(zip(parameters, module.parameter_jacobian(0.0, y, p, u).T, strict=True)),
        }
        for name, column in exact.items():
            found = fmu.getDirectionalDerivative(rates, [refs[name]], [2.0])
            np.testing.assert_allclose(found, 2 * column, rtol=1e-12, atol=1e-12)
        for i, name in enumerate(states):
            ahead, behind = (y + 1e-6 * sign * np.eye(4)[i] for sign in (1, -1))
            change = module.kinetic_energy(0.0, ahead, p, u) - module.kinetic_energy(
                0.0, behind, p, u
            )
            found = fmu.getDirectionalDerivative(outputs[:1], [refs[name]], [1.0])
            np.testing.assert_allclose(found, change / 2e-6, atol=1e-8)


def test_a_state_of_the_unit_is_kept_and_given_back(folder: Path) -> None:
    """Two instances are independent, and bytes of one continue in the other; parameters change."""
    path = unit(folder, BALL)
    with instance(path, "CoSimulation") as (one, refs), instance(path, "CoSimulation") as (two, _):
        names = [refs["ball_x"], refs["ball_y"], refs["ball_angle_dot"]]
        for fmu in (one, two):
            begun(fmu, 2.0)
        one.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.3)
        assert two.getFloat64(names) == [0.0, 0.3, -3.0]
        kept = one.getFMUState()
        data = one.serializeFMUState(kept)
        one.doStep(currentCommunicationPoint=0.3, communicationStepSize=0.3)
        wanted = one.getFloat64(names)
        other = two.deserializeFMUState(data)
        two.setFMUState(other)
        two.doStep(currentCommunicationPoint=0.3, communicationStepSize=0.3)
        assert two.getFloat64(names) == wanted
        one.setFMUState(kept)
        one.doStep(currentCommunicationPoint=0.3, communicationStepSize=0.3)
        assert one.getFloat64(names) == wanted
        one.freeFMUState(kept), two.freeFMUState(other)
        with pytest.raises(Exception, match="fmi3DoStep"):
            one.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.3)


def test_same_scene_same_bytes_and_nothing_foreign_is_replaced(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The unit's own file is replaced, another one is not; without a compiler it has sources."""
    path = unit(folder, "cart_pole")
    data = path.read_bytes()
    assert eomgen.export("cart_pole", "fmu", path) == (path,)
    assert path.read_bytes() == data
    foreign = tmp_path / "foreign.fmu"
    foreign.write_bytes(b"PK: not ours")
    with pytest.raises(RunError, match="not written by eomgen"):
        eomgen.export("cart_pole", "fmu", foreign)
    assert foreign.read_bytes() == b"PK: not ours"

    def none() -> None:
        raise RunError(compiler.ABSENT)

    monkeypatch.setattr("eomgen.exports.fmu.find_compiler", none)
    alone = tmp_path / "alone.fmu"
    assert main(["export", "cart_pole", "--fmu", "-o", str(alone)]) == 0
    with zipfile.ZipFile(alone) as made:
        assert not any(name.startswith("binaries") for name in made.namelist())
    with zipfile.ZipFile(io.BytesIO(data)) as made:
        assert any(name.startswith("binaries") for name in made.namelist())


def test_what_a_unit_cannot_hold_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One clear line, and no file."""
    with pytest.raises(SceneError, match=r"form: .*leave it out"):
        eomgen.export("two_body", "fmu", tmp_path / "x.fmu", form="momentum")
    with pytest.raises(RunError, match="number: not an option of fmu; only of firmware"):
        eomgen.export("two_body", "fmu", tmp_path / "x.fmu", number="float")
    with pytest.raises(RunError, match="'Radau' makes no steps of exported code"):
        eomgen.export("two_body", "fmu", tmp_path / "x.fmu", integrator="Radau")
    with pytest.raises(RunError, match="unknown name 'fmi'"):
        eomgen.export("two_body", "fmi", tmp_path / "x.fmu")
    assert not list(tmp_path.iterdir())
    assert main(["export", "two_body", "--fmu", "--float"]) == 1
    assert capsys.readouterr().err == "eomgen: --float: not an option of fmu; only of firmware\n"


def test_units_have_their_dimensions(folder: Path) -> None:
    """Exponents of the base units, and none where a unit is not a product of whole powers."""
    assert exponents("N m s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert exponents("m^3/s^2") == {"m": 3, "s": -2}
    assert exponents("N/m^1.5") is exponents("furlong") is exponents("W/m K") is None
    assert [rate_of(x) for x in ("m", "rad/s", "m/s^2", "")] == ["m/s", "rad/s^2", "m/s^3", "1/s"]
    description = read_model_description(str(unit(folder, "cart_pole")))
    units = {each.name: each.baseUnit for each in description.unitDefinitions}
    assert (units["J"].kg, units["J"].m, units["J"].s) == (1, 2, -2)


def test_a_unit_that_does_not_compile_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A warning, and in a terminal a line."""
    monkeypatch.setattr("eomgen.exports.fmu.FLAGS", ("-Ddouble=none",))
    path = tmp_path / "unit.fmu"
    with pytest.warns(UserWarning, match="the unit has sources alone: .*error"):
        eomgen.export("pendulum", "fmu", path, integrator="Rodas5P")
    with zipfile.ZipFile(path) as made:
        assert not [name for name in made.namelist() if name.startswith("binaries")]
