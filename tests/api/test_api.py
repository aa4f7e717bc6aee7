"""The public functions: what they take, what they return, and that nothing else is public."""

import copy
import logging
import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.commands.main import main
from eomgen.pipeline import compile_program
from eomgen.run.trajectory import Outcome, load_npz
from eomgen.scene.reader import BUILT_IN

DROP: dict[str, Any] = {
    "name": "drop",
    "bodies": [{"name": "ball", "mass": np.float64(2.0), "inertia_com": 0.1}],
    "joints": ({"name": "flight", "type": "free", "child": "ball"},),
    "effects": [{"type": "gravity", "g": 9.81}],
    "initial": {"q": {"ball_y": np.int64(3)}},
}


def test_all_names_are_there() -> None:
    """Sorted, each once; each there, and said what it is; anything else is refused."""
    assert eomgen.__all__ == sorted(set(eomgen.__all__)) == dir(eomgen)
    for name in eomgen.__all__:
        assert getattr(eomgen, name).__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'integrate'"):
        getattr(eomgen, "integrate")  # noqa: B009  # ty: as a user writes it


def test_importing_takes_no_time() -> None:
    """What is not used is not loaded."""
    code = "import sys, eomgen; sys.exit(any(m in sys.modules for m in ('numpy', 'sympy')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_scene_in_every_way(tmp_path: Path) -> None:
    """A name, a path as text or as a path, a text, tables, and a scene are one scene."""
    path = BUILT_IN / "pendulum.toml"
    text = path.read_text("utf-8")
    found = [eomgen.read(x) for x in ("pendulum", str(path), path, text, eomgen.read(text))]
    assert all(scene == found[0] for scene in found)
    model = eomgen.check(DROP)
    assert model.value(model.bodies[0].mass) == 2.0
    assert [c.name for c in model.coordinates] == ["ball_x", "ball_y", "ball_angle"]


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ({**DROP, "bodeis": {1, 2}}, "scene: bodeis: unknown key (did you mean 'bodies'?)"),
        ({**DROP, "name": 7}, "scene: name: 7 is not a text; give one"),
        ({**DROP, "points": np.zeros(2)}, "scene: points[0]: 0.0 is not a table; give one"),
        (7, "a scene cannot be read from int; give a path, a name, a text, a mapping or a Scene"),
        ("pendulam", "pendulam: no such file or built-in scene (did you mean 'pendulum'?)"),
    ],
)
def test_a_mistake_is_a_line(source: Any, said: str) -> None:
    """As on the command line, in `lines` of the error."""
    with pytest.raises(eomgen.SceneError) as caught:
        eomgen.check(source)
    assert caught.value.lines[0] == said


@pytest.mark.parametrize(
    "change",
    [
        {"bodeis": []},
        {"name": 7},
        {"bodies": [{"name": "ball", "mass": "1 kg", "colour": 0}]},
        {"joints": [{"name": "pin", "type": "revolt", "child": "ball"}]},
        {"initial": {"q": [1, "2"]}, "form": "speed"},
    ],
)
def test_a_scene_built_in_python_is_refused_as_a_file_is(change: dict[str, Any]) -> None:
    """The same lines: place, value, remedy."""
    tables: dict[str, Any] = {**DROP, **change}
    lines = []
    for build in (lambda: eomgen.Scene(**tables), lambda: eomgen.read(tables)):
        with pytest.raises(eomgen.SceneError) as caught:
            build()
        lines.append(caught.value.lines)
    assert lines[0] == lines[1] and all(line.startswith("scene: ") for line in lines[0])
    assert eomgen.Scene(**eomgen.read(DROP).__dict__) == eomgen.read(DROP)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", ["two_body_forced", "furuta_pendulum", "cart_pole"])
