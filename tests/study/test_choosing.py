"""`--accuracy`, `--budget`, `--estimate`: the choice meets its bound, and errors are reported."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from accuracy_scenes import case_of
from campaign import some

from eomgen.commands.main import main
from eomgen.run.integrators.interface import SMALLEST_RTOL
from eomgen.run.problem import Contacts, FloatArray, Problem
from eomgen.run.trajectory import COUNTS, Trajectory
from eomgen.study.accuracy import choosing
from eomgen.study.accuracy.choosing import meet
from eomgen.study.accuracy.estimate import STRIKES, by_second_run, difference, estimated
from eomgen.study.accuracy.measure import error
from eomgen.study.accuracy.methods import method_of
from eomgen.study.accuracy.search import Search, Trial
from eomgen.study.accuracy.trial import Case, Setting, Tried

pytestmark = pytest.mark.usefixtures("blank_figures")

# A small body on a hinge as stiff as a beam, ω = 3e4/s, damped, beside a swing of seconds.
STIFF = """
name = "stiff"
bodies = [
  { name = "a", mass = 1, inertia_com = 0.1 },
  { name = "b", mass = 1e-3, inertia_com = 1e-6 },
]
joints = [
  { name = "pin", type = "revolute", parent = "world", child = "a", r_child = [0, 0.5] },
  { name = "tip", type = "revolute", parent = "a", child = "b", r_parent = [0, -0.5] },
]
effects = [
  { type = "gravity", g = 9.81 },
  { type = "joint_spring", name = "beam", joint = "tip", stiffness = 1000, damping = 0.1 },
]
initial = { q = { pin_angle_deg = 60 } }
simulation = { t_end = 2, integrator = "LSODA" }
"""
# github.com/Noah-Parsons/light-cartpole-benchmark: the cart weighs a millionth of the pole.
SPIKY = """
name = "spiky"
bodies = [
  { name = "cart", mass = 1e-6, inertia_com = 0 },
  { name = "pole", mass = 1, inertia_com = 0 },
]
joints = [
  { name = "rail", type = "prismatic", parent = "world", child = "cart", axis = [1, 0] },
  { name = "pin", type = "revolute", parent = "cart", child = "pole", r_child = [0, 1] },
]
effects = [{ type = "gravity", g = 9.81 }]
initial = { q = { pin_angle_deg = 90 } }
simulation = { t_end = 10 }
"""


def truth(case: Case, integrator: str = "DOP853", rtol: float = SMALLEST_RTOL) -> FloatArray:
    """The motion (n, ny) as tightly as doubles have it."""
    return case.run(Setting(integrator, rtol, 1e-2 * rtol)).trajectory.y


def motion(t: FloatArray, y: FloatArray) -> Trajectory:
    """A run of one state, finished."""
    counts = dict.fromkeys(COUNTS, 0)
    return Trajectory("made up", ("q",), t, y[:, None], "RK45", True, "", counts)


def test_a_difference_is_no_accident_of_its_moment() -> None:
    """One that passes through 0 at the end counts as large as it was just before; one that is large
    for a moment, as a spike makes it, counts as at the end.
    """
    t = np.linspace(0.0, 1.0, 201)
    swings = difference(motion(t, np.zeros(201)), motion(t, np.sin(20 * np.pi * t)), np.ones(1))
    assert 0.5 < swings < 1
    spike = np.where(np.arange(201) == 198, 1.0, 1e-6)
    assert difference(motion(t, np.zeros(201)), motion(t, spike), np.ones(1)) == 1e-6
    assert difference(motion(t, t * 0), motion(t[::200], t[::200]), np.ones(1)) == 1
    struck = motion(np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    assert difference(struck, motion(np.array([0.0, 1.0]), np.array([0.0, -1.0])), np.ones(1)) == 0


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("scene", "targets"),
    [("pendulum", (1e-3, 1e-6, 1e-9)), ("two_body", (1e-3, 1e-8)), ("double_pendulum", (1e-4,))],
)
def test_the_accuracy_holds(scene: str, targets: tuple[float, ...]) -> None:
    """The true error, by a run as tight as doubles allow, is below what was asked for, and the
    estimate is not far from it.
    """
    case = case_of(scene)
    true = truth(case)
    for target in targets:
        choice = meet(case, target)
        off = error(choice.tried.trajectory.y[-1], true[-1], case.scale(true))
        assert choice.met and off < target
        assert choice.error <= target / 2
        assert off < 3 * choice.error


def test_a_stiff_scene() -> None:
    """Explicit methods are not followed to the end; the error holds by another method's measure."""
    case = case_of(STIFF)
    true = truth(case, "Radau", 1e-11)
    choice = meet(case, 1e-6)
    assert choice.tried.setting.integrator in ("LSODA", "Rodas5P", "Radau") and choice.met
    assert error(choice.tried.trajectory.y[-1], true[-1], case.scale(true)) < 1e-6
    setting = choice.tried.setting
    cut = case.run(replace(setting, integrator="RK45"), most=0.0)
    assert cut.cut and not cut.trajectory.finished


