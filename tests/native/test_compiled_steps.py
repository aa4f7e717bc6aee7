"""Steps in compiled code: the bits of Python's, and when a run takes them."""

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.base.errors import RunError
from eomgen.native import accelerator
from eomgen.results import Run
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.scene.built_in import built_in_names

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")
SCENES = some(("two_body_forced", "spinning_top"), built_in_names())
FALL = """
name = "bead"
dimensions = 2
[[bodies]]
name = "bead"
mass = 2.0
inertia_com = 0
[[joints]]
name = "wire"
type = "prismatic"
parent = "world"
child = "bead"
axis = [1, 0]
coordinate = "x"
[[effects]]
type = "motor"
name = "pull"
joint = "wire"
torque = "-1/x**2"
[initial]
q = [1.0]
v = [0.0]
"""


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
    assert ours.outcome == theirs.outcome and ours.message == theirs.message
    assert ours.resume.keys() == theirs.resume.keys()
    for name, value in ours.resume.items():
        assert value.tobytes() == theirs.resume[name].tobytes(), name


@pytest.mark.every(2)
@compiler
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("rtol", [1e-3, 1e-11])
def test_the_bits_are_those_of_python(scene: str, rtol: float) -> None:
    """At loose tolerances steps are rejected; quaternions are normalised; rows lie in steps."""
    end = 1.0 if scene in ("ragdoll", "walker_motors", "stiff_beam") else 3.0
    compiled, python = both(scene, t_end=end, rtol=rtol, samples=237)
    assert_same(compiled, python)


@compiler
def test_python_makes_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even the one that reaches the end, which is rejected if it is too long."""
    ends = (1.0, 2.013, 2.5)
    runs = [eomgen.simulate("two_body", t_end=end, backend="numpy", rtol=1e-4) for end in ends]
    monkeypatch.setattr(DormandPrince8, "step", pytest.fail)
    for end, python in zip(ends, runs, strict=True):
        compiled = eomgen.simulate("two_body", t_end=end, backend="c", rtol=1e-4)
        assert_same(compiled, python)


@compiler
def test_parameters_inputs_and_the_longest_step_count() -> None:
    options = {
        "parameters": {"m_A": 1.7},
        "inputs": {"tau": 0.3},
        "max_step": 0.01,
        "t_end": 2.0,
    }
    compiled, python = both("two_body_forced", **options)
    assert_same(compiled, python)
    assert compiled.compiled and compiled.trajectory.counts["capped"] > 190
    other = eomgen.simulate("two_body_forced", backend="c", **{**options, "inputs": {}})
    assert not np.array_equal(other.y, compiled.y)


@compiler
def test_a_run_goes_on_in_either() -> None:
    """What one has begun the other continues."""
    whole = eomgen.simulate("two_body", t_end=4.0, backend="numpy", integrator="DOP853")
    for first, second in (("c", "numpy"), ("numpy", "c")):
        options: dict[str, Any] = {"integrator": "DOP853"}
        begun = eomgen.simulate("two_body", t_end=2.0, backend=first, **options)
        run = eomgen.simulate("two_body", t_end=4.0, resume=begun, backend=second, **options)
        assert run.y[-1].tobytes() == whole.y[-1].tobytes()


@compiler
def test_each_step_is_followed() -> None:
    """And the run ends at the very step at which it is asked to."""

    def following(seen: list[tuple[float, bytes]]) -> Callable[[float, Any], bool]:
        def follow(t: float, y: Any) -> bool:
            seen.append((t, y.tobytes()))
            return len(seen) == 30

        return follow

    ours, theirs = list[tuple[float, bytes]](), list[tuple[float, bytes]]()
    options: dict[str, Any] = {"t_end": 9.0, "integrator": "DOP853"}
    compiled = eomgen.simulate("two_body", backend="c", follow=following(ours), **options)
    python = eomgen.simulate("two_body", backend="numpy", follow=following(theirs), **options)
    assert ours == theirs and len(ours) == 30
    assert_same(compiled, python)


@compiler
def test_aims_are_met_by_the_same_runs() -> None:
    """Trial runs in compiled code cost what they cost in Python, so the choice is the same."""
    compiled, python = both("two_body", accuracy=1e-7, integrator=None)
    assert compiled.options == python.options and compiled.error == python.error
    assert_same(compiled, python)


@compiler
def test_what_fails_fails_alike() -> None:
    """A fall into the centre of attraction: the last steps and the message are Python's."""
    compiled, python = both(FALL, t_end=5.0)
    assert not compiled.finished and compiled.compiled
    assert_same(compiled, python)


@pytest.fixture
def empty_store(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> Iterator[None]:
    """A store without libraries."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    return iter(())


@compiler
def test_a_long_run_is_compiled_on_its_way(
    empty_store: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It begins in Python. A short one is not compiled, but takes a library that is there."""
    run = eomgen.simulate("two_body", t_end=0.1, integrator="DOP853")
    assert not run.compiled
    with monkeypatch.context() as patch:
        patch.setattr(accelerator, "STARTING", 1e-3)
        patch.setattr(accelerator, "AN_OPERATION", 0.0)
        run = eomgen.simulate("two_body", t_end=5.0, integrator="DOP853")
    assert run.compiled
    assert_same(run, eomgen.simulate("two_body", t_end=5.0, integrator="DOP853", backend="numpy"))
    assert eomgen.simulate("two_body", t_end=0.1, integrator="DOP853").compiled


def test_without_a_compiler_long_runs_say_so(
    empty_store: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Short ones do not, for they would not be compiled."""
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    run = eomgen.simulate("two_body", t_end=0.1, integrator="DOP853")
    assert not run.compiled and not any("compile" in line for line in run.warnings)
    monkeypatch.setattr(accelerator, "STARTING", 0.0)
    monkeypatch.setattr(accelerator, "AN_OPERATION", 0.0)
    run = eomgen.simulate("two_body", t_end=0.1, integrator="DOP853")
    assert run.finished and not run.compiled
    assert [line for line in run.warnings if "no C compiler was found" in line]
    with pytest.raises(RunError, match="no C compiler was found"):
        eomgen.simulate("two_body", t_end=0.1, backend="c")


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


def test_what_steps_need_is_compiled_together(
    empty_store: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once the run has taken as long as compiling all of it will, and not one after another."""
    module: Any = eomgen.load(eomgen.generate("double_pendulum"))
    made, prices = list[str](), {"derivative": 1.0, "jacobian": 2.0}
    of = accelerator.Accelerator(eomgen.check("double_pendulum"), module, None, None)
    for name, price in prices.items():
        library = accelerator._Library(name, dict, "main.c", price, pytest.fail)
        of._libraries[name] = library
    now = [0.0]
    monkeypatch.setattr(accelerator.time, "perf_counter", lambda: 5.0 + now[0])
    monkeypatch.setattr(accelerator, "kept_library", lambda about: None)
    monkeypatch.setattr(
        accelerator, "compiled_library", lambda about, *_: made.append(about) or object()
    )
    for now[0] in (0.0, 2.9):
        assert of._found(tuple(prices)) is None and not made
    now[0] = 3.1
    assert set(of._found(tuple(prices)) or ()) == set(prices) == set(made)


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(RunError, match="backend: 'fortran' is not one of auto, numpy, c"):
        eomgen.simulate("two_body", backend="fortran")  # type: ignore[arg-type]
