"""Compiled steps of scenes with contacts, stops and pulses: the bits of Python's."""

import ast
import math
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np
import pytest
from campaign import FULL, some
from crank_rocker import STOPPED
from falling_block import BLOCK
from scenes import WEIGHT, effect, lone
from scipy.optimize import brentq
from test_compiled_runs import EXPLICIT, assert_same, both, compiler

import eomgen
from eomgen.api.runs import Run
from eomgen.engine.printed import text
from eomgen.engine.roots import FOUND, RTOL, WANTED, Search, begun, gone_on
from eomgen.native import equal_steps
from eomgen.run.integrators import strides
from eomgen.run.integrators.dormand_prince_8 import DormandPrince8
from eomgen.scene.built_in import built_in_names
from eomgen.scene.reader import read_scene

SCENES = some(("bouncing_two_body",), ("bouncing_two_body", *built_in_names()))
ENDS = {"ragdoll": 1.0, "walker_motors": 0.5, "stiff_beam": 0.2}
WATCHED = ("bicycle",)
"""Whose constraints are so near to being singular that Python looks at each step."""
WHEEL = lone(
    "revolute",
    effect("motor", name="pulse", joint="axle", torque="5*step(t - a)*step(a + w - t)"),
    effect(
        "motor",
        name="stops",
        joint="axle",
        torque="-s*k*max(0, q - 1) + s*k*max(0, -1 - q) - s*0.4*step(q_dot)*max(0, q - 1)",
    ),
    effect("motor", name="brush", joint="axle", torque="m*step(sin(u*q - f*t) - 0.95)"),
    body="disc",
    on="axle",
    name="wheel",
    parameters={"a": 1.0, "w": 0.1, "k": 400.0, "s": 1.0, "m": 0.0, "u": 1.0, "f": 3.0},
    initial={"q": {"q": 0.3}, "v": {"q_dot": 3.0}},
    simulation={"integrator": "DOP853", "rtol": 1e-08, "t_end": 3.0},
    inertia_com=0.4,
    coordinate="q",
)
"""A wheel between springy stops, with a pulse in time."""
TURNING = WHEEL.replace("s = 1.0, m = 0.0", "s = 0.0, m = 2.0").replace(
    "q_dot = 3.0", "q_dot = 40.0"
)
"""The wheel turns freely, many times in a step, past a brush that moves."""
STILL = WHEEL.replace("q_dot = 3.0", "q_dot = 1e-3").replace(
    "u = 1.0, f = 3.0", "u = 1e-6, f = 62.83185307179586"
)
"""The wheel hardly turns. The brush is there in each period of 0.1 s, and has no force."""
HELD = lone(
    "free",
    WEIGHT,
    effect("external_force", name="lift", body="block", force=[1, "push*max(0, sin(3*t))"]),
    effect("contact", name="floor", law="impact", points=["foot"], restitution=0.6),
    body="block",
    on="flight",
    name="block",
    parameters={"push": 8.0},
    points=[{"name": "foot", "body": "block", "at": [0.3, 0.0]}],
    initial={"q": {"block_y": 0.7}, "v": {"block_angle_dot": 25.0}},
    simulation={"t_end": 3.0},
)