def test_the_matrices_are_the_equations(scene: str) -> None:
    """M v̇ + V + G = F, with v̇ of the generated module, and of the solution written out."""
    import sympy as sp

    found = eomgen.derive(scene)
    module: Any = eomgen.load(eomgen.generate(scene))
    rng = np.random.default_rng(3)
    y = rng.uniform(-1.0, 1.0, len(module.STATES))
    u = {name: float(rng.uniform(-2.0, 2.0)) for name in module.INPUTS}
    names = {**module.PARAMETERS, **u, **dict(zip(module.STATES, y.tolist(), strict=True))}
    rates = module.derivative(0.0, y, None, u)[len(found.matrices.q) :]

    def number(expression: Any) -> Any:
        free = {s: sp.Float(names[s.name]) for s in expression.free_symbols}
        return np.array(expression.xreplace(free).tolist(), dtype=float)

    M, rest = number(found.M), number(found.F - found.V - found.G).ravel()
    assert found.M == found.M.T
    assert M @ rates == pytest.approx(rest, rel=1e-12, abs=1e-12)
    assert list(found.vd) == [found.solution[a] for a in found.matrices.a]
    assert number(found.vd).ravel() == pytest.approx(rates, rel=1e-12)
    assert sp.sympify(sp.srepr(found.vd)) == found.vd
    free = (found.M.free_symbols | found.vd.free_symbols) - {*found.symbols.values()}
    assert not free and found.symbols.keys() <= found.meanings.keys()
    assert found.symbols["g"].is_real and "m/s^2" in found.meanings["g"]
    assert found._repr_latex_().startswith("$\\displaystyle ")
    assert found.text().startswith(found.title) and "<html" in found.html()
    again = pickle.loads(pickle.dumps(found))
    assert again.M == found.M and again.solution == found.solution


def test_forces_of_effects_are_written_out() -> None:
    """F names them; `written_out` says what they are, as formulas of the motion and the time."""
    import sympy as sp

    motor = {
        "type": "motor",
        "name": "push",
        "joint": "pin",
        "torque": "3*sin(t) - tanh(pin_angle_dot)",
    }
    pin = {"name": "pin", "type": "revolute", "parent": "world", "child": "ball"}
    found = eomgen.derive({**DROP, "joints": [pin], "effects": [motor], "initial": {}})
    angle, t = found.symbols["pin_angle_dot"], found.symbols["t"]
    assert found.F.free_symbols.isdisjoint({angle, t})
    assert found.written_out(found.F) == sp.Matrix([3 * sp.sin(t) - sp.tanh(angle)])
    assert found.written_out(found.F).free_symbols == {angle, t}


def test_a_module(tmp_path: Path) -> None:
    """The same bytes as by the command; loaded as a value or from its file, and no other file."""
    made = eomgen.generate("cart_pole", outputs=["mass_matrix"], route="aba")
    command = ["generate", "cart_pole", "--outputs", "mass_matrix", "--route", "aba"]
    assert main([*command, "-o", str(tmp_path)]) == 0
    path = tmp_path / "cart_pole_aba.py"
    assert path.read_text("utf-8") == made.source
    made.save(path)
    for functions in (eomgen.load(made), eomgen.load(path)):
        assert functions.mass_matrix(0.0, functions.initial_state()).shape == (2, 2)  # type: ignore[attr-defined]
    assert "<pre>aba" in made._repr_html_()
    (tmp_path / "mine.py").write_text("raise SystemExit")
    with pytest.raises(eomgen.RunError, match=r"mine\.py: is not a module generated by eomgen"):
        eomgen.load(tmp_path / "mine.py")
    with pytest.raises(eomgen.SceneError, match=r"no output 'masses_matrix' \(did you mean"):
        eomgen.generate("cart_pole", outputs=["masses_matrix"])


def test_a_run_is_that_of_the_command(tmp_path: Path) -> None:
    """To the last bit; kept in files, pickled, shown."""
    command = "simulate cart_pole --t-end 0.3 --set m_pole=0.3 --input push=2 --integrator Radau"
    assert main([*command.split(), "-o", str(tmp_path)]) == 0
    theirs = load_npz(tmp_path / "cart_pole.npz")
    run = eomgen.simulate(
        "cart_pole",
        t_end=0.3,
        parameters={"m_pole": 0.3},
        inputs={"push": 2.0},
        integrator="Radau",
        works=True,
    )
    assert np.array_equal(run.y, theirs.y) and np.array_equal(run.t, theirs.t)
    assert np.array_equal(run["theta"], run.y[:, run.states.index("theta")])
    assert run.finished and run.report["steps"] == theirs.counts["steps"]
    assert run.trajectory.works is not None and "push" in run.trajectory.work_names
    again = pickle.loads(pickle.dumps(run))
    assert np.array_equal(again.y, run.y) and again.model == run.model
    assert {path.suffix for path in run.save(tmp_path / "kept")} == {".py", ".csv", ".npz", ".html"}
    assert ">steps</td>" in run._repr_html_()
    with pytest.raises(KeyError, match="no state 'thta'; known: x, theta"):
        run["thta"]


