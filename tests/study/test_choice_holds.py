"""`--accuracy` and `--budget` where they once did not hold: on scenes that are not built in.

The whole set of these, with three targets each, is `tests/campaigns/choosing.py --own`.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from accuracy_scenes import case_of, closed_end, made, text
from campaign import thinned
from mpmath import mp, mpf

from eomgen.commands.main import main
from eomgen.run.checks import allowed_errors
from eomgen.run.module import as_problem
from eomgen.run.problem import FloatArray, Problem
from eomgen.store import program_of
from eomgen.study.accuracy import search, trial
from eomgen.study.accuracy.budgeting import within
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.estimate import second_of
from eomgen.study.accuracy.ladder import Ladder, Work, next_setting
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.moved import moved
from eomgen.study.accuracy.reference import reference
from eomgen.study.accuracy.trial import Case, Setting, Tried

pytestmark = pytest.mark.usefixtures("blank_figures")


def end_of(scene: str, t_end: float | None = None) -> FloatArray:
    """A scene's last state in extended precision, rounded."""
    known = closed_end(scene) if t_end is None else None
    if known is not None:
        return np.array([float(x) for x in known])
    model, module, wanted = made(scene)
    return reference(model, module, t_end=t_end or wanted.t_end, doubles=False).y[-1]


def off(case: Case, run: Tried, true: FloatArray) -> float:
    """A run's true error at the end, in parts of the motion's scale."""
    return error(run.trajectory.y[-1], true, case.scale(run.extent))


def spin_after(inertia: Sequence[float], spin: Sequence[float], t_end: float) -> FloatArray:
    """The angular velocity of a free body by Euler's equations, Taylor series in 50 digits."""
    with mp.workdps(50):
        i, w = [mpf(x) for x in inertia], [mpf(x) for x in spin]
        c = [(i[k - 2] - i[k - 1]) / i[k] for k in range(3)]
        for _ in range(round(4 * t_end)):
            s = [[x] for x in w]
            for n in range(40):
                new = [mp.fdot(s[k - 2], s[k - 1][::-1]) * c[k] / (n + 1) for k in range(3)]
                for series, term in zip(s, new, strict=True):
                    series.append(term)
            w = [mp.polyval(series[::-1], mpf(0.25)) for series in s]
        return np.array([float(x) for x in w])