pytestmark = compiler


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of steps that were made in C at once."""
    numbers: list[int] = []
    original = strides.Strides._compiled

    def noted(self: strides.Strides, *given: Any) -> Any:
        stride = original(self, *given)
        numbers.append(len(stride.ends) if stride else 0)
        return stride

    monkeypatch.setattr(strides.Strides, "_compiled", noted)
    return numbers


def alike(scene: str, **options: Any) -> Run:
    """The run in C, which is that in Python."""
    compiled, python = both(scene, **options)
    assert_same(compiled, python)
    return compiled


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("rtol", [1e-4, 1e-10])
def test_the_bits_are_those_of_python(scene: str, rtol: float, made: list[int]) -> None:
    end = min(ENDS.get(scene, 2.0), read_scene(scene).simulation.t_end)
    run = alike(scene, t_end=end, rtol=rtol, samples=237)
    assert scene in WATCHED or sum(made) > 0.3 * run.trajectory.counts["steps"]


@pytest.mark.parametrize(
    ("method", "rtol"),
    [
        ("DOP853", 1e-5),
        ("Rodas5P", 1e-6),
        pytest.param("taylor", 1e-6, marks=pytest.mark.every(2)),
        *some((), [("DOP853", 1e-10)]),
    ],
)
def test_contacts_are_held_in_c(method: str, rtol: float, made: list[int]) -> None:
    """Steps of a block on two feet, on one and on none, and those in which events are."""
    run = alike(BLOCK, integrator=method, t_end=2.0, rtol=rtol, samples=100)
    assert [event.kind for event in run.trajectory.events][-1] == "rest"
    assert sum(made) == run.trajectory.counts["steps"]


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [WHEEL, STOPPED])
def test_stiff_steps_are_checked_in_c(scene: str, made: list[int]) -> None:
    """For branches and contacts, on constraints; works take the states within."""
    compiled, python = both(scene, integrator="Rodas5P", rtol=1e-6, t_end=1.0, works=True)
    assert_same(compiled, python)
    assert sum(made) > 0.9 * compiled.trajectory.counts["steps"]


@pytest.mark.every(2)
@pytest.mark.parametrize(("scene", "share"), [(WHEEL, 0.7), (TURNING, 0.4)])
def test_stops_and_pulses_are_seen(scene: str, share: float, made: list[int]) -> None:
    """Wherever they lie, at loose and tight tolerances. Most steps are made in C."""
    random, steps, cut = np.random.default_rng(3), 0, 0
    for _ in range(150 if FULL else 3):
        given = {
            "a": random.uniform(0.0, 3.0),
            "w": 10 ** random.uniform(-5, -1),
            "k": 10 ** random.uniform(0, 5),
        }
        rtol = 10 ** random.uniform(-11, -3)
        run = alike(scene, parameters=given, rtol=rtol, samples=11)
        steps += run.trajectory.counts["steps"]
        cut += run.trajectory.counts["cut"]
    assert cut
    assert sum(made) > share * steps


def test_python_makes_only_what_was_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that passed over a pulse is repeated in C, shorter."""
    made, make = list[float](), DormandPrince8.make

    def noted(self: DormandPrince8, *given: Any) -> bool:
        made.append(self.t)
        return make(self, *given)

    monkeypatch.setattr(DormandPrince8, "make", noted)
    random, cut = np.random.default_rng(3), 0
    for _ in range(5):
        exponents = {"w": random.uniform(-5, -1), "k": random.uniform(0, 5)}
        given = {name: 10**x for name, x in exponents.items()} | {"a": random.uniform(0.0, 3.0)}
        run = eomgen.simulate(
            TURNING, backend="c", integrator="DOP853", parameters=given, rtol=1e-7, samples=11
        )
        cut += run.trajectory.counts["cut"]
    assert 0 < cut <= len(made) <= 2 * cut


def test_a_function_with_the_period_of_a_step_is_seen() -> None:
    """At the ends of all steps it has the same value, far from 0."""
    begun = alike(STILL, parameters={"a": 9.0}, max_step=0.1, t_end=2.05)
    assert begun.trajectory.counts["capped"] > 15
    assert begun.trajectory.resume["turned"] > 1.9


def test_a_contact_that_closes_and_opens_in_a_step_is_seen() -> None:
    """Its gap is positive wherever it is checked."""
    alike(HELD, integrator="DOP853", parameters={"push": 13.0}, rtol=1e-2)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [WHEEL, TURNING, "bouncing_two_body"])
def test_a_run_goes_on_in_either(scene: str) -> None:
    """What one has begun the other continues, also where a step is to end before a pulse."""
    whole = eomgen.simulate(scene, t_end=3.0, backend="numpy")
    for end in (0.99, 1.5):
        for first, second in (("c", "numpy"), ("numpy", "c")):
            begun = eomgen.simulate(scene, t_end=end, backend=first)
            run = eomgen.simulate(scene, t_end=3.0, resume=begun, backend=second)
            assert run.y[-1].tobytes() == whole.y[-1].tobytes()


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", [WHEEL, HELD, *some((), built_in_names())])
def test_works_are_the_same(scene: str, made: list[int]) -> None:
    """They need states within steps. Powers are computed in C, too."""
    end = min(ENDS.get(scene, 2.0), 0.5 if scene in built_in_names() else 2.0)
    compiled, python = both(scene, integrator="DOP853", works=True, t_end=end)
    assert_same(compiled, python)
    ours, theirs = compiled.trajectory.works, python.trajectory.works
    if theirs is None:
        assert ours is None
    else:
        assert ours is not None and ours.tobytes() == theirs.tobytes()
    assert scene in WATCHED or sum(made) > 0.3 * compiled.trajectory.counts["steps"]