def test_a_run_is_followed_and_stopped() -> None:
    """It is called at every step, with a copy; a true result ends the run there."""
    seen: list[float] = []

    def follow(t: float, y: np.ndarray) -> bool:
        seen.append(t)
        y[:] = np.nan
        return t > 1.0

    run = eomgen.simulate("pendulum", t_end=5.0, follow=follow)
    assert seen == sorted(seen) and len(seen) == run.report["steps"]
    assert not run.finished and "ended by the function that follows it" in run.message
    assert (run.outcome.kind, run.outcome.remedy) == ("ended", "")
    assert run.t[-1] <= seen[-1] and np.isfinite(run.y).all()
    whole = eomgen.simulate("pendulum", t_end=5.0, follow=lambda t, y: None)
    assert np.array_equal(whole.y, eomgen.simulate("pendulum", t_end=5.0).y)


def test_how_a_run_ends_is_data() -> None:
    """Not a text to be searched: its kind, why, and what to change."""
    assert eomgen.simulate("pendulum", t_end=1.0).outcome == Outcome("finished")
    stuck = eomgen.simulate("double_pendulum", integrator="euler", dt=0.2, t_end=20.0)
    assert stuck.outcome.kind == "stopped" and not stuck.finished
    assert stuck.outcome.reason in stuck.message and "step" in stuck.outcome.remedy

    def interrupt(t: float, y: np.ndarray) -> None:
        raise KeyboardInterrupt

    run = eomgen.simulate("pendulum", follow=interrupt)
    assert run.outcome.kind == "interrupted" and run.message.startswith("interrupted at t = ")


