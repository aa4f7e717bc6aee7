"""Runs in compiled code, by steps or by functions alone: the bits of Python's, and when a run takes
them.
"""

import ctypes
import math
import re
import shutil
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.api.generating import compiled as generated
from eomgen.api.given import check, read
from eomgen.api.options import RunOptions
from eomgen.api.planning import plan_run
from eomgen.api.runs import Run
from eomgen.base.errors import RunError
from eomgen.codegen import jacobians
from eomgen.codegen.backends import c, c_directions
from eomgen.codegen.interface import interface_of
from eomgen.model.model import Model
from eomgen.native import accelerator, functions
from eomgen.native.accelerator import Accelerator
from eomgen.native.library import built
from eomgen.pipeline import compile_program
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Problem
from eomgen.scene.built_in import built_in_names
from eomgen.store import interfaced_program_of
from eomgen.study.accuracy.moved import moved
from eomgen.study.diagnosis import problem_of

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")
pytestmark = compiler
FALL = """
name = "bead"
bodies = [{ name = "bead", mass = 2.0, inertia_com = 0 }]
effects = [{ type = "motor", name = "pull", joint = "wire", torque = "-1/x**2" }]
initial = { q = [1.0], v = [0.0] }
[[joints]]
name = "wire"
type = "prismatic"
parent = "world"
child = "bead"
axis = [1, 0]
coordinate = "x"
"""
TOP = """
name = "top"
dimensions = 3
route = "aba"
parameters = { k = 40.0, c = 2.0 }
bodies = [
    { name = "hull", mass = 2.0, inertia_com = [0.3, 0.4, 0.5] },
    { name = "arm", mass = 0.5, inertia_com = [0.02, 0.03, 0.04] },
]
effects = [
    { type = "gravity", g = 9.81 },
    { type = "joint_spring", name = "stiff", joint = "elbow", stiffness = "k", damping = "c" },
    { type = "motor", name = "drive", joint = "elbow", torque = "3*sin(4*t)" },
    { type = "motor", name = "push", joint = "elbow", torque = "input" },
]
initial = { q = { b = 0.1 }, v = { hang_wx = 3.0, hang_wz = 8.0 } }
[[joints]]
name = "hang"
type = "ball"
parent = "world"
child = "hull"
r_child = [0.1, 0, 0.4]
[[joints]]
name = "elbow"
type = "revolute"
parent = "hull"
child = "arm"
axis = [0, 1, 0]
r_child = [-0.3, 0, 0]
coordinate = "b"
"""
"""A quaternion, an elbow with spring and damper, a drive that depends on time, an input."""
PLANE = """
name = "plane_orbit"
bodies = [
    { name = "cart", mass = 1.0, inertia_com = 0 },
    { name = "bead", mass = 2.0, inertia_com = 0 },
]
effects = [
    { type = "motor", name = "pull", joint = "along", torque = "sin(3*t) - 40*x**3" },
    { type = "motor", name = "hold", joint = "across", torque = "-30*s + x" },
]
initial = { q = [1.0, 0.5], v = [0.2, -1.0] }
[[joints]]
name = "along"
type = "prismatic"
parent = "world"
child = "cart"
axis = [1, 0]
coordinate = "x"
[[joints]]
name = "across"
type = "prismatic"
parent = "cart"
child = "bead"
axis = [0.6, 0.8]
coordinate = "s"
"""
"""Two masses on straight wires: forces depend on positions and time, as leapfrog asks."""
STIFF = {"k": 1e6, "c": 1e3}
"""Parameters of TOP that only implicit methods can follow."""
Options = dict[str, Any]
ADAPTIVE = ("DOP853", "Rodas5P", "RK45", "Radau", "BDF")
"""The first two make steps in C; the others call functions in C."""
EXPLICIT = ("euler", "semi_implicit_euler", "rk4")
GAUSS = ("implicit_midpoint", "gauss_4", "gauss_6")
LEAPFROGS = ("leapfrog", "leapfrog_4", "leapfrog_6")


def both(scene: str, **options: Any) -> tuple[Run, Run]:
    """A run in compiled code, and in Python."""
    options = {"integrator": "DOP853", **options}
    compiled = eomgen.simulate(scene, backend="c", **options)
    python = eomgen.simulate(scene, backend="numpy", **options)
    assert not python.compiled
    return compiled, python


