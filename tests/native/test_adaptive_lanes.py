"""Many members at once by DOP853 in vector registers: single runs, at every width, beside any."""

import math
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scenes import WEIGHT, effect, lone
from test_lanes import WIDTHS, members

import eomgen
from eomgen.api.given import check, read
from eomgen.engine.adaptive import Bounds
from eomgen.native import adaptive_lanes, lanes
from eomgen.native.adaptive_lanes import AdaptiveLanes
from eomgen.run.checks import allowed_errors
from eomgen.run.integrate import integrate
from eomgen.run.integrators.fixed_step import Grid
from eomgen.run.module import as_problem, load_module
from eomgen.store import generated_code, interfaced_program_of

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(CC is None, reason="there is no C compiler")
SCENES = ("two_body_forced", "tumbling_body")
LOOSE: dict[str, Any] = {"rtol": 1e-4, "atol": 1e-6}
"""Tolerances at which rounding changes no length of a step."""


@cache
def kernels(scene: str, width: int = 0) -> tuple[AdaptiveLanes, Any]:
    """The kernels of a scene, and its Python module. A width beyond that of this processor is
    computed in narrower registers.
    """
    model = check(read(scene))
    module = load_module(generated_code(model).module, scene)
    texts = adaptive_lanes.sources(*interfaced_program_of(model))
    with pytest.MonkeyPatch.context() as patch:
        if width > lanes.width():
            patch.setitem(lanes.FLAGS, width, lanes.FLAGS[lanes.width()])
        return AdaptiveLanes(texts, width or lanes.width()), module