def test_nothing_of_the_process_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The collector of whoever calls is left as it is, whether or not the store has the module."""
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path))
    monkeypatch.setattr("gc.set_threshold", None)
    monkeypatch.setattr("gc.disable", None)
    assert eomgen.load(eomgen.generate("acrobot")).NAME == "acrobot"


def test_a_run_by_its_error() -> None:
    """Estimated below what is asked for; out of reach, it is said and the best run returned."""
    run = eomgen.simulate("pendulum", t_end=2.0, accuracy=1e-6)
    assert run.error < 1e-6 and not run.warnings
    (said,) = eomgen.simulate("pendulum", t_end=2.0, accuracy=1e-17).warnings
    assert said.startswith("accuracy: not reached; the error estimate is ")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"parameters": {"lenght": 1.0}}, "parameters: no parameter 'lenght'"),
        ({"parameters": {"bob_mass": "1 kg"}}, "parameters: bob_mass is not a finite number"),
        ({"inputs": {"push": 1.0}}, "inputs: no input 'push'; known: none"),
        ({"integrator": "rk5"}, "rk5"),
        ({"integrator": "rk4", "rtol": 1e-3}, "rtol, atol: rk4 takes equal steps; give dt instead"),
        ({"accuracy": 1e-3, "budget": 1.0}, "a run has only one aim"),
        ({"accuracy": 1e-3, "dt": 1.0}, "accuracy, dt: accuracy chooses dt itself; leave one out"),
        ({"t_end": -1.0}, "t_end"),
    ],
)
def test_what_cannot_be_run_is_said(asked: dict[str, Any], said: str) -> None:
    with pytest.raises(eomgen.RunError) as caught:
        eomgen.simulate("pendulum", **asked)
    assert said in str(caught.value)


def test_a_linearisation() -> None:
    """About the nearest equilibrium, where it comes to rest, or a state that is given."""
    up = eomgen.linearise("cart_pole", state={"theta": 3.0})
    down = eomgen.linearise("cart_pole", at="rest")
    assert max(np.linalg.eigvals(up.A).real) > 1 > max(np.linalg.eigvals(down.A).real)
    here = eomgen.linearise("cart_pole", at="initial", state={"theta": 0.5}, inputs={"push": 1.0})
    module = eomgen.load(eomgen.generate("cart_pole"))
    assert np.array_equal(here.A, module.jacobian(0.0, here.y, None, {"push": 1.0}))
    assert here.input_names == ("push",) and here.B.shape == (4, 1)
    with pytest.raises(eomgen.RunError, match="state: no state 'tetha'"):
        eomgen.linearise("cart_pole", state={"tetha": 0.1})


def test_a_verification() -> None:
    assert eomgen.verify("pendulum", states=1).missed == ()


@pytest.mark.apart
def test_values_are_sent_to_another_process() -> None:
    """There and back, to one that was started anew; what is refused there is raised here."""
    model, module = eomgen.check("cart_pole"), eomgen.generate("cart_pole")
    run = eomgen.simulate("cart_pole", t_end=0.1)
    values = [eomgen.read("cart_pole"), model, module, compile_program(model).system.program]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert list(pool.map(copy.copy, values)) == values
        again = pool.submit(copy.copy, run).result()
        theirs = pool.submit(eomgen.simulate, model.name, t_end=0.1).result()
        refusal = pool.submit(eomgen.check, {"name": 7}).exception()
    assert np.array_equal(again.y, run.y) and np.array_equal(theirs.y, run.y)
    assert again.outcome == run.outcome and again.module == module
    assert isinstance(refusal, eomgen.SceneError)
    assert refusal.lines == ("scene: name: 7 is not a text; give one",)


def test_a_run_goes_on_from_another_or_its_archive(tmp_path: Path) -> None:
    """To the same bits as if it had not ended, guarded and with its error estimated."""
    whole = eomgen.simulate("pendulum", t_end=1.0)
    half = eomgen.simulate("pendulum", t_end=0.5, guard="stop", estimate=True)
    assert half.estimate is not None and 0 < half.error == half.estimate.last < 1e-6
    half.save(tmp_path)
    for earlier in (half, tmp_path / "pendulum.npz"):
        rest = eomgen.simulate("pendulum", t_end=1.0, resume=earlier)
        assert rest.begun.endswith("as if the run had not ended")
        assert np.array_equal(rest.y[-1], whole.y[-1])
    assert whole.begun == "" and whole.imbalance is not None and whole.imbalance.lost < 1e-6
    with pytest.raises(eomgen.RunError, match="resume: continues with a given method"):
        eomgen.simulate("pendulum", resume=half, accuracy=1e-3)
    with pytest.raises(eomgen.RunError, match="guard: 'watch' is not one of stop, repair"):
        eomgen.simulate("pendulum", guard="watch")  # type: ignore[arg-type]


def test_studies_are_values(tmp_path: Path) -> None:
    """What runs cost, kept in a table and taken from it; what effects cost; how exact it all is."""
    table = tmp_path / "runs.csv"
    asked: dict[str, Any] = {"methods": ["rk4"], "quick": True, "t_end": 0.2, "run_time": 1000.0}
    first, again = (eomgen.accuracy("pendulum", **asked, table=table) for _ in range(2))
    assert first.made == len(first.works) > 0 and again.made == 0
    assert [w.error for w in again.works] == [w.error for w in first.works]
    assert len(pickle.loads(pickle.dumps(first)).works) == len(first.works)
    bill = eomgen.effects("pendulum", motion=None)
    assert "gravity" in [item.label for item in bill.items]
    assert eomgen.arithmetic("pendulum", states=1).taken in ("closed", "ldl", "aba")
    for call, said in (
        (lambda: eomgen.accuracy("pendulum", t_end=0.0), "t_end: 0 is not a positive time"),
        (lambda: eomgen.effects("pendulum", motion=0.0), "motion: 0 is not a positive time"),
        (lambda: eomgen.arithmetic("pendulum", states=0), "states: 0 is not a number from 1"),
        (lambda: eomgen.verify("pendulum", seed=-1), "seed: -1 is negative"),
        (lambda: eomgen.horizon("pendulum", seconds=0.0), "horizon: 0 is not a positive time"),
    ):
        with pytest.raises(eomgen.RunError, match=said):
            call()


def test_warnings_go_to_the_logger(caplog: pytest.LogCaptureFixture) -> None:
    """What a run warns of is logged; without a handler nothing is printed."""
    rising = {**DROP, "effects": [{"type": "gravity", "g": -9.81}]}
    run = eomgen.simulate(rising, t_end=0.1)
    assert run.warnings
    assert [r.getMessage() for r in caplog.records if r.levelname == "WARNING"] == [
        f"drop: {warning}" for warning in run.warnings
    ]
    assert {record.name for record in caplog.records} == {"eomgen"}
    assert any(isinstance(h, logging.NullHandler) for h in logging.getLogger("eomgen").handlers)