def test_one_method_alone() -> None:
    """The method asked for is kept to, equal steps among it."""
    case = case_of("pendulum")
    case = replace(case, t_end=3.0, kept={**case.kept, "samples": 101})
    true = truth(case)
    for name in ("rk4", "implicit_midpoint"):
        target = 1e-3 if name == "implicit_midpoint" else 1e-6
        said: list[str] = []
        choice = meet(case, target, name, said.append)
        assert choice.tried.setting.integrator == name and choice.met
        assert all(text.startswith(f"--integrator {name} ") for text in said)
        assert error(choice.tried.trajectory.y[-1], true[-1], case.scale(true)) < target


@pytest.mark.full
def test_a_motion_that_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lorenz's over 50 s grows an error by 1e19: no run in doubles is right, and once DOP853 as
    tight as it goes is wrong, no other method is asked. Samples of DOP853 follow.
    """

    def derivative(t: float, y: FloatArray) -> FloatArray:
        a, b, c = y.tolist()
        return np.array([10 * (b - a), a * (28 - c) - b, a * b - 8 / 3 * c])

    def jacobian(t: float, y: FloatArray) -> FloatArray:
        a, b, c = y.tolist()
        return np.array([[-10, 10, 0], [28 - c, -1, -a], [b, a, -8 / 3]])

    lorenz = Problem("lorenz", ("a", "b", "c"), (0, 1, 2), derivative, jacobian, np.ones(3))
    made: list[Tried] = []
    run = Case.run
    monkeypatch.setattr(Case, "run", lambda *a, **k: made.append(run(*a, **k)) or made[-1])
    choice = meet(Case(lorenz, 50.0, dict.fromkeys("abc", "m"), {}), 1e-3)
    assert not choice.met and choice.error > 1e-3
    assert {one.setting.integrator for one in made} == {"DOP853"}


def test_steps_that_something_else_keeps_short() -> None:
    """Two runs of the same steps show nothing of their error."""
    case = case_of("pendulum")
    case = replace(case, kept={**case.kept, "max_step": 0.01})
    true = truth(replace(case, kept={**case.kept, "max_step": None}))
    choice = meet(case, 1e-4, "RK45")
    assert choice.met and 0 < choice.error <= 5e-5
    assert error(choice.tried.trajectory.y[-1], true[-1], case.scale(true)) < 1e-4


def test_what_was_put_aside(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that takes longer than another one at first is gone back to where that one, which
    is taken to 2.3e-14 only, does not get there.
    """
    case = case_of("two_body")
    made: list[Setting] = []
    run = Case.run

    def slow(self: Case, setting: Setting, *, most: float = math.inf, **given: Any) -> Tried:
        made.append(setting)
        cut = 0.0 if setting.integrator == "DOP853" and math.isfinite(most) else math.inf
        return run(self, setting, most=cut, **given)

    monkeypatch.setattr(Case, "run", slow)
    monkeypatch.setattr(choosing, "candidates", lambda search, asked: ["LSODA", "DOP853"])
    choice = meet(case, 1e-16)
    assert not choice.met
    tightest = {
        name: min(one.rtol or 0 for one in made if one.integrator == name)
        for name in {one.integrator for one in made}
    }
    assert tightest == {"LSODA": SMALLEST_RTOL, "DOP853": 1e-16}