def run(
    ours: AdaptiveLanes, columns: Sequence[np.ndarray], times: np.ndarray, **options: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Runs from states y with parameters p and inputs u, columns; rows at the times."""
    y, p, u = map(np.ascontiguousarray, columns)
    k, _, _ = ours.prepare(p.T)
    options = {"longest": math.inf, **LOOSE, **options}
    atol = np.full((ours.states, 1), options.pop("atol"))
    bounds = Bounds(atol, options.pop("rtol"), options.pop("longest"))
    return ours.dop853(y, k, u, bounds, times, **options)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_runs_are_those_of_the_method_in_python(scene: str) -> None:
    """The same steps, with some rejected, rows within steps and at their ends."""
    ours, module = kernels(scene)
    columns = members(module, 11)
    times = np.linspace(0.0, 0.5, 12)
    for longest in (None, 0.02):
        bound = {"longest": longest or math.inf}
        rows, sound = run(ours, columns, times[1:], **bound)
        assert sound.all() and rows.shape == (11, len(module.STATES), 11)
        for j in range(11):
            y, p, u = (array[:, j] for array in columns)
            problem = replace(as_problem(module, p, u), initial=y)
            options = {**LOOSE, "samples": 12, "max_step": longest}
            single = integrate(replace(problem, corners=False), "DOP853", 0.5, **options)
            size = np.abs(single.y).max()
            assert np.allclose(rows[:, :, j], single.y[1:], rtol=0, atol=1e-9 * size)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_a_member_has_the_same_bits_at_every_width_and_beside_any_others(scene: str) -> None:
    """One neighbour overflows, one is not finite; others need many more steps; the order is
    reversed, or members run one by one.
    """
    times, count, bad = np.array([0.1, 0.5, 1.0]), 21, [4, 6]
    good = [j for j in range(count) if j not in bad]
    results = []
    for width in WIDTHS:
        ours, module = kernels(scene, width)
        columns = members(module, count)
        y = columns[0]
        y[-1, 4], y[-1, 6] = 1e300, np.inf
        y[:, ::5] *= 3.0
        for order in (np.arange(count), np.arange(count)[::-1]):
            rows, sound = run(ours, [array[:, order] for array in columns], times, rtol=1e-9)
            back = np.argsort(order)
            assert sound[back][good].all() and not sound[back][bad].any()
            results.append(rows[..., back][..., good].tobytes())
        alone = [run(ours, [array[:, [j]] for array in columns], times, rtol=1e-9) for j in good]
        results.append(np.concatenate([rows for rows, _ in alone], axis=2).tobytes())
    assert len(set(results)) == 1


def test_a_member_that_is_slow_is_given_up() -> None:
    """Steps that are too short for the pace, here by a limit on their length."""
    ours, module = kernels(SCENES[0])
    columns = members(module, 3)
    for longest, valid in ((1e-4, True), (1e-5, False)):
        _, sound = run(ours, columns, np.array([2.5]), longest=longest)
        assert (sound == valid).all()


@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_runs_are_counted_and_can_be_stopped(method: str) -> None:
    """From outside, through two integers in memory."""
    ours, module = kernels(SCENES[0])
    count, shared = 13, np.zeros(2, dtype=np.int64)
    columns = members(module, count)
    places = (shared.ctypes.data, shared.ctypes.data + 8)

    def valid() -> np.ndarray:
        if method == "dop853":
            return run(ours, columns, np.array([0.5]), addresses=places)[1]
        y, p, u = map(np.ascontiguousarray, columns)
        k, _, _ = ours.prepare(p.T)
        sizes = np.ones((len(y), 1))
        return ours.rk4(y, k, u, Grid(0.0, 0.5, 0.01, 50), sizes=sizes, addresses=places)[1]

    assert valid().all() and shared.tolist() == [count, 0]
    shared[1] = 1
    assert not valid().any() and shared[0] == count


def test_a_sweep_in_lanes_is_that_of_single_runs() -> None:
    """To the tolerance; the same tolerances are taken, and members that stop or are refused say
    why in the same words.
    """
    vary = {"m_A": [1.0, -1.0, 1.2, 0.9, 1e200], "theta_dot": [0.1, 0.2, 1e160, 0.4, 0.5]}
    asked: dict[str, Any] = {"t_end": 0.5, "integrator": "DOP853", "samples": 6}
    one, other = (
        eomgen.ensemble("two_body_forced", vary, backend=backend, **asked)
        for backend in ("c", "numpy")
    )
    assert one.status == other.status and one.status[1:3] == ["refused", "stopped"]
    assert one.messages.tolist() == other.messages.tolist()
    for name in ("final", "rows", "t"):
        a, b = getattr(one, name), getattr(other, name)
        assert np.allclose(a, b, rtol=1e-9, atol=1e-9, equal_nan=True), name


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", SCENES)
def test_default_tolerances_are_those_of_a_single_run(
    scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose sizes depend on parameters and inputs of a member."""
    taken: list[np.ndarray] = []
    once = AdaptiveLanes.dop853

    def watching(self: Any, *given: Any, **options: Any) -> Any:
        taken.append(given[3].atol)
        return once(self, *given, **options)

    monkeypatch.setattr(AdaptiveLanes, "dop853", watching)
    _, module = kernels(scene)
    lengths = [name for name in module.PARAMETERS if module.UNITS[name] == "m"]
    names = [*lengths[:1], *module.INPUTS]
    vary = {name: [0.3, 1.0, 40.0] for name in names} or {module.STATES[-1]: [0.1, 0.2, 0.3]}
    eomgen.ensemble(scene, vary, t_end=0.1, integrator="DOP853", rtol=1e-9, backend="c")
    for j in range(3):
        values = {name: column[j] for name, column in vary.items()}
        p = {n: v for n, v in values.items() if n in module.PARAMETERS} or None
        u = {n: v for n, v in values.items() if n in module.INPUTS} or None
        expected = allowed_errors(as_problem(module, p, u), "DOP853", 1e-9, None, 0.1)
        found = taken[0][:, min(j, taken[0].shape[1] - 1)]
        assert np.allclose(found, expected, rtol=1e-12, atol=0)


STEEP = lone(
    "revolute",
    WEIGHT,
    effect("field", name="push", kind="formula", body="bob", force=["1/(1 + exp(900*x))", 0]),
    body="bob",
    on="pivot",
    name="steep",
    initial={"q": {"theta": -1.4}},
    inertia_com=0,
    r_child=[-1.0, 0],
    coordinate="theta",
)
"""A pendulum with a force that overflows beyond x = 0.79 m, although it is finite there."""


def test_a_hidden_overflow_is_that_of_its_member_alone() -> None:
    """It stops there as in Python, and its neighbours have the bits that they have without it."""
    asked: dict[str, Any] = {"t_end": 2.0, "integrator": "DOP853", "samples": 5}
    angles = np.array([-1.4, -1.3, -2.9, -1.5, -1.6])
    one, other = (
        eomgen.ensemble(STEEP, {"theta": angles}, backend=backend, **asked)
        for backend in ("c", "numpy")
    )
    assert one.status == other.status == [*["finished"] * 2, "stopped", *["finished"] * 2]
    assert one.messages.tolist() == other.messages.tolist() and "no finite value" in one.messages[2]
    good = [0, 1, 3, 4]
    without = eomgen.ensemble(STEEP, {"theta": angles[good]}, backend="c", **asked)
    assert one.rows[good].tobytes() == without.rows.tobytes()