def assert_same(compiled: Run, python: Run) -> None:
    """The runs are the same to the bit, also in what a later one continues from."""
    ours, theirs = compiled.trajectory, python.trajectory
    assert ours.t.tobytes() == theirs.t.tobytes()
    assert ours.y.tobytes() == theirs.y.tobytes()
    assert ours.counts == theirs.counts
    assert ours.events == theirs.events
    assert (ours.works is None) == (theirs.works is None)
    assert ours.works is None or ours.works.tobytes() == theirs.works.tobytes()
    assert ours.outcome == theirs.outcome and ours.message == theirs.message
    assert ours.resume.keys() == theirs.resume.keys()
    for name, value in ours.resume.items():
        assert value.tobytes() == theirs.resume[name].tobytes(), name


def alike(scene: str, **options: Any) -> Run:
    """The compiled run, which is that of Python."""
    compiled, python = both(scene, **options)
    assert_same(compiled, python)
    assert compiled.compiled
    return compiled


def usual(method: str, dt: float = 1e-3) -> tuple[str, Options]:
    """A scene that a method can integrate, and the options of a run."""
    if method in ADAPTIVE:
        own = {"rtol": 1e-5, **({"parameters": STIFF} if method == "Rodas5P" else {})}
    else:
        own = {"dt": dt, "unstable": method not in GAUSS}
    return PLANE if method in LEAPFROGS else TOP, {"integrator": method, **own}


# The bits.


@pytest.mark.parametrize("method", ADAPTIVE)
def test_steps_of_many_lengths_have_the_bits_of_python(method: str) -> None:
    """Rejected at loose tolerances, or bounded; quaternions are normalised, time, parameters and
    inputs count, and rows lie in steps.
    """
    scene, options = usual(method)
    values = {**options.pop("parameters", {}), "arm_mass": 0.7}
    options |= {"parameters": values, "inputs": {"push": 0.3}}
    alike(scene, **{**options, "rtol": 1e-3}, t_end=0.1, samples=137)
    if method in ADAPTIVE[:2]:
        options["rtol"] = 1e-10 if method == "DOP853" else 1e-5
        run = alike(scene, **options, t_end=0.2, max_step=0.005)
        assert run.trajectory.counts["capped"] > 30


@pytest.mark.every(2)
@pytest.mark.parametrize("method", [*EXPLICIT, *GAUSS])
def test_equal_steps_have_the_bits_of_python(method: str) -> None:
    """Over more than one stride; Newton's iterations are as many; some of the steps are rows."""
    scene, options = usual(method, 1e-3 if method in GAUSS else 2e-4)
    options |= {"parameters": {"arm_mass": 0.7}, "inputs": {"push": 0.3}}
    end, count = (0.0507, 51) if method in GAUSS else (0.30007, 1501)
    for samples in (None, 7):
        options["unstable"] = samples == 7 and method not in GAUSS
        run = alike(scene, **options, t_end=end, samples=samples)
        assert run.trajectory.counts["steps"] == count


@pytest.mark.every(2)
@pytest.mark.parametrize("method", LEAPFROGS)
@pytest.mark.parametrize("scene", [PLANE, FALL])
def test_leapfrog_has_the_bits_of_python(scene: str, method: str) -> None:
    """The stability of its steps is judged alike, too."""
    for dt, unstable in ((1e-3, True), (1e-3, False), (0.2, False)):
        compiled, python = both(scene, t_end=0.53, integrator=method, dt=dt, unstable=unstable)
        assert_same(compiled, python)


@pytest.mark.full
@pytest.mark.parametrize("method", [*ADAPTIVE, *EXPLICIT, *GAUSS, "leapfrog"])
@pytest.mark.parametrize("scene", built_in_names())
def test_bits_of_built_in_scenes(scene: str, method: str) -> None:
    large = scene in ("ragdoll", "walker_motors", "human_figure", "stiff_beam")
    for rtol in (1e-3, 1e-7):
        own: Options = {"rtol": rtol} if method in ADAPTIVE else {"dt": 1e-3}
        if method in EXPLICIT:
            own["unstable"] = rtol > 1e-4
        end = 0.1 if large or method in ADAPTIVE[2:] else 1.0
        try:
            eomgen.simulate(scene, t_end=1e-3, integrator=method, **own)
        except eomgen.RunError as error:
            assert re.match("integrator: (leapfrog|BDF) ", str(error))
            return  # it does not suit the scene
        assert_same(*both(scene, t_end=end, integrator=method, samples=137, **own))