def test_impacts_have_a_floor_of_their_own() -> None:
    """With rigid contacts nothing is taken to be more exact than two runs are near each other."""
    case = case_of("pendulum")
    nothing: Any = lambda *given: np.zeros(0)  # noqa: E731
    contacts = Contacts((), (), nothing, nothing, nothing, nothing)
    struck = replace(case, problem=replace(case.problem, contacts=contacts))
    run = case.run(Setting("DOP853", 1e-15, 1e-15))
    scale = case.scale(run.trajectory.y)
    found, floor = (estimated(each, run, run, scale) for each in (case, struck))
    assert found.last < floor.last == floor.most == STRIKES


def test_two_runs_that_agree_by_accident() -> None:
    """An error falls no faster than theory says, whatever the two runs of one tolerance show; one
    that is made only of rounding is not tightened on and on.
    """
    search = Search(case_of("pendulum"), lambda text: None)
    method = method_of("DOP853")
    search.begin(method)
    (first,) = search.trials
    run = search.case.run(search.setting(method, first.run.tolerance / 1000))
    search.trials.append(Trial(run, run))
    assert search.error(search.trials[1]) == pytest.approx(search.error(first) / 1000)
    assert search.plan(method, 1e-20) and not search.plan(method, 1e-20, most=run.work)


@pytest.mark.parametrize(
    ("scene", "target", "most"), [("two_body", 1e-6, 8), ("pendulum", 0.05, 4)]
)
def test_few_trials(scene: str, target: float, most: int) -> None:
    """Where theory holds a search is soon at its end, and what is more exact than asked for needs
    no sample of rounding.
    """
    assert meet(case_of(scene), target).runs <= most


def test_a_second_run_reports_the_error() -> None:
    """Adaptive and equal steps: the estimate is near the true error."""
    case = replace(case_of("pendulum"), t_end=3.0)
    true = truth(case)
    for setting in (
        Setting("RK45", 1e-6, 1e-8),
        Setting("rk4", dt=0.02),
        Setting("euler", dt=1e-3),
        Setting("Radau", 1e-5, 1e-7),
    ):
        first = case.run(setting)
        found = by_second_run(case, first)
        # Of equal steps, a row is at each; the last is at the end in all.
        off = error(first.trajectory.y[-1], true[-1], case.scale(true))
        assert off / 4 < found.last < 20 * off, setting.options
        assert found.most >= found.last
        assert found.last > 0.9 * off or setting.dt is None
        assert found.second.tolerance < first.tolerance
    tightest = case.run(Setting("DOP853", 1e-16, 1e-16))
    found = by_second_run(case, tightest)
    assert found.second.tolerance > 1e-16 and 1e-16 < found.last < 1e-11


def rows(folder: Path) -> FloatArray:
    """The states that a run of two_body has kept."""
    with np.load(folder / "two_body.npz") as kept:
        return np.asarray(kept["y"])


