"""Equal steps in compiled code: the bits of Python's, and the same verdicts on their stability."""

from typing import Any

import numpy as np
import pytest
from campaign import some
from test_compiled_events import HELD
from test_compiled_steps import FALL, assert_same, both, compiler

import eomgen
from eomgen.native import equal_steps
from eomgen.run.integrators.stability import StabilityMonitor
from eomgen.scene.built_in import built_in_names

METHODS = ("euler", "semi_implicit_euler", "rk4")
SCENES = some(("two_body_forced", "spinning_top"), built_in_names())
pytestmark = compiler


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", METHODS)
def test_the_bits_are_those_of_python(scene: str, method: str) -> None:
    """Over more than one stride; quaternions are normalised; some of the steps are rows."""
    for samples in (None, 7):
        options: dict[str, Any] = {"integrator": method, "dt": 2e-4, "samples": samples}
        compiled, python = both(scene, t_end=0.30007, unstable=samples == 7, **options)
        assert_same(compiled, python)
    assert compiled.trajectory.counts["steps"] == 1501 or not compiled.finished


@pytest.mark.every(2)
@pytest.mark.parametrize("method", METHODS)
def test_parameters_and_inputs_count(method: str) -> None:
    options = {"parameters": {"m_A": 1.7}, "inputs": {"tau": 0.3}, "t_end": 0.5, "dt": 1e-3}
    compiled, python = both("two_body_forced", integrator=method, **options)
    assert_same(compiled, python)
    assert compiled.compiled
    other = eomgen.simulate("two_body_forced", integrator=method, backend="c", t_end=0.5, dt=1e-3)
    assert not np.array_equal(other.y, compiled.y)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", METHODS)
def test_a_run_goes_on_in_either(method: str) -> None:
    """What one has begun the other continues, also from the middle of a step of the whole run."""
    options: dict[str, Any] = {"integrator": method, "dt": 1e-3}
    whole = eomgen.simulate("two_body", t_end=1.2, backend="numpy", **options)
    for first, second in (("c", "numpy"), ("numpy", "c"), ("c", "c")):
        begun = eomgen.simulate("two_body", t_end=0.5995, backend=first, **options)
        run = eomgen.simulate("two_body", t_end=1.2, resume=begun, backend=second, **options)
        assert run.y[-1].tobytes() == whole.y[-1].tobytes()


def test_each_step_is_followed() -> None:
    seen: dict[str, list[tuple[float, bytes]]] = {"c": [], "numpy": []}
    runs = {}
    for backend, steps in seen.items():

        def follow(t: float, y: Any, steps: list[tuple[float, bytes]] = steps) -> bool:
            steps.append((t, y.tobytes()))
            return len(steps) == 1500

        options: dict[str, Any] = {"t_end": 9.0, "dt": 1e-3, "integrator": "rk4"}
        runs[backend] = eomgen.simulate("two_body", backend=backend, follow=follow, **options)  # type: ignore[arg-type]
    assert seen["c"] == seen["numpy"] and len(seen["c"]) == 1500
    assert_same(runs["c"], runs["numpy"])


@pytest.mark.parametrize(
    ("scene", "dt", "t_end"),
    [
        *some((), (("stiff_beam", 2e-4, 0.2),)),
        ("double_pendulum", 0.05, 20.0),
        ("double_pendulum", 0.2, 50.0),
    ],
)
@pytest.mark.every(2)
@pytest.mark.parametrize("method", METHODS)
def test_steps_that_jump_are_checked_alike(
    scene: str, dt: float, t_end: float, method: str, monkeypatch: pytest.MonkeyPatch
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
        options: dict[str, Any] = {"integrator": method, "dt": dt, "t_end": t_end}
        runs.append(eomgen.simulate(scene, backend=backend, **options))  # type: ignore[arg-type]
    assert_same(*runs)
    assert looks[0] == looks[1]
    assert looks[0] or not runs[0].finished


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [HELD, "bouncing_two_body"])
@pytest.mark.parametrize("method", METHODS)
def test_rigid_contacts_end_steps(scene: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They strike, are held and open. Python makes the first step, the last, and what it checks."""
    made, steps = equal_steps.made, list[int]()

    def noted(*given: Any) -> int:
        why = made(*given)
        steps.append(given[8].made)
        return why

    monkeypatch.setattr(equal_steps, "made", noted)
    compiled, python = both(scene, integrator=method, t_end=3.0, dt=1e-3, samples=77)
    assert_same(compiled, python)
    assert compiled.trajectory.events == python.trajectory.events
    assert {event.kind for event in python.trajectory.events} >= {"impact"}
    assert sum(steps) > 0.97 * python.trajectory.counts["steps"]
    for first, second in ((compiled, "numpy"), (python, "c")):
        begun = eomgen.simulate(scene, integrator=method, t_end=1.5, dt=1e-3, backend="c")
        run = eomgen.simulate(
            scene, integrator=method, t_end=3.0, dt=1e-3, backend=second, resume=begun
        )
        assert run.y[-1].tobytes() == first.y[-1].tobytes()


@pytest.mark.every(2)
@pytest.mark.parametrize("method", METHODS)
def test_what_fails_fails_alike(method: str) -> None:
    compiled, python = both(FALL, t_end=5.0, integrator=method, dt=1e-3, unstable=True)
    assert compiled.compiled
    assert_same(compiled, python)


@pytest.mark.every(2)
@pytest.mark.parametrize("method", METHODS)
def test_time_counts(method: str) -> None:
    """A force that depends on time, at each node of a step."""
    pushed = FALL.replace("-1/x**2", "sin(3*t)*x")
    compiled, python = both(pushed, t_end=1.0, integrator=method, dt=1e-2)
    assert compiled.compiled
    assert_same(compiled, python)