@pytest.mark.full
@pytest.mark.parametrize("method", ["DOP853", "Rodas5P", "gauss_4"])
def test_no_optimisation_changes_a_bit(method: str, optimised: None) -> None:
    """Other tests compile without it."""
    scene, options = usual(method)
    alike(scene, **options, t_end=0.1)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["rk4", "DOP853", "Rodas5P", "gauss_4", "leapfrog", "RK45"])
def test_a_run_goes_on_in_either(method: str) -> None:
    """What one has begun the other continues, with the control of its steps, also from the middle
    of a step of the whole run.
    """
    scene, options = usual(method, 1e-2)
    whole = eomgen.simulate(scene, t_end=0.6, backend="numpy", **options)
    for first, second in (("c", "numpy"), ("numpy", "c"), ("c", "c")):
        begun = eomgen.simulate(scene, t_end=0.305, backend=first, **options)
        run = eomgen.simulate(scene, t_end=0.6, resume=begun, backend=second, **options)
        if method not in ADAPTIVE or second != first:
            assert run.y[-1].tobytes() == whole.y[-1].tobytes()
        assert run.compiled == (second == "c")


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["DOP853", "rk4", "Rodas5P"])
def test_each_step_is_followed(method: str) -> None:
    """And the run ends at the very step at which it is asked to."""
    scene, options = usual(method)
    most = 1500 if method == "rk4" else 30

    def following(seen: list[tuple[float, bytes]]) -> Callable[[float, Any], bool]:
        def follow(t: float, y: Any) -> bool:
            seen.append((t, y.tobytes()))
            return len(seen) == most

        return follow

    seen: dict[str, list[tuple[float, bytes]]] = {"c": [], "numpy": []}
    runs = [
        eomgen.simulate(scene, backend=name, follow=following(steps), t_end=9.0, **options)  # type: ignore[arg-type]
        for name, steps in seen.items()
    ]
    assert seen["c"] == seen["numpy"] and len(seen["c"]) == most
    assert_same(*runs)


@pytest.mark.every(4)
@pytest.mark.parametrize("method", [*EXPLICIT, *GAUSS, "leapfrog", "DOP853", "Rodas5P"])
def test_what_fails_fails_alike(method: str) -> None:
    """In the fall into a centre, and where Newton's iteration does not converge."""
    for dt in (1e-3, 0.3) if method in (*GAUSS, "leapfrog") else (1e-3,):
        own: Options = {} if method in ADAPTIVE else {"dt": dt, "unstable": method in EXPLICIT}
        compiled, python = both(FALL, t_end=3.0, integrator=method, **own)
        assert_same(compiled, python)
        assert compiled.compiled and (method not in ADAPTIVE or not compiled.finished)


