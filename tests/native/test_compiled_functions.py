"""Functions in compiled code in runs whose steps are made in Python: the bits of Python's."""

import ctypes
from typing import Any

import numpy as np
import pytest
from campaign import some
from test_compiled_steps import FALL, assert_same, both, compiler

import eomgen
from eomgen.api.generating import compiled as generated
from eomgen.api.given import check, read
from eomgen.api.options import RunOptions
from eomgen.api.planning import plan_run
from eomgen.codegen import jacobians
from eomgen.codegen.backends import c, c_directions
from eomgen.codegen.interface import interface_of
from eomgen.model.model import Model
from eomgen.native import accelerator, functions
from eomgen.native.accelerator import Accelerator
from eomgen.native.library import built
from eomgen.pipeline import compile_program
from eomgen.run.module import GeneratedModule
from eomgen.run.problem import Problem
from eomgen.scene.built_in import built_in_names
from eomgen.store import interfaced_program_of
from eomgen.study.accuracy.moved import moved
from eomgen.study.diagnosis import problem_of

pytestmark = compiler
SCENES = some(("bouncing_two_body", "tumbling_body"), built_in_names())
"""With rigid contacts; with quaternions."""


@pytest.mark.every(4)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", ["RK45", "BDF", "gauss_4"])
def test_the_bits_are_those_of_python(scene: str, method: str) -> None:
    """An explicit method, one with Jacobians, and one with equal implicit steps."""
    options = {"dt": 2e-3} if method == "gauss_4" else {"rtol": 1e-7}
    compiled, python = both(scene, t_end=0.1, integrator=method, **options)
    assert_same(compiled, python)
    assert compiled.compiled
    assert compiled.trajectory.events == python.trajectory.events


def test_contacts_bounce_and_are_held_alike() -> None:
    """Impacts, held contacts and their powers, up to rest."""
    compiled, python = both("bouncing_two_body", t_end=5.0, works=True)
    assert_same(compiled, python)
    assert compiled.trajectory.counts["impacts"] > 5
    kinds = {event.kind for event in compiled.trajectory.events}
    assert kinds == {"impact", "rest", "lift"}
    assert compiled.trajectory.events == python.trajectory.events
    ours, theirs = compiled.trajectory.works, python.trajectory.works
    assert ours is not None and theirs is not None and ours.tobytes() == theirs.tobytes()


def test_parameters_and_inputs_count() -> None:
    options = {"parameters": {"m_A": 1.7}, "inputs": {"tau": 0.3}, "t_end": 0.5}
    compiled, python = both("two_body_forced", integrator="Radau", **options)
    assert_same(compiled, python)
    assert compiled.compiled
    other = eomgen.simulate("two_body_forced", integrator="Radau", backend="c", t_end=0.5)
    assert not np.array_equal(other.y, compiled.y)


def test_what_fails_fails_alike() -> None:
    """What overflows or divides by 0 is computed in Python, and so are its errors."""
    compiled, python = both(FALL, t_end=5.0, integrator="RK45")
    assert not compiled.finished and compiled.compiled
    assert_same(compiled, python)
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


def test_a_long_run_is_compiled_on_its_way(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """It begins in Python, and changes over in the middle; the next one begins in C."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    options: dict[str, Any] = {"integrator": "RK45", "t_end": 5.0}
    assert not eomgen.simulate("two_body", **{**options, "t_end": 0.1}).compiled
    monkeypatch.setattr(accelerator, "STARTING", 1e-3)
    monkeypatch.setattr(accelerator, "AN_OPERATION", 0.0)
    monkeypatch.setattr(functions, "INTERVAL", 1e-3)
    run = eomgen.simulate("two_body", **options)
    assert run.compiled
    assert_same(run, eomgen.simulate("two_body", backend="numpy", **options))
    assert eomgen.simulate("two_body", **{**options, "t_end": 0.1}).compiled


def test_parameters_that_are_too_large_are_said() -> None:
    run = eomgen.simulate(
        "two_body", t_end=0.01, parameters={"g": 1e70}, integrator="RK45", backend="c"
    )
    assert not run.compiled
    assert [line for line in run.warnings if "nothing was computed in C: a parameter" in line]


def prepared(scene: str) -> tuple[Model, GeneratedModule, Problem]:
    """The model of a scene, its module and its problem, whose functions are Python's."""
    model = plan_run(read(scene), check(scene), RunOptions(scene)).model
    module = generated(model)[1]
    return model, module, problem_of(module, None, None, model)


EACH = ("double_pendulum", "bouncing_two_body", "tumbling_body")


@pytest.mark.parametrize("name", some(EACH, (*EACH, "human_figure")))
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
    assert ours.compiled is not None and ours.compiled.steps("rodas_5p", ()) is not None
    y = plain.initial
    assert plain.derivative(0.3, y).tobytes() != perturbed.derivative(0.3, y).tobytes()


ROPE = """
name = "rope"
dimensions = 2
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