@pytest.mark.full
def test_near_a_separatrix(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rotation about the middle axis turns what rounding does to a constant, 1/3 here, into 1e-8:
    no run of that module is better than that, and two of them do not show it.
    """
    scene = tmp_path / "nut.toml"
    scene.write_text(text("separatrix_1"))
    asked = ["simulate", str(scene), "--integrator", "DOP853", "-o", str(tmp_path)]
    assert main([*asked, "--accuracy", "1e-9"]) == 1
    assert "not reached" in capsys.readouterr().err
    assert main([*asked, "--accuracy", "1e-6"]) == 0
    with np.load(tmp_path / "separatrix_1.npz") as run:
        found = run["y"][-1][-3:]
    true = spin_after([1.0, 2.0, 3.0], [0.001, 3.0, 0.0005], 30)
    assert np.max(np.abs(found - true)) < 1e-6 * 6


def test_constants_are_moved_by_what_rounding_did_to_them() -> None:
    """1/3 is rounded and moves by a unit in the last place; 2 and 1/2 are not, and stay."""
    model, module, _ = made("separatrix_1")
    twin = moved(module, program_of(model))
    own, other = (m._DEFAULT["derivative"] for m in (module, twin))  # type: ignore[attr-defined]
    assert own != other
    for a, b in zip(own, other, strict=True):
        assert abs(a - b) <= 2 * np.spacing(abs(a))
        assert a == b or a not in (0.5, 1.0, 2.0, -1.0, 0.0)
    y = as_problem(module).initial + 0.1
    assert not np.array_equal(module.derivative(0.0, y), twin.derivative(0.0, y))
    assert np.array_equal(module.derivative(0.0, y), made("separatrix_1")[1].derivative(0.0, y))


def test_stiff_springs() -> None:
    """The reference has its extended precision, and Rodas5P is offered before explicit methods step
    on.
    """
    case, true = case_of("slide_1e8", 0.5), end_of("slide_1e8", 0.5)
    choice = meet(case, 1e-3)
    assert choice.met and off(case, choice.tried, true) < 1e-3
    assert choice.tried.setting.integrator == "Rodas5P"
    assert choice.tried.trajectory.counts["steps"] < 1000


def test_the_default_atol() -> None:
    """It follows rtol below 1e-9, where 1e-12 of each state's size is what errors would come from;
    but a tolerance below what rounding makes of a step of a stiff spring is met by no step.
    """
    problem = case_of("double_pendulum").problem
    sizes = np.array(problem.sizes)
    for rtol, part in ((1e-6, 1e-12), (1e-10, 1e-13), (1e-13, 1e-15)):
        assert allowed_errors(problem, "DOP853", rtol, None, 10.0) == pytest.approx(part * sizes)
    problem = case_of("slide_1e8").problem
    assert problem.noise is not None
    noise, sizes = problem.noise(4.0), np.array(problem.sizes)
    # Of the rate of the slide: half a unit of k s / m, over 2 sqrt(k / m).
    assert noise[3] == pytest.approx(0.25 * np.sqrt(1e8 / 0.4) * 2**-53, rel=0.9)
    allowed = allowed_errors(problem, "DOP853", 1e-13, None, 4.0)
    assert np.all(allowed >= np.minimum(10 * noise, 1e-12 * sizes))
    assert np.all(allowed <= 1e-12 * sizes)


@pytest.mark.full
def test_rows_a_period_apart() -> None:
    """Those of an orbit do not move at all: that is no scale, and no reason to refuse."""
    case = case_of("orbit_99", samples=31)
    choice = meet(case, 1e-4, "DOP853")
    assert choice.met and off(case, choice.tried, end_of("orbit_99")) < 1e-4


def test_what_is_said_of_rows_before_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The target is one of the last state; what is known of all rows is reported beside it."""
    scene = tmp_path / "crank.toml"
    scene.write_text(text("crank"))
    assert main(["simulate", str(scene), "--accuracy", "1e-6", "-o", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert ", relative, at the end, at most" in out and "before, at t =" in out


class Clock:
    """A clock that counts what is computed, so that no test hangs on the machine's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, tick: float) -> None:
        self.now, self._tick = 0.0, tick
        for module in (search, trial):
            clock = SimpleNamespace(perf_counter=lambda: self.now, process_time=lambda: self.now)
            monkeypatch.setattr(module, "time", clock)

    def counting(self, problem: Problem) -> Problem:
        """The problem, whose evaluations take time by this clock."""

        def ticking(function: Callable[[float, FloatArray], FloatArray]) -> Any:
            def value(t: float, y: FloatArray) -> FloatArray:
                self.now += self._tick
                return function(t, y)

            return value

        return replace(
            problem, derivative=ticking(problem.derivative), jacobian=ticking(problem.jacobian)
        )

    def case(self, scene: str) -> Case:
        """A scene's run by this clock."""
        case = case_of(scene)
        twin = case.moved
        assert twin is not None
        return replace(
            case, problem=self.counting(case.problem), moved=lambda way: self.counting(twin(way))
        )


def test_a_budget_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each ten times more of it makes the run more exact, as far as doubles go."""
    true, errors = end_of("crank"), []
    for budget in (0.02, 0.06, 0.3):
        clock = Clock(monkeypatch, 2e-5)
        case = clock.case("crank")
        choice = within(case, budget)
        assert clock.now < 1.05 * budget
        errors.append(off(case, choice.tried, true))
    assert errors[1] < errors[0] / 30 and errors[2] < 1e-11


def test_no_clock_has_a_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same scene gives the same runs on a machine that is slow at anything, now and then."""
    tried = []
    run = Case.run

    def kept(self: Case, setting: Setting, **given: Any) -> Tried:
        tried[-1].append(setting)
        return run(self, setting, **given)

    monkeypatch.setattr(Case, "run", kept)
    for lags in ((0.0,), (1.0, 1e-6, 50.0), (1e-9,)):
        ticks = itertools.accumulate(itertools.cycle(lags))
        for module in (search, trial):
            tick = lambda ticks=ticks: next(ticks)  # noqa: E731
            clock = SimpleNamespace(perf_counter=tick, process_time=tick)
            monkeypatch.setattr(module, "time", clock)
        tried.append([])
        assert meet(case_of("two_body"), 1e-7).met
    assert tried[0] == tried[1] == tried[2]


FORCED = [
    ("crank", "LSODA", (1e-3, 1e-9)), ("crank", "DOP853", (1e-3, 1e-9)), ("crank", "rk4", (1e-3,)),
    ("stiff_hinges", "LSODA", (1e-3, 1e-6)),
    ("stiff_hinges", "Radau", (1e-3, 1e-6)),
    ("stiff_hinges", "Rodas5P", (1e-3, 1e-6)),
    ("slope", "RK45", (1e-6,)), ("slope", "DOP853", (1e-6,)),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "cheapest", "targets"), thinned(FORCED, 4))
def test_the_accuracy_holds_whichever_method_is_the_cheapest(
    monkeypatch: pytest.MonkeyPatch, scene: str, cheapest: str, targets: tuple[float, ...]
) -> None:
    """Costs decide on the method alone, never on whether its error is what was asked for."""
    meter = trial.meter

    def forced(problem: Problem, method: str) -> Any:
        cost, part = meter(problem, method), 1e-3 if method == cheapest else 1.0
        return lambda tally: part * cost(tally)

    monkeypatch.setattr(trial, "meter", forced)
    case = case_of(scene, samples=201)
    true = end_of(scene)
    for target in targets:
        choice = meet(case, target)
        found = off(case, choice.tried, true)
        assert choice.met and found < target
        assert found < 2 * choice.error


def test_steps_as_long_as_any_may_be() -> None:
    """Where tolerances do not make the steps, the second run has others all the same."""
    case = case_of("crank")
    run = case.run(Setting("RK45", 1e-6, 1e-6))
    counts = {**run.trajectory.counts, "capped": run.trajectory.counts["steps"]}
    capped = replace(run, trajectory=replace(run.trajectory, counts=counts))
    setting, other = second_of(case, run)
    assert setting.rtol == 1e-5 and other is case
    setting, other = second_of(case, capped)
    assert setting == run.setting and other.kept["max_step"] < case.t_end / 1000
    _, other = second_of(replace(case, kept={**case.kept, "max_step": 0.01}), capped)
    assert other.kept["max_step"] == 0.02


def test_the_study_asks_for_what_rounding_allows() -> None:
    """No setting of `eomgen accuracy` has an atol below what rounding makes of a step."""
    noise = 1e-10
    quiet = Ladder(t_end=1.0, first=25, atol_scale=1e-11, quick=False, run_time=60.0)
    for method in ("LSODA", "DOP853", "Radau"):
        for ladder, least in ((quiet, 0.0), (replace(quiet, noise=noise), noise)):
            done: dict[Setting, Work] = {}
            while setting := next_setting(ladder, method, done):
                assert setting.rtol is not None and setting.atol is not None
                assert setting.atol == pytest.approx(1e-11 * setting.rtol) or least
                assert setting.atol >= 10 * least
                done[setting] = Work(setting, "ok", 0.0, 1, error=setting.rtol)
            assert len(done) == 12