@pytest.mark.every(2)
@pytest.mark.parametrize(("dt", "t_end"), [(0.05, 20.0), (0.2, 50.0)])
@pytest.mark.parametrize("method", EXPLICIT)
def test_steps_that_jump_are_checked_alike(
    dt: float, t_end: float, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The monitor looks at the same steps and knows the same of them; messages are the same."""
    looks: list[list[Any]] = []
    affordable = StabilityMonitor._is_affordable

    def noted(self: StabilityMonitor, problem: Any, rate: Any, evaluated: Any, h: float) -> bool:
        found = affordable(self, problem, rate, evaluated, h)
        known = [(y.tobytes(), slope.tobytes()) for y, slope in evaluated]
        looks[-1].append((rate.tobytes(), known, self._steps, self._calls, self._spent, found))
        return found

    monkeypatch.setattr(StabilityMonitor, "_is_affordable", noted)
    runs = []
    for backend in ("c", "numpy"):
        looks.append([])
        options: Options = {"integrator": method, "dt": dt, "t_end": t_end}
        runs.append(eomgen.simulate("double_pendulum", backend=backend, **options))  # type: ignore[arg-type]
    assert_same(*runs)
    assert looks[0] == looks[1]
    assert looks[0] or not runs[0].finished


def test_python_makes_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even the one that reaches the end, which is rejected if it is too long."""
    ends = (1.0, 2.013, 2.5)
    runs = [eomgen.simulate("two_body", t_end=end, backend="numpy", rtol=1e-4) for end in ends]
    monkeypatch.setattr(DormandPrince8, "make", pytest.fail)
    for end, python in zip(ends, runs, strict=True):
        compiled = eomgen.simulate("two_body", t_end=end, backend="c", rtol=1e-4)
        assert_same(compiled, python)


@pytest.mark.parametrize(("scene", "values"), [("two_body", {}), (TOP, STIFF)])
def test_aims_are_met_by_the_same_runs(scene: str, values: dict[str, float]) -> None:
    """Trial runs, with constants perturbed, cost in compiled code what they cost in Python, so the
    choice is the same: the stiff method where it pays.
    """
    compiled, python = both(scene, parameters=values, accuracy=1e-4, integrator=None, t_end=1.0)
    assert ("Rodas5P" in compiled.options) == bool(values)
    assert compiled.options == python.options and compiled.error == python.error
    assert_same(compiled, python)


def test_corners_in_time_are_seen() -> None:
    """A force that begins and ends within a moment. Steps are cut there, by the same bits."""
    pushed = FALL.replace("-1/x**2", "1000 if max(0.7 - t, t - 0.701) < 0 else 0")
    for rtol in (1e-3, 1e-6):
        run = alike(pushed, t_end=40.0, integrator="Rodas5P", rtol=rtol)
        assert run.trajectory.y[-1][1] == pytest.approx(0.5, rel=5 * rtol)


def test_steps_end_at_known_times() -> None:
    """At the last double before a pulse of 10 µs begins, and before it ends: none of it is lost."""
    pulse = "1e5*(step(t - 5.00001) - step(t - 5.00002))"
    pushed = FALL.replace("-1/x**2", pulse)
    for integrator in ("DOP853", "Rodas5P"):
        run = alike(pushed, t_end=10.0, integrator=integrator, rtol=1e-13, atol=1e-12)
        speed = 1e5 * (5.00002 - 5.00001) / 2
        assert run.trajectory.y[-1][1] == pytest.approx(speed, rel=1e-9)
        assert run.trajectory.counts["derivatives"] < 1000


def test_corners_in_space_are_seen() -> None:
    """Python makes these steps."""
    pushed = FALL.replace("-1/x**2", "-2*max(x, 0)")
    run = eomgen.simulate(pushed, t_end=2.0, integrator="Rodas5P", backend="c")
    assert run.trajectory.y[-1][1] == pytest.approx(-1.0, rel=1e-6)


def test_works_are_the_same() -> None:
    """Their powers need states within steps: Python makes these steps, with functions in C."""
    scene, options = usual("Rodas5P")
    assert alike(scene, **options, t_end=0.1, works=True).trajectory.works is not None


def test_contacts_bounce_and_are_held_alike() -> None:
    """Impacts, held contacts and their powers, up to rest; by an implicit method too."""
    run = alike("bouncing_two_body", t_end=5.0, works=True)
    assert run.trajectory.counts["impacts"] > 5
    assert {event.kind for event in run.trajectory.events} == {"impact", "rest", "lift"}
    alike("bouncing_two_body", t_end=0.1, integrator="gauss_4", dt=2e-3)


def test_inputs_of_time_count() -> None:
    """The derivative depends on time, though its kernel does not."""
    given: Options = {"inputs": {"push": lambda t: math.sin(5 * t)}, "t_end": 0.1, "samples": 11}
    still = TOP.replace("3*sin(4*t)", "3")
    runs = [
        eomgen.simulate(still, integrator=name, rtol=1e-9, **given)
        for name in ("Rodas5P", "DOP853")
    ]
    assert np.abs(runs[0].y - runs[1].y).max() < 1e-8
    counts = runs[0].trajectory.counts
    assert counts["derivatives"] >= 11 * counts["steps"], "two for the derivative in time"


# Functions.


@cache
def prepared(scene: str) -> tuple[Model, GeneratedModule, Problem]:
    """The model of a scene, its module and its problem, whose functions are Python's."""
    model = plan_run(read(scene), check(scene), RunOptions(scene)).model
    module = generated(model)[1]
    return model, module, problem_of(module, None, None, model)


def test_functions_fail_alike() -> None:
    """What overflows or divides by 0 is computed in Python, and so are its errors."""
    model, module, plain = prepared(FALL)
    compilable = Accelerator(model, module, None, None)
    compilable.compile()
    ours = compilable.of(plain)
    for x in (1.0, 0.0, 1e-200, 1e30, np.nan, np.inf):
        found = [_outcome(problem, np.array([x, 0.0])) for problem in (plain, ours)]
        assert found[0] == found[1]
    assert found[0] != _outcome(plain, plain.initial)


def _outcome(problem: Problem, y: Any) -> str:
    """The derivative at a state, or the error that it raises."""
    try:
        return problem.derivative(0.0, y).tobytes().hex()
    except (ArithmeticError, ValueError) as error:
        return repr(error)


def test_parameters_that_are_too_large_are_said() -> None:
    run = eomgen.simulate(
        "two_body", t_end=0.01, parameters={"g": 1e70}, integrator="RK45", backend="c"
    )
    assert not run.compiled
    assert [line for line in run.warnings if "nothing was computed in C: a parameter" in line]


@pytest.mark.parametrize("name", ["bouncing_two_body", TOP, *some((), ("human_figure",))])
def test_each_function_is_that_of_its_module(name: str) -> None:
    """Also with perturbed constants, which must be used."""
    model, module, plain = prepared(name)
    twin = moved(module, interfaced_program_of(model)[0])
    perturbed = problem_of(twin, None, None, model)
    compilable = Accelerator(model, module, None, None)
    compilable.compile()
    compared = set()
    random = np.random.default_rng(1)
    for python, ours in (
        (plain, compilable.of(plain)),
        (perturbed, compilable.of(perturbed, twin)),
    ):
        for _ in range(3):
            y = python.unit(plain.initial + random.normal(0, 0.2, plain.initial.shape))
            for what, calls in _calls(python, ours).items():
                values = [np.asarray(call(0.3, y)) for call in calls]
                assert values[0].shape == values[1].shape
                assert values[0].tobytes() == values[1].tobytes(), what
                compared.add((what, python is plain))
    assert len(compared) == (12 if plain.contacts else 4)
    assert ours.compiled is not None and ours.compiled.steps("Rodas5P", ()) is not None
    y = plain.initial
    assert plain.derivative(0.3, y).tobytes() != perturbed.derivative(0.3, y).tobytes()


def _calls(python: Problem, ours: Problem) -> dict[str, tuple[Any, Any]]:
    """The functions of two problems side by side, as functions of time and state."""
    found: dict[str, tuple[Any, Any]] = {
        "derivative": (python.derivative, ours.derivative),
        "jacobian": (python.jacobian, ours.jacobian),
    }
    a, b = python.contacts, ours.contacts
    if a and b:
        forces = np.linspace(1.0, 2.0, len(a.names))
        found |= {
            "gaps": (a.gaps, b.gaps),
            "rates": (a.rates, b.rates),
            "held": tuple(lambda t, y, c=c: c.held(t, y, forces) for c in (a, b)),
            "impact": tuple(lambda t, y, c=c: c.impact(t, y, 1, 0.5) for c in (a, b)),
        }
    return found


ROPE = """
name = "rope"
[[chains]]
name = "link"
count = 5
mass = 1.0
inertia_com = 0.1
r_parent = [0, 0.5]
r_child = [0, -0.5]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "motor"
name = "stop"
joint = "link_joint_2"
torque = "-50*max(link_joint_2_angle - 0.1*sin(t), 0) if t < 0.2 else -abs(link_joint_2_angle)"
"""
"""Five links: the derivatives of some forces depend on which branch applies."""


def test_directions_together_have_the_bits_of_one_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Jacobian along ten directions, in C for eight at once and for one after the other."""
    monkeypatch.setattr(jacobians, "LARGEST_JACOBIAN", 10)
    system = compile_program(check(read(ROPE))).system
    assert "jacobian" in system.tangents
    given = functions.restricted(system.program, interface_of(system), ("jacobian",))
    texts = [backend.library(*given) for backend in (c_directions, c)]
    assert texts[0] != texts[1]
    found, random = [], np.random.default_rng(2)
    cases = [(t, random.normal(size=10)) for t in (0.1, 0.3) for _ in range(8)]
    for text in texts:
        library = built(text)
        k, out = np.zeros(100), np.zeros((10, 10))
        library.constants_of(np.array(list(system.model.defaults.values())).ctypes, k.ctypes)
        for t, y in cases:
            arrays = (array.ctypes for array in (y, k, k, k, out))
            assert library.checked_jacobian(ctypes.c_double(t), *arrays) == 1
            found.append(out.tobytes())
    half = len(cases)
    assert found[:half] == found[half:] and len(set(found)) == half


# When.


@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["DOP853", "Rodas5P", "RK45"])
def test_a_long_run_is_compiled_on_its_way(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It begins in Python. A short one is not compiled, but takes libraries that are there."""
    scene, options = PLANE.replace("orbit", method), {"integrator": method, "rtol": 1e-7}
    assert not eomgen.simulate(scene, t_end=0.01, **options).compiled
    with monkeypatch.context() as patch:
        patch.setattr(accelerator, "STARTING", 1e-3)
        patch.setattr(accelerator, "AN_OPERATION", 0.0)
        patch.setattr(functions, "INTERVAL", 1e-3)
        run = eomgen.simulate(scene, t_end=3.0, **options)
    assert run.compiled
    assert_same(run, eomgen.simulate(scene, t_end=3.0, backend="numpy", **options))
    assert eomgen.simulate(scene, t_end=0.01, **options).compiled


def test_without_a_compiler_long_runs_say_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    """Short ones do not, for they would not be compiled."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    options: Options = {"t_end": 0.1, "integrator": "DOP853"}
    run = eomgen.simulate(FALL, **options)
    assert not run.compiled and not any("compile" in line for line in run.warnings)
    monkeypatch.setattr(accelerator, "STARTING", 0.0)
    monkeypatch.setattr(accelerator, "AN_OPERATION", 0.0)
    run = eomgen.simulate(FALL, **options)
    assert run.finished and not run.compiled
    assert [line for line in run.warnings if "no C compiler was found" in line]
    with pytest.raises(RunError, match="no C compiler was found"):
        eomgen.simulate(FALL, t_end=0.1, backend="c")


def test_a_library_is_compiled_once_that_pays_for_all_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """What Python has taken for a function counts, in whichever run."""
    made, library = list[str](), object()

    def compiled(about: str, *given: Any) -> Any:
        made.append(about)
        return library

    monkeypatch.setattr(accelerator, "kept_library", lambda about: None)
    monkeypatch.setattr(accelerator, "compiled_library", compiled)
    of = accelerator._Library("jacobian", dict, "main.c", 1.0, pytest.fail)
    assert of.beyond(0.4) is None and of.beyond(0.4) is None and not made
    assert of.beyond(0.4) is library and of.beyond(0.0) is library and made == ["jacobian"]


def test_what_steps_need_is_compiled_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once the run has taken as long as compiling all of it will, and not one after another."""
    module: Any = eomgen.load(eomgen.generate("double_pendulum"))
    made, prices = list[str](), {"derivative": 1.0, "jacobian": 2.0}
    of = Accelerator(eomgen.check("double_pendulum"), module, None, None)
    for name, price in prices.items():
        library = accelerator._Library(name, dict, "main.c", price, pytest.fail)
        of._libraries[name] = library
    now = [0.0]
    monkeypatch.setattr(accelerator.time, "perf_counter", lambda: 5.0 + now[0])
    monkeypatch.setattr(accelerator, "kept_library", lambda about: None)
    monkeypatch.setattr(
        accelerator, "compiled_library", lambda about, *_: made.append(about) or object()
    )
    of._of_model = lambda: None  # type: ignore[assignment, return-value]
    for now[0] in (0.0, 2.9):
        assert of.found(tuple(prices)) is None and not made
    now[0] = 3.1
    assert set(of.found(tuple(prices)) or ()) == set(prices) == set(made)


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(RunError, match="backend: 'fortran' is not one of auto, numpy, c"):
        eomgen.simulate("two_body", backend="fortran")  # type: ignore[arg-type]