def test_the_same_run_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The options printed make the same run, to the last bit, works or not, few rows or many.

    Which they are is the same each time.
    """

    def made(name: str, *options: str) -> FloatArray:
        kept = ["--no-pictures", "-o", str(tmp_path / name)]
        assert main(["simulate", "two_body", *options, *kept]) == 0
        return rows(tmp_path / name)

    for name, more in (("many", ("--samples", "300")), ("few", ("--works", "--samples", "5"))):
        one = made(name, "--accuracy", "5e-6", *more)
        out = capsys.readouterr().out
        (options,) = re.findall(r"chosen: (--integrator .*)", out)
        assert re.search(r"error estimate \S+, relative, at the end, at most", out)
        two = made(f"{name} again", *options.split(), "--samples", "300")
        assert len(one) == int(more[-1]) and np.array_equal(two[-1], one[-1])
        assert name == "few" or np.array_equal(one, two)


@pytest.mark.full
def test_out_of_reach(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What rounding does not allow is said in one line; the best run is kept."""
    assert main(["simulate", "pendulum", "--accuracy", "1e-16", "-o", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert re.fullmatch(
        r"eomgen: --accuracy 1e-16: not reached; the best run's error estimate is \S+: a double "
        r"resolves theta only to \S+ of its range of motion; take a shorter --t-end\n",
        said.err,
    )
    assert (tmp_path / "pendulum.npz").exists()


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "integrator", some(["DOP853", "BDF"], ["RK45", "DOP853", "LSODA", "BDF", "Radau"])
)
def test_a_wrong_run_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], integrator: str
) -> None:
    """At SciPy's default tolerances every method reports success on the light cart-pole and is
    wrong (published errors 2.29, 0.086, 2.21, 3.85, 0.134): only energy shows it, and a second run.
    """
    scene = tmp_path / "spiky.toml"
    scene.write_text(SPIKY)
    bounds = ["--rtol", "1e-3", "--atol", "1e-6", "--integrator", integrator]
    assert main(["simulate", str(scene), *bounds, "--estimate", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert re.search(r"error estimate \S+, relative, at the end, at most", said.out)
    assert "warning: by its error estimate this run has a relative error of" in said.err
    assert "warning: exact motion conserves its energy, but this run is off by" in said.err


def test_no_false_alarm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Energy that is lost to damping, or comes from a force, is none of the method's errors."""
    scene = tmp_path / "stiff.toml"
    scene.write_text(STIFF)
    quiet = [
        [str(scene), "--t-end", "0.3", "--works"],
        ["two_body_forced", "--input", "tau=3", "--t-end", "0.5", "--works"],
        ["pendulum", "--estimate"],
        ["tumbling_body", "--t-end", "1"],
    ]
    for asked in quiet:
        assert main(["simulate", *asked, "--no-pictures", "-o", str(tmp_path)]) == 0
        assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--accuracy 1e-6 --rtol 1e-6", "--accuracy chooses rtol itself; leave one out"),
        ("--accuracy 1e-6 --dt 0.1", "--accuracy chooses dt itself; leave one out"),
        ("--budget 2s --atol 1e-9", "--budget chooses atol itself; leave one out"),
        ("--accuracy 1e-6 --budget 2s", "a run has only one aim; give one of them"),
        ("--accuracy 0", "--accuracy: 0 is not between 0 and 0.1; give e.g. 1e-6"),
        ("--accuracy nan", "--accuracy: nan is not between 0 and 0.1; give e.g. 1e-6"),
        ("--accuracy 1", "--accuracy: 1 is not between 0 and 0.1; give e.g. 1e-6"),
        ("--accuracy 1e-3 --integrator RK54", "unknown name 'RK54' (did you mean 'RK45'?)"),
        ("--accuracy 1e-3 --t-end -1", "--t-end: -1 is not a positive time"),
        ("--accuracy 1e-3 --t-end nan --integrator rk4", "--t-end: nan is not a positive time"),
        ("--accuracy 1e-3 --max-step 0", "max_step: 0 is not a positive step"),
        ("--accuracy 1e-3 --samples 1", "samples: 1 is too few"),
        ("--budget 2h", "--budget 2h: is not a computing time; give e.g. 2s, 500ms or 1.5min"),
        ("--budget=-1s", "--budget -1s: is not a computing time"),
        ("--budget 1..2", "--budget 1..2: is not a computing time"),
        ("--budget 1e-9", "no run of pendulum to t = 10 s fits into 1e-09 s; give more, or a sho"),
    ],
)
def test_what_cannot_be_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: str, words: str
) -> None:
    """One clear line each."""
    assert main(["simulate", "pendulum", *options.split(), "-o", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1


def test_a_scene_that_breaks_off(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where no method gets to the end, the farthest run is kept, and its reason reported."""
    scene = tmp_path / "breaks.toml"
    text = STIFF.replace("damping = 0.1", 'damping = 0.1, law = "1 / (0.001 - deflection)"')
    scene.write_text(text)
    asked = ["simulate", str(scene), "--accuracy", "1e-4", "-o", str(tmp_path)]
    assert main(asked) == 1
    assert capsys.readouterr().err


def test_an_interrupt_ends_it_all() -> None:
    """Ctrl-C while methods are tried is no failure of one of them."""
    case = case_of("pendulum")
    calls = 0

    def derivative(t: float, y: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        if calls == 500:
            raise KeyboardInterrupt
        return case.problem.derivative(t, y)

    with pytest.raises(KeyboardInterrupt):
        meet(replace(case, problem=replace(case.problem, derivative=derivative)), 1e-6)


def test_methods_are_known() -> None:
    """Equal steps have an order, tolerances an exponent near 1."""
    assert method_of("rk4").equal_steps and method_of("rk4").exponent == 4
    assert not method_of("LSODA").equal_steps and method_of("LSODA").exponent == 1
    assert math.isclose(method_of("RK45").growth, 0.2)