@pytest.mark.parametrize("scene", [WHEEL, HELD])
def test_each_step_is_followed(scene: str) -> None:
    seen = []
    for backend in ("c", "numpy"):
        steps = list[tuple[float, bytes]]()

        def follow(t: float, y: Any, steps: list[tuple[float, bytes]] = steps) -> None:
            steps.append((t, y.tobytes()))

        run = eomgen.simulate(scene, integrator="DOP853", backend=backend, follow=follow)  # type: ignore[arg-type]
        assert run.compiled == (backend == "c")
        seen.append((steps, run.trajectory.events))
    assert seen[0] == seen[1] and len(seen[0][0]) > 20


def test_aims_are_met_by_the_same_runs() -> None:
    compiled, python = both(WHEEL, accuracy=1e-6, integrator=None)
    assert compiled.options == python.options and compiled.error == python.error
    assert_same(compiled, python)


@pytest.mark.every(2)
@pytest.mark.parametrize(("scene", "fault"), [(WHEEL, "FAR"), (WHEEL, "TOGETHER"), (HELD, "")])
def test_a_check_left_out_is_noticed(
    scene: str, fault: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    """What C is printed from has another constant, or takes contacts to stay apart."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    of = text()
    for name in ("are_far", "cut"):
        other = {**of.modules[name], fault: {"FAR": 0.0, "TOGETHER": 2.0}.get(fault)}
        monkeypatch.setitem(of.modules, name, other)
    if not fault:
        closes = deepcopy(of.functions["closing"])
        closes.body = ast.parse("return inf").body
        monkeypatch.setitem(of.functions, "closing", closes)
    options: dict[str, Any] = {"rtol": 1e-9}
    if scene == WHEEL:
        options = {"rtol": 1e-3, "parameters": {"w": 1e-2}}
    with pytest.raises(AssertionError):
        alike(scene, **options)


@pytest.fixture
def equal(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of steps of equal length that were made in C at once."""
    made, steps = equal_steps.Call.made, list[int]()

    def noted(*given: Any) -> int:
        why = made(*given)
        steps.append(given[4].made)
        return why

    monkeypatch.setattr(equal_steps.Call, "made", noted)
    return steps


def test_contacts_of_loops_end_steps(equal: list[int]) -> None:
    """On the way states are put on the constraints, at events too."""
    run = alike(STOPPED, integrator="rk4", t_end=1.0, dt=5e-3, samples=37)
    assert {event.kind for event in run.trajectory.events} == {"impact", "rest"}
    assert sum(equal) > 0.97 * run.trajectory.counts["steps"]


@pytest.mark.every(4)
@pytest.mark.parametrize("scene", [HELD, "bouncing_two_body"])
@pytest.mark.parametrize("method", ["gauss_4", *EXPLICIT])
def test_rigid_contacts_end_steps(scene: str, method: str, equal: list[int]) -> None:
    """They strike, are held and open. Python makes the first step, the last, and what it checks."""
    compiled, python = both(scene, integrator=method, t_end=3.0, dt=1e-3, samples=77)
    assert_same(compiled, python)
    assert {event.kind for event in python.trajectory.events} >= {"impact"}
    assert sum(equal) > 0.97 * python.trajectory.counts["steps"]
    for first, second in ((compiled, "numpy"), (python, "c")):
        begun = eomgen.simulate(scene, integrator=method, t_end=1.5, dt=1e-3, backend="c")
        run = eomgen.simulate(
            scene, integrator=method, t_end=3.0, dt=1e-3, backend=second, resume=begun
        )
        assert run.y[-1].tobytes() == first.y[-1].tobytes()


def test_zeros_are_those_of_scipy() -> None:
    """To the bit, by as many evaluations."""
    random = np.random.default_rng(5)
    for case in range(600):
        powers, (a, b) = random.normal(size=4), sorted(random.uniform(-3, 3, 2).tolist())
        places: list[float] = []

        def function(x: float, case: int, powers: Any, places: list[float]) -> float:
            places.append(x)
            value = float(np.polyval(powers, x))
            jump = math.copysign(max(abs(value), 0.1), value)
            return (value, math.sin(3 * value), jump)[case % 3]

        given = partial(function, case=case, powers=powers, places=places)
        ends = given(a), given(b)
        if ends[0] * ends[1] < 0:
            search = Search(10 ** random.uniform(-14, -3), RTOL)
            answer = begun(search, a, b, *ends)
            while answer == WANTED:
                answer = gone_on(search, given(search.here))
            count = len(places)
            assert answer == FOUND and search.here == brentq(given, a, b, xtol=search.xtol)
            assert places[:count] == places[count:]
